//! Bind groups, filled by name.

use std::sync::Arc;

use kiln_gpu::Gpu;
use kiln_scene::{Draw, Light, Material, Scene};
use kiln_shader::Member;
use wgpu::util::{BufferInitDescriptor, DeviceExt as _};

use crate::lights;
use crate::own::OwnGroup;
use crate::parameter::ParameterValues;
use crate::pose::Pose;
use crate::prepare::Environment;
use crate::program::{Bound, Program};
use crate::scene_gpu::GpuScene;
use crate::shadow::ShadowSource;
use crate::slot::Slot;
use crate::uniform::{FrameValues, InspectValues, draw_member, fill_block, material_member};

/// What all draws of one program share: group 0 with the buffer that each frame writes, and what the author added.
#[derive(Debug)]
pub(crate) struct FrameBinding {
    group: Option<wgpu::BindGroup>,
    own: Option<Arc<OwnGroup>>,
    block: Option<(wgpu::Buffer, Bound)>,
    /// With how many fit.
    lights: Option<(wgpu::Buffer, usize)>,
    sun: Option<(wgpu::Buffer, Bound)>,
    inspect: Option<(wgpu::Buffer, Bound)>,
}

/// What programs share that are drawn in one pass.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shared<'a> {
    pub environment: &'a Environment,
    /// The picture that some programs read.
    pub picture: Option<&'a wgpu::TextureView>,
    /// What the sun does not reach; given where a program reads it.
    pub shadow: Option<ShadowSource<'a>>,
}

impl FrameBinding {
    /// Binds the environment, and the picture that the program reads if it is one that does.
    pub fn new(gpu: &Gpu, program: &Program, shared: &Shared<'_>) -> Self {
        let Shared { environment, picture, shadow } = *shared;
        let sun = program.groups[0].iter().find(|bound| bound.slot == Slot::Sun);
        let sun = sun.map(|bound| (uniform_buffer(gpu, bound, Vec::new()), bound.clone()));
        let frame = program.groups[0].iter().find(|bound| bound.slot == Slot::Frame);
        let block = frame.map(|bound| (uniform_buffer(gpu, bound, Vec::new()), bound.clone()));
        let lights = program.groups[0].iter().find_map(|bound| {
            let capacity = bound.light_capacity()?;
            Some((uniform_buffer(gpu, bound, Vec::new()), capacity))
        });
        let inspect = program.groups[0].iter().find(|bound| bound.slot == Slot::Inspect);
        let inspect = inspect.map(|bound| (uniform_buffer(gpu, bound, Vec::new()), bound.clone()));
        let resource = |bound: &Bound| {
            let view = match bound.slot {
                Slot::Frame => return block.as_ref().map(|(buffer, _)| buffer.as_entire_binding()),
                Slot::Lights => return lights.as_ref().map(|(buffer, _)| buffer.as_entire_binding()),
                Slot::Sun => return sun.as_ref().map(|(buffer, _)| buffer.as_entire_binding()),
                Slot::SunShadowSampler => {
                    return shadow.map(|shadow| wgpu::BindingResource::Sampler(shadow.sampler));
                }
                Slot::SunShadow => shadow.map(|shadow| shadow.view),
                Slot::Inspect => return inspect.as_ref().map(|(buffer, _)| buffer.as_entire_binding()),
                Slot::EnvSampler | Slot::LutSampler => {
                    return Some(wgpu::BindingResource::Sampler(&environment.sampler));
                }
                Slot::EnvSkybox => Some(&environment.skybox.view),
                Slot::EnvIrradiance => Some(&environment.irradiance.view),
                Slot::EnvSpecular => Some(&environment.specular.view),
                Slot::EnvSheen => Some(&environment.sheen.view),
                Slot::LutGgx => Some(&environment.lut_ggx.view),
                Slot::LutCharlie => Some(&environment.lut_charlie.view),
                Slot::HdrColor | Slot::SceneColor => picture,
                _ => None,
            };
            view.map(wgpu::BindingResource::TextureView)
        };
        let group = create_group(gpu, program, 0, resource);
        FrameBinding { group, own: program.own_group.clone(), block, lights, sun, inspect }
    }

    /// Writes the lights as they are in this frame. Those beyond the room that the shader has are left out, the weakest first.
    pub fn write_lights(&self, gpu: &Gpu, scene: &Scene, lights: &[Light]) {
        if let Some((buffer, capacity)) = &self.lights {
            let drawn = lights::strongest(lights, scene, *capacity);
            gpu.queue.write_buffer(buffer, 0, &lights::block(&drawn));
        }
    }

    /// Writes which channel to show.
    pub fn write_inspect(&self, gpu: &Gpu, values: &InspectValues) {
        if let Some((buffer, Bound { block: Some((size_bytes, members)), .. })) = &self.inspect {
            gpu.queue.write_buffer(buffer, 0, &fill_block(*size_bytes, members, |name| values.member(name)));
        }
    }

    /// Sets groups 0 and 3.
    pub fn set(&self, pass: &mut wgpu::RenderPass<'_>) {
        let own = self.own.as_ref().map(|own| &own.group);
        for (index, group) in [(0, self.group.as_ref()), (3, own)] {
            if let Some(group) = group {
                pass.set_bind_group(index, group, &[]);
            }
        }
    }

    /// Writes this frame's values and those of the author's parameters.
    pub fn write(&self, gpu: &Gpu, values: &FrameValues, parameters: &ParameterValues) {
        if let Some(own) = &self.own {
            own.write(gpu, parameters);
        }
        if let Some((buffer, Bound { block: Some((size_bytes, members)), .. })) = &self.block {
            gpu.queue.write_buffer(buffer, 0, &fill_block(*size_bytes, members, |name| values.member(name)));
        }
        if let Some((buffer, Bound { block: Some((size_bytes, members)), .. })) = &self.sun {
            let block = fill_block(*size_bytes, members, |name| values.sun.member(name));
            gpu.queue.write_buffer(buffer, 0, &block);
        }
    }
}

/// Group 1: a material as one program reads it.
#[derive(Debug)]
pub(crate) struct MaterialBinding {
    pub group: Option<wgpu::BindGroup>,
    block: Option<(wgpu::Buffer, Bound)>,
}

impl MaterialBinding {
    /// Binds the scene's textures and writes the material's numbers.
    pub fn new(gpu: &Gpu, program: &Program, scene: &GpuScene, material: &Material) -> Self {
        let uniform = program.groups[1].iter().find(|bound| bound.slot == Slot::Material);
        let block = uniform.map(|bound| (uniform_buffer(gpu, bound, Vec::new()), bound.clone()));
        let group = create_group(gpu, program, 1, |bound| match bound.slot {
            Slot::Material => block.as_ref().map(|(buffer, _)| buffer.as_entire_binding()),
            Slot::MaterialTexture(map) => {
                Some(wgpu::BindingResource::TextureView(scene.texture(material, map).0))
            }
            Slot::MaterialSampler(map) => {
                Some(wgpu::BindingResource::Sampler(scene.texture(material, map).1))
            }
            _ => None,
        });
        let binding = MaterialBinding { group, block };
        binding.write(gpu, material);
        binding
    }

    /// Writes the material's numbers; its textures stay.
    pub fn write(&self, gpu: &Gpu, material: &Material) {
        if let Some((buffer, Bound { block: Some((size_bytes, members)), .. })) = &self.block {
            let block = fill_block(*size_bytes, members, |name| material_member(material, name));
            gpu.queue.write_buffer(buffer, 0, &block);
        }
    }
}

/// The `draw` blocks of all draws of a program in one buffer, read at a dynamic offset.
#[derive(Debug)]
pub(crate) struct DrawBlocks {
    buffer: wgpu::Buffer,
    size_bytes: u32,
    /// From block to block.
    stride_bytes: usize,
    members: Vec<Member>,
    /// Numbers of the draws, ascending.
    draws: Vec<usize>,
}

impl DrawBlocks {
    /// `None` if the program reads no such block.
    pub fn new(gpu: &Gpu, program: &Program, draws: Vec<usize>, pose: &Pose) -> Option<Self> {
        let bound = program.groups[2].iter().find(|bound| bound.slot == Slot::Draw)?;
        let (size_bytes, members) = bound.block.clone()?;
        let alignment = gpu.device.limits().min_uniform_buffer_offset_alignment as usize;
        let stride_bytes = (size_bytes as usize).next_multiple_of(alignment);
        let buffer = uniform_buffer(gpu, bound, vec![0; stride_bytes * draws.len()]);
        let blocks = DrawBlocks { buffer, size_bytes, stride_bytes, members, draws };
        blocks.write(gpu, pose);
        Some(blocks)
    }

    /// Where the block of a draw begins.
    pub fn offset_of(&self, draw: usize) -> u32 {
        (self.draws.partition_point(|&other| other < draw) * self.stride_bytes) as u32
    }

    /// Writes where the draws are.
    pub fn write(&self, gpu: &Gpu, pose: &Pose) {
        let mut bytes = Vec::with_capacity(self.draws.len() * self.stride_bytes);
        for &draw in &self.draws {
            let world = pose.draws[draw].world;
            bytes.extend(fill_block(self.size_bytes, &self.members, |name| draw_member(world, name)));
            bytes.resize(bytes.len().next_multiple_of(self.stride_bytes), 0);
        }
        gpu.queue.write_buffer(&self.buffer, 0, &bytes);
    }
}

/// Group 2 of a draw, with its number.
pub(crate) fn draw_group(
    gpu: &Gpu,
    program: &Program,
    blocks: Option<&DrawBlocks>,
    scene: &GpuScene,
    (index, draw): (usize, &Draw),
) -> Option<wgpu::BindGroup> {
    let stored = |slot: Slot| match slot {
        Slot::JointMatrices => scene.joint_matrices[draw.skin?].as_ref(),
        Slot::MorphDeltas => scene.meshes[draw.primitive].morph_deltas.as_ref(),
        Slot::MorphWeights => scene.morph_weights[draw.morph?].as_ref(),
        Slot::Instances => scene.instances[index].as_ref(),
        _ => None,
    };
    create_group(gpu, program, 2, |bound| match bound.slot {
        Slot::Draw => blocks.map(|blocks| {
            let size = u64::from(blocks.size_bytes).try_into().ok();
            wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer: &blocks.buffer, offset: 0, size })
        }),
        Slot::MorphDeltas | Slot::MorphWeights => {
            Some(stored(bound.slot).unwrap_or(&scene.neutral_morph).as_entire_binding())
        }
        _ => Some(stored(bound.slot).unwrap_or(&scene.neutral_matrix).as_entire_binding()),
    })
}

/// A uniform buffer that holds `contents`, and at least the block's size.
fn uniform_buffer(gpu: &Gpu, bound: &Bound, mut contents: Vec<u8>) -> wgpu::Buffer {
    let size = bound.block.as_ref().map_or(0, |(size, _)| *size as usize);
    contents.resize(contents.len().max(size), 0);
    gpu.device.create_buffer_init(&BufferInitDescriptor {
        label: Some("uniform"),
        contents: &contents,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
    })
}

fn create_group<'a>(
    gpu: &Gpu,
    program: &'a Program,
    group: usize,
    resource: impl Fn(&Bound) -> Option<wgpu::BindingResource<'a>>,
) -> Option<wgpu::BindGroup> {
    let layout = program.layouts[group].as_ref()?;
    let entry =
        |bound: &Bound| Some(wgpu::BindGroupEntry { binding: bound.binding, resource: resource(bound)? });
    let entries: Vec<_> = program.groups[group].iter().filter_map(entry).collect();
    Some(gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries }))
}
