//! A plain background instead of the environment.

use kiln_gpu::Gpu;

use crate::program::{DEPTH_FORMAT, HDR_FORMAT};
use crate::view::{Background, View, from_srgb};

/// Greys of the checker's squares, sRGB-encoded.
const CHECKER: [u8; 2] = [0x99, 0x66];
/// Edge of a square in pixels.
const SQUARE: f32 = 16.0;
/// Largest radiance, what a 16-bit float holds: colours are divided by the exposure.
const RADIANCE_MAX: f32 = 65504.0;

/// Draws backgrounds of one or two colours.
#[derive(Debug)]
pub(crate) struct Backdrop {
    pipeline: wgpu::RenderPipeline,
    colors: wgpu::Buffer,
    group: wgpu::BindGroup,
}

impl Backdrop {
    /// Makes the pipeline, for so many samples a pixel.
    pub fn new(gpu: &Gpu, sample_count: u32) -> Self {
        let module = gpu.device.create_shader_module(wgpu::include_wgsl!("backdrop.wgsl"));
        let pipeline = overlay_pipeline(gpu, &module, "fs_main", sample_count, None, None);
        let colors = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("backdrop"),
            size: 32,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("backdrop"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: colors.as_entire_binding() }],
        });
        Backdrop { pipeline, colors, group }
    }

    /// Writes the colours that the view asks for; exposure leaves them as they are.
    pub fn write(&self, gpu: &Gpu, view: &View) {
        let [first, second] = match view.background {
            Background::Color(color) => [color, color],
            Background::Checker | Background::Environment => CHECKER.map(|grey| [from_srgb(grey); 3]),
        };
        let [first, second] = [first, second]
            .map(|color| color.map(|value| (value * (-view.exposure_ev).exp2()).min(RADIANCE_MAX)));
        let block: [f32; 8] = [first[0], first[1], first[2], SQUARE, second[0], second[1], second[2], 0.0];
        gpu.queue.write_buffer(&self.colors, 0, bytemuck::cast_slice(&block));
    }

    /// Fills what is still open.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.draw(0..3, 0..1);
    }
}

/// A pipeline of the preview's own that draws into the scene, behind what is nearer and hiding nothing. `fragment` names its
/// fragment stage.
pub(crate) fn overlay_pipeline(
    gpu: &Gpu,
    module: &wgpu::ShaderModule,
    fragment: &str,
    sample_count: u32,
    blend: Option<wgpu::BlendState>,
    cull_mode: Option<wgpu::Face>,
) -> wgpu::RenderPipeline {
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(fragment),
        layout: None,
        vertex: wgpu::VertexState {
            module,
            entry_point: Some("vs_main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState { cull_mode, ..Default::default() },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(false),
            depth_compare: Some(wgpu::CompareFunction::LessEqual),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState { count: sample_count, ..Default::default() },
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(fragment),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(wgpu::ColorTargetState {
                format: HDR_FORMAT,
                blend,
                write_mask: wgpu::ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}
