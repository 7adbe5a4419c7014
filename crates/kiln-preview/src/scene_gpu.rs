//! A scene's geometry and textures on the device.

use std::collections::HashMap;

use kiln_diagnostic::Diagnostic;
use kiln_gpu::Gpu;
use kiln_scene::{Image8, Primitive, Sampler, Scene};
use wgpu::util::{BufferInitDescriptor, DeviceExt as _};

use crate::mip::Average;
use crate::slot::{Map, Neutral};
use crate::texture::{create_sampler, create_trilinear_sampler, upload_image};

/// A loaded scene: the CPU side without vertices and images, and the device's side.
#[derive(Debug)]
pub(crate) struct GpuScene {
    pub scene: Scene,
    pub meshes: Vec<Mesh>,
    textures: Vec<(wgpu::TextureView, wgpu::Sampler)>,
    neutral_white: wgpu::TextureView,
    neutral_normal: wgpu::TextureView,
    neutral_brush: wgpu::TextureView,
    neutral_sampler: wgpu::Sampler,
}

/// Geometry of a primitive.
#[derive(Debug)]
pub(crate) struct Mesh {
    pub vertices: wgpu::Buffer,
    pub indices: wgpu::Buffer,
    pub index_count: u32,
}

impl GpuScene {
    /// Loads a normalised GLB and uploads what it holds.
    pub fn upload(gpu: &Gpu, name: &str, glb: &[u8]) -> Result<Self, Diagnostic> {
        let failed = |error: kiln_scene::SceneError| {
            Diagnostic::error(format!("scene `{name}` cannot be loaded")).with_note(error.to_string())
        };
        let mut scene = kiln_scene::load(glb).map_err(failed)?;
        let meshes = scene.primitives.iter().map(|primitive| Mesh::upload(gpu, name, primitive));
        let meshes = meshes.collect::<Result<_, _>>()?;
        let textures = upload_textures(gpu, &scene);
        for primitive in &mut scene.primitives {
            primitive.vertices = Vec::new();
            primitive.indices = Vec::new();
        }
        scene.images = Vec::new();
        let neutral = |label, rgba: [u8; 4]| {
            let texel = Image8 { width: 1, height: 1, rgba: rgba.to_vec() };
            upload_image(gpu, label, &texel, Average::Linear)
        };
        Ok(GpuScene {
            scene,
            meshes,
            textures,
            neutral_white: neutral("neutral white", [255; 4]),
            // 128 decodes to 0.0039 instead of 0: the nearest code, and shaders leave flat maps out anyway.
            neutral_normal: neutral("neutral normal", [128, 128, 255, 255]),
            // The same code leaves the brush 0.2° off the tangent.
            neutral_brush: neutral("neutral brush", [255, 128, 255, 255]),
            neutral_sampler: create_trilinear_sampler(gpu),
        })
    }

    /// The texture and sampler that a material has for `map`, or neutral ones.
    pub fn texture(&self, material: &kiln_scene::Material, map: Map) -> (&wgpu::TextureView, &wgpu::Sampler) {
        let own = map.of(material).and_then(|texture| self.textures.get(texture.texture));
        let neutral = match map.neutral() {
            Neutral::White => &self.neutral_white,
            Neutral::FlatNormal => &self.neutral_normal,
            Neutral::AlongTangent => &self.neutral_brush,
        };
        own.map_or((neutral, &self.neutral_sampler), |(view, sampler)| (view, sampler))
    }
}

impl Mesh {
    fn upload(gpu: &Gpu, name: &str, primitive: &Primitive) -> Result<Self, Diagnostic> {
        let vertices: &[u8] = bytemuck::cast_slice(&primitive.vertices);
        let indices: &[u8] = bytemuck::cast_slice(&primitive.indices);
        let limit = gpu.device.limits().max_buffer_size;
        let largest = vertices.len().max(indices.len());
        if largest as u64 > limit {
            let message = format!("a primitive of scene `{name}` needs {largest} bytes in one buffer");
            return Err(Diagnostic::error(message).with_note(format!("this device takes {limit}")));
        }
        let upload = |label, contents, usage| {
            gpu.device.create_buffer_init(&BufferInitDescriptor { label: Some(label), contents, usage })
        };
        Ok(Mesh {
            vertices: upload("vertices", vertices, wgpu::BufferUsages::VERTEX),
            indices: upload("indices", indices, wgpu::BufferUsages::INDEX),
            index_count: primitive.indices.len() as u32,
        })
    }
}

/// One device texture for each image and way to average, one sampler for each way to sample.
fn upload_textures(gpu: &Gpu, scene: &Scene) -> Vec<(wgpu::TextureView, wgpu::Sampler)> {
    let mut views: HashMap<(usize, Average), wgpu::TextureView> = HashMap::new();
    let mut samplers: HashMap<Sampler, wgpu::Sampler> = HashMap::new();
    let white = Image8 { width: 1, height: 1, rgba: vec![255; 4] };
    let upload = |texture: &kiln_scene::Texture| {
        let average = Average::from(texture.color_space);
        let image = scene.images.get(texture.image).unwrap_or(&white);
        let view = views.entry((texture.image, average));
        let view = view.or_insert_with(|| upload_image(gpu, "material", image, average)).clone();
        let sampler = samplers.entry(texture.sampler).or_insert_with(|| create_sampler(gpu, texture.sampler));
        (view, sampler.clone())
    };
    scene.textures.iter().map(upload).collect()
}
