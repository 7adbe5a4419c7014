//! Finds the next fault: naga stops at its first, so what is broken is taken out of the linked text and the rest is read again.
//!
//! Faults are mostly in bodies of functions. Once a module has one, all its functions lose their bodies and return zero
//! values: who imports them is still checked. Anything else that is broken goes, and its name with it; that it is missing is
//! then no fault of those who use it. Places in the text stay what they are: what goes leaves spaces, what is new stands
//! behind the end.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::explain::Finding;
use crate::join::Linked;
use crate::token::{self, Kind, Token};

/// The linked text without what was found to be broken.
pub struct Lenient {
    /// What is left.
    pub text: String,
    declarations: Vec<Declaration>,
    /// Names of declarations that are gone.
    gone: BTreeSet<String>,
}

/// A declaration at module scope.
struct Declaration {
    range: Range<usize>,
    module: usize,
    name: String,
    /// Of a function that has not lost it: where it begins, and the bytes of the type it returns.
    body: Option<(usize, Option<Range<usize>>)>,
}

impl Lenient {
    /// All of a linked text.
    pub fn new(linked: &Linked) -> Lenient {
        // Text that does not tokenise is not linked.
        let tokens = token::tokenize(&linked.text).unwrap_or_default();
        let parts = split(&tokens).into_iter();
        let declarations = parts.filter_map(|part| declaration(linked, &tokens[part])).collect();
        Lenient { text: linked.text.clone(), declarations, gone: BTreeSet::new() }
    }

    /// Whether a finding only says that something is missing which was taken out.
    pub fn is_consequence(&self, finding: &Finding) -> bool {
        let named = finding.labels.first().and_then(|(range, _)| self.text.get(range.clone()));
        finding.message.starts_with("no definition in scope")
            && named.is_some_and(|name| self.gone.contains(name))
    }

    /// Takes out what has a fault at byte `at`, and `with_module` the bodies of all functions beside it; whether something
    /// stands there.
    pub fn take_out(&mut self, at: usize, with_module: bool) -> bool {
        let found = self.declarations.iter().position(|declaration| declaration.range.contains(&at));
        let Some(found) = found else { return false };
        let Declaration { module, body, .. } = &self.declarations[found];
        let module = *module;
        if body.as_ref().is_none_or(|(body, _)| at < *body) {
            let broken = self.declarations.remove(found);
            blank(&mut self.text, broken.range);
            self.gone.insert(broken.name);
        } else {
            self.declarations[found].lose_body(&mut self.text);
        }
        if with_module {
            let others = self.declarations.iter_mut().filter(|declaration| declaration.module == module);
            others.for_each(|declaration| declaration.lose_body(&mut self.text));
        }
        true
    }
}

impl Declaration {
    /// Moves a function without its body behind the end of the text.
    fn lose_body(&mut self, text: &mut String) {
        let Some((body, result)) = self.body.take() else { return };
        let head = &text[self.range.start..body];
        let result = result.map_or(String::new(), |result| format!("return {}();", &text[result]));
        let bodiless = format!("{head}{{ {result} }}\n");
        blank(text, self.range.clone());
        self.range = text.len()..text.len() + bodiless.len();
        text.push_str(&bodiless);
    }
}

fn blank(text: &mut String, range: Range<usize>) {
    let spaces = " ".repeat(range.len());
    text.replace_range(range, &spaces);
}

/// Ranges of tokens, one for each declaration.
fn split(tokens: &[Token]) -> Vec<Range<usize>> {
    let (mut found, mut start, mut depth) = (Vec::new(), 0, 0_usize);
    for (index, token) in tokens.iter().enumerate() {
        match token.kind {
            Kind::Mark('{' | '(' | '[') => depth += 1,
            Kind::Mark('}' | ')' | ']') => depth = depth.saturating_sub(1),
            _ => {}
        }
        if depth == 0 && (token.is(';') || token.is('}')) {
            found.push(start..index + 1);
            start = index + 1;
        }
    }
    found
}

fn declaration(linked: &Linked, tokens: &[Token]) -> Option<Declaration> {
    let text = &linked.text;
    let range = tokens.first()?.start..tokens.last()?.end;
    let (module, _) = linked.origin(range.clone())?;
    let keyword = tokens.iter().position(|token| KEYWORDS.iter().any(|word| token.is_word(text, word)))?;
    let mut names = tokens[keyword + 1..].iter();
    if names.as_slice().first().is_some_and(|token| token.is('<')) {
        names.find(|token| token.is('>'));
    }
    // An assertion has none: what follows is its condition.
    let name = names.next().filter(|_| !tokens[keyword].is_word(text, "const_assert"));
    let name = name.map(|token| text[token.range()].to_owned()).unwrap_or_default();
    let is_function = tokens[keyword].is_word(text, "fn");
    let body = tokens.iter().position(|token| token.is('{')).filter(|_| is_function);
    let body = body.map(|body| (tokens[body].start, result(&tokens[keyword..body])));
    Some(Declaration { range, module, name, body })
}

const KEYWORDS: [&str; 7] = ["fn", "struct", "const", "override", "alias", "var", "const_assert"];

/// The type behind the arrow of a function's head, without attributes.
fn result(head: &[Token]) -> Option<Range<usize>> {
    let arrow = head.windows(2).rposition(|pair| pair[0].is('-') && pair[1].is('>'))?;
    let mut rest = &head[arrow + 2..];
    while rest.first()?.is('@') {
        rest = rest.get(2..)?;
        if rest.first()?.is('(') {
            let end = rest.iter().position(|token| token.is(')'))?;
            rest = &rest[end + 1..];
        }
    }
    Some(rest.first()?.start..rest.last()?.end)
}
