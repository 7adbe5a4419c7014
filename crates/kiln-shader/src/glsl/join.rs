//! Joins the WGSL of several stages: equal declarations once, others under new names.

use std::collections::{BTreeMap, BTreeSet};

use super::source_map::Origins;
use crate::token::{self, Kind, Token};

/// A declaration of canonical WGSL.
#[derive(Clone, Debug)]
struct Declaration {
    /// Its name.
    name: String,
    /// Its text.
    text: String,
    /// Its stage, and its name there.
    origin: (usize, String),
}

/// A name that two stages declare otherwise, although it is filled from outside.
#[derive(Debug, PartialEq, Eq)]
pub struct Clash(pub String);

/// Joins the stages' texts, each with the ending for names that clash. `merged` are structs whose members
/// are united. Says where each name comes from, too.
pub fn join(stages: &[(String, &str)], merged: &BTreeSet<&str>) -> Result<(String, Origins), Clash> {
    let mut joined: Vec<Declaration> = Vec::new();
    for (stage, (text, ending)) in stages.iter().enumerate() {
        let mut added = split(stage, text);
        rename_clashes(&joined, &mut added, ending, merged)?;
        for declaration in added {
            match joined.iter_mut().find(|other| other.name == declaration.name) {
                None => joined.push(declaration),
                Some(other) if merged.contains(&*other.name) => unite(other, &declaration)?,
                Some(_) => {}
            }
        }
    }
    let origins = joined.iter().map(|declaration| (declaration.name.clone(), declaration.origin.clone()));
    let origins = origins.collect();
    Ok((joined.into_iter().map(|declaration| declaration.text + "\n").collect(), origins))
}

/// Renames until each name means the same in both; a declaration may differ only in a name it mentions, so
/// each round may find more.
fn rename_clashes(
    joined: &[Declaration],
    added: &mut [Declaration],
    ending: &str,
    merged: &BTreeSet<&str>,
) -> Result<(), Clash> {
    let known: BTreeMap<&str, &str> = joined.iter().map(|other| (&*other.name, &*other.text)).collect();
    loop {
        let differs = |declaration: &&Declaration| {
            let other = known.get(&*declaration.name);
            other.is_some_and(|text| *text != declaration.text) && !merged.contains(&*declaration.name)
        };
        let clashes: Vec<Declaration> = added.iter().filter(differs).cloned().collect();
        if clashes.is_empty() {
            return Ok(());
        }
        let mut renamed = BTreeMap::new();
        for clash in clashes {
            if clash.text.starts_with("@group") {
                return Err(Clash(clash.name));
            }
            let mut name = format!("{}_{ending}", clash.name);
            while known.contains_key(&*name) || added.iter().any(|other| other.name == name) {
                name.push('x');
            }
            renamed.insert(clash.name, name);
        }
        for declaration in added.iter_mut() {
            rename(declaration, &renamed);
        }
    }
}

fn rename(declaration: &mut Declaration, renamed: &BTreeMap<String, String>) {
    let text = std::mem::take(&mut declaration.text);
    let tokens = token::tokenize(&text).unwrap_or_default();
    let is_struct = text.starts_with("struct");
    let mut at = 0;
    for (index, token) in tokens.iter().enumerate() {
        let before = index.checked_sub(1).map(|before| tokens[before]);
        let is_member = before.is_some_and(|before| before.is('.') || before.is('@'))
            || (is_struct && tokens.get(index + 1).is_some_and(|next| next.is(':')));
        let Some(name) = renamed.get(&text[token.range()]).filter(|_| !is_member) else { continue };
        declaration.text.push_str(&text[at..token.start]);
        declaration.text.push_str(name);
        at = token.end;
    }
    declaration.text.push_str(&text[at..]);
    if let Some(name) = renamed.get(&declaration.name) {
        declaration.name.clone_from(name);
    }
}

/// Adds the members of `more` that `into` has not.
fn unite(into: &mut Declaration, more: &Declaration) -> Result<(), Clash> {
    let mut known = members(&into.text);
    for (name, text) in members(&more.text) {
        match known.iter().find(|(other, _)| *other == name) {
            None => known.push((name, text)),
            Some((_, other)) if *other == text => {}
            Some(_) => return Err(Clash(name)),
        }
    }
    let members: String = known.iter().map(|(name, ty)| format!("    {name}: {ty},\n")).collect();
    into.text = format!("struct {} {{\n{members}}}\n", into.name);
    Ok(())
}

/// Names and types of a struct's members; naga writes one a line.
fn members(text: &str) -> Vec<(String, String)> {
    let lines = text.lines().filter_map(|line| line.trim().strip_suffix(','));
    let pairs = lines.filter_map(|line| line.split_once(": "));
    pairs.map(|(name, ty)| (name.to_owned(), ty.to_owned())).collect()
}

/// Splits canonical text into its declarations.
fn split(stage: usize, text: &str) -> Vec<Declaration> {
    let tokens = token::tokenize(text).unwrap_or_default();
    let mut found = Vec::new();
    let (mut start, mut depth) = (0, 0_usize);
    for (index, token) in tokens.iter().enumerate() {
        let closes = match token.kind {
            Kind::Mark('{' | '(' | '[') => {
                depth += 1;
                false
            }
            Kind::Mark(mark @ ('}' | ')' | ']')) => {
                depth = depth.saturating_sub(1);
                depth == 0 && mark == '}'
            }
            Kind::Mark(';') => depth == 0,
            _ => false,
        };
        if closes {
            let own = &tokens[start..=index];
            if let Some(name) = declared_name(text, own) {
                let text = format!("{}\n", &text[own[0].start..token.end]);
                found.push(Declaration { origin: (stage, name.clone()), name, text });
            }
            start = index + 1;
        }
    }
    found
}

/// The word after the keyword, as in `@group(0) @binding(0) var<uniform> name`.
fn declared_name(text: &str, tokens: &[Token]) -> Option<String> {
    let keywords = ["struct", "fn", "const", "override", "alias", "var"];
    let keyword = tokens
        .iter()
        .position(|token| token.kind == Kind::Word && keywords.contains(&&text[token.range()]))?;
    let mut rest = &tokens[keyword + 1..];
    if rest.first().is_some_and(|token| token.is('<')) {
        let end = rest.iter().position(|token| token.is('>'))?;
        rest = &rest[end + 1..];
    }
    rest.first().map(|name| text[name.range()].to_owned())
}
