//! One stage through naga: lowered GLSL in, canonical WGSL out.

use std::collections::BTreeMap;
use std::ops::Range;

use naga::front::glsl::{Error, ErrorKind, ExpectedToken, Frontend, Options, TokenValue};
use naga::valid::{FunctionError, ValidationError};
use naga::{AddressSpace, Arena, Barrier, Block, Expression, Module, SampleLevel, Statement, TypeInner};

use super::lower::Lowered;
use super::source_map::{self, StageFunction};
use super::{inout, layout, lower, stage, stride};
use crate::explain::Finding;
use crate::front::{self, Fault};
use crate::lint::{self, Warning};
use crate::{Stage, canonical, describe, writable};

/// What naga made of a stage, or what is wrong.
pub type Made = Result<Translated, Vec<Finding>>;

/// A stage in WGSL.
#[derive(Debug)]
pub struct Translated {
    /// Its text.
    pub wgsl: String,
    /// What is doubtful about it.
    pub warnings: Vec<Warning>,
    /// Its functions.
    pub functions: Vec<StageFunction>,
}

/// Variables' names by group and binding.
pub type Names = BTreeMap<(u32, u32), String>;

/// Translates a stage; with `lints`, also says what is doubtful.
pub fn translate(lowered: &Lowered, stage: Stage, names: &Names, lints: bool) -> Result<Made, Fault> {
    match front::on_deep_stack(Fault::Internal, || run(lowered, stage, names, lints)) {
        // naga's GLSL front end panics where its WGSL front end says where the type is.
        Err(Fault::Internal(panic)) if panic.contains("LayoutError") && panic.contains("TooLarge") => {
            let message = "an array or struct has 2 GiB or more".to_owned();
            Ok(Err(vec![Finding { message, notes: Vec::new(), labels: Vec::new() }]))
        }
        made => made,
    }
}

fn run(lowered: &Lowered, stage: Stage, names: &Names, lints: bool) -> Result<Made, Fault> {
    let text = &*lowered.text.text;
    let options = Options::from(stage::for_naga(stage));
    let mut module = match Frontend::default().parse(&options, text) {
        Ok(module) => module,
        Err(errors) => return Ok(Err(errors.errors.iter().map(|error| finding(text, error)).collect())),
    };
    stride::close_gaps(&mut module);
    let misplaced = layout::apply(&mut module, text, &lowered.moved);
    if !misplaced.is_empty() {
        return Ok(Err(misplaced));
    }
    name_variables(&mut module, stage, names);
    name_members(&mut module);
    for (_, function) in module.functions.iter_mut() {
        repair(&mut function.body);
        measure_in_place(&mut function.expressions);
        if stage != Stage::Fragment {
            read_first_level(&mut function.expressions);
        }
    }
    inout::copy_parts(&mut module);
    if let Err(error) = front::validate(&module) {
        let mut finding = front::validation_finding(&module, &error);
        if let Some((message, range)) = stored(&module, error.as_inner()) {
            finding.message = message;
            finding.labels.splice(0..0, range.map(|range| (range, String::new())));
        }
        finding.message = in_glsl(&finding.message);
        // The chain of entry points and functions: the place says it.
        finding.notes.retain(|note| !(note.starts_with("function '") || note.starts_with("entry point")));
        finding.notes.iter_mut().for_each(|note| *note = in_glsl(note));
        // A function's label is but its head, and stands for all of it.
        finding.labels.sort_by_key(|(_, label)| label.starts_with("naga::ir::Function"));
        return Ok(Err(vec![finding]));
    }
    let info = front::strip(&mut module)?;
    if let Err(finding) = writable::check(&module) {
        return Ok(Err(vec![finding]));
    }
    let warnings = if lints { lint::check(&module, &info) } else { Vec::new() };
    let wgsl = canonical::emit(&module, &info).map_err(Fault::Internal)?;
    let functions = source_map::functions(&module, &wgsl);
    Ok(Ok(Translated { wgsl, warnings, functions }))
}

/// Gives variables the names that Kiln binds by, and the entry point its own.
fn name_variables(module: &mut Module, stage: Stage, names: &BTreeMap<(u32, u32), String>) {
    let mut arguments: Vec<String> = Vec::new();
    for entry in &mut module.entry_points {
        stage::entry_point(stage).clone_into(&mut entry.name);
        arguments.extend(entry.function.arguments.iter().filter_map(|argument| argument.name.clone()));
    }
    for (_, variable) in module.global_variables.iter_mut() {
        if let Some(name) = variable.binding.and_then(|at| names.get(&(at.group, at.binding))) {
            variable.name = Some(name.clone());
        }
        // naga copies each input to a variable; the input itself keeps the name.
        let is_copy = variable.space == AddressSpace::Private
            && variable.name.as_ref().is_some_and(|name| arguments.contains(name));
        if is_copy && let Some(name) = &mut variable.name {
            name.push_str("_in");
        }
    }
    for (_, function) in module.functions.iter_mut() {
        let stage = match stage {
            Stage::Vertex => "vertex",
            Stage::Fragment => "fragment",
            Stage::Compute => "compute",
        };
        match function.name.as_deref() {
            Some("main") => function.name = Some(format!("{stage}_main")),
            Some(lower::AUTHORS_MAIN) => function.name = Some(format!("{stage}_body")),
            _ => {}
        }
    }
}

/// Gives members of one struct different names: naga calls all elements of an array that is passed alike.
fn name_members(module: &mut Module) {
    let handles: Vec<_> = module.types.iter().map(|(handle, _)| handle).collect();
    for handle in handles {
        let mut ty = module.types[handle].clone();
        let TypeInner::Struct { members, .. } = &mut ty.inner else { continue };
        let names: Vec<Option<String>> = members.iter().map(|member| member.name.clone()).collect();
        let mut renamed = false;
        for (index, member) in members.iter_mut().enumerate() {
            let is_repeated = names.iter().filter(|name| **name == member.name).count() > 1;
            if let Some(name) = member.name.as_mut().filter(|_| is_repeated) {
                let element = names[..index].iter().filter(|other| **other == names[index]).count();
                name.push_str(&format!("_{element}"));
                renamed = true;
            }
        }
        if renamed {
            module.types.replace(handle, ty);
        }
    }
}

/// naga loads an array to ask for its length, which none without a length allows: the question goes to its place.
fn measure_in_place(expressions: &mut Arena<Expression>) {
    let measured = expressions.iter().filter_map(|(_, expression)| match expression {
        Expression::ArrayLength(array) => Some(*array),
        _ => None,
    });
    for array in measured.collect::<Vec<_>>() {
        if let Expression::Load { pointer } = expressions[array] {
            expressions[array] = expressions[pointer].clone();
        }
    }
}

/// Lookups without derivatives, which have no level by themselves, read the first. Some of GLSL's have no form with a level,
/// as that of `sampler2DArrayShadow`.
fn read_first_level(expressions: &mut Arena<Expression>) {
    for (_, expression) in expressions.iter_mut() {
        if let Expression::ImageSample { level, .. } = expression
            && *level == SampleLevel::Auto
        {
            *level = SampleLevel::Zero;
        }
    }
}

/// Repairs two things of naga's: cases that end by `return` and the like are said to fall through, and
/// `barrier()` asks for subgroups too.
fn repair(block: &mut Block) {
    for statement in block.iter_mut() {
        match statement {
            Statement::Block(inner) => repair(inner),
            Statement::ControlBarrier(barrier) => barrier.remove(Barrier::SUB_GROUP),
            Statement::If { accept, reject, .. } => {
                repair(accept);
                repair(reject);
            }
            Statement::Loop { body, continuing, .. } => {
                repair(body);
                repair(continuing);
            }
            Statement::Switch { cases, .. } => {
                for case in cases {
                    repair(&mut case.body);
                    case.fall_through &= !ends(&case.body);
                }
            }
            _ => {}
        }
    }
}

fn ends(block: &Block) -> bool {
    match block.last() {
        Some(Statement::Break | Statement::Continue | Statement::Return { .. } | Statement::Kill) => true,
        Some(Statement::Block(inner)) => ends(inner),
        Some(Statement::If { accept, reject, .. }) => ends(accept) && ends(reject),
        _ => false,
    }
}

/// What an assignment of another type says, and where the value stands: naga names the variable's declaration.
fn stored(module: &Module, error: &ValidationError) -> Option<(String, Option<Range<usize>>)> {
    let ValidationError::Function { handle, source, .. } = error else { return None };
    let FunctionError::InvalidStoreTypes { pointer, value } = source else { return None };
    let function = &module.functions[*handle];
    let mut root = *pointer;
    let name = loop {
        match &function.expressions[root] {
            Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => root = *base,
            Expression::LocalVariable(local) => break function.local_variables[*local].name.as_deref(),
            Expression::GlobalVariable(global) => break module.global_variables[*global].name.as_deref(),
            Expression::FunctionArgument(index) => {
                break function.arguments.get(usize::try_from(*index).ok()?)?.name.as_deref();
            }
            _ => break None,
        }
    };
    let target = name.map_or("this".to_owned(), |name| format!("`{name}`"));
    let message = format!("a value of another type is assigned to {target}");
    Some((message, function.expressions.get_span(*value).to_range()))
}

/// naga's types in GLSL's words.
fn in_glsl(message: &str) -> String {
    if message.starts_with("unable to operate on image class") {
        return "textures of integers cannot be filtered".to_owned();
    }
    let mut text = message.to_owned();
    for (scalar, prefix) in [("f32", ""), ("i32", "i"), ("u32", "u"), ("bool", "b")] {
        for len in 2..=4 {
            text = text.replace(&format!("vec{len}<{scalar}>"), &format!("{prefix}vec{len}"));
            text = text.replace(&format!("mat{len}x{len}<{scalar}>"), &format!("mat{len}"));
            for rows in 2..=4 {
                text = text.replace(&format!("mat{len}x{rows}<{scalar}>"), &format!("mat{len}x{rows}"));
            }
        }
    }
    text.replace("`f32`", "`float`").replace("`i32`", "`int`").replace("`u32`", "`uint`")
}

/// An operator between types that it does not take, which naga notices late: at what stands after it.
fn incompatible(text: &str, error: &Error) -> Option<Finding> {
    let message = error.kind.to_string();
    let (_, operation) = message.split_once("IncompatibleOperands(")?;
    let sign = describe::sign(operation.trim_start_matches(['"', '\\']).split('(').next()?);
    let end = error.meta.to_range()?.end;
    let labels =
        text.get(..end)?.rfind(&format!(" {sign} ")).map(|at| (at + 1..at + 1 + sign.len(), String::new()));
    let message = if operation.contains("Struct {") {
        format!("structs do not go together in `{sign}`: use their members")
    } else {
        format!("these types do not go together in `{sign}`")
    };
    Some(Finding { message, notes: Vec::new(), labels: labels.into_iter().collect() })
}

fn finding(text: &str, error: &Error) -> Finding {
    if let Some(finding) = incompatible(text, error) {
        return finding;
    }
    let range = error.meta.to_range();
    let found = range.clone().and_then(|range| text.get(range)).unwrap_or("the end").to_owned();
    let message = match &error.kind {
        ErrorKind::EndOfFile => "unexpected end of the file".to_owned(),
        ErrorKind::InvalidToken(TokenValue::Identifier(name), expected)
            if expected.contains(&ExpectedToken::Eof) =>
        {
            format!("no type `{name}`")
        }
        ErrorKind::InvalidToken(_, expected) => {
            let expected: Vec<String> = expected.iter().map(expected_text).collect();
            format!("expected {}, found `{found}`", expected.join(" or "))
        }
        ErrorKind::UnknownVariable(name) => format!("no variable `{name}` in scope"),
        ErrorKind::UnknownType(name) => format!("no type `{name}`"),
        ErrorKind::UnknownField(name) => format!("no member `{name}`"),
        ErrorKind::UnknownLayoutQualifier(name) => format!("layout `{name}` is not supported here"),
        ErrorKind::VariableAlreadyDeclared(name) => format!("`{name}` is declared twice"),
        ErrorKind::UnsupportedMatrixWithTwoRowsInStd140 { columns } => {
            format!("`mat{columns}x2` cannot stand in a struct or uniform")
        }
        ErrorKind::NotImplemented(what) => format!("{what} is not supported"),
        other => describe::clean(&other.to_string()).replace(['\'', '"'], "`"),
    };
    let labels = range.map(|range| (range, String::new())).into_iter().collect();
    Finding { message: in_glsl(&message), notes: Vec::new(), labels }
}

fn expected_text(expected: &ExpectedToken) -> String {
    let ExpectedToken::Token(token) = expected else {
        return expected.to_string().replace("identifier", "a name").replace("end of file", "a declaration");
    };
    let text = match token {
        TokenValue::Semicolon => ";",
        TokenValue::Comma => ",",
        TokenValue::Colon => ":",
        TokenValue::Assign => "=",
        TokenValue::LeftBrace => "{",
        TokenValue::RightBrace => "}",
        TokenValue::LeftParen => "(",
        TokenValue::RightParen => ")",
        TokenValue::LeftBracket => "[",
        TokenValue::RightBracket => "]",
        TokenValue::While => "while",
        TokenValue::Case => "case",
        TokenValue::Default => "default",
        TokenValue::Void => "void",
        TokenValue::Struct => "struct",
        other => return format!("{other:?}").to_lowercase(),
    };
    format!("`{text}`")
}
