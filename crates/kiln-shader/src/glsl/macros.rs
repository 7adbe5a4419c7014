//! Macros: definitions and their expansion, with a bound on the work.

use std::collections::BTreeMap;
use std::rc::Rc;

use super::lex::{self, Hidden, Kind, Token};
use super::source::Place;

/// Most tokens that the expansions of one stage may give. Large shaders have a tenth of this.
pub const EXPANDED_TOKENS_MAX: usize = 1 << 19;
/// Deepest nesting of macro calls in arguments of macro calls.
const ARGUMENT_DEPTH_MAX: usize = 64;

/// Longest chain of macros that stand for each other.
const REPLACED_DEPTH_MAX: usize = 256;

/// A definition.
#[derive(Clone, Debug)]
pub struct Macro {
    /// Parameters, if it is like a function.
    pub parameters: Option<Vec<Rc<str>>>,
    /// What it stands for.
    pub body: Vec<Token>,
}

impl Macro {
    /// Whether a second definition says the same.
    pub fn equals(&self, other: &Macro) -> bool {
        let texts = |body: &[Token]| body.iter().map(|token| Rc::clone(&token.text)).collect::<Vec<_>>();
        self.parameters == other.parameters && texts(&self.body) == texts(&other.body)
    }
}

/// What is wrong with a use of a macro.
#[derive(Debug)]
pub struct Fault {
    /// What is wrong.
    pub message: String,
    /// Where.
    pub place: Place,
}

/// All definitions at some point of the text.
#[derive(Debug, Default)]
pub struct Macros {
    /// Definitions by name.
    pub definitions: BTreeMap<Rc<str>, Macro>,
    /// First byte of each line of each file, by index: for `__LINE__`.
    pub line_starts: BTreeMap<usize, Vec<usize>>,
    /// Tokens that expansions gave so far.
    expanded: usize,
    /// Words put together with `##`.
    pub pasted: Vec<Rc<str>>,
}

impl Macros {
    /// Expands all macros in `tokens`.
    pub fn expand(&mut self, tokens: &[Token]) -> Result<Vec<Token>, Fault> {
        self.expand_at(tokens, 0)
    }

    fn expand_at(&mut self, tokens: &[Token], depth: usize) -> Result<Vec<Token>, Fault> {
        let mut todo: Vec<Token> = tokens.iter().rev().cloned().collect();
        let mut out = Vec::with_capacity(tokens.len());
        while let Some(token) = todo.pop() {
            let Some(definition) = self.definition(&token) else {
                out.push(token);
                continue;
            };
            let arguments = match &definition.parameters {
                None => Vec::new(),
                Some(_) if !todo.last().is_some_and(|next| next.is("(")) => {
                    // The name of a macro like a function, without arguments, is only a name.
                    out.push(token);
                    continue;
                }
                Some(parameters) => arguments(&mut todo, &token, parameters.len())?,
            };
            let mut replaced = self.replace(&token, &definition, &arguments, depth)?;
            self.spend(replaced.len() + 1, token.place)?;
            // The first token of an expansion stands where its macro stood.
            if let Some(first) = replaced.first_mut() {
                (first.starts_line, first.spaced) = (token.starts_line, token.spaced);
            }
            todo.extend(replaced.into_iter().rev());
        }
        Ok(out)
    }

    fn definition(&self, token: &Token) -> Option<Macro> {
        if !token.is_word() {
            return None;
        }
        if token.is("__LINE__") || token.is("__FILE__") {
            let value = if token.is("__LINE__") { self.line(token.place) } else { 0 };
            let body = vec![Token::new(Kind::Number, value.to_string(), token.place)];
            return Some(Macro { parameters: None, body });
        }
        let definition = self.definitions.get(&token.text)?;
        (!is_hidden(token)).then(|| definition.clone())
    }

    /// Whether the limit is passed: what follows would only repeat it.
    pub fn is_exhausted(&self) -> bool {
        self.expanded > EXPANDED_TOKENS_MAX
    }

    fn line(&self, place: Place) -> usize {
        let starts = self.line_starts.get(&place.file);
        starts.map_or(0, |starts| starts.partition_point(|start| *start <= place.start))
    }

    fn spend(&mut self, count: usize, place: Place) -> Result<(), Fault> {
        self.expanded += count;
        if self.expanded <= EXPANDED_TOKENS_MAX {
            return Ok(());
        }
        let message = format!("macros expand to more than {EXPANDED_TOKENS_MAX} tokens");
        Err(Fault { message, place })
    }

    /// The body of `definition` with its parameters replaced, as tokens at the place of `name`.
    fn replace(
        &mut self,
        name: &Token,
        definition: &Macro,
        arguments: &[Vec<Token>],
        depth: usize,
    ) -> Result<Vec<Token>, Fault> {
        if depth == ARGUMENT_DEPTH_MAX {
            let message = format!("macro calls nest at most {ARGUMENT_DEPTH_MAX} deep");
            return Err(Fault { message, place: name.place });
        }
        self.spend(definition.body.len(), name.place)?;
        let count = name.hidden.as_ref().map_or(0, |hidden| hidden.count) + 1;
        if count > REPLACED_DEPTH_MAX {
            let message = format!("macros stand for macros more than {REPLACED_DEPTH_MAX} deep");
            return Err(Fault { message, place: name.place });
        }
        let hidden = Rc::new(Hidden { name: Rc::clone(&name.text), rest: name.hidden.clone(), count });
        let parameters = definition.parameters.as_deref().unwrap_or_default();
        let body = &definition.body;
        let mut out: Vec<Token> = Vec::new();
        for (index, token) in body.iter().enumerate() {
            if token.is("##") {
                continue;
            }
            let pastes = |at: Option<usize>| at.and_then(|at| body.get(at)).is_some_and(|t| t.is("##"));
            let (joined, joins) = (pastes(index.checked_sub(1)), pastes(Some(index + 1)));
            let parameter = parameters.iter().position(|parameter| *parameter == token.text);
            let mut piece = match parameter {
                // An operand of `##` is not expanded.
                Some(at) if joined || joins => arguments[at].clone(),
                Some(at) => self.expand_at(&arguments[at], depth + 1)?,
                None => {
                    let mut token = token.clone();
                    (token.place, token.hidden, token.starts_line) =
                        (name.place, Some(Rc::clone(&hidden)), false);
                    vec![token]
                }
            };
            self.spend(piece.len(), name.place)?;
            if joined && !piece.is_empty() && !out.is_empty() {
                self.paste(&mut out, piece.remove(0), name)?;
            }
            out.append(&mut piece);
        }
        Ok(out)
    }

    /// Joins the last token of `out` with `right`.
    fn paste(&mut self, out: &mut Vec<Token>, right: Token, name: &Token) -> Result<(), Fault> {
        let Some(mut left) = out.pop() else { return Ok(()) };
        let text = format!("{}{}", left.text, right.text);
        let parsed = lex::tokenize(name.place.file, &text).unwrap_or_default();
        let [token] = &parsed[..] else {
            let message = format!("`##` joins `{}` and `{}`, which is not one token", left.text, right.text);
            return Err(Fault { message, place: name.place });
        };
        (left.kind, left.text) = (token.kind, Rc::clone(&token.text));
        self.pasted.push(Rc::clone(&left.text));
        out.push(left);
        Ok(())
    }
}

fn is_hidden(token: &Token) -> bool {
    let mut at = token.hidden.as_ref();
    while let Some(hidden) = at {
        if hidden.name == token.text {
            return true;
        }
        at = hidden.rest.as_ref();
    }
    false
}

/// Takes `( … )` off `todo`, which is in reverse, and splits it into as many arguments as wanted.
fn arguments(todo: &mut Vec<Token>, name: &Token, count: usize) -> Result<Vec<Vec<Token>>, Fault> {
    let mut arguments = vec![Vec::new()];
    todo.pop();
    let mut depth = 1_usize;
    while depth > 0 {
        let Some(token) = todo.pop() else {
            let message = format!("the arguments of macro `{}` have no end", name.text);
            return Err(Fault { message, place: name.place });
        };
        match &*token.text {
            "(" => depth += 1,
            ")" => depth -= 1,
            _ => {}
        }
        if depth == 1 && token.is(",") {
            arguments.push(Vec::new());
        } else if depth > 0 {
            arguments.last_mut().unwrap_or(&mut Vec::new()).push(token);
        }
    }
    if count == 0 && arguments.len() == 1 && arguments[0].is_empty() {
        arguments.clear();
    }
    if arguments.len() == count {
        return Ok(arguments);
    }
    let message = format!("macro `{}` takes {count} arguments, {} are given", name.text, arguments.len());
    Err(Fault { message, place: name.place })
}
