//! Group 3: what a shader's author adds, parameters and textures.

use std::collections::BTreeMap;

use kiln_diagnostic::Diagnostic;
use kiln_gpu::Gpu;
use kiln_link::Revision;
use kiln_scene::{Sampler, Wrap, decode_image};
use kiln_shader::Member;

use crate::mip::Average;
use crate::parameter::{OfferedParameter, ParameterValues};
use crate::program::Bound;
use crate::slot::Slot;
use crate::texture::{create_sampler, upload_image};
use crate::uniform::parameter_block;
use crate::upload::Uploader;

/// The textures that come with a shader, by the names of its variables.
#[derive(Debug)]
pub(crate) struct OwnTextures {
    views: BTreeMap<String, wgpu::TextureView>,
    /// Repeats, trilinear.
    sampler: wgpu::Sampler,
}

/// A shader's group 3.
#[derive(Debug)]
pub(crate) struct OwnGroup {
    pub group: wgpu::BindGroup,
    block: Option<ParameterBlock>,
}

/// The uniform `params` with the parameters of its members.
#[derive(Debug)]
struct ParameterBlock {
    buffer: wgpu::Buffer,
    size_bytes: u32,
    fields: Vec<(Member, OfferedParameter)>,
}

impl OwnGroup {
    /// Writes the parameters' values.
    pub fn write(&self, gpu: &Gpu, values: &ParameterValues) {
        if let Some(ParameterBlock { buffer, size_bytes, fields }) = &self.block {
            gpu.queue.write_buffer(buffer, 0, &parameter_block(*size_bytes, fields, values));
        }
    }
}

/// Prefix of the parts of a shader's target that are textures.
const PART: &str = "texture.";

impl OwnTextures {
    /// Uploads the textures of the target `name`.
    pub fn upload(
        uploader: &Uploader,
        revision: &Revision,
        name: &str,
        srgb: &[String],
    ) -> Result<Self, Diagnostic> {
        let mut textures = OwnTextures::none(&uploader.gpu);
        let parts = revision.table.targets.get(name).map_or(&[][..], |target| &target.parts);
        for variable in parts.iter().filter_map(|part| part.name.strip_prefix(PART)) {
            let Some(file) = revision.part(name, &format!("{PART}{variable}")) else { continue };
            let image = decode_image(file).map_err(|reason| {
                Diagnostic::error(format!("texture `{variable}` of `{name}` cannot be read: {reason}"))
            })?;
            let is_srgb = srgb.iter().any(|other| other == variable);
            let average = if is_srgb { Average::Srgb } else { Average::Linear };
            textures.views.insert(variable.to_owned(), upload_image(uploader, variable, &image, average));
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

    /// Group 3 of a shader that offers `parameters`.
    pub fn group(
        &self,
        gpu: &Gpu,
        layout: Option<&wgpu::BindGroupLayout>,
        bounds: &[Bound],
        parameters: &[OfferedParameter],
    ) -> Option<OwnGroup> {
        let layout = layout?;
        let block = bounds.iter().find_map(|bound| ParameterBlock::new(gpu, bound, parameters));
        let resource = |bound: &Bound| match bound.slot {
            Slot::OwnTexture => self.views.get(&bound.name).map(wgpu::BindingResource::TextureView),
            Slot::OwnSampler => Some(wgpu::BindingResource::Sampler(&self.sampler)),
            Slot::Params => block.as_ref().map(|block| block.buffer.as_entire_binding()),
            _ => None,
        };
        let entry =
            |bound: &Bound| Some(wgpu::BindGroupEntry { binding: bound.binding, resource: resource(bound)? });
        let entries = bounds.iter().map(entry).collect::<Option<Vec<_>>>()?;
        let descriptor = wgpu::BindGroupDescriptor { label: Some("own"), layout, entries: &entries };
        Some(OwnGroup { group: gpu.device.create_bind_group(&descriptor), block })
    }
}

impl ParameterBlock {
    /// `None` for what is no uniform.
    fn new(gpu: &Gpu, bound: &Bound, parameters: &[OfferedParameter]) -> Option<Self> {
        let (size_bytes, members) = bound.block.as_ref()?;
        let field = |member: &Member| {
            let is_its =
                |parameter: &&OfferedParameter| parameter.name == member.name && !parameter.is_override;
            Some((member.clone(), parameters.iter().find(is_its)?.clone()))
        };
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("params"),
            size: u64::from(*size_bytes),
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        Some(ParameterBlock {
            buffer,
            size_bytes: *size_bytes,
            fields: members.iter().filter_map(field).collect(),
        })
    }
}
