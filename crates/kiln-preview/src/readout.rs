//! Pictures from the device: copied in a frame, read whenever there is time.

use std::time::Duration;

use half::f16;
use kiln_gpu::{Gpu, GpuError};
use kiln_image::Image;

/// How long the device may take for the frames before a copy.
pub(crate) const COPY_LIMIT: Duration = Duration::from_secs(20);

/// What a texture is at this moment of the queue, for somebody who reads it later; the device is not waited for.
pub(crate) fn copy_of(gpu: &Gpu, texture: &wgpu::Texture) -> wgpu::Texture {
    let copy = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("copy"),
        size: texture.size(),
        mip_level_count: 1,
        sample_count: 1,
        dimension: texture.dimension(),
        format: texture.format(),
        usage: wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_texture(texture.as_image_copy(), copy.as_image_copy(), texture.size());
    gpu.queue.submit([encoder.finish()]);
    copy
}

/// A display picture: sRGB-encoded values, three bytes a pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Rgb {
    pub width: usize,
    pub height: usize,
    pub bytes: Vec<u8>,
}

/// Reads a display picture; alpha is left out.
pub(crate) fn read_rgb(gpu: &Gpu, texture: &wgpu::Texture) -> Result<Rgb, GpuError> {
    let rgba = gpu.read_texture(texture, 0)?;
    let bytes = rgba.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    Ok(Rgb { width: texture.width() as usize, height: texture.height() as usize, bytes })
}

/// Reads radiance, linear Rec. 709; alpha is left out.
pub(crate) fn read_radiance(gpu: &Gpu, texture: &wgpu::Texture) -> Result<Image, GpuError> {
    let bytes = gpu.read_texture(texture, 0)?;
    let channel = |half: &[u8]| f16::from_le_bytes([half[0], half[1]]).to_f32();
    let rgb = bytes.chunks_exact(8).flat_map(|texel| texel[..6].chunks_exact(2).map(channel)).collect();
    let incomplete = |_| GpuError::Readback { reason: "the picture is incomplete".to_owned() };
    Image::new(texture.width() as usize, texture.height() as usize, rgb).map_err(incomplete)
}
