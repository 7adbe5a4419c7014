//! Frames without a window.

use std::sync::Arc;

use image::RgbaImage;
use kiln_gpu::{Gpu, GpuError};
use kiln_image::Image;
use kiln_link::Revision;

use crate::assignment::{Assignment, RefusedParameter};
use crate::faults::FaultCounts;
use crate::inspector::ANSWER_LIMIT;
use crate::pass_timer::PassTime;
use crate::prepare::Preparer;
use crate::probe::PixelProbe;
use crate::readout::read_radiance;
use crate::renderer::Renderer;
use crate::report::ApplyReport;
use crate::view::{Selection, View};

/// Shows revisions in an offscreen picture; what the window does with threads, it does in order.
#[derive(Debug)]
pub struct HeadlessViewer {
    /// How the picture is taken; change it freely between frames.
    pub view: View,
    gpu: Gpu,
    selection: Selection,
    revision: Option<Revision>,
    preparer: Preparer,
    renderer: Renderer,
    report: ApplyReport,
}

impl HeadlessViewer {
    /// A viewer that shows nothing yet. `size` is width and height in pixels.
    pub fn new(gpu: Gpu, size: [u32; 2]) -> Self {
        HeadlessViewer {
            view: View::default(),
            selection: Selection::default(),
            revision: None,
            preparer: Preparer::new(&gpu),
            renderer: Renderer::new(&gpu, size),
            report: ApplyReport::default(),
            gpu,
        }
    }

    /// Chooses what to show, of the last revision and of those to come.
    pub fn select(&mut self, selection: Selection) -> ApplyReport {
        self.selection = selection;
        match self.revision.take() {
            Some(revision) => self.apply(&revision),
            None => self.report.clone(),
        }
    }

    /// Shows a revision; returns when pipelines and uploads are done. What cannot be used keeps its last good form.
    pub fn apply(&mut self, revision: &Revision) -> ApplyReport {
        self.revision = Some(revision.clone());
        if let Some(prepared) = self.preparer.prepare(revision, &self.selection, &self.view.parameters) {
            self.report = prepared.report.clone();
            self.renderer.show(Arc::new(prepared));
        }
        self.report.clone()
    }

    /// Sets parameters of shaders that are shown; if one is refused, none is set.
    ///
    /// # Errors
    /// There is no such parameter, or it does not take the value.
    pub fn assign(&mut self, assignments: &[Assignment]) -> Result<ApplyReport, RefusedParameter> {
        let mut values = self.view.parameters.clone();
        for assignment in assignments {
            values.assign(assignment, &self.report.parameters)?;
        }
        // Members of `params` are written with every frame; overrides stand in pipelines.
        let has_other_pipelines = values.overrides() != self.view.parameters.overrides();
        self.view.parameters = values;
        match self.revision.take_if(|_| has_other_pipelines) {
            Some(revision) => Ok(self.apply(&revision)),
            None => Ok(self.report.clone()),
        }
    }

    /// Changes the picture's size.
    pub fn resize(&mut self, size: [u32; 2]) {
        self.renderer.resize(size);
    }

    /// The picture's width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.renderer.size()
    }

    /// Draws with one sample a pixel from now on, as the window does while slow pictures move; edges are jagged then.
    pub fn draw_single_samples(&mut self) {
        self.renderer.resize_sampled(self.renderer.size(), 1);
    }

    /// Draws a frame and waits until the device is done with it.
    ///
    /// # Errors
    /// [`GpuError::Readback`] when the device is lost.
    pub fn draw(&mut self) -> Result<(), GpuError> {
        self.renderer.render(&self.view);
        self.gpu.wait()
    }

    /// Draws a frame and reads it: sRGB-encoded, black before the first revision.
    ///
    /// # Errors
    /// [`GpuError::Readback`] when the device is lost.
    pub fn render(&mut self) -> Result<RgbaImage, GpuError> {
        self.renderer.render(&self.view);
        self.picture()
    }

    /// Reads the last frame: sRGB-encoded, black before the first.
    ///
    /// # Errors
    /// [`GpuError::Readback`] when the device is lost.
    pub fn picture(&self) -> Result<RgbaImage, GpuError> {
        let output = self.renderer.output();
        let (width, height) = (output.width(), output.height());
        let bytes = self.gpu.read_texture(output, 0)?;
        let truncated = || GpuError::Readback { reason: "the picture is incomplete".to_owned() };
        RgbaImage::from_raw(width, height, bytes).ok_or_else(truncated)
    }

    /// Draws a frame and reads its radiance as [`HeadlessViewer::radiance`] does.
    ///
    /// # Errors
    /// [`GpuError::Readback`] when the device is lost.
    pub fn render_radiance(&mut self) -> Result<Image, GpuError> {
        self.renderer.render(&self.view);
        self.radiance()
    }

    /// Reads the last frame's radiance, before exposure and tone mapping: linear Rec. 709, alpha left out.
    ///
    /// # Errors
    /// [`GpuError::Readback`] when the device is lost.
    pub fn radiance(&self) -> Result<Image, GpuError> {
        read_radiance(&self.gpu, self.renderer.radiance())
    }

    /// How long the passes of the last frame took; `None` where the device has no clocks for them. Ask after
    /// [`HeadlessViewer::draw`].
    pub fn take_pass_times(&self) -> Option<Vec<PassTime>> {
        self.renderer.inspector().take_pass_times(ANSWER_LIMIT)
    }

    /// Draws a frame and says what it holds at a pixel, column and row from the upper left; `None` outside of it.
    ///
    /// # Errors
    /// [`GpuError::Readback`] when the device is lost.
    pub fn probe(&mut self, pixel: [u32; 2]) -> Result<Option<PixelProbe>, GpuError> {
        self.renderer.keeps_depth = true;
        self.renderer.render(&self.view);
        let Some(pending) = self.renderer.probe(pixel) else { return Ok(None) };
        self.gpu.wait()?;
        let lost = || GpuError::Readback { reason: "the answer never came".to_owned() };
        pending.wait().map(Some).ok_or_else(lost)
    }

    /// Draws a frame and counts the pixels that [`View::fault_limit`] marks; `None` if it marks none, or the device cannot count.
    ///
    /// # Errors
    /// [`GpuError::Readback`] when the device is lost.
    pub fn count_faults(&mut self) -> Result<Option<FaultCounts>, GpuError> {
        self.draw()?;
        Ok(self.renderer.inspector().take_faults(ANSWER_LIMIT))
    }

    /// Whether frames go through a picture of the opaque scene.
    #[cfg(test)]
    pub(crate) fn draws_scene_color(&self) -> bool {
        self.renderer.draws_scene_color()
    }

    /// Whether frames have a pass for what the sun does not reach.
    #[cfg(test)]
    pub(crate) fn draws_shadow(&self) -> bool {
        self.renderer.draws_shadow()
    }

    /// The device it draws on.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }
}
