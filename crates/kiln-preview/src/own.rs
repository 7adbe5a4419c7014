//! Group 3: what a shader's author adds, parameters and textures.

use std::collections::BTreeMap;

use kiln_diagnostic::Diagnostic;
use kiln_gpu::Gpu;
use kiln_link::Revision;
use kiln_scene::{Sampler, Wrap, decode_image};
use kiln_shader::Reflection;
use wgpu::util::DeviceExt as _;

use crate::mip::Average;
use crate::program::Bound;
use crate::slot::Slot;
use crate::texture::{create_sampler, upload_image};
use crate::uniform::parameter_block;

/// The textures that come with a shader, by the names of its variables.
#[derive(Debug)]
pub(crate) struct OwnTextures {
    views: BTreeMap<String, wgpu::TextureView>,
    /// Repeats, trilinear.
    sampler: wgpu::Sampler,
}

/// Prefix of the parts of a shader's target that are textures.
const PART: &str = "texture.";

impl OwnTextures {
    /// Uploads the textures of the target `name`.
    pub fn upload(gpu: &Gpu, revision: &Revision, name: &str, srgb: &[String]) -> Result<Self, Diagnostic> {
        let mut textures = OwnTextures::none(gpu);
        let parts = revision.table.targets.get(name).map_or(&[][..], |target| &target.parts);
        for variable in parts.iter().filter_map(|part| part.name.strip_prefix(PART)) {
            let Some(file) = revision.part(name, &format!("{PART}{variable}")) else { continue };
            let image = decode_image(file).map_err(|reason| {
                Diagnostic::error(format!("texture `{variable}` of `{name}` cannot be read: {reason}"))
            })?;
            let is_srgb = srgb.iter().any(|other| other == variable);
            let average = if is_srgb { Average::Srgb } else { Average::Linear };
            textures.views.insert(variable.to_owned(), upload_image(gpu, variable, &image, average));
        }
        Ok(textures)
    }

    /// No textures.
    pub fn none(gpu: &Gpu) -> Self {
        let (wrap_u, wrap_v) = (Wrap::Repeat, Wrap::Repeat);
        let sampler = Sampler { wrap_u, wrap_v, mag_linear: true, min_linear: true, mip_linear: Some(true) };
        OwnTextures { views: BTreeMap::new(), sampler: create_sampler(gpu, sampler) }
    }

    /// Says which texture a shader declares without having it.
    pub fn check(&self, shader: &str, bounds: &[Bound]) -> Result<(), Diagnostic> {
        let missing = bounds
            .iter()
            .find(|bound| bound.slot == Slot::OwnTexture && !self.views.contains_key(&bound.name));
        missing.map_or(Ok(()), |bound| {
            let message = format!("`{shader}` declares the texture `{}`, which nobody gives", bound.name);
            let help =
                format!("name its file in [shader.…]: textures = [\"{}=textures/file.png\"]", bound.name);
            Err(Diagnostic::error(message).with_help(help))
        })
    }

    /// The bind group of a shader's own textures, and of its parameters with their first values.
    pub fn group(
        &self,
        gpu: &Gpu,
        layout: Option<&wgpu::BindGroupLayout>,
        bounds: &[Bound],
        reflection: &Reflection,
    ) -> Option<wgpu::BindGroup> {
        let layout = layout?;
        let buffers: Vec<Option<wgpu::Buffer>> =
            bounds.iter().map(|bound| parameter_buffer(gpu, bound, reflection)).collect();
        let resource = |bound: &Bound| match bound.slot {
            Slot::OwnTexture => self.views.get(&bound.name).map(wgpu::BindingResource::TextureView),
            Slot::OwnSampler => Some(wgpu::BindingResource::Sampler(&self.sampler)),
            _ => None,
        };
        let mut entries = Vec::new();
        for (bound, buffer) in bounds.iter().zip(&buffers) {
            let resource =
                buffer.as_ref().map(wgpu::Buffer::as_entire_binding).or_else(|| resource(bound))?;
            entries.push(wgpu::BindGroupEntry { binding: bound.binding, resource });
        }
        let descriptor = wgpu::BindGroupDescriptor { label: Some("own"), layout, entries: &entries };
        Some(gpu.device.create_bind_group(&descriptor))
    }
}

fn parameter_buffer(gpu: &Gpu, bound: &Bound, reflection: &Reflection) -> Option<wgpu::Buffer> {
    let (size_bytes, members) = bound.block.as_ref()?;
    Some(gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("params"),
        contents: &parameter_block(*size_bytes, members, &reflection.parameters),
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
    }))
}
