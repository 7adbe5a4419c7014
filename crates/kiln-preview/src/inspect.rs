//! Looking into the frame: which draws show channels, and how their values become a picture.

use std::collections::BTreeSet;

use kiln_gpu::Gpu;
use kiln_link::Revision;
use kiln_scene::{EffectSet, variant_name};
use serde::Deserialize;
use wgpu::util::{BufferInitDescriptor, DeviceExt as _};

use crate::channel::{Channel, Encoding, LEVEL_COLORS, variant_color};
use crate::program::OUTPUT_FORMAT;
use crate::target::read_meta;

/// The group of targets with the shaders that show channels; a daemon makes them for who wants it.
pub(crate) const GROUP: &str = "inspect";

/// What the shown scene can show of itself besides its picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Inspection {
    /// Whether the shaders that show channels are there.
    pub state: InspectionState,
    /// Every effect that some draw of the scene is drawn with.
    pub effects: EffectSet,
    /// Variants of the shader that draw the scene, each with its colour in [`Channel::Variant`], linear.
    pub variants: Vec<(String, [f32; 3])>,
}

/// Whether the shaders that show channels are there.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum InspectionState {
    /// The revision was made for nobody who wants them.
    #[default]
    NotAsked,
    /// They are.
    Ready,
    /// They cannot be; why, in a sentence.
    Unable(String),
}

impl Inspection {
    /// The colour of a variant, by its target `inspect/SHADER/VARIANT`.
    pub(crate) fn color_of(&self, target: &str) -> [f32; 3] {
        let variant = target.rsplit('/').next().unwrap_or_default();
        let found = self.variants.iter().find(|(name, _)| name == variant);
        found.map_or([0.0; 3], |(_, color)| *color)
    }

    /// Why a channel cannot be shown, in a sentence; `None` if it can, or may once it is asked for.
    pub fn refusal(&self, channel: Channel) -> Option<String> {
        if let InspectionState::Unable(reason) = &self.state {
            return Some(reason.clone());
        }
        let needs = channel.needs();
        if needs.is_empty() || needs.iter().any(|effect| self.effects.contains(effect)) {
            return None;
        }
        let names: Vec<&str> = needs.iter().map(|effect| effect.name()).collect();
        Some(format!("no material of this scene has {}", names.join(" or ")))
    }
}

/// The effects that each of these sets of effects is drawn with, and the variants they make.
pub(crate) fn describe(revision: &Revision, shader: &str, sets: &BTreeSet<EffectSet>) -> Inspection {
    let color = |(index, set): (usize, &EffectSet)| (variant_name(set), variant_color(index));
    Inspection {
        state: state(revision, shader),
        effects: sets.iter().flatten().copied().collect(),
        variants: sets.iter().enumerate().map(color).collect(),
    }
}

/// `meta` of `inspect/shaders`.
#[derive(Default, Deserialize)]
struct InspectMeta {
    /// Those whose conditions know the feature.
    #[serde(default)]
    shaders: BTreeSet<String>,
}

fn state(revision: &Revision, shader: &str) -> InspectionState {
    let name = format!("{GROUP}/shaders");
    let Some(target) = revision.table.targets.get(&name) else { return InspectionState::NotAsked };
    let meta: InspectMeta = read_meta(&name, target, GROUP).unwrap_or_default();
    if meta.shaders.contains(shader) {
        return InspectionState::Ready;
    }
    InspectionState::Unable(format!(
        "`shader.{shader}` has no feature `inspect`: docs/shader-interface.md says how one shows channels"
    ))
}

/// Turns values of channels into display values.
#[derive(Debug)]
pub(crate) struct ChannelDisplay {
    pipeline: wgpu::RenderPipeline,
}

impl ChannelDisplay {
    /// Makes the pipeline.
    pub fn new(gpu: &Gpu) -> Self {
        let module = gpu.device.create_shader_module(wgpu::include_wgsl!("inspect_display.wgsl"));
        ChannelDisplay { pipeline: full_screen_pipeline(gpu, "channel", &module, None) }
    }

    /// What it reads, of a picture of one size. Made for each frame: cheap beside drawing one.
    pub fn bind(&self, gpu: &Gpu, values: &wgpu::TextureView, encoding: Encoding) -> wgpu::BindGroup {
        let code: u32 = match encoding {
            Encoding::Color => 0,
            Encoding::Data | Encoding::Radiance => 1,
            Encoding::Direction => 2,
            Encoding::Uv => 3,
            Encoding::Level => 4,
        };
        let colors = LEVEL_COLORS.map(|[red, green, blue]| [red, green, blue, 1.0]);
        let mut contents = bytemuck::cast_slice(&[code, 0, 0, 0]).to_vec();
        contents.extend_from_slice(bytemuck::cast_slice(&colors));
        let buffer = gpu.device.create_buffer_init(&BufferInitDescriptor {
            label: Some("channel"),
            contents: &contents,
            usage: wgpu::BufferUsages::UNIFORM,
        });
        let view = wgpu::BindingResource::TextureView(values);
        let entries = [
            wgpu::BindGroupEntry { binding: 0, resource: view },
            wgpu::BindGroupEntry { binding: 1, resource: buffer.as_entire_binding() },
        ];
        let layout = &self.pipeline.get_bind_group_layout(0);
        let label = Some("channel");
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label, layout, entries: &entries })
    }

    /// Draws the picture.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, group: &wgpu::BindGroup) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.draw(0..3, 0..1);
    }
}

/// A pipeline that covers the output with one triangle.
pub(crate) fn full_screen_pipeline(
    gpu: &Gpu,
    label: &str,
    module: &wgpu::ShaderModule,
    blend: Option<wgpu::BlendState>,
) -> wgpu::RenderPipeline {
    let compilation_options = wgpu::PipelineCompilationOptions::default();
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(label),
        layout: None,
        vertex: wgpu::VertexState {
            module,
            entry_point: Some("vs_main"),
            compilation_options: compilation_options.clone(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some("fs_main"),
            compilation_options,
            targets: &[Some(wgpu::ColorTargetState {
                format: OUTPUT_FORMAT,
                blend,
                write_mask: wgpu::ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}
