//! Which of the author's functions do more than give a value.

use std::collections::BTreeSet;
use std::rc::Rc;

use super::Parsed;
use super::declare::{Function, Item, Qualifiers};

/// Functions whose call changes something outside of them, or might: those with `out` parameters, those that
/// name a global which can be written, and those that call one.
pub fn functions(stage: &Parsed) -> BTreeSet<Rc<str>> {
    let globals = writable(stage);
    let mut functions: Vec<&Function> = Vec::new();
    let mut found = BTreeSet::new();
    for item in &stage.items {
        let Item::Function(function) = item else { continue };
        let gives = function.parameters.iter().flatten().any(|token| token.is("out") || token.is("inout"));
        let touches = function.body.iter().flatten().any(|token| {
            let text = &*token.text;
            globals.contains(text) || is_effect(text)
        });
        if gives || touches {
            found.insert(Rc::clone(&function.name.text));
        } else {
            functions.push(function);
        }
    }
    // Callers of those, until there are no more.
    loop {
        let count = found.len();
        for function in &functions {
            if function.body.iter().flatten().any(|token| found.contains(&token.text)) {
                found.insert(Rc::clone(&function.name.text));
            }
        }
        if found.len() == count {
            return found;
        }
    }
}

/// Whether `word` of GLSL's own does more than give a value.
pub fn is_effect(word: &str) -> bool {
    word == "discard" || word == "barrier" || word == "imageStore" || word.contains("tomic")
}

fn writable(stage: &Parsed) -> BTreeSet<&str> {
    let mut found =
        BTreeSet::from(["gl_FragColor", "gl_FragData", "gl_FragDepth", "gl_Position", "gl_PointSize"]);
    let is_writable = |qualifiers: &Qualifiers| {
        !["const", "in", "uniform", "attribute"].iter().any(|storage| qualifiers.is(storage))
    };
    for item in &stage.items {
        match item {
            Item::Variable(variable) if is_writable(&variable.qualifiers) => {
                found.insert(&*variable.name.text);
            }
            Item::Block(block) if is_writable(&block.qualifiers) => {
                found.extend(block.instance.iter().map(|name| &*name.text));
                found.extend(block.members.iter().map(|member| &*member.name.text));
            }
            _ => {}
        }
    }
    found
}
