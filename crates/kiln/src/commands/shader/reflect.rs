//! `kiln shader reflect`.

use std::process::ExitCode;

use kiln_shader::{BindingKind, Parameter, ParameterPlace, Reflection, Stage, Widget};
use serde_json::{Value, json};

use super::exit_code;
use super::subject::{merged, subjects};
use crate::args::ReflectArgs;
use crate::out::say;
use crate::report;

pub(super) fn run(args: &ReflectArgs) -> anyhow::Result<ExitCode> {
    let (subjects, mut diagnostics) = subjects(&args.subjects)?;
    let mut shaders: Vec<Value> = Vec::new();
    for subject in &subjects {
        let variants = subject.compile()?;
        diagnostics.extend(merged(&variants));
        for variant in &variants {
            let Some(compiled) = &variant.outcome.compiled else { continue };
            if args.json {
                let files = variant.outcome.dependencies.iter().filter(|file| file.found);
                shaders.push(json!({
                    "shader": subject.name,
                    "variants": variant.names,
                    "files": files.map(|file| &file.path).collect::<Vec<_>>(),
                    "reflection": compiled.reflection,
                }));
            } else {
                say!("{} ({})", subject.name, variant.names.join(" = "));
                lines(&compiled.reflection).iter().for_each(|line| say!("  {line}"));
            }
        }
    }
    if args.json {
        say!("{:#}", json!({"shaders": shaders, "diagnostics": diagnostics}));
    } else {
        report::print_diagnostics(&diagnostics, false);
    }
    Ok(exit_code(&diagnostics))
}

fn lines(reflection: &Reflection) -> Vec<String> {
    let mut lines = Vec::new();
    for entry in &reflection.entry_points {
        let inputs =
            entry.inputs.iter().map(|input| format!("{} {}: {}", input.location, input.name, input.ty));
        let [x, y, z] = entry.workgroup_size;
        let size = if entry.stage == Stage::Compute {
            format!("  workgroups of {x} × {y} × {z}")
        } else {
            String::new()
        };
        lines.push(format!("{} {}{size}", stage_name(entry.stage), entry.name));
        lines.extend(inputs.map(|input| format!("  input {input}")));
    }
    for binding in &reflection.bindings {
        let stages = binding.stages.iter().map(|stage| stage_name(*stage)).collect::<Vec<_>>().join(", ");
        let place = format!("group {} binding {}", binding.group, binding.binding);
        lines.push(format!("{place}  {}: {}  ({stages})", binding.name, kind(&binding.kind)));
        if let BindingKind::Uniform { members, .. } = &binding.kind {
            let member = |member: &kiln_shader::Member| {
                format!("  {:>5}  {}: {}", member.offset_bytes, member.name, member.ty)
            };
            lines.extend(members.iter().map(member));
        }
    }
    for constant in &reflection.overrides {
        let default = constant.default.map_or_else(String::new, |value| format!(" = {value}"));
        lines.push(format!("override {}: {}{default}", constant.name, constant.ty));
    }
    for parameter in &reflection.parameters {
        let place = match &parameter.place {
            ParameterPlace::Override => "override".to_owned(),
            ParameterPlace::Member { uniform } => format!("member of {uniform}"),
        };
        let widget = match &parameter.widget {
            Widget::Number => "number".to_owned(),
            Widget::Slider { least, greatest } => format!("slider from {least} to {greatest}"),
            Widget::Color => "color".to_owned(),
            Widget::Toggle => "toggle".to_owned(),
            Widget::Choice { names } => format!("choice of {}", names.join(", ")),
        };
        let Parameter { name, default, label, .. } = parameter;
        let first = default.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
        lines.push(
            format!("parameter {name} ({place}): {widget}, first {first}  {label}").trim_end().to_owned(),
        );
    }
    lines
}

fn stage_name(stage: Stage) -> &'static str {
    match stage {
        Stage::Vertex => "vertex",
        Stage::Fragment => "fragment",
        Stage::Compute => "compute",
    }
}

fn kind(kind: &BindingKind) -> String {
    match kind {
        BindingKind::Uniform { size_bytes, .. } => format!("uniform of {size_bytes} bytes"),
        BindingKind::Storage { read_only, size_bytes } => {
            let access = if *read_only { "read" } else { "read_write" };
            format!("storage ({access}) of at least {size_bytes} bytes")
        }
        BindingKind::Texture { dimension, sample, multisampled } => {
            format!("texture {dimension} of {sample}{}", if *multisampled { ", multisampled" } else { "" })
        }
        BindingKind::StorageTexture { dimension, format, access } => {
            format!("storage texture {dimension} of {format} ({access})")
        }
        BindingKind::Sampler { comparison } => {
            if *comparison { "comparison sampler" } else { "sampler" }.to_owned()
        }
    }
}
