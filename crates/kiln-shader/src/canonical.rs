//! The canonical form of a shader: WGSL emitted by naga, with the author's names where a renderer binds by them.
//!
//! naga's writer makes names unique and appends `_` to those that end in a digit. Names that matter outside
//! (global variables, entry points, struct members, overrides) are therefore handed to it as placeholders
//! that it leaves alone, and put back into its text; a local that then has the same name gets another.
//! Names inside functions matter to nobody outside: they are numbered, so that renaming one changes nothing.
//! [`crate::SourceMap`] has the author's.
//!
//! Canonical text compiles to itself. Where a `let` names a constant, naga's writer would put the constant where the name
//! stood, and its parser then works out what is not constant in WGSL, or refuses it: `1f / 0f`. So it is told to write the `let`.

use std::collections::{BTreeMap, BTreeSet};

use naga::back::wgsl::WriterFlags;
use naga::compact::{KeepUnused, compact};
use naga::proc::{Alignment, Layouter};
use naga::valid::ModuleInfo;
use naga::{Block, Expression, Handle, Module, Range, Span, Statement, StructMember, TypeInner, UniqueArena};
use rustc_hash::FxHashSet;

use crate::token::{self, Kind, Token};

/// Removes what no entry point uses, named constants too.
pub fn strip_unused(module: &mut Module) {
    loop {
        compact(module, KeepUnused::No);
        // naga keeps named constants; without its name an unused one goes with the next round.
        let unused = unused_constants(module);
        if unused.is_empty() {
            return;
        }
        for handle in unused {
            module.constants[handle].name = None;
        }
    }
}

fn unused_constants(module: &Module) -> Vec<Handle<naga::Constant>> {
    let functions = module.functions.iter().map(|(_, function)| function);
    let functions = functions.chain(module.entry_points.iter().map(|entry| &entry.function));
    let expressions =
        functions.flat_map(|function| function.expressions.iter()).chain(module.global_expressions.iter());
    let used: BTreeSet<_> = expressions
        .filter_map(|(_, expression)| match expression {
            Expression::Constant(handle) => Some(handle.index()),
            _ => None,
        })
        .collect();
    let named = module.constants.iter().filter(|(_, constant)| constant.name.is_some());
    named.map(|(handle, _)| handle).filter(|handle| !used.contains(&handle.index())).collect()
}

/// Emits a valid module.
pub fn emit(module: &Module, info: &ModuleInfo) -> Result<String, String> {
    let mut module = module.clone();
    let kept = replace_names(&mut module)?;
    number_locals(&mut module);
    write_named_constants(&mut module, info);
    let text = naga::back::wgsl::write_string(&module, info, WriterFlags::empty())
        .map_err(|error| format!("cannot write canonical WGSL: {error}"))?;
    // Functions that the writer adds have names that it changes when it meets them again.
    let text = text.replace("gen__naga_", "gen_naga_");
    restore_names(&number_values(&text)?, &kept)
}

/// Numbers what `let` names, in the order of the text and in each function from 1: naga's writer names values of its own
/// after their place in the module, which is another when the text is read again. No function or type is called
/// `value_1`, because naga changes names that end in digits.
fn number_values(text: &str) -> Result<String, String> {
    let tokens = token::tokenize(text).map_err(|_| "canonical text does not tokenise".to_owned())?;
    let mut numbered = String::with_capacity(text.len());
    let mut names: BTreeMap<&str, String> = BTreeMap::new();
    let mut at = 0;
    for (index, token) in tokens.iter().enumerate() {
        if token.kind != Kind::Word {
            continue;
        }
        let word = &text[token.range()];
        if word == "fn" {
            names.clear();
        }
        let before = index.checked_sub(1).map(|before| tokens[before]);
        if before.is_some_and(|before| before.is_word(text, "let")) {
            let name = format!("value_{}", names.len() + 1);
            names.insert(word, name);
        }
        let is_member = before.is_some_and(|before| before.is('.'));
        if let Some(name) = names.get(word).filter(|_| !is_member) {
            numbered.push_str(&text[at..token.start]);
            numbered.push_str(name);
            at = token.end;
        }
    }
    numbered.push_str(&text[at..]);
    Ok(numbered)
}

/// Placeholders with the names they stand for.
#[derive(Default)]
struct Kept {
    prefix: String,
    names: BTreeMap<String, String>,
    /// Those of `names` that a local could hide; members have a scope of their own.
    globals: BTreeSet<String>,
    /// Bytes that members take with the space behind them, where that is more than their type's size: naga's writer forgets
    /// `@align` and `@size`, which lay a block out as its author's program fills it.
    sizes: BTreeMap<String, u32>,
}

impl Kept {
    fn hide_member(&mut self, name: &mut String) {
        let placeholder = format!("{}{}", self.prefix, letters(self.names.len()));
        self.names.insert(placeholder.clone(), std::mem::replace(name, placeholder));
    }

    /// Hides the names of a struct's members, and notes which are followed by more space than WGSL puts there by itself.
    fn hide_members(&mut self, layouter: &Layouter, members: &mut [StructMember], span: u32) {
        let ends: Vec<u32> = members.iter().skip(1).map(|member| member.offset).chain([span]).collect();
        let alignments = members.iter().skip(1).map(|member| layouter[member.ty].alignment);
        let widest = members.iter().map(|member| layouter[member.ty].alignment).max();
        let alignments: Vec<Alignment> = alignments.chain(widest).collect();
        for ((member, end), alignment) in members.iter_mut().zip(ends).zip(alignments) {
            let natural = alignment.round_up(member.offset + layouter[member.ty].size);
            let Some(name) = member.name.as_mut().filter(|name| is_legal(name)) else { continue };
            self.hide_member(name);
            if end > natural {
                self.sizes.insert(name.clone(), end - member.offset);
            }
        }
    }

    /// Replaces `name` by a new placeholder, unless it is a name of WGSL's own that the text may need.
    fn hide_global(&mut self, name: &mut String) {
        let builtins = naga::keywords::wgsl::BUILTIN_IDENTIFIERS;
        if !builtins.contains(&name.as_str()) && !is_baked(name) && is_legal(name) {
            self.globals.insert(name.clone());
            self.hide_member(name);
        }
    }
}

/// Whether WGSL allows `name`: other languages have names that are reserved words there.
fn is_legal(name: &str) -> bool {
    !naga::keywords::wgsl::RESERVED.contains(&name) && name != "_" && !name.starts_with("__")
}

/// Whether `name` looks like what naga calls intermediate results.
fn is_baked(name: &str) -> bool {
    name.strip_prefix("_e").is_some_and(|rest| rest.bytes().all(|byte| byte.is_ascii_digit()))
}

/// `number` in letters: naga changes names that end in digits.
fn letters(mut number: usize) -> String {
    let mut text = String::new();
    loop {
        text.insert(0, char::from(b'a' + u8::try_from(number % 26).unwrap_or(0)));
        number /= 26;
        if number == 0 {
            return text;
        }
    }
}

fn replace_names(module: &mut Module) -> Result<Kept, String> {
    let mut layouter = Layouter::default();
    layouter.update(module.to_ctx()).map_err(|error| format!("a type without layout: {error}"))?;
    let mut kept = Kept { prefix: unused_prefix(module), ..Kept::default() };
    let mut types = UniqueArena::new();
    for (handle, ty) in module.types.iter() {
        let mut ty = ty.clone();
        // Members of predeclared structs, as `modf` returns, are WGSL's own.
        let predeclared = ty.name.as_ref().is_some_and(|name| name.starts_with("__"));
        if let (TypeInner::Struct { members, span }, false) = (&mut ty.inner, predeclared) {
            kept.hide_members(&layouter, members, *span);
        }
        types.insert(ty, module.types.get_span(handle));
    }
    module.types = types;
    for (_, variable) in module.global_variables.iter_mut() {
        variable.name.iter_mut().for_each(|name| kept.hide_global(name));
    }
    for (_, constant) in module.overrides.iter_mut() {
        constant.name.iter_mut().for_each(|name| kept.hide_global(name));
    }
    for entry in &mut module.entry_points {
        kept.hide_global(&mut entry.name);
    }
    Ok(kept)
}

/// Names arguments, variables and values by what they are; naga's writer numbers equal names of a function.
fn number_locals(module: &mut Module) {
    let functions = module.functions.iter_mut().map(|(_, function)| function);
    for function in functions.chain(module.entry_points.iter_mut().map(|entry| &mut entry.function)) {
        for argument in &mut function.arguments {
            argument.name = Some("argument".to_owned());
        }
        for (_, local) in function.local_variables.iter_mut() {
            local.name = Some("variable".to_owned());
        }
        for name in function.named_expressions.values_mut() {
            "value".clone_into(name);
        }
    }
}

/// Has the writer write a `let` for each constant that one names and something reads, at the function's beginning. No valid
/// module says so: what needs no work is never emitted.
fn write_named_constants(module: &mut Module, info: &ModuleInfo) {
    let functions = module.functions.iter_mut().map(|(handle, function)| (function, &info[handle]));
    let entries = module.entry_points.iter_mut().enumerate();
    let entries = entries.map(|(index, entry)| (&mut entry.function, info.get_entry_point(index)));
    for (function, facts) in functions.chain(entries) {
        let is_constant = |expression: &Expression| {
            matches!(expression, Expression::Literal(_) | Expression::Constant(_) | Expression::ZeroValue(_))
        };
        let named = function.named_expressions.keys().copied();
        let is_read = |named: &Handle<Expression>| facts[*named].ref_count > 0;
        let mut named: Vec<_> =
            named.filter(|named| is_constant(&function.expressions[*named]) && is_read(named)).collect();
        named.sort();
        let mut lets = Block::with_capacity(named.len());
        for constant in named {
            lets.push(Statement::Emit(Range::new_from_bounds(constant, constant)), Span::UNDEFINED);
        }
        function.body.splice(0..0, lets);
    }
}

/// A prefix that no name of the module starts with.
fn unused_prefix(module: &Module) -> String {
    let mut names: Vec<&str> = Vec::new();
    let functions = module.functions.iter().map(|(_, function)| function);
    for function in functions.chain(module.entry_points.iter().map(|entry| &entry.function)) {
        names.extend(function.name.as_deref());
        names.extend(function.arguments.iter().filter_map(|argument| argument.name.as_deref()));
        names.extend(function.local_variables.iter().filter_map(|(_, local)| local.name.as_deref()));
        names.extend(function.named_expressions.values().map(String::as_str));
    }
    names.extend(module.constants.iter().filter_map(|(_, constant)| constant.name.as_deref()));
    names.extend(module.types.iter().filter_map(|(_, ty)| ty.name.as_deref()));
    let mut prefix = "kept_".to_owned();
    while names.iter().any(|name| name.starts_with(&prefix)) {
        prefix.insert(0, 'k');
    }
    prefix
}

fn restore_names(text: &str, kept: &Kept) -> Result<String, String> {
    let tokens = token::tokenize(text).map_err(|_| "canonical text does not tokenise".to_owned())?;
    let renamed = rename_collisions(text, &tokens, kept);
    let mut restored = String::with_capacity(text.len());
    let mut at = 0;
    for (index, token) in tokens.iter().enumerate() {
        if token.kind != Kind::Word {
            continue;
        }
        let word = &text[token.range()];
        let kept_name = if word.starts_with(&kept.prefix) { kept.names.get(word) } else { None };
        let name = kept_name.or_else(|| {
            let renamed = renamed.get(word)?;
            is_plain_name(text, &tokens, index).then_some(renamed)
        });
        if let Some(name) = name {
            restored.push_str(&text[at..token.start]);
            // Only a declaration has a colon behind its member.
            let is_declared = tokens.get(index + 1).is_some_and(|next| next.is(':'));
            if let Some(size) = kept.sizes.get(word).filter(|_| is_declared) {
                restored.push_str(&format!("@size({size}) "));
            }
            restored.push_str(name);
            at = token.end;
        }
    }
    restored.push_str(&text[at..]);
    Ok(restored)
}

/// New names for locals, functions and types that have a kept name.
fn rename_collisions(text: &str, tokens: &[Token], kept: &Kept) -> BTreeMap<String, String> {
    let words = tokens.iter().filter(|token| token.kind == Kind::Word);
    let present: FxHashSet<&str> = words.map(|token| &text[token.range()]).collect();
    let mut renamed = BTreeMap::new();
    for name in kept.globals.iter().filter(|name| present.contains(name.as_str())) {
        let mut new = format!("{name}_v");
        while present.contains(new.as_str()) || kept.globals.contains(&new) {
            new.push('v');
        }
        renamed.insert(name.clone(), new);
    }
    renamed
}

/// Whether token `index` names something declared in the text: not a component, and not an attribute
/// or its argument, as in `@builtin(position)`.
fn is_plain_name(text: &str, tokens: &[Token], index: usize) -> bool {
    let before = |count: usize| index.checked_sub(count).map(|index| &tokens[index]);
    let is_component = before(1).is_some_and(|token| token.is('.'));
    let is_attribute = before(1).is_some_and(|token| token.is('@'));
    // As in `@builtin(position)` and `@interpolate(perspective, centroid)`.
    let inside = |token: &Token| token.kind == Kind::Word || token.is(',');
    let open = (0..index).rev().find(|&at| !inside(&tokens[at]));
    let in_builtin = open.filter(|&at| tokens[at].is('(') && at >= 2).is_some_and(|at| {
        ["builtin", "interpolate"].iter().any(|word| tokens[at - 1].is_word(text, word))
            && tokens[at - 2].is('@')
    });
    !(is_component || is_attribute || in_builtin)
}
