//! The floor that a view may have: lines, and the sun's shadow.
//!
//! Drawn between the background and what is seen through: glass shows neither lines nor shadow behind itself.

use glam::{Mat4, Vec3};
use kiln_gpu::Gpu;
use kiln_scene::Bounds;

use crate::backdrop::overlay_pipeline;
use crate::prepare::Environment;
use crate::shadow::ShadowSource;
use crate::uniform::FrameValues;
use crate::view::{Background, Ground};

/// Half the floor's edge in diagonals of the scene.
const RADIUS: f32 = 10.0;
/// How far the floor lies below the scene, in diagonals: a scene's own floor stays on top.
const GAP: f32 = 5e-4;
/// Linear radiance of a line under exposure 0, seen in the dark and on grey.
const LINE: f32 = 0.5;
/// The same on a background of one colour that is brighter than [`BRIGHT`].
const LINE_ON_BRIGHT: f32 = 0.05;
/// Mean of a colour's linear channels.
const BRIGHT: f32 = 0.25;

/// Draws floors.
#[derive(Debug)]
pub(crate) struct GroundPainter {
    grid: wgpu::RenderPipeline,
    grid_group: wgpu::BindGroup,
    shadow: wgpu::RenderPipeline,
    block: wgpu::Buffer,
}

/// `Ground` of ground.wgsl.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Block {
    clip_from_world: Mat4,
    shadow_from_world: Mat4,
    center: Vec3,
    radius: f32,
    sun_direction: Vec3,
    shadow_texel: f32,
    sun_over_pi: Vec3,
    spacing: f32,
    irradiance_scale: f32,
    line: f32,
    padding: [f32; 2],
}

/// Where a floor is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Floor {
    center: Vec3,
    radius: f32,
    /// From line to line.
    spacing: f32,
}

impl Floor {
    /// Below a scene at rest.
    pub fn below(bounds: Bounds) -> Floor {
        let diagonal = (bounds.max - bounds.min).length().clamp(1e-6, 1e12);
        let middle = (bounds.min + bounds.max) / 2.0;
        let center = Vec3::new(middle.x, bounds.min.y - GAP * diagonal, middle.z);
        Floor { center, radius: RADIUS * diagonal, spacing: 10.0_f32.powf((diagonal / 3.0).log10().floor()) }
    }

    /// What it and the scene take of the world.
    pub fn beside(self, scene: Bounds) -> Bounds {
        let half = Vec3::new(self.radius, 0.0, self.radius);
        Bounds { min: scene.min.min(self.center - half), max: scene.max.max(self.center + half) }
    }
}

impl GroundPainter {
    /// Makes the pipelines, for so many samples a pixel.
    pub fn new(gpu: &Gpu, sample_count: u32) -> Self {
        let module = gpu.device.create_shader_module(wgpu::include_wgsl!("ground.wgsl"));
        let multiply = wgpu::BlendComponent {
            src_factor: wgpu::BlendFactor::Zero,
            dst_factor: wgpu::BlendFactor::Src,
            operation: wgpu::BlendOperation::Add,
        };
        // Alpha stays, or what is behind would no longer be opaque.
        let keep = wgpu::BlendComponent {
            src_factor: wgpu::BlendFactor::Zero,
            dst_factor: wgpu::BlendFactor::One,
            operation: wgpu::BlendOperation::Add,
        };
        let over = wgpu::BlendState { alpha: keep, ..wgpu::BlendState::ALPHA_BLENDING };
        let darken = wgpu::BlendState { color: multiply, alpha: keep };
        let above = Some(wgpu::Face::Back);
        let grid = overlay_pipeline(gpu, &module, "fs_grid", sample_count, Some(over), None);
        let block = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("ground"),
            size: size_of::<Block>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let grid_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("ground"),
            layout: &grid.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: block.as_entire_binding() }],
        });
        let shadow = overlay_pipeline(gpu, &module, "fs_shadow", sample_count, Some(darken), above);
        GroundPainter { grid, grid_group, shadow, block }
    }

    /// Writes where the floor is and what lights it in this frame.
    pub fn write(&self, gpu: &Gpu, floor: Floor, values: &FrameValues, background: Background) {
        let sun = &values.sun;
        let line = match background {
            Background::Color(color) if color.iter().sum::<f32>() > 3.0 * BRIGHT => LINE_ON_BRIGHT,
            _ => LINE,
        };
        let block = Block {
            clip_from_world: values.clip_from_world,
            shadow_from_world: sun.shadow_from_world,
            center: floor.center,
            radius: floor.radius,
            sun_direction: sun.direction,
            shadow_texel: sun.shadow_texel,
            sun_over_pi: sun.irradiance * sun.direction.y.max(0.0) / std::f32::consts::PI,
            spacing: floor.spacing,
            irradiance_scale: values.irradiance_scale * values.environment_intensity,
            line: line / values.exposure,
            padding: [0.0; 2],
        };
        gpu.queue.write_buffer(&self.block, 0, bytemuck::bytes_of(&block));
    }

    /// Draws the shadow, then the lines.
    pub fn draw(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::RenderPass<'_>,
        ground: Ground,
        environment: &Environment,
        shadow: Option<&ShadowSource<'_>>,
    ) {
        if let Some(shadow) = shadow.filter(|_| ground.catches_shadow) {
            pass.set_pipeline(&self.shadow);
            pass.set_bind_group(0, &self.shadow_group(gpu, environment, shadow), &[]);
            pass.draw(0..6, 0..1);
        }
        if ground.has_grid {
            pass.set_pipeline(&self.grid);
            pass.set_bind_group(0, &self.grid_group, &[]);
            pass.draw(0..6, 0..1);
        }
    }

    fn shadow_group(
        &self,
        gpu: &Gpu,
        environment: &Environment,
        shadow: &ShadowSource<'_>,
    ) -> wgpu::BindGroup {
        let resources = [
            self.block.as_entire_binding(),
            wgpu::BindingResource::TextureView(&environment.irradiance.view),
            wgpu::BindingResource::Sampler(&environment.sampler),
            wgpu::BindingResource::TextureView(shadow.view),
            wgpu::BindingResource::Sampler(shadow.sampler),
        ];
        let entry = |(binding, resource)| wgpu::BindGroupEntry { binding, resource };
        let entries: Vec<_> = (0..).zip(resources).map(entry).collect();
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("ground"),
            layout: &self.shadow.get_bind_group_layout(0),
            entries: &entries,
        })
    }
}
