//! What GLSL writes alike for all types, and naga for some: `==` of structs and arrays, writing to several
//! components of a matrix' column, a `mat2` of a `vec4`. Each becomes a function that is defined for the type.

use std::fmt::Write;
use std::rc::Rc;

use super::builtin;
use super::lazy;
use super::lex::{self, Kind, Token};
use super::rewrite::{Local, Rewriter, tokens_of};
use super::scene::Helper;
use super::statement;
use super::texture_array;
use super::types::Type;

impl Rewriter<'_, '_, '_> {
    fn type_of(&self, tokens: &[Token]) -> Option<Type> {
        let local = |name: &str| {
            self.local(name).map(|local| match local {
                Local::Value(ty) => Some(ty.clone()),
                Local::Texture(..) | Local::Textures(..) => None,
            })
        };
        self.scene.types.of_value(tokens, &local)
    }

    /// Writes `a == b` and `a != b` of structs and arrays as a call.
    pub(super) fn comparison(&mut self, tokens: &[Token], at: usize) -> bool {
        let (start, end) = (statement::place_start(tokens, at), statement::place_end(tokens, at + 1));
        let left = self.type_of(&tokens[start..at]);
        let ty = left.or_else(|| self.type_of(&tokens[at + 1..end]));
        let Some(ty) = ty.filter(|ty| self.scene.types.is_composite(ty) && !ty.is_unsized()) else {
            return false;
        };
        self.define_equality(&ty, &tokens[at]);
        let place = tokens[at].place;
        let call: &[&str] =
            if tokens[at].is("!=") { &["!", "kiln_equal", "("] } else { &["kiln_equal", "("] };
        let from = self.written[start];
        self.out.splice(from..from, tokens_of(call, place));
        self.out.extend(tokens_of(&[","], place));
        self.close(end, &[")"], place);
        true
    }

    /// Defines `kiln_equal` for a type, and before it for the structs it is made of. Arrays in structs are compared
    /// where they are: to naga they differ from those outside, by the distance of their elements.
    fn define_equality(&mut self, ty: &Type, first: &Token) {
        let lengths: Vec<String> = ty.array.iter().map(|length| self.length(length)).collect();
        if !self.scene.compared.insert(format!("{} {lengths:?}", ty.name)) {
            return;
        }
        let parts: Vec<(String, Type)> = if ty.array.is_empty() {
            let members = self.scene.types.members.get(&ty.name).cloned().unwrap_or_default();
            members.into_iter().map(|(name, ty)| (format!(".{name}"), ty)).collect()
        } else {
            vec![(String::new(), ty.clone())]
        };
        let array: String = lengths.iter().rev().map(|length| format!("[{length}]")).collect();
        let mut text = String::new();
        let _ = writeln!(text, "bool kiln_equal({0}{array} a, {0}{array} b) {{", ty.name);
        for (mut part, ty) in parts {
            for (depth, length) in ty.array.iter().enumerate() {
                let length = self.length(length);
                let _ = writeln!(text, "for (int i{depth} = 0; i{depth} < int({length}); i{depth}++)");
                part.push_str(&format!("[i{depth}]"));
            }
            let element = Type { array: Vec::new(), ..ty };
            if self.scene.types.is_composite(&element) {
                self.define_equality(&element, first);
                let _ = writeln!(text, "if (!kiln_equal(a{part}, b{part})) return false;");
            } else {
                let _ = writeln!(text, "if (a{part} != b{part}) return false;");
            }
        }
        text.push_str("return true;\n}\n");
        self.scene.helpers.push(Helper { text, place: first.place });
    }

    /// What stands between brackets, as a number where that is known: one type has one text.
    fn length(&self, brackets: &[Token]) -> String {
        let inside = brackets.get(1..brackets.len() - 1).unwrap_or_default();
        match texture_array::value(inside, &self.scene.constants) {
            Some(value) => value.to_string(),
            None => inside.iter().map(|token| format!("{} ", token.text)).collect(),
        }
    }

    /// Writes `m[i].xz = v` and `m[i].xz += v` as a call.
    pub(super) fn column_assignment(&mut self, tokens: &[Token], at: usize) -> bool {
        let place = tokens[at].place;
        let Some([bracket, dot, components]) = at.checked_sub(3).and_then(|from| tokens.get(from..at)) else {
            return false;
        };
        let is_swizzle = components.text.len() > 1
            && ["xyzw", "rgba", "stpq"].iter().any(|set| components.text.chars().all(|c| set.contains(c)));
        if !(bracket.is("]") && dot.is(".") && is_swizzle) {
            return false;
        }
        let start = statement::place_start(tokens, at);
        let Some(open) = lex::opening(tokens, at - 3).filter(|open| *open > start) else { return false };
        let Some(rows) = self.type_of(&tokens[start..open]).and_then(|ty| ty.rows()) else { return false };
        let (swizzle, len) = (Rc::clone(&components.text), components.text.len());
        let written = format!("kiln_set_{swizzle}");
        if self.scene.compared.insert(format!("{written} {rows}")) {
            let text = format!(
                "vec{len} {written}(inout vec{rows} column, vec{len} value) {{ column.{swizzle} = value; return value; }}\n"
            );
            self.scene.helpers.push(Helper { text, place });
        }
        let from = self.written[start];
        self.out.truncate(self.out.len() - 2);
        let column = self.out[from..].to_vec();
        self.out.splice(from..from, tokens_of(&[&written, "("], place));
        self.out.extend(tokens_of(&[","], place));
        let end = statement::value_end(tokens, at + 1);
        if lazy::is_compound(&tokens[at].text) {
            self.out.extend(column);
            let operator = tokens[at].text.trim_end_matches('=').to_owned();
            self.out.extend(tokens_of(&[".", &swizzle, &operator, "("], place));
            self.close(end, &[")", ")"], place);
        } else {
            self.close(end, &[")"], place);
        }
        true
    }

    /// Writes `m[i].y = v`, `m[i].y++` and their like as `m[i][1]`; the dot stands at `at`.
    pub(super) fn column_component(&mut self, tokens: &[Token], at: usize) -> bool {
        let is_step = |token: &Token| token.is("++") || token.is("--");
        let [_, component, next, ..] = &tokens[at..] else { return false };
        let sets = ["xyzw", "rgba", "stpq"];
        let index =
            sets.iter().find_map(|set| set.find(&*component.text)).filter(|_| component.text.len() == 1);
        let (Some(index), Some(close)) = (index, at.checked_sub(1).filter(|close| tokens[*close].is("]")))
        else {
            return false;
        };
        let start = statement::place_start(tokens, at);
        let is_stepped = start.checked_sub(1).is_some_and(|before| is_step(&tokens[before]));
        if !(is_stepped || is_step(next) || lazy::is_assignment(&next.text)) {
            return false;
        }
        let open = lex::opening(tokens, close).filter(|open| *open > start);
        if open.and_then(|open| self.type_of(&tokens[start..open])?.rows()).is_none() {
            return false;
        }
        self.out.extend(tokens_of(&["[", &index.to_string(), "]"], component.place));
        self.instead.insert(at + 1, Vec::new());
        true
    }

    /// The function to call for a `mat2` of one argument that may be a `vec4`, which naga does not take.
    pub(super) fn matrix_of_vector(&mut self, tokens: &[Token], at: usize) -> Option<Token> {
        if !is_matrix_of_one(tokens, at) {
            return None;
        }
        let close = lex::closing(tokens, at + 1)?;
        if self.type_of(&tokens[at + 2..close]).is_some_and(|ty| !ty.name.eq_ignore_ascii_case("vec4")) {
            return None;
        }
        self.scene.polyfills.entry("mat2").or_insert(tokens[at].place);
        Some(Token::new(Kind::Word, "kiln_mat2", tokens[at].place))
    }
}

/// Whether a `mat2` of one argument that is no literal stands at `at`.
pub fn is_matrix_of_one(tokens: &[Token], at: usize) -> bool {
    let Some(close) =
        Some(at).filter(|at| builtin::is_mat2(&tokens[*at].text)).and_then(|at| lex::closing(tokens, at + 1))
    else {
        return false;
    };
    let argument = &tokens[at + 2..close];
    lex::split_commas(argument).len() == 1 && argument.iter().any(Token::is_word)
}
