//! The opaque scene as what transmits light sees it: a picture with ever smaller, smoother levels.
//!
//! Colour is multiplied by alpha, which is the share of a texel that the scene covers. Through the rest shines the
//! environment, which its own maps filter better than a picture of it could.

use kiln_gpu::Gpu;

use crate::pass_timer::PassTimer;
use crate::program::HDR_FORMAT;

/// Makes the smaller levels.
#[derive(Debug)]
pub(crate) struct Downsampler {
    pipeline: wgpu::RenderPipeline,
    sampler: wgpu::Sampler,
}

/// The picture of one size.
#[derive(Debug)]
pub(crate) struct SceneColor {
    /// All levels, to be read.
    pub view: wgpu::TextureView,
    /// Each level, to be drawn to; the largest first.
    levels: Vec<wgpu::TextureView>,
    /// What each level but the first is made from.
    sources: Vec<wgpu::BindGroup>,
}

impl Downsampler {
    /// Makes the pipeline.
    pub fn new(gpu: &Gpu) -> Self {
        let module = gpu.device.create_shader_module(wgpu::include_wgsl!("downsample.wgsl"));
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("downsample"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: None,
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: None,
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(HDR_FORMAT.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        Downsampler { pipeline, sampler }
    }

    /// Fills the smaller levels from the largest.
    pub fn run(&self, encoder: &mut wgpu::CommandEncoder, picture: &SceneColor, timer: Option<&PassTimer>) {
        let [mut before, mut after] =
            timer.and_then(|timer| timer.span("downsample")).map_or([None, None], |span| span.map(Some));
        for (index, (source, view)) in picture.sources.iter().zip(&picture.levels[1..]).enumerate() {
            let is_last = index + 1 == picture.sources.len();
            let timestamp_writes = match (before.take(), is_last.then(|| after.take()).flatten()) {
                (Some(before), Some(after)) => Some(wgpu::RenderPassTimestampWrites {
                    end_of_pass_write_index: after.end_of_pass_write_index,
                    ..before
                }),
                (before, after) => before.or(after),
            };
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("downsample"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations::default(),
                })],
                timestamp_writes,
                ..Default::default()
            });
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, source, &[]);
            pass.draw(0..3, 0..1);
        }
    }
}

impl SceneColor {
    /// An empty picture of width and height `size`, with all levels down to one texel.
    pub fn new(gpu: &Gpu, downsampler: &Downsampler, size: [u32; 2]) -> Self {
        let extent = wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 };
        let level_count = extent.max_mips(wgpu::TextureDimension::D2);
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("scene color"),
            size: extent,
            mip_level_count: level_count,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: HDR_FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let level = |level| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                base_mip_level: level,
                mip_level_count: Some(1),
                ..Default::default()
            })
        };
        let levels: Vec<wgpu::TextureView> = (0..level_count).map(level).collect();
        let layout = downsampler.pipeline.get_bind_group_layout(0);
        let source = |view| {
            let (view, sampler) = (
                wgpu::BindingResource::TextureView(view),
                wgpu::BindingResource::Sampler(&downsampler.sampler),
            );
            let entries = [
                wgpu::BindGroupEntry { binding: 0, resource: view },
                wgpu::BindGroupEntry { binding: 1, resource: sampler },
            ];
            let layout = &layout;
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("downsample"),
                layout,
                entries: &entries,
            })
        };
        let sources = levels[..levels.len() - 1].iter().map(source).collect();
        SceneColor { view: texture.create_view(&wgpu::TextureViewDescriptor::default()), levels, sources }
    }

    /// Fills the largest level with a picture of the same size.
    pub fn copy_base(&self, encoder: &mut wgpu::CommandEncoder, picture: &wgpu::Texture) {
        let base = self.view.texture();
        encoder.copy_texture_to_texture(picture.as_image_copy(), base.as_image_copy(), picture.size());
    }

    /// The largest level.
    pub fn base(&self) -> &wgpu::TextureView {
        &self.levels[0]
    }
}
