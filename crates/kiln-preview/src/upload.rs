//! Brings bytes to the device in pieces, so that no frame waits for more than one of them.
//!
//! What is written to a queue goes to the device in front of whatever is submitted next, which may be the frame of another
//! thread. So a piece is submitted, and the device done with it, before the next one is written: in front of any frame there
//! is at most one. A device that nobody draws on takes pieces as fast as it can.

use std::cell::Cell;
use std::time::Duration;

use kiln_gpu::Gpu;

/// Bytes between two submissions: a third of a millisecond over PCIe 3.0, and more than a row of any texture.
pub(crate) const PIECE_BYTES: usize = 4 << 20;

/// How long a device may take for a piece before nobody waits for it any more.
const PIECE_TIMEOUT: Duration = Duration::from_secs(20);

/// What was brought to the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Uploaded {
    /// All of it.
    pub bytes: u64,
    /// In how many submissions.
    pub pieces: u64,
    /// The most that one submission had: the most that a frame waited for.
    pub piece_bytes_max: u64,
}

/// Writes textures and buffers.
pub(crate) struct Uploader {
    pub gpu: Gpu,
    /// Written, not yet submitted.
    unsent_bytes: Cell<usize>,
    uploaded: Cell<Uploaded>,
    #[cfg(test)]
    after_piece: Option<Box<dyn Fn() + Send>>,
}

impl std::fmt::Debug for Uploader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Uploader").field("uploaded", &self.uploaded).finish_non_exhaustive()
    }
}

impl Uploader {
    /// Has brought nothing yet.
    pub fn new(gpu: &Gpu) -> Self {
        Uploader {
            gpu: gpu.clone(),
            unsent_bytes: Cell::new(0),
            uploaded: Cell::default(),
            #[cfg(test)]
            after_piece: None,
        }
    }

    /// Runs `work` whenever the device is done with a piece.
    #[cfg(test)]
    pub fn after_piece(&mut self, work: impl Fn() + Send + 'static) {
        self.after_piece = Some(Box::new(work));
    }

    /// Writes all layers of a level from tight rows.
    pub fn write_level(&self, texture: &wgpu::Texture, mip_level: u32, texels: &[u8]) {
        let full = texture.size();
        let (width, height) = ((full.width >> mip_level).max(1), (full.height >> mip_level).max(1));
        let row_bytes = width * texture.format().block_copy_size(None).unwrap_or(0);
        let rows_max = (PIECE_BYTES / row_bytes.max(1) as usize).max(1);
        let rows = texels.chunks(row_bytes.max(1) as usize * height as usize).zip(0..);
        for (layer, z) in rows.take(full.depth_or_array_layers as usize) {
            for (band, y) in layer.chunks(rows_max * row_bytes as usize).zip((0..height).step_by(rows_max)) {
                let height = rows_max.min((height - y) as usize) as u32;
                self.make_room(band.len());
                self.gpu.queue.write_texture(
                    wgpu::TexelCopyTextureInfo {
                        mip_level,
                        origin: wgpu::Origin3d { x: 0, y, z },
                        ..texture.as_image_copy()
                    },
                    band,
                    wgpu::TexelCopyBufferLayout {
                        offset: 0,
                        bytes_per_row: Some(row_bytes),
                        rows_per_image: None,
                    },
                    wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                );
            }
        }
    }

    /// A buffer that holds `contents`, with zeros up to a multiple of 4 bytes.
    pub fn buffer(&self, label: &str, contents: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        const ALIGNMENT: usize = wgpu::COPY_BUFFER_ALIGNMENT as usize;
        let buffer = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: contents.len().next_multiple_of(ALIGNMENT) as u64,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        for (piece, offset) in contents.chunks(PIECE_BYTES).zip((0_u64..).step_by(PIECE_BYTES)) {
            self.make_room(piece.len());
            let whole = piece.len() / ALIGNMENT * ALIGNMENT;
            self.gpu.queue.write_buffer(&buffer, offset, &piece[..whole]);
            if whole < piece.len() {
                let mut last = [0; ALIGNMENT];
                last[..piece.len() - whole].copy_from_slice(&piece[whole..]);
                self.gpu.queue.write_buffer(&buffer, offset + whole as u64, &last);
            }
        }
        buffer
    }

    /// Submits what is left, waits until the device is done with it, and says what was brought since the last call.
    pub fn finish(&self) -> Uploaded {
        self.submit();
        self.uploaded.take()
    }

    /// Announces a write of so many bytes, and submits the ones before if they do not fit into one piece with it.
    fn make_room(&self, bytes: usize) {
        if self.unsent_bytes.get() > 0 && self.unsent_bytes.get() + bytes > PIECE_BYTES {
            self.submit();
        }
        self.unsent_bytes.set(self.unsent_bytes.get() + bytes);
    }

    fn submit(&self) {
        self.gpu.queue.submit([]);
        // A lost device is shown by the window; there is nothing to wait for then.
        self.gpu.submitted().wait(PIECE_TIMEOUT);
        let bytes = self.unsent_bytes.take() as u64;
        let Uploaded { bytes: before, pieces, piece_bytes_max } = self.uploaded.get();
        self.uploaded.set(Uploaded {
            bytes: before + bytes,
            pieces: pieces + u64::from(bytes > 0),
            piece_bytes_max: piece_bytes_max.max(bytes),
        });
        #[cfg(test)]
        self.after_piece.iter().for_each(|work| work());
    }
}
