//! What the demo sees with: a renderer where there is a graphics device, nothing where there is none.

use kiln_link::Revision;

/// A way to look at revisions.
pub(super) struct Eyes {
    #[cfg(feature = "preview")]
    viewer: Option<kiln_preview::HeadlessViewer>,
    description: String,
    last_picture: Vec<u8>,
}

/// A frame and when it was done.
pub(super) struct Seen {
    pub(super) png: Vec<u8>,
    pub(super) ready_unix_ms: f64,
    pub(super) drawn_unix_ms: f64,
    /// The picture is exactly the one before.
    pub(super) is_unchanged: bool,
}

impl Eyes {
    #[cfg(feature = "preview")]
    pub(super) fn open(size: [u32; 2]) -> Eyes {
        let (viewer, description) = match kiln_gpu::Gpu::headless() {
            Ok(gpu) => {
                let description = format!("frames are drawn by {}", gpu.description());
                (Some(kiln_preview::HeadlessViewer::new(gpu, size)), description)
            }
            Err(error) => (None, format!("no frames, only the artefacts: {error}")),
        };
        Eyes { viewer, description, last_picture: Vec::new() }
    }

    #[cfg(not(feature = "preview"))]
    pub(super) fn open(_: [u32; 2]) -> Eyes {
        let description = "no frames, only the artefacts: this kiln was built without its preview".to_owned();
        Eyes { description, last_picture: Vec::new() }
    }

    pub(super) fn describe(&self) -> &str {
        &self.description
    }

    #[cfg(feature = "preview")]
    pub(super) fn can_open_window(&self) -> bool {
        self.viewer.is_some() && crate::place::has_display()
    }

    #[cfg(not(feature = "preview"))]
    pub(super) fn can_open_window(&self) -> bool {
        false
    }

    /// Draws a revision; `None` without a device.
    #[cfg(feature = "preview")]
    pub(super) fn look(&mut self, revision: &Revision) -> anyhow::Result<Option<Seen>> {
        use super::unix_ms;
        let Some(viewer) = &mut self.viewer else { return Ok(None) };
        let applied = viewer.apply(revision);
        let ready_unix_ms = unix_ms();
        crate::report::print_diagnostics(&applied.diagnostics, false);
        viewer.draw()?;
        let drawn_unix_ms = unix_ms();
        let picture = viewer.render()?;
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let png = kiln_image::png::encode_rgba8(width, height, picture.as_raw());
        let is_unchanged = std::mem::replace(&mut self.last_picture, picture.into_raw());
        let is_unchanged = is_unchanged == self.last_picture;
        Ok(Some(Seen { png, ready_unix_ms, drawn_unix_ms, is_unchanged }))
    }

    #[cfg(not(feature = "preview"))]
    pub(super) fn look(&mut self, _: &Revision) -> anyhow::Result<Option<Seen>> {
        let _ = &self.last_picture;
        Ok(None)
    }
}
