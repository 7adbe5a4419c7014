//! The sun's shadow map: the depth of what stands nearest to the sun, seen along its light.
//!
//! Opaque and masked draws cast shadows; what is blended or lets light through casts none. A draw's own `vs_main` places its
//! vertices, with a `frame` whose `clip_from_world` is the sun's, so what is skinned, morphed and copied casts the shadow of what
//! is seen. Its `fs_main` runs only where alpha is masked, for what it discards.

use std::cell::RefCell;

use glam::{Mat3, Mat4, Quat, Vec3};
use kiln_gpu::Gpu;
use kiln_scene::Bounds;

use crate::binding::{FrameBinding, Shared};
use crate::camera::corners;
use crate::parameter::ParameterValues;
use crate::prepare::Prepared;
use crate::program::DEPTH_FORMAT;
use crate::sun::{Sun, SunValues};
use crate::uniform::FrameValues;
use crate::view::AnimationTime;

/// Texels along an edge of the map.
const SIZE: u32 = 2048;
/// Texels around the scene: what the widest filter reads beyond it.
const MARGIN_TEXELS: f32 = 4.0;
/// The map's extent is rounded up to one of so many steps an octave, so that an animation does not change it with every frame.
const STEPS_PER_OCTAVE: f32 = 8.0;

/// What a program reads the sun's shadow through.
#[derive(Debug)]
pub(crate) struct ShadowReader {
    /// Compares, and mixes four comparisons.
    sampler: wgpu::Sampler,
    /// Bound where there is no map: nothing reads it.
    neutral: wgpu::TextureView,
}

/// A map as programs read it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShadowSource<'a> {
    pub view: &'a wgpu::TextureView,
    pub sampler: &'a wgpu::Sampler,
}

/// A map, and what its pass is drawn with.
#[derive(Debug)]
pub(crate) struct ShadowMap {
    view: wgpu::TextureView,
    /// Of each of the draw list's programs, seen from the sun.
    pub frames: Vec<FrameBinding>,
    /// What it holds.
    drawn: RefCell<Option<Contents>>,
}

/// All that decides what a map holds, beside shaders that read the time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Contents {
    pub frustum: Frustum,
    pub animation: Option<AnimationTime>,
    pub parameters: ParameterValues,
}

/// The box of light that falls on a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frustum {
    pub clip_from_world: Mat4,
    /// Edge of a texel in the world.
    pub texel: f32,
}

impl ShadowReader {
    pub fn new(gpu: &Gpu) -> Self {
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("shadow"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            compare: Some(wgpu::CompareFunction::LessEqual),
            ..Default::default()
        });
        ShadowReader { sampler, neutral: create_map(gpu, 1) }
    }

    /// How `map` is read, if there is one.
    pub fn source<'a>(&'a self, map: Option<&'a ShadowMap>) -> ShadowSource<'a> {
        ShadowSource { view: map.map_or(&self.neutral, |map| &map.view), sampler: &self.sampler }
    }
}

impl ShadowMap {
    /// A map for what is prepared.
    pub fn new(gpu: &Gpu, prepared: &Prepared, reader: &ShadowReader) -> Self {
        let shared = Shared {
            environment: &prepared.environment,
            // Nothing that reads a picture casts a shadow: any texture fits its place.
            picture: Some(&prepared.environment.lut_ggx.view),
            // The pass writes the map, so it must not have it bound to be read.
            shadow: Some(reader.source(None)),
        };
        let programs = prepared.draws.programs.iter();
        let frames = programs.map(|binding| FrameBinding::new(gpu, &binding.program, &shared)).collect();
        ShadowMap { view: create_map(gpu, SIZE), frames, drawn: RefCell::new(None) }
    }

    /// Whether the map must be drawn to hold this; from now on it does.
    pub fn takes(&self, contents: Contents) -> bool {
        self.drawn.replace(Some(contents.clone())).as_ref() != Some(&contents)
    }

    /// Begins the pass that fills the map.
    pub fn begin<'a>(
        &self,
        encoder: &'a mut wgpu::CommandEncoder,
        timestamp_writes: Option<wgpu::RenderPassTimestampWrites<'a>>,
    ) -> wgpu::RenderPass<'a> {
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("sun shadow"),
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.view,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(1.0),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            timestamp_writes,
            ..Default::default()
        })
    }
}

impl Frustum {
    /// The box along `direction`, which points towards the sun, that holds all of `bounds`: square, and moved and sized in steps, so
    /// that shadows of what rests keep still while something else moves.
    pub fn around(bounds: Bounds, direction: Vec3) -> Frustum {
        // Rows are right, up and towards the sun.
        let turn = Mat3::from_quat(Quat::from_rotation_arc(direction, Vec3::Z));
        let corners = corners(bounds).map(|corner| turn * corner);
        let min = corners.into_iter().fold(Vec3::INFINITY, Vec3::min);
        let max = corners.into_iter().fold(Vec3::NEG_INFINITY, Vec3::max);
        let extent = (max - min).truncate().max_element().max(1e-6);
        let extent = ((extent.log2() * STEPS_PER_OCTAVE).ceil() / STEPS_PER_OCTAVE).exp2();
        let texel = extent / (SIZE as f32 - 2.0 * MARGIN_TEXELS);
        let center = (((min + max) / 2.0).truncate() / texel).round() * texel;
        let half = texel * SIZE as f32 / 2.0;
        let depth = (max.z - min.z).max(extent * 1e-3);
        // Depth 0 is a little nearer to the sun than anything.
        let (near, range) = (max.z + 0.01 * depth, 1.02 * depth);
        let clip_from_light = Mat4::from_cols_array(&[
            1.0 / half,
            0.0,
            0.0,
            0.0, //
            0.0,
            1.0 / half,
            0.0,
            0.0, //
            0.0,
            0.0,
            -1.0 / range,
            0.0, //
            -center.x / half,
            -center.y / half,
            near / range,
            1.0,
        ]);
        Frustum { clip_from_world: clip_from_light * Mat4::from_mat3(turn), texel }
    }

    /// The frame as the sun sees it.
    pub fn values(self, seen: &FrameValues) -> FrameValues {
        FrameValues { clip_from_world: self.clip_from_world, ..*seen }
    }
}

impl SunValues {
    /// A sun in the sky, over what `frustum` holds.
    pub fn new(sun: Sun, frustum: Frustum) -> Self {
        // Clip space to a texture's: y downwards, and 0 … 1.
        let map_from_clip =
            Mat4::from_translation(Vec3::new(0.5, 0.5, 0.0)) * Mat4::from_scale(Vec3::new(0.5, -0.5, 1.0));
        SunValues {
            direction: sun.direction,
            irradiance: sun.irradiance,
            angular_radius: sun.angular_radius_rad,
            shadow_from_world: map_from_clip * frustum.clip_from_world,
            shadow_texel: frustum.texel,
        }
    }
}

fn create_map(gpu: &Gpu, size: u32) -> wgpu::TextureView {
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("sun shadow"),
        size: wgpu::Extent3d { width: size, height: size, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: DEPTH_FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}
