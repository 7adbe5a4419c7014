//! Arrays in structs have their elements as close as others. naga lays structs out as uniforms, with 16 bytes for
//! each element, and so takes an array of a member for another type than the same array of a local: neither could
//! be assigned to the other. WGSL says no strides, so there they are one type.

use std::collections::BTreeSet;

use naga::proc::{Alignment, Layouter};
use naga::{AddressSpace, Expression, Function, Handle, Module, Type, TypeInner, UniqueArena};

/// Closes the gaps between elements, except in uniforms, which are filled from outside as they are laid out.
pub fn close_gaps(module: &mut Module) {
    let kept = of_uniforms(module);
    // Lengths of arrays may be overrides.
    let mut fresh = Module { overrides: module.overrides.clone(), ..Module::default() };
    let mut layouter = Layouter::default();
    // Where each type went: what it is made of stands before it.
    let mut moved: Vec<Handle<Type>> = Vec::new();
    for (handle, ty) in module.types.iter() {
        let mut ty = ty.clone();
        let to = |handle: Handle<Type>| moved[handle.index()];
        match &mut ty.inner {
            TypeInner::Array { base, stride, .. } => {
                *base = to(*base);
                if !kept.contains(&handle) {
                    *stride = layouter[*base].to_stride();
                }
            }
            TypeInner::Pointer { base, .. } | TypeInner::BindingArray { base, .. } => *base = to(*base),
            TypeInner::Struct { members, span } => {
                members.iter_mut().for_each(|member| member.ty = to(member.ty));
                let has_arrays =
                    |inner: &TypeInner| matches!(inner, TypeInner::Array { .. } | TypeInner::Struct { .. });
                if !kept.contains(&handle)
                    && members.iter().any(|member| has_arrays(&fresh.types[member.ty].inner))
                {
                    let (mut end, mut widest) = (0_u32, Alignment::ONE);
                    for member in members {
                        let layout = layouter[member.ty];
                        member.offset = layout.alignment.round_up(end);
                        end = member.offset.saturating_add(layout.size);
                        widest = widest.max(layout.alignment);
                    }
                    *span = widest.round_up(end);
                }
            }
            _ => {}
        }
        moved.push(fresh.types.insert(ty, module.types.get_span(handle)));
        if layouter.update(fresh.to_ctx()).is_err() {
            // Validation says what is wrong with such a type.
            return;
        }
    }
    module.types = fresh.types;
    follow(module, &moved);
}

/// Types that uniforms and buffers are made of.
fn of_uniforms(module: &Module) -> BTreeSet<Handle<Type>> {
    let is_filled = |space| matches!(space, AddressSpace::Uniform | AddressSpace::Storage { .. });
    let variables = module.global_variables.iter().filter(|(_, variable)| is_filled(variable.space));
    let mut todo: Vec<Handle<Type>> = variables.map(|(_, variable)| variable.ty).collect();
    let mut found = BTreeSet::new();
    while let Some(handle) = todo.pop() {
        if found.insert(handle) {
            todo.extend(parts(&module.types, handle));
        }
    }
    found
}

fn parts(types: &UniqueArena<Type>, handle: Handle<Type>) -> Vec<Handle<Type>> {
    match &types[handle].inner {
        TypeInner::Array { base, .. } => vec![*base],
        TypeInner::Struct { members, .. } => members.iter().map(|member| member.ty).collect(),
        _ => Vec::new(),
    }
}

/// Lets all of a module use the types where they went.
fn follow(module: &mut Module, moved: &[Handle<Type>]) {
    let to = |handle: &mut Handle<Type>| *handle = moved[handle.index()];
    module.constants.iter_mut().for_each(|(_, constant)| to(&mut constant.ty));
    module.overrides.iter_mut().for_each(|(_, constant)| to(&mut constant.ty));
    module.global_variables.iter_mut().for_each(|(_, variable)| to(&mut variable.ty));
    let expression = |expression: &mut Expression| match expression {
        Expression::ZeroValue(ty)
        | Expression::Compose { ty, .. }
        | Expression::AtomicResult { ty, .. }
        | Expression::WorkGroupUniformLoadResult { ty }
        | Expression::SubgroupOperationResult { ty } => to(ty),
        _ => {}
    };
    let function = |function: &mut Function| {
        function.arguments.iter_mut().for_each(|argument| to(&mut argument.ty));
        function.result.iter_mut().for_each(|result| to(&mut result.ty));
        function.local_variables.iter_mut().for_each(|(_, variable)| to(&mut variable.ty));
        function.expressions.iter_mut().for_each(|(_, inner)| expression(inner));
    };
    module.global_expressions.iter_mut().for_each(|(_, inner)| expression(inner));
    module.functions.iter_mut().for_each(|(_, inner)| function(inner));
    module.entry_points.iter_mut().for_each(|entry| function(&mut entry.function));
}
