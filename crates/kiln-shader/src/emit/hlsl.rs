//! HLSL for Direct3D 12.

use naga::BuiltIn;
use naga::back::hlsl::{BindTarget, Options, PipelineOptions, ShaderModel, Writer};

use super::bindings::Kind;
use super::{BindingMap, EmitError, Emitted, Input, Language, Slot, entry_points, takes_built_in};

/// naga keeps spaces in a byte; the last one is where it would put its sampler indices.
const SPACES_MAX: u8 = u8::MAX;

pub fn write(input: &Input<'_>) -> Result<Emitted, EmitError> {
    let options = options(input)?;
    let pipeline = PipelineOptions::default();
    let mut text = String::new();
    let reflection = Writer::new(&mut text, &options, &pipeline)
        .write(input.module, input.info, None)
        .map_err(|error| EmitError::Internal(format!("HLSL: {error}")))?;
    let names = reflection.entry_point_names;
    let emitted_name = |index: usize, _: &str| match names.get(index) {
        Some(Ok(name)) => Ok(name.clone()),
        Some(Err(error)) => Err(EmitError::Internal(format!("HLSL: {error}"))),
        None => Err(EmitError::Internal("HLSL: an entry point is missing".to_owned())),
    };
    let resources = input.resources.iter().map(|resource| {
        let register = format!("{}{}", class(resource.kind), resource.place.binding);
        resource.at(Slot::Register { register, space: resource.place.group })
    });
    let resources = resources.collect();
    let entry_points = entry_points(input.module, emitted_name)?;
    let bytes = bind_samplers(&text)?.into_bytes();
    let bindings = BindingMap { entry_points, resources, buffer_sizes: None };
    Ok(Emitted { file_suffix: ".hlsl".to_owned(), bytes, notes: notes(input), bindings })
}

/// The letter of the register.
fn class(kind: Kind) -> char {
    match kind {
        Kind::Uniform => 'b',
        Kind::Texture | Kind::Storage { writable: false, .. } => 't',
        Kind::StorageTexture | Kind::Storage { writable: true, .. } => 'u',
        Kind::Sampler => 's',
    }
}

fn options(input: &Input<'_>) -> Result<Options, EmitError> {
    let mut options = Options {
        shader_model: ShaderModel::V6_0,
        // Only for its array of sampler indices, which `bind_samplers` takes out.
        fake_missing_bindings: true,
        restrict_indexing: true,
        force_loop_bounding: false,
        ..Options::default()
    };
    for resource in &input.resources {
        let space = u8::try_from(resource.place.group).ok().filter(|space| *space < SPACES_MAX);
        let space = space.ok_or(EmitError::TooMany {
            language: Language::Hlsl,
            what: "bind groups",
            limit: SPACES_MAX.into(),
        })?;
        let target = BindTarget {
            space,
            register: resource.place.binding,
            restrict_indexing: true,
            ..BindTarget::default()
        };
        options.binding_map.insert(resource.place, target);
    }
    Ok(options)
}

/// Binds samplers to registers. naga reads them from a heap through an array of indices, as wgpu binds them;
/// nobody else does, so its lines
///
/// ```text
/// SamplerState nagaSamplerHeap[2048]: register(s0, space0);
/// SamplerComparisonState nagaComparisonSamplerHeap[2048]: register(s0, space1);
/// StructuredBuffer<uint> nagaGroup0SamplerIndexArray : register(t0, space255);
/// static const SamplerState env_sampler = nagaSamplerHeap[nagaGroup0SamplerIndexArray[5]];
/// ```
///
/// become `SamplerState env_sampler : register(s5, space0);`.
fn bind_samplers(text: &str) -> Result<String, EmitError> {
    const DROPPED: [&str; 3] = [
        "SamplerState nagaSamplerHeap[",
        "SamplerComparisonState nagaComparisonSamplerHeap[",
        "StructuredBuffer<uint> nagaGroup",
    ];
    let mut bound = String::with_capacity(text.len());
    for line in text.lines().filter(|line| !DROPPED.iter().any(|dropped| line.starts_with(dropped))) {
        bound.push_str(&sampler_declaration(line).unwrap_or_else(|| line.to_owned()));
        bound.push('\n');
    }
    if ["nagaSamplerHeap", "nagaComparisonSamplerHeap", "SamplerIndexArray"]
        .iter()
        .any(|name| bound.contains(name))
    {
        return Err(EmitError::Internal("HLSL: a sampler is read in an unknown way".to_owned()));
    }
    Ok(bound)
}

fn sampler_declaration(line: &str) -> Option<String> {
    let (declared, value) = line.strip_prefix("static const ")?.split_once(" = ")?;
    let (_, index) = value.split_once("SamplerHeap[nagaGroup")?;
    let (group, index) = index.split_once("SamplerIndexArray[")?;
    let binding = index.strip_suffix("]];")?;
    Some(format!("{declared} : register(s{binding}, space{group});"))
}

fn notes(input: &Input<'_>) -> Vec<String> {
    let taken = |built_in| {
        input.module.entry_points.iter().any(|entry| takes_built_in(input.module, entry, built_in))
    };
    let mut notes = Vec::new();
    if taken(BuiltIn::VertexIndex) {
        notes.push("`SV_VertexID` counts from 0 in every draw: begin draws at vertex 0".to_owned());
    }
    if taken(BuiltIn::InstanceIndex) {
        notes.push("`SV_InstanceID` counts from 0 in every draw: begin draws at instance 0".to_owned());
    }
    notes
}
