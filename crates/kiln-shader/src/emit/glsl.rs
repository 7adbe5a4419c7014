//! GLSL for OpenGL 4.5, OpenGL ES 3.0 and WebGL 2.

use std::collections::BTreeMap;

use naga::back::PipelineConstants;
use naga::back::glsl::{
    self, Features, Options, PipelineOptions, ReflectionInfo, Version, Writer, WriterFlags,
};
use naga::back::pipeline_constants::process_overrides;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::{BuiltIn, EntryPoint, Module, ShaderStage};

use super::bindings::{Indices, Kind, resources};
use super::{
    BindingMap, BoundResource, EmitError, Emitted, EmittedEntryPoint, GlslNamespace, Input, Language, Slot,
    gaps, stage, takes_built_in,
};

/// naga keeps binding points in a byte; no driver has as many.
const BINDINGS_MAX: u8 = u8::MAX;

pub fn write(input: &Input<'_>, language: Language) -> Result<Vec<Emitted>, EmitError> {
    let indices = Indices::new(language, &input.resources, namespace, |namespace| {
        let what = match namespace {
            GlslNamespace::UniformBlock => "uniform blocks",
            GlslNamespace::StorageBlock => "storage blocks",
            GlslNamespace::Texture => "textures",
            GlslNamespace::Image => "images",
        };
        (BINDINGS_MAX, what)
    })?;
    input
        .module
        .entry_points
        .iter()
        .map(|entry| File { input, language, entry, indices: &indices }.write())
        .collect()
}

/// Samplers have no place of their own.
fn namespace(kind: Kind) -> Option<GlslNamespace> {
    match kind {
        Kind::Uniform => Some(GlslNamespace::UniformBlock),
        Kind::Storage { .. } => Some(GlslNamespace::StorageBlock),
        Kind::Texture => Some(GlslNamespace::Texture),
        Kind::StorageTexture => Some(GlslNamespace::Image),
        Kind::Sampler => None,
    }
}

/// The file of one entry point.
struct File<'a> {
    input: &'a Input<'a>,
    language: Language,
    entry: &'a EntryPoint,
    indices: &'a Indices<GlslNamespace>,
}

impl File<'_> {
    fn write(&self) -> Result<Emitted, EmitError> {
        // Alone, so that it is not refused for what only another entry point needs.
        let (name, stage_of) = (self.entry.name.as_str(), self.entry.stage);
        let (module, info) = process_overrides(
            self.input.module,
            self.input.info,
            Some((stage_of, name)),
            &PipelineConstants::default(),
        )
        .map_err(|error| EmitError::Internal(format!("GLSL: {error}")))?;
        let used = resources(&module)?;
        if let Some(what) = gaps::gap(&module, &info, self.language) {
            return Err(self.unsupported(what, gaps::HELP));
        }
        let is_es = self.language == Language::GlslEs;
        let mut options = Options {
            version: if is_es { Version::new_gles(300) } else { Version::Desktop(450) },
            writer_flags: WriterFlags::ADJUST_COORDINATE_SPACE,
            ..Options::default()
        };
        for resource in &used {
            let index =
                namespace(resource.kind).and_then(|namespace| self.indices.get(namespace, resource.place));
            options.binding_map.extend(index.map(|index| (resource.place, index)));
        }
        let pipeline =
            PipelineOptions { shader_stage: stage_of, entry_point: name.to_owned(), multiview: None };
        // ES 3.00 cannot ask how many levels a texture has, which a check needs.
        let image_load =
            if is_es { BoundsCheckPolicy::Unchecked } else { BoundsCheckPolicy::ReadZeroSkipWrite };
        let policies = BoundsCheckPolicies { image_load, ..BoundsCheckPolicies::default() };
        let mut text = String::new();
        let reflection = Writer::new(&mut text, &module, &info, &options, &pipeline, policies)
            .and_then(|mut writer| writer.write())
            .map_err(|error| self.error(error))?;
        if text.contains(gaps::SHADOW_LOD) {
            return Err(self.unsupported(gaps::describe(Features::TEXTURE_SHADOW_LOD), gaps::HELP));
        }
        let entry_point = EmittedEntryPoint {
            name: name.to_owned(),
            emitted_name: "main".to_owned(),
            stage: stage(stage_of)?,
        };
        let resources = self.bound(&module, &reflection);
        let bindings = BindingMap { entry_points: vec![entry_point], resources, buffer_sizes: None };
        Ok(Emitted {
            file_suffix: self.suffix()?,
            bytes: text.into_bytes(),
            notes: self.notes(&module),
            bindings,
        })
    }

    fn suffix(&self) -> Result<String, EmitError> {
        let plain = self.language.file_suffix(stage(self.entry.stage)?);
        let alike = self.input.module.entry_points.iter().filter(|entry| entry.stage == self.entry.stage);
        Ok(if alike.count() > 1 { format!(".{}{plain}", self.entry.name) } else { plain.to_owned() })
    }

    /// Resources by the names that they have in the text.
    fn bound(&self, module: &Module, reflection: &ReflectionInfo) -> Vec<BoundResource> {
        let mut symbols = BTreeMap::new();
        for (handle, symbol) in &reflection.uniforms {
            symbols.insert(*handle, (symbol, None));
        }
        for (symbol, mapping) in &reflection.texture_mapping {
            let sampler = mapping.sampler.and_then(|sampler| module.global_variables[sampler].name.clone());
            symbols.insert(mapping.texture, (symbol, sampler));
        }
        let mut bound = Vec::new();
        for (handle, (symbol, sampler)) in symbols {
            let place = module.global_variables[handle].binding;
            let resource = self.input.resources.iter().find(|resource| {
                Some(resource.place) == place
                    && Some(&resource.name) == module.global_variables[handle].name.as_ref()
            });
            let Some((resource, namespace)) =
                resource.and_then(|resource| Some((resource, namespace(resource.kind)?)))
            else {
                continue;
            };
            let Some(index) = self.indices.get(namespace, resource.place) else { continue };
            let (symbol, index) = (symbol.clone(), index.into());
            bound.push(resource.at(Slot::Uniform { namespace, symbol, index, sampler }));
        }
        bound.sort_by_key(|resource| (resource.group, resource.binding));
        bound
    }

    fn notes(&self, module: &Module) -> Vec<String> {
        let mut notes = Vec::new();
        if self.entry.stage == ShaderStage::Vertex {
            notes.push(
                "row 0 of the framebuffer is the top of the picture, and counter-clockwise is `GL_CW`"
                    .to_owned(),
            );
        }
        if module.entry_points.iter().any(|entry| takes_built_in(module, entry, BuiltIn::InstanceIndex)) {
            notes.push(
                "set the uniform `naga_vs_first_instance` to the first instance of the draw".to_owned(),
            );
        }
        notes
    }

    fn unsupported(&self, what: impl Into<String>, help: &str) -> EmitError {
        EmitError::Unsupported {
            language: self.language,
            entry_point: self.entry.name.clone(),
            what: what.into(),
            help: help.to_owned(),
        }
    }

    fn error(&self, error: glsl::Error) -> EmitError {
        match error {
            glsl::Error::MissingFeatures(features) => self.unsupported(gaps::describe(features), gaps::HELP),
            glsl::Error::Custom(what) | glsl::Error::UnsupportedExternal(what) => {
                self.unsupported(what, gaps::HELP)
            }
            glsl::Error::FirstSamplingNotSupported => {
                self.unsupported("`@interpolate(flat, first)`", "write `@interpolate(flat, either)`")
            }
            glsl::Error::ImageMultipleSamplers => self.unsupported(
                "a texture that is read with two samplers",
                "declare the texture a second time, under another binding",
            ),
            error => EmitError::Internal(format!("GLSL: {error}")),
        }
    }
}
