//! Uses of combined textures in expressions: both parts for a function of the author's, joined for GLSL's own.

use std::rc::Rc;

use super::builtin::{self, Combined};
use super::declare;
use super::lex::{self, Token};
use super::rewrite::{Local, Rewriter, tokens_of};
use super::scene::{Helper, Meaning};
use super::texture_array;

/// Names of a texture and its sampler.
pub type Parts = [String; 2];

/// The parts of the elements of the texture array `name`, by what names their samplers.
pub fn elements(name: &str, count: usize, sampler: impl Fn(&str) -> String) -> Vec<Parts> {
    let names = (0..count).map(|index| texture_array::element_name(name, index));
    names.map(|texture| [texture.clone(), sampler(&texture)]).collect()
}

fn joined(elements: &[Parts]) -> Vec<&str> {
    let mut texts = Vec::new();
    for [texture, sampler] in elements {
        texts.extend([texture, ",", sampler, ","]);
    }
    texts.pop();
    texts
}

impl Rewriter<'_, '_, '_> {
    /// A parameter of the combined type at `at`: two for each texture.
    pub(super) fn texture_parameter(&mut self, kept: &[Token], at: usize, combined: &Combined) -> Vec<Token> {
        let (ty, rest) = (&kept[at], &kept[at + 1..]);
        let of_type = declare::array_len(rest);
        let name = rest.get(of_type).filter(|name| name.is_word());
        let (text, place) = (name.map_or("unused", |name| &*name.text), name.unwrap_or(ty).place);
        let array = [&rest[..of_type], rest.get(of_type + 1..).unwrap_or_default()].concat();
        let sampler = |texture: &str| format!("{texture}_sampler");
        let (elements, local) = if array.is_empty() {
            let parts = [text.to_owned(), sampler(text)];
            (vec![parts.clone()], Local::Texture(combined.clone(), parts[1].clone()))
        } else {
            let count = texture_array::count(text, &array, &self.scene.constants).unwrap_or_else(
                |(message, help)| {
                    self.report(place, message, help);
                    0
                },
            );
            let elements = elements(text, count, sampler);
            (elements.clone(), Local::Textures(combined.clone(), elements))
        };
        if let Some(name) = name {
            self.declare(&name.text, local);
        }
        let mut texts = Vec::new();
        for [texture, sampler] in &elements {
            texts.extend([&*combined.texture, texture, ",", combined.sampler, sampler, ","]);
        }
        texts.pop();
        tokens_of(&texts, place)
    }

    /// What is called with the tokens `at..=end` as one argument.
    fn callee(&self, tokens: &[Token], at: usize, end: usize) -> Option<Rc<str>> {
        let is_argument =
            at.checked_sub(1).is_some_and(|before| ["(", ","].iter().any(|mark| tokens[before].is(mark)))
                && tokens.get(end + 1).is_some_and(|next| [")", ","].iter().any(|mark| next.is(mark)));
        self.calls.last().cloned().flatten().filter(|_| is_argument)
    }

    /// A combined texture.
    pub(super) fn texture(&mut self, tokens: &[Token], at: usize, combined: &Combined, sampler: &str) {
        if tokens.get(at + 1).is_some_and(|next| next.is("[")) {
            let message = format!("`{}` is no array", tokens[at].text);
            return self.report(
                tokens[at].place,
                message,
                "leave out the brackets, or declare it with a length",
            );
        }
        let parts = [tokens[at].text.to_string(), sampler.to_owned()];
        self.texture_argument(tokens, at, at, combined, &parts);
    }

    /// The texture that the tokens `at..=end` name, as an argument.
    fn texture_argument(
        &mut self,
        tokens: &[Token],
        at: usize,
        end: usize,
        combined: &Combined,
        parts: &Parts,
    ) {
        let place = tokens[at].place.to(tokens[end].place);
        let [texture, sampler] = parts;
        match self.callee(tokens, at, end) {
            None => self.report(
                place,
                format!("the texture `{}` has no value", tokens[at].text),
                "pass it to a function, as in `texture(name, uv)`",
            ),
            Some(callee) if self.scene.textured.contains(&callee) => {
                self.out.extend(tokens_of(&[texture, ",", sampler], place));
            }
            Some(_) => {
                self.out.extend(tokens_of(&[&combined.constructor, "(", texture, ",", sampler, ")"], place));
            }
        }
    }

    /// An array of combined textures: one of them, all, or their number.
    pub(super) fn textures(&mut self, tokens: &[Token], at: usize, combined: &Combined, elements: &[Parts]) {
        let (name, place) = (&tokens[at].text, tokens[at].place);
        let rest = &tokens[at + 1..];
        if rest.len() > 3 && rest[0].is(".") && rest[1].is("length") && rest[2].is("(") && rest[3].is(")") {
            self.out.extend(tokens_of(&[&elements.len().to_string()], place));
            return self.leave_out(at + 1, at + 4);
        }
        let Some(close) = rest.first().filter(|next| next.is("[")).and_then(|_| lex::closing(tokens, at + 1))
        else {
            let callee = self.callee(tokens, at, at).filter(|callee| self.scene.textured.contains(callee));
            if callee.is_some() {
                return self.out.extend(tokens_of(&joined(elements), place));
            }
            return self.report(
                place,
                format!("the texture array `{name}` has no value"),
                "use an element, as in `texture(name[0], uv)`, or pass it to a function",
            );
        };
        let index = &tokens[at + 2..close];
        let place = place.to(tokens[close].place);
        match self.constant(index) {
            Some(value) => match usize::try_from(value).ok().and_then(|value| elements.get(value)) {
                Some(parts) => self.texture_argument(tokens, at, close, combined, parts),
                None => self.report(
                    place,
                    format!("`{name}` has no element {value}"),
                    format!("its elements are 0 … {}", elements.len().saturating_sub(1)),
                ),
            },
            None => self.report(
                place,
                format!("an element of `{name}` is chosen while the shader runs, and passed to a function of yours"),
                "pass the array and the index, and choose where the texture is read",
            ),
        }
        self.leave_out(at + 1, close);
    }

    fn leave_out(&mut self, first: usize, last: usize) {
        (first..=last).for_each(|at| drop(self.instead.insert(at, Vec::new())));
    }

    /// The value of an expression of literals and constants that no local hides.
    fn constant(&self, tokens: &[Token]) -> Option<i64> {
        let hidden = tokens.iter().any(|token| token.is_word() && self.local(&token.text).is_some());
        texture_array::value(tokens, &self.scene.constants).filter(|_| !hidden)
    }

    /// The combined texture that an argument names, or makes, if it begins with `word`.
    pub(super) fn combined(&self, word: &str) -> Option<Combined> {
        match self.local(word) {
            Some(Local::Texture(combined, _) | Local::Textures(combined, _)) => Some(combined.clone()),
            Some(Local::Value(_)) => None,
            None => match self.scene.meanings.get(word) {
                Some(Meaning::Texture(combined, _) | Meaning::Textures(combined, _)) => {
                    Some(combined.clone())
                }
                _ => builtin::combined(word),
            },
        }
    }

    /// Whether the lookup `name`, whose arguments stand at `first..close`, compares with a reference: WGSL has that at the first
    /// level or at one of its own choice.
    pub(super) fn is_comparison(&mut self, tokens: &[Token], name: &str, first: usize, close: usize) -> bool {
        let combined = tokens.get(first).and_then(|word| self.combined(&word.text));
        if combined.is_none_or(|combined| combined.sampler != "samplerShadow") {
            return false;
        }
        let arguments = lex::split_commas(&tokens[first..close]);
        let is_first = |level: &[Token]| matches!(level, [number] if number.text.trim_end_matches(['f', 'F']).parse() == Ok(0.0_f32));
        let chooses = match texture_array::lookup(name) {
            Some("textureLod") => arguments.get(2).is_some_and(|level| !is_first(level)),
            lookup => lookup == Some("textureGrad"),
        };
        if chooses {
            let message = format!("`{name}` of a shadow sampler reads level 0");
            let help = "shadow maps with levels cannot be compared at a chosen one: write `0.0`, or `texture` in a fragment stage";
            let warning = self.sources.warning(tokens[first].place, message).with_help(help);
            self.sources.diagnostics.push(warning);
        }
        true
    }

    /// Rounds the layer among the coordinates of the lookup `name`, whose arguments stand at `first..close`: naga cuts its
    /// fraction off.
    pub(super) fn round_layer(&mut self, tokens: &[Token], name: &str, first: usize, close: usize) {
        if !["texture", "textureLod", "textureGrad"].map(Some).contains(&texture_array::lookup(name)) {
            return;
        }
        let combined = self.combined(&tokens[first].text);
        let function = match combined.as_ref().and_then(|combined| combined.texture.split_once("texture")) {
            Some((_, "2DArray")) => "layer",
            Some((_, "CubeArray")) => "cube_layer",
            _ => return,
        };
        let arguments = lex::split_commas(&tokens[first..close]);
        let [texture, coordinates, ..] = arguments[..] else { return };
        let place = tokens[first].place;
        let start = first + texture.len() + 1;
        self.scene.polyfills.entry(function).or_insert(place);
        let written = format!("kiln_{function}");
        self.before.entry(start).or_default().extend(tokens_of(&[&written, "("], place));
        self.close(start + coordinates.len(), &[")"], place);
    }

    /// The function to call instead of `name`, if the texture at `at` is an element whose index is not constant: it
    /// takes all elements and the index. `close` is the end of the call.
    pub(super) fn selected(
        &mut self,
        tokens: &[Token],
        name: &str,
        at: usize,
        close: usize,
    ) -> Option<String> {
        let (combined, elements) = match self.local(&tokens[at].text) {
            Some(Local::Textures(combined, elements)) => (combined.clone(), elements.clone()),
            Some(_) => return None,
            None => match self.scene.meanings.get(&*tokens[at].text) {
                Some(Meaning::Textures(combined, elements)) => (combined.clone(), elements.clone()),
                _ => return None,
            },
        };
        let end =
            tokens.get(at + 1).filter(|next| next.is("[")).and_then(|_| lex::closing(tokens, at + 1))?;
        if self.constant(&tokens[at + 2..end]).is_some() || elements.is_empty() {
            return None;
        }
        let offset = texture_array::offset_argument(name);
        let offset =
            offset.and_then(|wanted| self.take_offset(tokens, at, close, wanted)).unwrap_or_default();
        let count = elements.len();
        let key = format!("{name} {} {count} {offset}", combined.constructor);
        let written = match self.scene.selectors.get(&key) {
            Some(written) => written.clone(),
            None => {
                let number = self.scene.selectors.len();
                let written = format!("kiln_{number}_{name}");
                let stage = self.scene.stage;
                let text = texture_array::selector(&written, name, &combined, count, stage, &offset)?;
                let place = tokens[at].place;
                self.scene.helpers.push(Helper { text, place });
                self.scene.selectors.insert(key, written.clone());
                written
            }
        };
        let place = tokens[at].place;
        let mut first = tokens_of(&joined(&elements), place);
        first.extend(tokens_of(&[",", "int"], place));
        self.instead.insert(at, first);
        self.instead.insert(at + 1, tokens_of(&["("], place));
        self.instead.insert(end, tokens_of(&[")"], place));
        Some(written)
    }

    /// Takes argument `wanted` out of a call, whose arguments stand at `first..close`; it must be constant.
    fn take_offset(&mut self, tokens: &[Token], first: usize, close: usize, wanted: usize) -> Option<String> {
        let arguments = lex::split_commas(&tokens[first..close]);
        let start = first + arguments.iter().take(wanted).map(|argument| argument.len() + 1).sum::<usize>();
        let argument = *arguments.get(wanted)?;
        let is_known = |token: &Token| {
            let is_constant =
                self.scene.constants.contains_key(&token.text) && self.local(&token.text).is_none();
            !token.is_word() || is_constant || builtin::is_value_type(&token.text)
        };
        if !argument.iter().all(is_known) {
            let message = "the offset of this lookup is not constant";
            self.report(argument[0].place, message, "write literals, as in `ivec2(1, 0)`");
        }
        self.leave_out(start - 1, start + argument.len() - 1);
        Some(argument.iter().map(|token| format!("{} ", token.text)).collect())
    }
}
