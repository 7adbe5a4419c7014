//! Declarations at the outermost level of a stage, found on tokens: just enough grammar to rewrite them.

use super::lex::{self, Token};
use super::source::Place;

/// What a stage declares, in source order.
#[derive(Clone, Debug)]
pub enum Item {
    /// A function, defined or only announced.
    Function(Function),
    /// `struct Name { … };`
    Struct(Struct),
    /// A variable; a declaration of several gives several.
    Variable(Variable),
    /// `uniform Name { … } instance;`
    Block(Block),
    /// Qualifiers alone, as `layout(local_size_x = 8) in;`, or with names, as `invariant gl_Position;`.
    Qualifiers(Qualifiers, Vec<Token>),
    /// What is not understood: naga explains it.
    Other(Vec<Token>),
}

/// A function.
#[derive(Clone, Debug)]
pub struct Function {
    /// Its name.
    pub name: Token,
    /// Qualifiers and type before the name.
    pub result: Vec<Token>,
    /// Parameters, each as its tokens.
    pub parameters: Vec<Vec<Token>>,
    /// `{ … }`; none if it is only announced.
    pub body: Option<Vec<Token>>,
}

/// A struct type.
#[derive(Clone, Debug)]
pub struct Struct {
    /// Its name.
    pub name: Token,
    /// Its members.
    pub members: Vec<Variable>,
}

/// A global variable, or a member of a struct or block.
#[derive(Clone, Debug)]
pub struct Variable {
    /// Its qualifiers.
    pub qualifiers: Qualifiers,
    /// The type's name.
    pub ty: Token,
    /// `[…]` of the variable and of its type.
    pub array: Vec<Token>,
    /// Its name.
    pub name: Token,
    /// What stands after `=`.
    pub initial: Option<Vec<Token>>,
}

/// An interface block.
#[derive(Clone, Debug)]
pub struct Block {
    /// Its qualifiers.
    pub qualifiers: Qualifiers,
    /// Its name.
    pub name: Token,
    /// Its members.
    pub members: Vec<Variable>,
    /// The name by which members are reached, if they are not reached by their own.
    pub instance: Option<Token>,
    /// `[…]` after the instance.
    pub array: Vec<Token>,
}

/// Qualifiers of a declaration.
#[derive(Clone, Debug, Default)]
pub struct Qualifiers {
    /// `const`, `in`, `out`, `uniform`, `buffer`, `shared`, `attribute` or `varying`.
    pub storage: Option<Token>,
    /// `layout(…)`: names with their values.
    pub layout: Vec<Layout>,
    /// `flat`, `noperspective`, `smooth`, `centroid`, `sample`.
    pub interpolation: Vec<Token>,
    /// `readonly`, `writeonly`.
    pub access: Vec<Token>,
    /// `invariant`.
    pub invariant: Option<Token>,
}

/// `name` or `name = value` in a `layout`.
#[derive(Clone, Debug)]
pub struct Layout {
    /// The name.
    pub name: Token,
    /// The value.
    pub value: Vec<Token>,
}

impl Qualifiers {
    /// Whether the storage is `word`.
    pub fn is(&self, word: &str) -> bool {
        self.storage.as_ref().is_some_and(|storage| storage.is(word))
    }

    /// The layout called `name`.
    pub fn layout(&self, name: &str) -> Option<&Layout> {
        self.layout.iter().find(|layout| layout.name.is(name))
    }

    /// The value of the layout called `name`, if it is an integer literal.
    pub fn integer(&self, name: &str) -> Option<u32> {
        let [value] = &self.layout(name)?.value[..] else { return None };
        u32::try_from(super::condition::integer(&value.text)?).ok()
    }
}

impl Variable {
    /// Where the variable is declared.
    pub fn place(&self) -> Place {
        self.name.place
    }

    /// Whether it is an array without a length.
    pub fn is_unsized(&self) -> bool {
        self.array.windows(2).any(|pair| pair[0].is("[") && pair[1].is("]"))
    }
}

impl Block {
    /// Whether a buffer's members are written as globals, though it has an instance. naga reads a member of an
    /// instance by loading all of the block, which it cannot if an array has no length.
    pub fn is_flattened(&self) -> bool {
        let has_unsized = self.members.iter().any(Variable::is_unsized);
        self.qualifiers.is("buffer") && self.instance.is_some() && has_unsized
    }
}

/// Qualifiers that say nothing to WGSL.
pub const DROPPED: [&str; 7] = ["precise", "highp", "mediump", "lowp", "coherent", "volatile", "restrict"];

const STORAGE: [&str; 8] = ["const", "in", "out", "uniform", "buffer", "shared", "attribute", "varying"];
const INTERPOLATION: [&str; 5] = ["flat", "noperspective", "smooth", "centroid", "sample"];

/// Parses a stage whose brackets pair up.
pub fn parse(tokens: &[Token]) -> Vec<Item> {
    let mut items = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        let len = declaration_len(&tokens[at..]);
        let declaration = &tokens[at..at + len];
        at += len;
        if declaration.len() > 1 && !declaration[0].is("precision") {
            let parsed = declared(declaration);
            items.extend(parsed.unwrap_or_else(|| vec![Item::Other(declaration.to_vec())]));
        }
    }
    items
}

/// Tokens up to a `;`, or to the end of a function's body.
fn declaration_len(tokens: &[Token]) -> usize {
    let mut at = 0;
    while at < tokens.len() {
        match &*tokens[at].text {
            ";" => return at + 1,
            "(" | "[" | "{" => {
                let is_body = tokens[at].is("{") && at > 0 && tokens[at - 1].is(")");
                let Some(close) = lex::closing(&tokens[at..], 0) else { return tokens.len() };
                at += close;
                if is_body {
                    return at + 1;
                }
            }
            _ => {}
        }
        at += 1;
    }
    tokens.len()
}

fn declared(tokens: &[Token]) -> Option<Vec<Item>> {
    let (qualifiers, at) = qualifiers(tokens)?;
    let rest = &tokens[at..];
    match rest {
        [end] if end.is(";") => Some(vec![Item::Qualifiers(qualifiers, Vec::new())]),
        [keyword, ..] if keyword.is("struct") => structure(qualifiers, rest),
        [name, open, ..] if name.is_word() && open.is("{") => block(qualifiers, rest),
        [name, next, ..] if name.is_word() && at > 0 && (next.is(";") || next.is(",")) => {
            let names = rest.iter().filter(|token| token.is_word()).cloned().collect();
            Some(vec![Item::Qualifiers(qualifiers, names)])
        }
        [ty, ..] if ty.is_word() => {
            let after_type = 1 + array_len(&rest[1..]);
            if rest.get(after_type + 1).is_some_and(|token| token.is("(")) {
                return function(tokens, at + after_type);
            }
            let variables = variables(&qualifiers, ty, &rest[1..])?;
            Some(variables.into_iter().map(Item::Variable).collect())
        }
        _ => None,
    }
}

/// Qualifiers at the beginning, and how many tokens they are.
pub fn qualifiers(tokens: &[Token]) -> Option<(Qualifiers, usize)> {
    let mut found = Qualifiers::default();
    let mut at = 0;
    while let Some(token) = tokens.get(at) {
        let word = &*token.text;
        if word == "layout" {
            let close = lex::closing(tokens, at + 1)?;
            for part in lex::split_commas(&tokens[at + 2..close]) {
                let (name, value) = part.split_first()?;
                let value = value.get(1..).unwrap_or_default().to_vec();
                found.layout.push(Layout { name: name.clone(), value });
            }
            at = close;
        } else if STORAGE.contains(&word) {
            found.storage = Some(token.clone());
        } else if INTERPOLATION.contains(&word) {
            found.interpolation.push(token.clone());
        } else if word == "readonly" || word == "writeonly" {
            found.access.push(token.clone());
        } else if word == "invariant" {
            found.invariant = Some(token.clone());
        } else if !DROPPED.contains(&word) {
            break;
        }
        at += 1;
    }
    Some((found, at))
}

/// Length of the `[…]` that `tokens` begin with.
pub fn array_len(tokens: &[Token]) -> usize {
    let mut at = 0;
    while tokens.get(at).is_some_and(|token| token.is("[")) {
        let Some(close) = lex::closing(tokens, at) else { return at };
        at = close + 1;
    }
    at
}

/// `[…][…]` in the other order: naga takes the last length for the outermost, GLSL the first.
pub fn reversed(array: &[Token]) -> Vec<Token> {
    let mut groups: Vec<&[Token]> = Vec::new();
    let mut rest = array;
    while let Some(close) = (!rest.is_empty()).then(|| lex::closing(rest, 0)).flatten() {
        let (group, after) = rest.split_at(close + 1);
        groups.push(group);
        rest = after;
    }
    groups.into_iter().rev().flatten().cloned().collect()
}

/// Variables after the type `ty`: `[2] a = …, b[3];`
fn variables(qualifiers: &Qualifiers, ty: &Token, rest: &[Token]) -> Option<Vec<Variable>> {
    let of_type = array_len(rest);
    let (type_array, rest) = rest.split_at(of_type);
    let (end, rest) = rest.split_last()?;
    if !end.is(";") {
        return None;
    }
    let mut variables = Vec::new();
    for part in lex::split_commas(rest) {
        let (name, part) = part.split_first()?;
        let (array, part) = part.split_at(array_len(part));
        let initial = match part.split_first() {
            None => None,
            Some((equals, value)) if equals.is("=") && !value.is_empty() => Some(value.to_vec()),
            Some(_) => return None,
        };
        if !name.is_word() {
            return None;
        }
        let (qualifiers, ty, name) = (qualifiers.clone(), ty.clone(), name.clone());
        variables.push(Variable { qualifiers, ty, array: [array, type_array].concat(), name, initial });
    }
    (!variables.is_empty()).then_some(variables)
}

/// Members between the braces at `open`.
fn members(tokens: &[Token], open: usize) -> Option<(Vec<Variable>, usize)> {
    let close = lex::closing(tokens, open)?;
    let mut found = Vec::new();
    let mut at = open + 1;
    while at < close {
        let len = declaration_len(&tokens[at..close]);
        let (qualifiers, start) = qualifiers(&tokens[at..at + len])?;
        let (ty, rest) = tokens[at + start..at + len].split_first()?;
        found.extend(variables(&qualifiers, ty, rest)?);
        at += len;
    }
    Some((found, close))
}

/// A struct alone, or with variables of it.
fn structure(qualifiers: Qualifiers, tokens: &[Token]) -> Option<Vec<Item>> {
    let name = tokens.get(1).filter(|name| name.is_word())?;
    let (members, close) = members(tokens, 2)?;
    let mut items = vec![Item::Struct(Struct { name: name.clone(), members })];
    if tokens.len() > close + 2 {
        let variables = variables(&qualifiers, name, &tokens[close + 1..])?;
        items.extend(variables.into_iter().map(Item::Variable));
    }
    Some(items)
}

fn block(qualifiers: Qualifiers, tokens: &[Token]) -> Option<Vec<Item>> {
    let (members, close) = members(tokens, 1)?;
    let name = tokens[0].clone();
    let (instance, array) = match &tokens[close + 1..] {
        [end] if end.is(";") => (None, Vec::new()),
        [instance, array @ .., end] if instance.is_word() && end.is(";") => {
            (Some(instance.clone()), array.to_vec())
        }
        _ => return None,
    };
    Some(vec![Item::Block(Block { qualifiers, name, members, instance, array })])
}

/// `name` is the index of the function's name.
fn function(tokens: &[Token], name: usize) -> Option<Vec<Item>> {
    let close = lex::closing(tokens, name + 1)?;
    let parameters = lex::split_commas(&tokens[name + 2..close]).into_iter().map(<[Token]>::to_vec);
    let mut parameters: Vec<Vec<Token>> = parameters.collect();
    if parameters.len() == 1 && parameters[0].len() == 1 && parameters[0][0].is("void") {
        parameters.clear();
    }
    let body = &tokens[close + 1..];
    let body = body.first()?.is("{").then(|| body.to_vec());
    let (result, name) = (tokens[..name].to_vec(), tokens[name].clone());
    Some(vec![Item::Function(Function { name, result, parameters, body })])
}
