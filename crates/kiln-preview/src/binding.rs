//! Bind groups, filled by name.

use std::sync::Arc;

use kiln_gpu::Gpu;
use kiln_scene::{Light, Material, Scene};
use wgpu::util::{BufferInitDescriptor, DeviceExt as _};

use crate::lights;
use crate::own::OwnGroup;
use crate::parameter::ParameterValues;
use crate::prepare::Environment;
use crate::program::{Bound, Program};
use crate::scene_gpu::GpuScene;
use crate::slot::Slot;
use crate::uniform::{FrameValues, fill_block, material_member};

/// What all draws of one program share: group 0 with the buffer that each frame writes, and what the author added.
#[derive(Debug)]
pub(crate) struct FrameBinding {
    group: Option<wgpu::BindGroup>,
    own: Option<Arc<OwnGroup>>,
    block: Option<(wgpu::Buffer, Bound)>,
    /// With how many fit.
    lights: Option<(wgpu::Buffer, usize)>,
}

impl FrameBinding {
    /// Binds the environment, and the picture that the program reads if it is one that does.
    pub fn new(
        gpu: &Gpu,
        program: &Program,
        environment: &Environment,
        picture: Option<&wgpu::TextureView>,
    ) -> Self {
        let frame = program.groups[0].iter().find(|bound| bound.slot == Slot::Frame);
        let block = frame.map(|bound| (uniform_buffer(gpu, bound, Vec::new()), bound.clone()));
        let lights = program.groups[0].iter().find_map(|bound| {
            let capacity = bound.light_capacity()?;
            Some((uniform_buffer(gpu, bound, Vec::new()), capacity))
        });
        let resource = |bound: &Bound| {
            let view = match bound.slot {
                Slot::Frame => return block.as_ref().map(|(buffer, _)| buffer.as_entire_binding()),
                Slot::Lights => return lights.as_ref().map(|(buffer, _)| buffer.as_entire_binding()),
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
        FrameBinding { group, own: program.own_group.clone(), block, lights }
    }

    /// Writes the lights as they are in this frame. Those beyond the room that the shader has are left out, the weakest first.
    pub fn write_lights(&self, gpu: &Gpu, scene: &Scene, lights: &[Light]) {
        if let Some((buffer, capacity)) = &self.lights {
            let drawn = lights::strongest(lights, scene, *capacity);
            gpu.queue.write_buffer(buffer, 0, &lights::block(&drawn));
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
    }
}

/// Group 1: a material as one program reads it.
pub(crate) fn material_group(
    gpu: &Gpu,
    program: &Program,
    scene: &GpuScene,
    material: &Material,
) -> Option<wgpu::BindGroup> {
    let uniform = program.groups[1].iter().find(|bound| bound.slot == Slot::Material);
    let buffer = uniform.map(|bound| {
        let (size_bytes, members) =
            bound.block.as_ref().map_or((0, &[][..]), |(size, members)| (*size, members));
        uniform_buffer(gpu, bound, fill_block(size_bytes, members, |name| material_member(material, name)))
    });
    create_group(gpu, program, 1, |bound| match bound.slot {
        Slot::Material => buffer.as_ref().map(wgpu::Buffer::as_entire_binding),
        Slot::MaterialTexture(map) => {
            Some(wgpu::BindingResource::TextureView(scene.texture(material, map).0))
        }
        Slot::MaterialSampler(map) => Some(wgpu::BindingResource::Sampler(scene.texture(material, map).1)),
        _ => None,
    })
}

/// Group 2: one buffer for all draws of a program, read at a dynamic offset.
pub(crate) fn draw_group(gpu: &Gpu, program: &Program, blocks: &[u8]) -> Option<wgpu::BindGroup> {
    let bound = program.groups[2].first()?;
    let size = bound.block.as_ref().map_or(0, |(size, _)| u64::from(*size));
    let buffer = uniform_buffer(gpu, bound, blocks.to_vec());
    create_group(gpu, program, 2, |_| {
        let binding = wgpu::BufferBinding { buffer: &buffer, offset: 0, size: size.try_into().ok() };
        Some(wgpu::BindingResource::Buffer(binding))
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
