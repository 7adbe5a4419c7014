//! Texels and bytes from the device to the CPU.

use crate::{Gpu, GpuError};

/// How long an answer that is on its way may take to be delivered.
const ANSWER_LIMIT: std::time::Duration = std::time::Duration::from_secs(10);

impl Gpu {
    /// Reads one level of a texture: its layers in order, rows tightly packed, texels as the device stores them.
    /// Waits until the device has done everything submitted so far.
    ///
    /// # Errors
    /// [`GpuError::NotReadable`] for multisampled, compressed and depth-stencil textures, [`GpuError::Readback`]
    /// when the device fails.
    pub fn read_texture(&self, texture: &wgpu::Texture, mip_level: u32) -> Result<Vec<u8>, GpuError> {
        let texel_bytes = readable_texel_bytes(texture)?;
        let size = texture.size();
        let width = (size.width >> mip_level).max(1);
        let height = (size.height >> mip_level).max(1);
        let layers = size.depth_or_array_layers;
        let row_bytes = width * texel_bytes;
        let padded_row_bytes = row_bytes.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer_bytes = u64::from(padded_row_bytes) * u64::from(height) * u64::from(layers);
        let buffer = self.readback_buffer(buffer_bytes);
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo { mip_level, ..texture.as_image_copy() },
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(padded_row_bytes),
                    rows_per_image: Some(height),
                },
            },
            wgpu::Extent3d { width, height, depth_or_array_layers: layers },
        );
        self.queue.submit([encoder.finish()]);
        let padded = self.map_and_copy(&buffer)?;
        let rows = padded.chunks_exact(padded_row_bytes as usize);
        Ok(rows.flat_map(|row| &row[..row_bytes as usize]).copied().collect())
    }

    /// Reads a whole buffer that has `COPY_SRC` and a size divisible by 4.
    ///
    /// # Errors
    /// [`GpuError::Readback`] when the device fails.
    pub fn read_buffer(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
        let copy = self.readback_buffer(buffer.size());
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, buffer.size());
        self.queue.submit([encoder.finish()]);
        self.map_and_copy(&copy)
    }

    /// Waits until the device has done everything submitted so far.
    ///
    /// # Errors
    /// [`GpuError::Readback`] when the device fails.
    pub fn wait(&self) -> Result<(), GpuError> {
        let polled = self.device.poll(wgpu::PollType::wait_indefinitely());
        polled.map(drop).map_err(|error| GpuError::Readback { reason: error.to_string() })
    }

    fn readback_buffer(&self, size: u64) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("readback"),
            size,
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        })
    }

    fn map_and_copy(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
        let (sender, receiver) = std::sync::mpsc::channel();
        // A receiver that is gone means that the wait below failed: nobody needs the answer then.
        buffer.map_async(wgpu::MapMode::Read, .., move |mapped| drop(sender.send(mapped)));
        self.wait()?;
        let failed = |reason: String| GpuError::Readback { reason };
        // Another thread that polls the same device may have taken over the answer and still be about to deliver it.
        let mapped =
            receiver.recv_timeout(ANSWER_LIMIT).map_err(|_| failed("the map never ended".to_owned()))?;
        mapped.map_err(|error| failed(error.to_string()))?;
        let bytes = buffer.get_mapped_range(..).map_err(|error| failed(error.to_string()))?.to_vec();
        buffer.unmap();
        Ok(bytes)
    }
}

fn readable_texel_bytes(texture: &wgpu::Texture) -> Result<u32, GpuError> {
    let format = texture.format();
    let whole = format.block_dimensions() == (1, 1) && !format.is_depth_stencil_format();
    let texel_bytes = format.block_copy_size(None).filter(|_| whole && texture.sample_count() == 1);
    texel_bytes.ok_or_else(|| GpuError::NotReadable {
        format: format!("{format:?}"),
        sample_count: texture.sample_count(),
    })
}
