//! Structs that uniforms hold: WGSL wants them at multiples of 16 bytes.

use std::collections::BTreeSet;
use std::rc::Rc;

use super::Parsed;
use super::builtin;
use super::declare::{Item, Struct, Variable};

/// The member that aligns a struct which has none of 16 bytes; nobody reads it.
pub const MEMBER: &str = "vec4 kiln_padding;\n";

/// Structs of a stage that need [`MEMBER`]. Those whose constructor is called stay as they are: it would
/// want one more argument.
pub fn padded_structs(stage: &Parsed) -> BTreeSet<Rc<str>> {
    let mut found = BTreeSet::new();
    for item in &stage.items {
        match item {
            Item::Variable(variable) if variable.qualifiers.is("uniform") => {
                collect(stage, variable, &mut found);
            }
            Item::Block(block) if block.qualifiers.is("uniform") => {
                block.members.iter().for_each(|member| collect(stage, member, &mut found));
            }
            _ => {}
        }
    }
    let is_constructed = |name: &Rc<str>| {
        let mut pairs = stage.tokens.windows(2);
        pairs.any(|pair| pair[0].text == *name && pair[1].is("("))
    };
    found.retain(|name| !is_constructed(name));
    found
}

/// Adds the struct of `variable` and those in it, once each.
fn collect(stage: &Parsed, variable: &Variable, found: &mut BTreeSet<Rc<str>>) {
    let mut todo = vec![Rc::clone(&variable.ty.text)];
    let mut seen = BTreeSet::new();
    while let Some(name) = todo.pop() {
        let Some(structure) = structure(stage, &name).filter(|_| seen.insert(Rc::clone(&name))) else {
            continue;
        };
        if !structure.members.iter().any(|member| is_aligned(&member.ty.text)) {
            found.insert(name);
        }
        todo.extend(structure.members.iter().map(|member| Rc::clone(&member.ty.text)));
    }
}

fn structure<'a>(stage: &'a Parsed, name: &str) -> Option<&'a Struct> {
    stage.items.iter().find_map(|item| match item {
        Item::Struct(structure) if structure.name.is(name) => Some(structure),
        _ => None,
    })
}

/// Whether `ty` is aligned to 16 bytes.
fn is_aligned(ty: &str) -> bool {
    builtin::vector_len(ty).is_some_and(|len| len > 2)
        || (builtin::columns(ty).is_some() && !ty.ends_with("x2") && ty != "mat2")
}
