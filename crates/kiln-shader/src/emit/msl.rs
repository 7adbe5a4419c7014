//! The Metal shading language.

use naga::ShaderStage;
use naga::back::msl::{
    BindSamplerTarget, BindTarget, BindingMap as Targets, EntryPointResources, Options, PipelineOptions,
    write_string,
};

use super::bindings::{Indices, Kind};
use super::{
    BindingMap, EmitError, Emitted, Input, Language, MslNamespace, Slot, WGSL_BOUNDS, entry_points, has_stage,
};

/// Entries of Metal's argument tables (Metal feature set tables, "Maximum number of entries ... per graphics or
/// compute function"). One buffer index is kept for sizes.
const BUFFERS_MAX: u8 = 30;
const TEXTURES_MAX: u8 = 128;
const SAMPLERS_MAX: u8 = 16;

pub fn write(input: &Input<'_>) -> Result<Emitted, EmitError> {
    let indices = Indices::new(Language::Msl, &input.resources, |kind| Some(namespace(kind)), limit)?;
    let needs_sizes = input
        .resources
        .iter()
        .any(|resource| matches!(resource.kind, Kind::Storage { unsized_end: true, .. }));
    let buffer_count = indices.count(MslNamespace::Buffer);
    let buffer_sizes = needs_sizes.then_some(buffer_count);
    let options = options(input, &indices, buffer_sizes);
    let (text, translation) = write_string(input.module, input.info, &options, &PipelineOptions::default())
        .map_err(|error| EmitError::Internal(format!("MSL: {error}")))?;
    let names = translation.entry_point_names;
    let emitted_name = |index: usize, _: &str| match names.get(index) {
        Some(Ok(name)) => Ok(name.clone()),
        Some(Err(error)) => Err(EmitError::Internal(format!("MSL: {error}"))),
        None => Err(EmitError::Internal("MSL: an entry point is missing".to_owned())),
    };
    let resources = input.resources.iter().filter_map(|resource| {
        let namespace = namespace(resource.kind);
        let index = indices.get(namespace, resource.place)?.into();
        Some(resource.at(Slot::Index { namespace, index }))
    });
    let resources = resources.collect();
    let bindings =
        BindingMap { entry_points: entry_points(input.module, emitted_name)?, resources, buffer_sizes };
    let notes = notes(input, buffer_count + u32::from(needs_sizes), buffer_sizes);
    Ok(Emitted { file_suffix: ".metal".to_owned(), bytes: text.into_bytes(), notes, bindings })
}

fn namespace(kind: Kind) -> MslNamespace {
    match kind {
        Kind::Uniform | Kind::Storage { .. } => MslNamespace::Buffer,
        Kind::Texture | Kind::StorageTexture => MslNamespace::Texture,
        Kind::Sampler => MslNamespace::Sampler,
    }
}

fn limit(namespace: MslNamespace) -> (u8, &'static str) {
    match namespace {
        MslNamespace::Buffer => (BUFFERS_MAX, "buffers"),
        MslNamespace::Texture => (TEXTURES_MAX, "textures"),
        MslNamespace::Sampler => (SAMPLERS_MAX, "samplers"),
    }
}

fn options(input: &Input<'_>, indices: &Indices<MslNamespace>, buffer_sizes: Option<u32>) -> Options {
    let mut targets = Targets::new();
    for resource in &input.resources {
        let index = indices.get(namespace(resource.kind), resource.place);
        // Variables of different entry points and kinds may share a binding.
        let target: &mut BindTarget = targets.entry(resource.place).or_default();
        match namespace(resource.kind) {
            MslNamespace::Buffer => target.buffer = index,
            MslNamespace::Texture => target.texture = index,
            MslNamespace::Sampler => target.sampler = index.map(BindSamplerTarget::Resource),
        }
        let writable = matches!(resource.kind, Kind::Storage { writable: true, .. } | Kind::StorageTexture);
        target.mutable |= writable;
    }
    let sizes_buffer = buffer_sizes.and_then(|index| u8::try_from(index).ok());
    let resources = EntryPointResources { resources: targets, immediates_buffer: None, sizes_buffer };
    let entry_points = input.module.entry_points.iter();
    Options {
        lang_version: (2, 4),
        per_entry_point_map: entry_points.map(|entry| (entry.name.clone(), resources.clone())).collect(),
        fake_missing_bindings: false,
        bounds_check_policies: WGSL_BOUNDS,
        force_loop_bounding: false,
        ..Options::default()
    }
}

fn notes(input: &Input<'_>, buffers_used: u32, buffer_sizes: Option<u32>) -> Vec<String> {
    let mut notes = Vec::new();
    if has_stage(input.module, ShaderStage::Vertex) {
        notes.push(format!("vertex buffers share the indices of buffers: use {buffers_used} and above"));
    }
    if let Some(index) = buffer_sizes {
        notes.push(format!("buffer {index} must hold the sizes of buffers that end with an array"));
    }
    notes
}
