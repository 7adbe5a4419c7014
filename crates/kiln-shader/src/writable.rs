//! What naga's WGSL writer says wrong or dies of: values outside of functions that are worked out from overrides.
//!
//! A workgroup size that is an override is written as 1, so these are refused where the author wrote them.

use naga::{Arena, ArraySize, Expression, Handle, Module, Span, TypeInner};

use crate::explain::Finding;

/// How messages about this end; what to do instead follows from it.
pub const ENDING: &str = "an override, which only functions may do";

/// The first such value of a valid module.
pub fn check(module: &Module) -> Result<(), Finding> {
    let finding = |message: String, span: Span| {
        let labels = span.to_range().map(|range| (range, String::new())).into_iter().collect();
        Err(Finding { message: format!("{message} {ENDING}"), notes: Vec::new(), labels })
    };
    let constants = &module.global_expressions;
    let place = |init: Handle<Expression>, whole: Span| match constants.get_span(init) {
        span if span.is_defined() => span,
        _ => whole,
    };
    for (handle, constant) in module.overrides.iter() {
        let (Some(name), Some(init)) = (&constant.name, constant.init) else { continue };
        if !is_plain(constants, init) {
            let span = place(init, module.overrides.get_span(handle));
            return finding(format!("the default value of `{name}` computes with"), span);
        }
    }
    for (handle, variable) in module.global_variables.iter() {
        let (name, whole) =
            (variable.name.as_deref().unwrap_or_default(), module.global_variables.get_span(handle));
        if let Some(init) = variable.init.filter(|init| !is_plain(constants, *init)) {
            return finding(format!("the initial value of `{name}` computes with"), place(init, whole));
        }
        if let TypeInner::Array { size: ArraySize::Pending(_), .. } = module.types[variable.ty].inner {
            return finding(format!("the length of `{name}` depends on"), whole);
        }
    }
    for entry in &module.entry_points {
        let sizes = entry.workgroup_size_overrides.iter().flatten().flatten();
        if let Some(size) = sizes.copied().next() {
            let message = format!("the workgroup size of `{}` depends on", entry.name);
            return finding(message, constants.get_span(size));
        }
    }
    Ok(())
}

/// Whether naga's writer can write it outside of functions.
fn is_plain(expressions: &Arena<Expression>, expression: Handle<Expression>) -> bool {
    match &expressions[expression] {
        Expression::Literal(_)
        | Expression::Constant(_)
        | Expression::Override(_)
        | Expression::ZeroValue(_) => true,
        Expression::Compose { components, .. } => {
            components.iter().all(|component| is_plain(expressions, *component))
        }
        Expression::Splat { value, .. } => is_plain(expressions, *value),
        _ => false,
    }
}
