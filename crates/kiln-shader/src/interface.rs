//! Builds the [`Reflection`] of a valid naga module.

use naga::common::wgsl::{ToWgsl, TypeContext};
use naga::proc::GlobalCtx;
use naga::valid::ModuleInfo;
use naga::{AddressSpace, ImageClass, ImageDimension, Module, ShaderStage, StorageAccess, TypeInner};

use crate::{Binding, BindingKind, EntryPoint, Member, Override, Reflection, Stage, VertexInput};

/// Reflects `module`. Entry points get their names from `emitted`, the canonical text read back, because a
/// pipeline is made from that text.
pub fn reflect(module: &Module, info: &ModuleInfo, emitted: &Module) -> Result<Reflection, String> {
    if emitted.entry_points.len() != module.entry_points.len() {
        return Err("canonical text has other entry points".to_owned());
    }
    let entry_points = module
        .entry_points
        .iter()
        .zip(&emitted.entry_points)
        .map(|(entry, emitted)| entry_point(module, entry, emitted.name.clone()))
        .collect::<Result<_, _>>()?;
    let mut bindings = Vec::new();
    for (handle, variable) in module.global_variables.iter() {
        let Some(resource) = variable.binding else { continue };
        let mut stages = Vec::new();
        for (index, entry) in module.entry_points.iter().enumerate() {
            let stage = stage(entry.stage)?;
            if !info.get_entry_point(index)[handle].is_empty() && !stages.contains(&stage) {
                stages.push(stage);
            }
        }
        if stages.is_empty() {
            continue;
        }
        let (group, binding) = (resource.group, resource.binding);
        let name = variable.name.clone().unwrap_or_default();
        bindings.push(Binding { group, binding, name, kind: kind(module, variable)?, stages });
    }
    bindings.sort_by_key(|binding| (binding.group, binding.binding));
    let overrides = module.overrides.iter().map(|(_, constant)| reflect_override(module, constant)).collect();
    Ok(Reflection { entry_points, bindings, overrides, parameters: Vec::new() })
}

fn reflect_override(module: &Module, constant: &naga::Override) -> Override {
    let default = constant.init.and_then(|init| match module.global_expressions[init] {
        naga::Expression::Literal(literal) => literal_value(literal),
        _ => None,
    });
    Override {
        name: constant.name.clone().unwrap_or_default(),
        id: constant.id,
        ty: type_name(module, constant.ty),
        default,
    }
}

fn literal_value(literal: naga::Literal) -> Option<f64> {
    match literal {
        naga::Literal::F32(value) => Some(f64::from(value)),
        naga::Literal::I32(value) => Some(f64::from(value)),
        naga::Literal::U32(value) => Some(f64::from(value)),
        naga::Literal::Bool(value) => Some(f64::from(u8::from(value))),
        naga::Literal::AbstractFloat(value) => Some(value),
        naga::Literal::AbstractInt(value) => Some(value as f64),
        _ => None,
    }
}

pub fn stage(stage: ShaderStage) -> Result<Stage, String> {
    match stage {
        ShaderStage::Vertex => Ok(Stage::Vertex),
        ShaderStage::Fragment => Ok(Stage::Fragment),
        ShaderStage::Compute => Ok(Stage::Compute),
        other => Err(format!("stage {other:?} is not supported")),
    }
}

fn entry_point(module: &Module, entry: &naga::EntryPoint, name: String) -> Result<EntryPoint, String> {
    let stage = stage(entry.stage)?;
    let mut inputs = Vec::new();
    if stage == Stage::Vertex {
        for argument in &entry.function.arguments {
            push_inputs(module, argument.name.as_ref(), argument.ty, argument.binding.as_ref(), &mut inputs);
        }
        inputs.sort_by_key(|input| input.location);
    }
    let workgroup_size = if stage == Stage::Compute { entry.workgroup_size } else { [0; 3] };
    Ok(EntryPoint { name, stage, inputs, workgroup_size })
}

fn push_inputs(
    module: &Module,
    name: Option<&String>,
    ty: naga::Handle<naga::Type>,
    binding: Option<&naga::Binding>,
    inputs: &mut Vec<VertexInput>,
) {
    if let Some(naga::Binding::Location { location, .. }) = binding {
        let name = name.cloned().unwrap_or_default();
        inputs.push(VertexInput { location: *location, name, ty: type_name(module, ty) });
    } else if let TypeInner::Struct { members, .. } = &module.types[ty].inner {
        for member in members {
            push_inputs(module, member.name.as_ref(), member.ty, member.binding.as_ref(), inputs);
        }
    }
}

fn type_name(module: &Module, ty: naga::Handle<naga::Type>) -> String {
    module.to_ctx().type_to_string(ty)
}

fn kind(module: &Module, variable: &naga::GlobalVariable) -> Result<BindingKind, String> {
    match (variable.space, &module.types[variable.ty].inner) {
        (AddressSpace::Uniform, inner) => Ok(uniform(module.to_ctx(), module, inner)),
        (AddressSpace::Storage { access }, inner) => Ok(BindingKind::Storage {
            read_only: !access.contains(StorageAccess::STORE),
            size_bytes: inner.size(module.to_ctx()),
        }),
        (AddressSpace::Handle, TypeInner::Sampler { comparison }) => {
            Ok(BindingKind::Sampler { comparison: *comparison })
        }
        (AddressSpace::Handle, TypeInner::Image { dim, arrayed, class }) => {
            texture(&dimension(*dim, *arrayed), *class)
        }
        (_, _) => Err(format!("binding type `{}` is not supported", type_name(module, variable.ty))),
    }
}

fn uniform(context: GlobalCtx<'_>, module: &Module, inner: &TypeInner) -> BindingKind {
    let members = match inner {
        TypeInner::Struct { members, .. } => members.as_slice(),
        _ => &[],
    };
    let members = members.iter().map(|member| Member {
        name: member.name.clone().unwrap_or_default(),
        ty: type_name(module, member.ty),
        offset_bytes: member.offset,
        size_bytes: module.types[member.ty].inner.size(context),
    });
    BindingKind::Uniform { size_bytes: inner.size(context), members: members.collect() }
}

fn dimension(dim: ImageDimension, arrayed: bool) -> String {
    let dim = match dim {
        ImageDimension::D1 => "1d",
        ImageDimension::D2 => "2d",
        ImageDimension::D3 => "3d",
        ImageDimension::Cube => "cube",
    };
    format!("{dim}{}", if arrayed { "_array" } else { "" })
}

fn texture(dimension: &str, class: ImageClass) -> Result<BindingKind, String> {
    let dimension = dimension.to_owned();
    let sampled = |dimension, sample: &str, multisampled| {
        Ok(BindingKind::Texture { dimension, sample: sample.to_owned(), multisampled })
    };
    match class {
        ImageClass::Sampled { kind: naga::ScalarKind::Sint, multi } => sampled(dimension, "sint", multi),
        ImageClass::Sampled { kind: naga::ScalarKind::Uint, multi } => sampled(dimension, "uint", multi),
        ImageClass::Sampled { multi, .. } => sampled(dimension, "float", multi),
        ImageClass::Depth { multi } => sampled(dimension, "depth", multi),
        ImageClass::Storage { format, access } => {
            let loads = access.contains(StorageAccess::LOAD);
            let stores = access.contains(StorageAccess::STORE);
            let access = match (loads, stores) {
                (true, true) => "read_write",
                (true, false) => "read",
                _ => "write",
            };
            let (format, access) = (format.to_wgsl().to_owned(), access.to_owned());
            Ok(BindingKind::StorageTexture { dimension, format, access })
        }
        ImageClass::External => Err("external textures are not supported".to_owned()),
    }
}
