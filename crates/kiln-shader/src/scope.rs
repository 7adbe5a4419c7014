//! Which declaration a name means, and the name it gets in the linked text, where all modules share one scope.
//!
//! Most names stay as they are. One gets another if two modules declare it, or if a module that knows it by an alias or a
//! path uses the plain name for something else. Names that something outside knows (entry points, variables, overrides)
//! never change.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use kiln_diagnostic::{Diagnostic, Span};

use crate::link::{Graph, Module};
use crate::module::{Declaration, Item, Name};
use crate::token::{Kind, Token};

/// A declaration: its module and its name there.
type Declared = (usize, String);

/// Gives each module of a graph its renames; returns what cannot be told apart.
pub fn resolve(graph: &mut Graph) -> Vec<Diagnostic> {
    let mut faults = Vec::new();
    let mut changed = colliding(graph, &mut faults);
    changed.extend(captured(graph, &mut faults));
    if changed.is_empty() && graph.modules.iter().all(|module| module.has_plain_names()) {
        return faults;
    }
    let global_names = invent(graph, changed);
    let renames: Vec<_> =
        graph.modules.iter().enumerate().map(|(index, _)| renames(graph, index, &global_names)).collect();
    for (module, renames) in graph.modules.iter_mut().zip(renames) {
        module.renames = renames;
    }
    faults
}

/// Declarations whose name another module's keeps.
fn colliding(graph: &Graph, faults: &mut Vec<Diagnostic>) -> BTreeSet<Declared> {
    let mut owners: BTreeMap<&str, Vec<(usize, &Declaration)>> = BTreeMap::new();
    for (index, module) in graph.modules.iter().enumerate() {
        for declaration in &module.view.outline.declarations {
            owners.entry(&declaration.name.name).or_default().push((index, declaration));
        }
    }
    let mut changed = BTreeSet::new();
    for (name, owners) in owners {
        // One that must keep its name goes before the others, of these the first.
        let keeper = owners.iter().position(|(_, declaration)| declaration.is_public).unwrap_or(0);
        let (first, kept) = owners[keeper];
        for (at, &(index, declaration)) in owners.iter().enumerate() {
            if at == keeper {
                continue;
            }
            if index == first || declaration.is_public {
                faults.push(declared_twice(graph, (first, &kept.name), (index, &declaration.name)));
            } else {
                changed.insert((index, name.to_owned()));
            }
        }
    }
    for (index, module) in graph.modules.iter().enumerate() {
        let own = &module.view.outline.declarations;
        for name in module.view.outline.imports.iter().flat_map(|import| &import.items).map(Item::local) {
            if let Some(declared) = own.iter().find(|declaration| declaration.name.name == name.name) {
                faults.push(declared_twice(graph, (index, name), (index, &declared.name)));
            }
        }
    }
    changed
}

fn declared_twice(graph: &Graph, (first, kept): (usize, &Name), (index, name): (usize, &Name)) -> Diagnostic {
    let place = Span::new(&graph.modules[first].text, kept.range.clone());
    let note = format!("first declared at {}:{}:{}", graph.modules[first].path, place.line, place.column);
    graph.error_at(index, name.range.clone(), format!("`{}` is declared twice", name.name)).with_note(note)
}

/// Declarations that a module knows by another name while it uses theirs for something of its own.
fn captured(graph: &Graph, faults: &mut Vec<Diagnostic>) -> BTreeSet<Declared> {
    let mut changed = BTreeSet::new();
    for (index, module) in graph.modules.iter().enumerate() {
        if module.has_plain_names() {
            continue;
        }
        let words = own_words(module);
        let aliases = module.names.iter().filter(|(local, (_, name))| *local != name);
        let targets = aliases.map(|(_, target)| target).chain(module.paths.iter().map(|(_, target)| target));
        for (target, name) in targets.filter(|(_, name)| words.contains_key(name.as_str())) {
            if module.names.get(name) == Some(&(*target, name.clone())) {
                // The plain word means the same here, unless a local has it.
                if let Some(local) = local_declaration(module, name) {
                    let message = format!("`{name}` is a local here, and is imported under another name too");
                    let help = "its plain name would be taken for the local: rename that";
                    faults.push(graph.error_at(index, local, message).with_help(help));
                }
                continue;
            }
            let declared = graph.modules[*target].view.outline.declarations.iter();
            if declared.into_iter().any(|declaration| declaration.name.name == *name && declaration.is_public)
            {
                let message =
                    format!("`{name}` means something else here than in `{}`", graph.modules[*target].path);
                let help = "it is known outside by that name and cannot get another: rename this one";
                faults.push(graph.error_at(index, words[name.as_str()].clone(), message).with_help(help));
            } else {
                changed.insert((*target, name.clone()));
            }
        }
    }
    changed
}

/// Words of a module that stand neither in imports nor in paths, with the first place of each.
fn own_words(module: &Module) -> BTreeMap<&str, Range<usize>> {
    let mut words = BTreeMap::new();
    for token in module.view.tokens.iter() {
        let is_apart = module.paths.iter().any(|(range, _)| contains(range, token))
            || module.view.outline.import_statements.iter().any(|range| contains(range, token));
        if token.kind == Kind::Word && !is_apart {
            words.entry(&module.text[token.range()]).or_insert(token.range());
        }
    }
    words
}

/// Where `name` is declared inside a function: behind `let`, `var` or `const`, or before the `:` of a parameter.
fn local_declaration(module: &Module, name: &str) -> Option<Range<usize>> {
    let (text, tokens) = (&*module.text, &module.view.tokens);
    let members = member_declarations(text, tokens);
    let is_declared = |at: usize| {
        let before = at.checked_sub(1).map(|at| &tokens[at]);
        let is_word = |token: &&Token| ["let", "var", "const"].iter().any(|word| token.is_word(text, word));
        before.is_some_and(|token| is_word(&token) || token.is('>'))
            || (tokens.get(at + 1).is_some_and(|next| next.is(':')) && !members.contains(&at))
    };
    let here = |at: &usize| tokens[*at].is_word(text, name) && is_declared(*at);
    (0..tokens.len()).find(here).map(|at| tokens[at].range())
}

fn contains(range: &Range<usize>, token: &Token) -> bool {
    range.start <= token.start && token.end <= range.end
}

/// New names: the old with the module's file name, unless some module has such a word.
fn invent(graph: &Graph, changed: BTreeSet<Declared>) -> BTreeMap<Declared, String> {
    let mut taken: BTreeSet<String> = BTreeSet::new();
    for module in &graph.modules {
        let words = module.view.tokens.iter().filter(|token| token.kind == Kind::Word);
        taken.extend(words.map(|token| module.text[token.range()].to_owned()));
    }
    let mut names = BTreeMap::new();
    for (index, name) in changed {
        let path = &graph.modules[index].path;
        let stem = path.rsplit('/').next().and_then(|file| file.split('.').next()).unwrap_or_default();
        let stem: String = stem.chars().filter(|character| character.is_ascii_alphanumeric()).collect();
        let first = format!("{name}_{stem}");
        let others = (2..).map(|number| format!("{first}_{number}"));
        let unused = std::iter::once(first.clone()).chain(others).find(|name| taken.insert(name.clone()));
        names.insert((index, name), unused.unwrap_or(first));
    }
    names
}

/// What is written in a module's text in place of what.
fn renames(
    graph: &Graph,
    index: usize,
    global_names: &BTreeMap<Declared, String>,
) -> Vec<(Range<usize>, String)> {
    let module = &graph.modules[index];
    let global = |declared: &Declared| global_names.get(declared).unwrap_or(&declared.1).clone();
    let own = module.view.outline.declarations.iter().map(|declaration| &declaration.name.name);
    let own = own.map(|name| (name.as_str(), global(&(index, name.clone()))));
    let imported = module.names.iter().map(|(local, declared)| (local.as_str(), global(declared)));
    let mut visible: BTreeMap<&str, String> = imported.chain(own).collect();
    visible.retain(|local, global| local != global);
    let paths = module.paths.iter().map(|(range, declared)| (range.clone(), global(declared)));
    let mut renames: Vec<(Range<usize>, String)> = paths.collect();
    if !visible.is_empty() {
        let tokens = &module.view.tokens;
        let members = member_declarations(&module.text, tokens);
        for (at, token) in tokens.iter().enumerate() {
            let is_component = at > 0 && (tokens[at - 1].is('.') || tokens[at - 1].is('@'));
            let is_apart = module.paths.iter().any(|(range, _)| contains(range, token));
            let Some(global) = visible.get(&module.text[token.range()]).filter(|_| token.kind == Kind::Word)
            else {
                continue;
            };
            if !is_component && !is_apart && !members.contains(&at) {
                renames.push((token.range(), global.clone()));
            }
        }
    }
    renames.sort_by_key(|(range, _)| range.start);
    renames
}

/// Tokens that name members of structs where those are declared.
fn member_declarations(text: &str, tokens: &[Token]) -> BTreeSet<usize> {
    let mut members = BTreeSet::new();
    let mut at = 0;
    while at < tokens.len() {
        if !(tokens[at].is_word(text, "struct") && tokens.get(at + 2).is_some_and(|token| token.is('{'))) {
            at += 1;
            continue;
        }
        let mut depth = 0_usize;
        at += 2;
        while let Some(token) = tokens.get(at) {
            match token.kind {
                Kind::Mark('{' | '(' | '[') => depth += 1,
                Kind::Mark('}' | ')' | ']') => depth = depth.saturating_sub(1),
                Kind::Word if depth == 1 && tokens.get(at + 1).is_some_and(|next| next.is(':')) => {
                    members.insert(at);
                }
                _ => {}
            }
            at += 1;
            if depth == 0 {
                break;
            }
        }
    }
    members
}
