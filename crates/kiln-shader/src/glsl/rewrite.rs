//! Rewrites expressions and statements to what naga reads. One pass over the tokens of a function, with the
//! scopes of local names, because a local may hide what would be rewritten.

use std::collections::BTreeMap;
use std::rc::Rc;

use kiln_diagnostic::Diagnostic;

use super::builtin::{self, Combined};
use super::declare::{self, DROPPED};
use super::lazy;
use super::lex::{self, Kind, Token};
use super::scene::{Meaning, Member, Scene, Stored};
use super::source::{Place, Sources};
use super::statement;
use super::texture::Parts;
use super::types::Type;
use crate::Stage;

/// What a local name is.
#[derive(Clone, Debug)]
pub(super) enum Local {
    /// A value of some type.
    Value(Type),
    /// A combined texture, with the name of its sampler.
    Texture(Combined, String),
    /// An array of them.
    Textures(Combined, Vec<Parts>),
}

/// Rewrites a function's parameters and body, or an initialiser: `result` is the type it gives.
pub struct Rewriter<'a, 's, 'r> {
    /// Where faults are left.
    pub sources: &'a mut Sources<'s, 'r>,
    pub(super) scene: &'a mut Scene,
    scopes: Vec<BTreeMap<Rc<str>, Local>>,
    /// Locals whose name holds from some token on.
    pending: BTreeMap<usize, Vec<(Rc<str>, Type)>>,
    /// Index after a `for` statement, where its scope ends.
    loops: Vec<usize>,
    /// What is called by each open parenthesis.
    pub(super) calls: Vec<Option<Rc<str>>>,
    /// Text before a token.
    pub(super) before: BTreeMap<usize, Vec<Token>>,
    /// Text in place of a token.
    pub(super) instead: BTreeMap<usize, Vec<Token>>,
    result: Option<Rc<str>>,
    pub(super) out: Vec<Token>,
    /// Where in `out` each token begins.
    pub(super) written: Vec<usize>,
}

/// Tokens that Kiln writes, on behalf of `place`.
pub(super) fn tokens_of(texts: &[&str], place: Place) -> Vec<Token> {
    texts.iter().map(|text| Token::new(kind_of(text), *text, place)).collect()
}

fn kind_of(text: &str) -> Kind {
    match text.bytes().next() {
        Some(byte) if byte.is_ascii_digit() => Kind::Number,
        Some(byte) if byte.is_ascii_alphabetic() || byte == b'_' => Kind::Word,
        _ => Kind::Mark,
    }
}

impl<'a, 's, 'r> Rewriter<'a, 's, 'r> {
    /// For one function or initialiser.
    pub fn new(sources: &'a mut Sources<'s, 'r>, scene: &'a mut Scene, result: Option<Rc<str>>) -> Self {
        Rewriter {
            sources,
            scene,
            scopes: vec![BTreeMap::new()],
            pending: BTreeMap::new(),
            loops: Vec::new(),
            calls: Vec::new(),
            before: BTreeMap::new(),
            instead: BTreeMap::new(),
            result,
            out: Vec::new(),
            written: Vec::new(),
        }
    }

    pub(super) fn report(&mut self, place: Place, message: impl Into<String>, help: impl Into<String>) {
        let diagnostic: Diagnostic = self.sources.error(place, message).with_help(help);
        self.sources.diagnostics.push(diagnostic);
    }

    /// Rewrites a parameter: combined textures become two.
    pub fn parameter(&mut self, tokens: &[Token]) -> Vec<Token> {
        let kept: Vec<&Token> = tokens.iter().filter(|token| !DROPPED.contains(&&*token.text)).collect();
        // A copy that nobody may change is a copy all the same.
        let is_copy = kept.iter().any(|token| token.is("in"))
            || !kept.iter().any(|token| token.is("out") || token.is("inout"));
        let kept: Vec<Token> = kept
            .into_iter()
            .filter(|token| !(is_copy && (token.is("const") || token.is("in"))))
            .cloned()
            .collect();
        let Some(at) = kept.iter().position(|token| !["out", "inout"].contains(&&*token.text)) else {
            return kept;
        };
        let rest = &kept[at + 1..];
        let name = rest.get(declare::array_len(rest)).filter(|name| name.is_word());
        if let Some(combined) = builtin::combined(&kept[at].text) {
            return self.texture_parameter(&kept, at, &combined);
        }
        let of_type = declare::array_len(rest);
        let end = rest.len().min(of_type + 1);
        if let Some(name) = name {
            let ty = Type::new(&kept[at].text, &[&rest[end..], &rest[..of_type]].concat());
            self.declare(&name.text, Local::Value(ty));
        }
        let arrays = (declare::reversed(&rest[..of_type]), declare::reversed(&rest[end..]));
        [&kept[..=at], &arrays.0, &rest[of_type..end], &arrays.1].concat()
    }

    /// Adds text before token `at`, after what is written there. What is inner was opened later and closes first.
    pub(super) fn close(&mut self, at: usize, texts: &[&str], place: Place) {
        self.before.entry(at).or_default().splice(0..0, tokens_of(texts, place));
    }

    pub(super) fn declare(&mut self, name: &Rc<str>, local: Local) {
        if let Some(scope) = self.scopes.last_mut() {
            scope.insert(Rc::clone(name), local);
        }
    }

    pub(super) fn local(&self, name: &str) -> Option<&Local> {
        self.scopes.iter().rev().find_map(|scope| scope.get(name))
    }

    /// Rewrites statements or an expression.
    pub fn tokens(mut self, tokens: &[Token]) -> Vec<Token> {
        for at in 0..tokens.len() {
            self.loops.retain(|end| {
                if *end <= at {
                    self.scopes.pop();
                }
                *end > at
            });
            for (name, ty) in self.pending.remove(&at).unwrap_or_default() {
                self.declare(&name, Local::Value(ty));
            }
            if let Some(before) = self.before.remove(&at) {
                self.out.extend(before);
            }
            self.written.push(self.out.len());
            match self.instead.remove(&at) {
                Some(instead) => self.out.extend(instead),
                None => self.token(tokens, at),
            }
        }
        if let Some(last) = self.before.remove(&tokens.len()) {
            self.out.extend(last);
        }
        self.out
    }

    fn token(&mut self, tokens: &[Token], at: usize) {
        let token = &tokens[at];
        match (&*token.text, token.kind) {
            ("{", _) => self.scopes.push(BTreeMap::new()),
            ("}", _) => drop(self.scopes.pop()),
            ("(", _) => {
                let callee =
                    at.checked_sub(1).map(|before| &tokens[before]).filter(|callee| callee.is_word());
                self.calls.push(callee.map(|callee| Rc::clone(&callee.text)));
            }
            (")", _) => drop(self.calls.pop()),
            ("[", _) if tokens.get(at + 1).is_some_and(|next| next.is("]")) => self.unsized_array(tokens, at),
            (text, Kind::Number) if text.ends_with("lf") || text.ends_with("LF") => {
                let single = &text[..text.len() - 2];
                self.report(
                    token.place,
                    format!("`{text}` is a double"),
                    format!("write `{single}`: there are no doubles in WGSL"),
                );
            }
            (".", _) if self.column_component(tokens, at) => return,
            ("==" | "!=", _) if self.comparison(tokens, at) => return,
            (text, _) if lazy::is_assignment(text) && self.column_assignment(tokens, at) => return,
            (_, Kind::Word) => return self.word(tokens, at),
            _ => {}
        }
        self.out.push(token.clone());
    }

    fn word(&mut self, tokens: &[Token], at: usize) {
        let token = &tokens[at];
        let after_dot = at.checked_sub(1).is_some_and(|before| tokens[before].is("."));
        let is_call = tokens.get(at + 1).is_some_and(|next| next.is("("));
        let text = &*token.text;
        if after_dot {
            self.out.push(token.clone());
            return;
        }
        match text {
            "for" => self.open_loop(tokens, at),
            "do" => self.check_do(tokens, at),
            "discard" if self.scene.stage != Stage::Fragment => {
                self.report(
                    token.place,
                    "`discard` stands outside of a fragment stage",
                    "move it to the fragment stage",
                );
            }
            "return" => self.convert_returned(tokens, at),
            _ if DROPPED.contains(&text) => return,
            _ => {}
        }
        if self.is_declaration(tokens, at) {
            self.declaration(tokens, at);
        } else if let Some(call) = self.matrix_of_vector(tokens, at) {
            return self.out.push(call);
        } else if self.is_type(text) {
            // A constructor of an array.
            self.reverse(tokens, at + 1);
        } else if self.local(text).is_none() && self.scene.functions.contains(text) && is_call {
            // The author's function hides what GLSL has of the same name.
        } else if self.rewritten(tokens, at, is_call) {
            return;
        }
        self.out.push(token.clone());
    }

    /// Whether the name at `at` was written in another way, or left out.
    fn rewritten(&mut self, tokens: &[Token], at: usize, is_call: bool) -> bool {
        let token = &tokens[at];
        if let Some(local) = self.local(&token.text).cloned() {
            match local {
                Local::Texture(combined, sampler) => self.texture(tokens, at, &combined, &sampler),
                Local::Textures(combined, elements) => self.textures(tokens, at, &combined, &elements),
                Local::Value(_) => return false,
            }
            return true;
        }
        match self.scene.meanings.get(&*token.text).cloned() {
            Some(Meaning::Texture(combined, sampler)) => self.texture(tokens, at, &combined, &sampler),
            Some(Meaning::Textures(combined, elements)) => self.textures(tokens, at, &combined, &elements),
            Some(Meaning::Stored(stored)) => self.stored(tokens, at, at, stored),
            Some(Meaning::Instance(members)) => return self.instance(tokens, at, &members),
            Some(Meaning::Expression(texts)) => {
                let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
                self.out.extend(tokens_of(&texts, token.place));
            }
            None if is_call => return self.call(tokens, at),
            None => {
                self.check_variable(token);
                return false;
            }
        }
        true
    }

    fn check_variable(&mut self, token: &Token) {
        let text = &*token.text;
        if let Some(help) = builtin::replacement(text) {
            self.report(token.place, format!("`{text}` is not supported"), help);
        } else if text.starts_with("gl_") && !builtin::VARIABLES.contains(&text) {
            let close = crate::suggest::closest(text, builtin::VARIABLES.into_iter());
            let help = close
                .map_or("the built-in variables are listed in docs/shader-interface.md".to_owned(), |name| {
                    format!("did you mean `{name}`?")
                });
            self.report(token.place, format!("there is no built-in variable `{text}`"), help);
        }
    }

    /// A uniform whose name ends at token `last`, and which is stored as another type.
    fn stored(&mut self, tokens: &[Token], first: usize, last: usize, stored: Stored) {
        let place = tokens[first].place.to(tokens[last].place);
        let mut end = last + 1;
        let is_array = stored.swizzle.is_some() || stored.rows == Some(true);
        if stored.rows != Some(false) && tokens.get(end).is_some_and(|next| next.is("[")) {
            end = lex::closing(tokens, end).map_or(end, |close| close + 1);
        } else if is_array && !tokens.get(end).is_some_and(|next| next.is(".")) {
            let help = match stored.rows {
                Some(_) => "use its elements, or leave `row_major` out",
                None => "use its elements, or declare it as an array of `vec4`",
            };
            let name = &tokens[last].text;
            self.report(place, format!("the array `{name}` cannot be used as a whole"), help);
        }
        let name: Vec<Token> = tokens[first..=last].to_vec();
        let swizzle = stored.swizzle.map(|swizzle| tokens_of(&[".", swizzle], place)).unwrap_or_default();
        let after = match stored.flags {
            Some(1) => tokens_of(&["!=", "0u", ")"], place),
            Some(count) => tokens_of(&[",", &format!("uvec{count}"), "(", "0u", ")", ")"], place),
            None if stored.rows.is_some() => tokens_of(&[")"], place),
            None => Vec::new(),
        };
        match stored.flags {
            Some(1) => self.out.extend(tokens_of(&["("], place)),
            Some(_) => self.out.extend(tokens_of(&["notEqual", "("], place)),
            None if stored.rows.is_some() => self.out.extend(tokens_of(&["transpose", "("], place)),
            None => {}
        }
        self.out.extend(name);
        let slot = self.before.entry(end).or_default();
        // What is inner was opened later and closes first.
        slot.splice(0..0, swizzle.into_iter().chain(after));
        for inner in first + 1..=last {
            self.instead.insert(inner, Vec::new());
        }
    }

    fn instance(&mut self, tokens: &[Token], at: usize, members: &BTreeMap<String, Member>) -> bool {
        let [_, dot, member, ..] = &tokens[at..] else { return false };
        if !dot.is(".") {
            return false;
        }
        let Some(found) = members.get(&*member.text) else {
            let is_passed = members.values().any(|member| matches!(member, Member::Renamed(_)));
            if is_passed {
                let close = crate::suggest::closest(&member.text, members.keys().map(String::as_str));
                let help = close.map_or("see the block's declaration".to_owned(), |name| {
                    format!("did you mean `{name}`?")
                });
                self.report(member.place, format!("no member `{}`", member.text), help);
            }
            return false;
        };
        match found {
            Member::Renamed(name) => {
                let mut token = member.clone();
                token.text = Rc::from(name.as_str());
                self.out.push(token);
                self.instead.insert(at + 1, Vec::new());
                self.instead.insert(at + 2, Vec::new());
            }
            Member::Stored(stored) => self.stored(tokens, at, at + 2, *stored),
        }
        true
    }

    /// A call of a function that is GLSL's own.
    fn call(&mut self, tokens: &[Token], at: usize) -> bool {
        let token = &tokens[at];
        let Some(close) = lex::closing(tokens, at + 1) else { return false };
        if builtin::MEMORY_BARRIERS.contains(&&*token.text) {
            (at + 1..=close).for_each(|inner| drop(self.instead.insert(inner, Vec::new())));
            return true;
        }
        if self.scene.stage != Stage::Fragment && builtin::is_derivative(&token.text) {
            let message = format!("`{}` stands outside of a fragment stage", token.text);
            self.report(token.place, message, "derivatives are taken in the fragment stage");
        }
        let modern = builtin::modern(&token.text);
        if modern.is_none()
            && let Some(help) = builtin::replacement(&token.text)
        {
            self.report(token.place, format!("`{}` is not supported", token.text), help);
            return false;
        }
        // The function is given its depth comparison as one number, older ones gave a colour.
        if token.text.starts_with("shadow") && modern.is_some() {
            self.out.extend(tokens_of(&["vec4", "("], token.place));
            self.before.entry(close + 1).or_default().splice(0..0, tokens_of(&[")"], token.place));
        }
        let mut name = modern.map_or(&*token.text, |modern| modern).to_owned();
        let count = lex::split_commas(&tokens[at + 2..close]).len();
        let is_shadow = self.is_comparison(tokens, &name, at + 2, close);
        let levelled = builtin::with_level(&name).filter(|(_, wanted)| *wanted == count && !is_shadow);
        if let Some((with_level, _)) = levelled.filter(|_| self.scene.stage != Stage::Fragment) {
            name = with_level.to_owned();
            self.before.entry(close).or_default().extend(tokens_of(&[",", "0.0"], token.place));
        }
        if let Some(function) = POLYFILLED.iter().find(|function| **function == name) {
            self.scene.polyfills.entry(function).or_insert(token.place);
            name.insert_str(0, "kiln_");
        }
        self.round_layer(tokens, &name, at + 2, close);
        if let Some(selected) = self.selected(tokens, &name, at + 2, close) {
            name = selected;
        }
        let mut call = token.clone();
        call.text = Rc::from(name);
        // The parenthesis that follows belongs to the written name.
        self.out.push(call);
        true
    }

    fn is_type(&self, word: &str) -> bool {
        builtin::is_value_type(word) || self.scene.structs.contains(word)
    }

    /// Whether token `at` is the type of a declaration.
    fn is_declaration(&self, tokens: &[Token], at: usize) -> bool {
        let rest = &tokens[at + 1..];
        let name = rest.get(declare::array_len(rest));
        self.is_type(&tokens[at].text)
            && self.local(&tokens[at].text).is_none()
            && name.is_some_and(Token::is_word)
    }

    /// Notes the names that a declaration adds, and splits it where naga would go wrong.
    fn declaration(&mut self, tokens: &[Token], at: usize) {
        let type_array = declare::array_len(&tokens[at + 1..]);
        let is_const = at.checked_sub(1).is_some_and(|before| tokens[before].is("const"));
        self.reverse(tokens, at + 1);
        let mut name = at + 1 + type_array;
        loop {
            self.reverse(tokens, name + 1);
            let end = statement::declarator_end(tokens, name);
            self.instead.insert(name, vec![tokens[name].clone()]);
            let of_name = &tokens[name + 1..][..declare::array_len(&tokens[name + 1..])];
            let array = [of_name, &tokens[at + 1..][..type_array]].concat();
            let declared = (Rc::clone(&tokens[name].text), Type::new(&tokens[at].text, &array));
            self.pending.entry(end).or_default().push(declared);
            if !tokens.get(end).is_some_and(|token| token.is(","))
                || !tokens.get(end + 1).is_some_and(Token::is_word)
            {
                return;
            }
            // naga gives the array of one name to all that follow.
            if tokens[name + 1].is("[") {
                let place = tokens[end].place;
                let mut again = tokens_of(if is_const { &[";", "const"] } else { &[";"] }, place);
                again.extend(tokens[at..=at + type_array].iter().cloned());
                self.instead.insert(end, again);
            }
            name = end + 1;
        }
    }

    /// Turns `[…][…]` at token `at` round for naga.
    fn reverse(&mut self, tokens: &[Token], at: usize) {
        let array = &tokens[at..at + declare::array_len(&tokens[at..])];
        let reversed = declare::reversed(array);
        let is_simple = array.windows(2).all(|pair| !(pair[0].is("[") && pair[1].is("]")));
        if is_simple && array.windows(2).any(|pair| pair[0].is("]") && pair[1].is("[")) {
            for index in at..at + array.len() {
                self.instead.insert(index, vec![reversed[index - at].clone()]);
            }
        }
    }

    /// The scope of a `for` begins at its parenthesis and ends with its body.
    fn open_loop(&mut self, tokens: &[Token], at: usize) {
        let Some(close) = lex::closing(tokens, at + 1) else { return };
        let end = match tokens.get(close + 1) {
            Some(open) if open.is("{") => lex::closing(tokens, close + 1).map_or(tokens.len(), |end| end + 1),
            _ => statement::end(tokens, close + 1),
        };
        self.scopes.push(BTreeMap::new());
        self.loops.push(end);
    }

    /// naga jumps over the condition of `do … while` at a `continue`, for ever.
    fn check_do(&mut self, tokens: &[Token], at: usize) {
        for place in statement::continues_of_do(tokens, at) {
            self.report(
                place,
                "`continue` in a `do` loop is not supported",
                "write `while (true) { … if (!condition) break; }`, or put the rest under an `if`",
            );
        }
    }

    /// naga does not convert what is returned: `return 0;` of a `float` becomes `return 0.0;`.
    fn convert_returned(&mut self, tokens: &[Token], at: usize) {
        let number = match &tokens[at + 1..] {
            [number, end, ..] if end.is(";") => Some((at + 1, number)),
            [minus, number, end, ..] if minus.is("-") && end.is(";") => Some((at + 2, number)),
            _ => None,
        };
        let Some((index, number)) = number else { return };
        let is_integer = number.kind == Kind::Number && number.text.bytes().all(|byte| byte.is_ascii_digit());
        let suffix = match self.result.as_deref() {
            Some("float") => ".0",
            Some("uint") => "u",
            _ => return,
        };
        if is_integer {
            let text = format!("{}{suffix}", number.text);
            self.instead.insert(index, vec![Token::new(Kind::Number, text, number.place)]);
        }
    }

    /// `T[](…)`, `T a[] = T[](…)`, `T[] a = …`: counts the elements.
    fn unsized_array(&mut self, tokens: &[Token], at: usize) {
        let value = match &tokens[at + 2..] {
            [open, ..] if open.is("(") => Some(at + 2),
            [equals, ..] if equals.is("=") => Some(at + 3),
            [name, equals, ..] if name.is_word() && equals.is("=") => Some(at + 4),
            _ => None,
        };
        let Some(value) = value else { return };
        let open = (value..tokens.len())
            .take_while(|at| !tokens[*at].is(";"))
            .find(|at| tokens[*at].is("(") || tokens[*at].is("{"));
        let elements = open.and_then(|open| Some(&tokens[open + 1..lex::closing(tokens, open)?]));
        let is_list = tokens.get(value).is_some_and(|first| first.is("(") || first.is("{"))
            || tokens.get(value + 1).is_some_and(|next| next.is("["));
        match elements.filter(|_| is_list) {
            Some(elements) => {
                let count = lex::split_commas(elements).len().to_string();
                self.before.entry(at + 1).or_default().push(Token::new(
                    Kind::Number,
                    count,
                    tokens[at].place,
                ));
            }
            None => self.report(
                tokens[at].place,
                "the length of this array is not known",
                "write it between the brackets",
            ),
        }
    }
}

/// Functions that are defined here when they are used.
pub const POLYFILLED: [&str; 5] = ["isnan", "isinf", "modf", "outerProduct", "matrixCompMult"];
