//! Order of functions: each after those it calls. GLSL lets a function be announced first, naga wants it
//! defined first.

use std::collections::BTreeMap;

use super::declare::{Function, Item};
use super::lex::Token;
use super::source::Sources;

/// The functions to write: those that are defined, in order, then announcements of others. Functions that
/// call each other are left in `sources`; overloads of one name count as one.
pub fn ordered<'a>(sources: &mut Sources<'_, '_>, items: &'a [Item]) -> Vec<&'a Function> {
    let functions = items.iter().filter_map(|item| match item {
        Item::Function(function) => Some(function),
        _ => None,
    });
    let (defined, announced): (Vec<_>, Vec<_>) = functions.partition(|function| function.body.is_some());
    let mut groups: Vec<(&str, Vec<&Function>)> = Vec::new();
    let mut group_of: BTreeMap<&str, usize> = BTreeMap::new();
    for function in defined {
        let name = &*function.name.text;
        let index = *group_of.entry(name).or_insert(groups.len());
        if index == groups.len() {
            groups.push((name, Vec::new()));
        }
        groups[index].1.push(function);
    }
    let calls: Vec<Vec<(usize, &Token)>> = groups.iter().map(|(_, group)| calls(group, &group_of)).collect();
    let mut out = Vec::new();
    let mut state = vec![State::New; groups.len()];
    for root in 0..groups.len() {
        // A group with the calls of it that were followed.
        let mut stack = vec![(root, 0)];
        while let Some((group, followed)) = stack.pop() {
            if followed == 0 && state[group] != State::New {
                continue;
            }
            state[group] = State::Open;
            let Some((callee, call)) = calls[group].get(followed) else {
                state[group] = State::Done;
                out.extend(&groups[group].1);
                continue;
            };
            stack.push((group, followed + 1));
            let calls_overload = *callee == group && groups[group].1.len() > 1;
            if state[*callee] == State::Open && !calls_overload {
                let fault = sources
                    .error(call.place, format!("`{}` calls itself, perhaps through others", call.text));
                sources.diagnostics.push(fault.with_help("shaders have no recursion: use a loop"));
            } else if state[*callee] == State::New {
                stack.push((*callee, 0));
            }
        }
    }
    out.extend(announced.into_iter().filter(|function| !group_of.contains_key(&*function.name.text)));
    out
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    New,
    Open,
    Done,
}

/// Groups that the functions of a group call, each with its first call.
fn calls<'a>(group: &[&'a Function], group_of: &BTreeMap<&str, usize>) -> Vec<(usize, &'a Token)> {
    let mut found: BTreeMap<usize, &Token> = BTreeMap::new();
    for body in group.iter().filter_map(|function| function.body.as_deref()) {
        for pair in body.windows(2).filter(|pair| pair[1].is("(")) {
            if let Some(callee) = group_of.get(&*pair[0].text) {
                found.entry(*callee).or_insert(&pair[0]);
            }
        }
    }
    found.into_iter().collect()
}
