//! Types of what is named, so far as rewriting asks: of variables, members, elements, constructors and calls.

use std::collections::BTreeMap;
use std::rc::Rc;

use super::Parsed;
use super::builtin;
use super::declare::{self, Item, Variable};
use super::lex::{self, Token};

/// A type by its name, with the `[…]` of an array, outermost first.
#[derive(Clone, Debug)]
pub struct Type {
    /// Its name without brackets.
    pub name: Rc<str>,
    /// Each with its brackets.
    pub array: Vec<Vec<Token>>,
}

impl Type {
    /// Of `name` with the brackets `array`.
    pub fn new(name: &Rc<str>, array: &[Token]) -> Type {
        let mut groups = Vec::new();
        let mut rest = array;
        while let Some(close) = lex::closing(rest, 0) {
            groups.push(rest[..=close].to_vec());
            rest = &rest[close + 1..];
        }
        Type { name: Rc::clone(name), array: groups }
    }

    fn of(variable: &Variable) -> Type {
        Type::new(&variable.ty.text, &variable.array)
    }

    /// Whether it is an array of unknown length.
    pub fn is_unsized(&self) -> bool {
        self.array.iter().any(|length| length.len() < 3)
    }

    /// What `[…]` gives.
    pub fn element(&self) -> Option<Type> {
        if let Some((_, inner)) = self.array.split_first() {
            return Some(Type { name: Rc::clone(&self.name), array: inner.to_vec() });
        }
        let name = match builtin::rows(&self.name) {
            Some(rows) => format!("vec{rows}"),
            None => {
                builtin::vector_len(&self.name)?;
                match self.name.as_bytes().first()? {
                    b'i' => "int",
                    b'u' => "uint",
                    b'b' => "bool",
                    _ => "float",
                }
                .to_owned()
            }
        };
        Some(Type { name: Rc::from(name), array: Vec::new() })
    }

    /// Rows, if it is a matrix.
    pub fn rows(&self) -> Option<u32> {
        builtin::rows(&self.name).filter(|_| self.array.is_empty())
    }
}

/// Types of a stage's global names.
#[derive(Debug, Default)]
pub struct Types {
    /// Of variables, and of blocks by their instance.
    pub variables: BTreeMap<Rc<str>, Type>,
    /// Members of structs and blocks, in order.
    pub members: BTreeMap<Rc<str>, Vec<(Rc<str>, Type)>>,
    /// What functions give; none where functions of one name give several.
    results: BTreeMap<Rc<str>, Option<Type>>,
}

impl Types {
    /// Of a stage.
    pub fn of(stage: &Parsed) -> Types {
        let mut types = Types::default();
        let members = |members: &[Variable]| {
            members.iter().map(|member| (Rc::clone(&member.name.text), Type::of(member))).collect::<Vec<_>>()
        };
        for item in &stage.items {
            match item {
                Item::Struct(structure) => {
                    types.members.insert(Rc::clone(&structure.name.text), members(&structure.members));
                }
                Item::Variable(variable) => {
                    types.variables.insert(Rc::clone(&variable.name.text), Type::of(variable));
                }
                Item::Block(block) => match &block.instance {
                    Some(instance) => {
                        types.members.insert(Rc::clone(&block.name.text), members(&block.members));
                        let ty = Type::new(&block.name.text, &block.array);
                        types.variables.insert(Rc::clone(&instance.text), ty);
                    }
                    None => types.variables.extend(members(&block.members)),
                },
                Item::Function(function) => {
                    let name =
                        function.result.iter().position(|token| !declare::DROPPED.contains(&&*token.text));
                    let Some((first, array)) = name.and_then(|at| function.result[at..].split_first()) else {
                        continue;
                    };
                    let ty = Some(Type::new(&first.text, array));
                    let same =
                        |other: &Option<Type>| other.as_ref().is_some_and(|other| other.name == first.text);
                    let known = types.results.entry(Rc::clone(&function.name.text)).or_insert(ty);
                    if !same(known) {
                        *known = None;
                    }
                }
                _ => {}
            }
        }
        types
    }

    /// Whether values of `ty` have members or elements that `==` compares one by one.
    pub fn is_composite(&self, ty: &Type) -> bool {
        !ty.array.is_empty() || self.members.contains_key(&ty.name)
    }

    /// The type of a value, looking up locals in `local`: `Some(None)` is one whose type is not known.
    pub fn of_value(&self, tokens: &[Token], local: &dyn Fn(&str) -> Option<Option<Type>>) -> Option<Type> {
        let mut depth = 0_usize;
        for (at, token) in tokens.iter().enumerate() {
            match &*token.text {
                "(" | "[" => depth += 1,
                ")" | "]" => depth = depth.saturating_sub(1),
                "?" if depth == 0 => {
                    return self
                        .of_place(&tokens[at + 1..super::statement::place_end(tokens, at + 1)], local);
                }
                _ => {}
            }
        }
        self.of_place(tokens, local)
    }

    /// The type of a name with its members, elements and calls.
    fn of_place(&self, tokens: &[Token], local: &dyn Fn(&str) -> Option<Option<Type>>) -> Option<Type> {
        let (first, rest) = tokens.split_first()?;
        let array = declare::array_len(rest);
        let is_call = |at: usize| tokens.get(at).is_some_and(|next| next.is("("));
        let is_type = builtin::is_value_type(&first.text) || self.members.contains_key(&first.text);
        let (mut ty, mut at) = if first.is("(") {
            let close = lex::closing(tokens, 0)?;
            (self.of_value(&tokens[1..close], local)?, close + 1)
        } else if let Some(ty) = local(&first.text) {
            (ty?, 1)
        } else if is_type && is_call(1 + array) {
            (Type::new(&first.text, &rest[..array]), lex::closing(tokens, 1 + array)? + 1)
        } else if is_call(1) {
            (self.results.get(&first.text)?.clone()?, lex::closing(tokens, 1)? + 1)
        } else {
            (self.variables.get(&first.text)?.clone(), 1)
        };
        while let Some(token) = tokens.get(at) {
            if token.is("[") {
                ty = ty.element()?;
                at = lex::closing(tokens, at)? + 1;
                continue;
            }
            let member = tokens.get(at + 1).filter(|_| token.is(".") && ty.array.is_empty())?;
            let mut members = self.members.get(&ty.name)?.iter();
            ty = members.find(|(name, _)| *name == member.text)?.1.clone();
            at += 2;
        }
        Some(ty)
    }
}
