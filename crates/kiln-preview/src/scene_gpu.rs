//! A scene's geometry and textures on the device.

use std::collections::HashMap;

use glam::{Mat4, Vec3};
use kiln_diagnostic::Diagnostic;
use kiln_gpu::Gpu;
use kiln_scene::{
    Bounds, Draw, Image8, Influence, MorphDelta, MorphTarget, Posed, Primitive, Sampler, Scene,
};
use wgpu::util::{BufferInitDescriptor, DeviceExt as _};

use crate::mip::Average;
use crate::slot::{Map, Neutral};
use crate::texture::{create_sampler, create_trilinear_sampler, upload_image};
use crate::upload::Uploader;

/// A loaded scene: the CPU side without vertices and images, and the device's side.
#[derive(Debug)]
pub(crate) struct GpuScene {
    pub scene: Scene,
    pub meshes: Vec<Mesh>,
    /// Matrices of copies, for each of the scene's draws, then for each of its hidden ones.
    pub instances: Vec<Option<wgpu::Buffer>>,
    /// For each of the scene's skins; frames of an animation write them.
    pub joint_matrices: Vec<Option<wgpu::Buffer>>,
    /// For each of the scene's morphing draws; frames of an animation write them.
    pub morph_weights: Vec<Option<wgpu::Buffer>>,
    /// Stands for joints and copies where there are none.
    pub neutral_matrix: wgpu::Buffer,
    /// Stands for what morphs, and by how much.
    pub neutral_morph: wgpu::Buffer,
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
    /// The joints that vertices hang on.
    influences: Option<wgpu::Buffer>,
    vertex_count: usize,
    /// As `docs/shader-interface.md` lays them out.
    pub morph_deltas: Option<wgpu::Buffer>,
    /// What a weight of 1 adds to positions at least and at most, for each weight.
    pub morph_reach: Vec<Bounds>,
}

impl GpuScene {
    /// Loads a normalised GLB and uploads what it holds.
    pub fn upload(uploader: &Uploader, name: &str, glb: &[u8]) -> Result<Self, Diagnostic> {
        let gpu = &uploader.gpu;
        let failed = |error: kiln_scene::SceneError| {
            Diagnostic::error(format!("scene `{name}` cannot be loaded")).with_note(error.to_string())
        };
        let mut scene = kiln_scene::load(glb).map_err(failed)?;
        let meshes = scene.primitives.iter().map(|primitive| Mesh::upload(uploader, name, primitive));
        let meshes = meshes.collect::<Result<_, _>>()?;
        let instances = all_draws(&scene).map(|draw| upload_instances(uploader, name, draw));
        let instances = instances.collect::<Result<_, _>>()?;
        let rest = scene.pose(None, 0.0);
        let stored = |label, contents| upload_stored(uploader, name, label, contents);
        let joints = rest.skins.iter().map(|it| stored("joint matrices", bytemuck::cast_slice(it)));
        let weights = rest.morphs.iter().map(|it| stored("morph weights", bytemuck::cast_slice(it)));
        let (joint_matrices, morph_weights) =
            (joints.collect::<Result<_, _>>()?, weights.collect::<Result<_, _>>()?);
        let textures = upload_textures(uploader, &scene);
        for primitive in &mut scene.primitives {
            primitive.vertices = Vec::new();
            primitive.indices = Vec::new();
            primitive.influences = Vec::new();
            primitive.targets = Vec::new();
        }
        scene.images = Vec::new();
        let neutral = |label, rgba: [u8; 4]| {
            let texel = Image8 { width: 1, height: 1, rgba: rgba.to_vec() };
            upload_image(uploader, label, &texel, Average::Linear)
        };
        Ok(GpuScene {
            scene,
            meshes,
            instances,
            joint_matrices,
            morph_weights,
            neutral_matrix: neutral_storage(gpu, &Mat4::IDENTITY.to_cols_array()),
            // One weight of 0 and, read as such, nine deltas.
            neutral_morph: neutral_storage(gpu, &[0.0]),
            textures,
            neutral_white: neutral("neutral white", [255; 4]),
            // 128 decodes to 0.0039 instead of 0: the nearest code, and shaders leave flat maps out anyway.
            neutral_normal: neutral("neutral normal", [128, 128, 255, 255]),
            // The same code leaves the brush 0.2° off the tangent.
            neutral_brush: neutral("neutral brush", [255, 128, 255, 255]),
            neutral_sampler: create_trilinear_sampler(gpu),
        })
    }

    /// The materials' textures, some of them more than once.
    pub fn textures(&self) -> impl Iterator<Item = &wgpu::Texture> {
        self.textures.iter().map(|(view, _)| view.texture())
    }

    /// Geometry, and how it is copied and deformed.
    pub fn buffers(&self) -> impl Iterator<Item = &wgpu::Buffer> {
        let of_meshes = self.meshes.iter().flat_map(|mesh| {
            [&mesh.vertices, &mesh.indices].into_iter().chain(&mesh.influences).chain(&mesh.morph_deltas)
        });
        let moving = self.instances.iter().chain(&self.joint_matrices).chain(&self.morph_weights);
        of_meshes.chain(moving.flatten())
    }

    /// Writes how skins and morphing draws are deformed.
    pub fn write_deformation(&self, gpu: &Gpu, posed: &Posed) {
        for (buffer, matrices) in self.joint_matrices.iter().zip(&posed.skins) {
            write(gpu, buffer.as_ref(), bytemuck::cast_slice(matrices));
        }
        for (buffer, weights) in self.morph_weights.iter().zip(&posed.morphs) {
            write(gpu, buffer.as_ref(), bytemuck::cast_slice(weights));
        }
    }

    /// Orders the copies of a draw from far to near, as blending wants them. `world` is where the draw is.
    pub fn sort_copies(&self, gpu: &Gpu, index: usize, world: Mat4, eye: Vec3) {
        let Some((draw, buffer)) = all_draws(&self.scene).nth(index).zip(self.instances[index].as_ref())
        else {
            return;
        };
        let middle = self.scene.primitives[draw.primitive].bounds;
        let middle = (middle.min + middle.max) / 2.0;
        let mut copies: Vec<(f32, Mat4)> = draw
            .instances
            .iter()
            .map(kiln_scene::Instance::matrix)
            .map(|copy| ((world * copy).transform_point3(middle).distance_squared(eye), copy))
            .collect();
        copies.sort_by(|a, b| b.0.total_cmp(&a.0));
        let matrices: Vec<Mat4> = copies.into_iter().map(|(_, matrix)| matrix).collect();
        gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(&matrices));
    }

    /// The joints that a mesh's vertices hang on. Without a skin that is the first, whose matrix is neutral.
    pub fn influences(&self, gpu: &Gpu, mesh: usize) -> wgpu::Buffer {
        let Mesh { influences, vertex_count, .. } = &self.meshes[mesh];
        influences.clone().unwrap_or_else(|| {
            let on_first = Influence { joints: [0; 4], weights: [1.0, 0.0, 0.0, 0.0] };
            gpu.device.create_buffer_init(&BufferInitDescriptor {
                label: Some("neutral influences"),
                contents: bytemuck::cast_slice(&vec![on_first; *vertex_count]),
                usage: wgpu::BufferUsages::VERTEX,
            })
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

/// What is drawn at rest, then what only animations show: draws are numbered in this order.
pub(crate) fn all_draws(scene: &Scene) -> impl Iterator<Item = &Draw> {
    scene.draws.iter().chain(&scene.hidden)
}

impl Mesh {
    fn upload(uploader: &Uploader, name: &str, primitive: &Primitive) -> Result<Self, Diagnostic> {
        let limits = uploader.gpu.device.limits();
        let upload =
            |label, contents, usage| upload(uploader, name, label, contents, usage, limits.max_buffer_size);
        let vertices: &[u8] = bytemuck::cast_slice(&primitive.vertices);
        let indices: &[u8] = bytemuck::cast_slice(&primitive.indices);
        let influences: &[u8] = bytemuck::cast_slice::<Influence, u8>(&primitive.influences);
        let deltas = interleaved(&primitive.targets, primitive.vertices.len());
        Ok(Mesh {
            vertices: upload("vertices", vertices, wgpu::BufferUsages::VERTEX)?,
            indices: upload("indices", indices, wgpu::BufferUsages::INDEX)?,
            index_count: primitive.indices.len() as u32,
            vertex_count: primitive.vertices.len(),
            influences: match influences.is_empty() {
                true => None,
                false => Some(upload("influences", influences, wgpu::BufferUsages::VERTEX)?),
            },
            morph_deltas: upload_stored(uploader, name, "morph deltas", bytemuck::cast_slice(&deltas))?,
            morph_reach: primitive.targets.iter().map(reach).collect(),
        })
    }
}

/// All that is added to a vertex side by side, as it is read.
fn interleaved(targets: &[MorphTarget], vertex_count: usize) -> Vec<MorphDelta> {
    let of_vertex = |vertex: usize| targets.iter().map(move |target| target.deltas[vertex]);
    (0..vertex_count).flat_map(of_vertex).collect()
}

fn reach(target: &MorphTarget) -> Bounds {
    let positions = || target.deltas.iter().map(|delta| Vec3::from(delta.position));
    Bounds { min: positions().fold(Vec3::ZERO, Vec3::min), max: positions().fold(Vec3::ZERO, Vec3::max) }
}

fn upload_instances(
    uploader: &Uploader,
    name: &str,
    draw: &Draw,
) -> Result<Option<wgpu::Buffer>, Diagnostic> {
    let matrices: Vec<Mat4> = draw.instances.iter().map(kiln_scene::Instance::matrix).collect();
    upload_stored(uploader, name, "instances", bytemuck::cast_slice(&matrices))
}

/// A storage buffer that frames may write; `None` for nothing.
fn upload_stored(
    uploader: &Uploader,
    scene: &str,
    label: &str,
    contents: &[u8],
) -> Result<Option<wgpu::Buffer>, Diagnostic> {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
    let limits = uploader.gpu.device.limits();
    // A device without storage buffers refuses the shaders that read them, by name.
    if contents.is_empty() || limits.max_storage_buffer_binding_size == 0 {
        return Ok(None);
    }
    let bytes_max = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
    upload(uploader, scene, label, contents, usage, bytes_max).map(Some)
}

fn write(gpu: &Gpu, buffer: Option<&wgpu::Buffer>, contents: &[u8]) {
    if let Some(buffer) = buffer {
        gpu.queue.write_buffer(buffer, 0, contents);
    }
}

/// A device without storage buffers has no program that reads it.
fn neutral_storage(gpu: &Gpu, contents: &[f32]) -> wgpu::Buffer {
    let has_any = gpu.device.limits().max_storage_buffer_binding_size > 0;
    let usage = if has_any { wgpu::BufferUsages::STORAGE } else { wgpu::BufferUsages::VERTEX };
    let contents = bytemuck::cast_slice(contents);
    gpu.device.create_buffer_init(&BufferInitDescriptor { label: Some("neutral"), contents, usage })
}

fn upload(
    uploader: &Uploader,
    scene: &str,
    label: &str,
    contents: &[u8],
    usage: wgpu::BufferUsages,
    bytes_max: u64,
) -> Result<wgpu::Buffer, Diagnostic> {
    if contents.len() as u64 > bytes_max {
        let needed = contents.len();
        let message = format!("scene `{scene}` needs {needed} bytes in one buffer of {label}");
        return Err(Diagnostic::error(message).with_note(format!("this device takes {bytes_max}")));
    }
    Ok(uploader.buffer(label, contents, usage))
}

/// One device texture for each image and way to average, one sampler for each way to sample.
fn upload_textures(uploader: &Uploader, scene: &Scene) -> Vec<(wgpu::TextureView, wgpu::Sampler)> {
    let mut views: HashMap<(usize, Average), wgpu::TextureView> = HashMap::new();
    let mut samplers: HashMap<Sampler, wgpu::Sampler> = HashMap::new();
    let white = Image8 { width: 1, height: 1, rgba: vec![255; 4] };
    let upload = |texture: &kiln_scene::Texture| {
        let average = Average::from(texture.color_space);
        let image = scene.images.get(texture.image).unwrap_or(&white);
        let view = views.entry((texture.image, average));
        let view = view.or_insert_with(|| upload_image(uploader, "material", image, average)).clone();
        let sampler =
            samplers.entry(texture.sampler).or_insert_with(|| create_sampler(&uploader.gpu, texture.sampler));
        (view, sampler.clone())
    };
    scene.textures.iter().map(upload).collect()
}
