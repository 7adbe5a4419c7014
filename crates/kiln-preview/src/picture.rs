//! The images a frame goes through.

use kiln_gpu::Gpu;

use crate::program::{DEPTH_FORMAT, HDR_FORMAT, OUTPUT_FORMAT};

/// The images a frame goes through.
#[derive(Debug)]
pub(crate) struct Picture {
    pub size: [u32; 2],
    /// Samples a pixel.
    pub sample_count: u32,
    /// Linear radiance of each sample; `hdr` itself where a pixel has one.
    pub samples: wgpu::TextureView,
    /// Linear radiance.
    pub radiance: wgpu::Texture,
    pub hdr: wgpu::TextureView,
    pub depth: wgpu::TextureView,
    pub output: wgpu::Texture,
    pub output_view: wgpu::TextureView,
}

impl Picture {
    /// The size limited to what the device takes.
    pub fn allowed_size(gpu: &Gpu, size: [u32; 2]) -> [u32; 2] {
        size.map(|pixels| pixels.clamp(1, gpu.device.limits().max_texture_dimension_2d))
    }

    /// Empty images of that size, limited so.
    pub fn new(gpu: &Gpu, size: [u32; 2], sample_count: u32) -> Self {
        let size = Self::allowed_size(gpu, size);
        let attachment = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let read = attachment | wgpu::TextureUsages::TEXTURE_BINDING;
        let create = |label, format, sample_count, usage| {
            gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage,
                view_formats: &[],
            })
        };
        let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        let output = create("output", OUTPUT_FORMAT, 1, read | wgpu::TextureUsages::COPY_SRC);
        let radiance = create("hdr", HDR_FORMAT, 1, read | wgpu::TextureUsages::COPY_SRC);
        let samples = (sample_count > 1).then(|| create("samples", HDR_FORMAT, sample_count, read));
        Picture {
            size,
            sample_count,
            samples: view(samples.as_ref().unwrap_or(&radiance)),
            hdr: view(&radiance),
            radiance,
            depth: view(&create("depth", DEPTH_FORMAT, sample_count, read)),
            output_view: view(&output),
            output,
        }
    }
}
