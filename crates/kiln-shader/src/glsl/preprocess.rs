//! The preprocessor: directives decided, includes joined, macros expanded.

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use std::sync::Arc;

use kiln_diagnostic::Diagnostic;

use super::lex::{self, Kind, OpenComment, Token};
use super::macros::{Macro, Macros};
use super::source::{Place, Sources};
use super::{condition, extension, include};
use crate::Program;
use crate::limits;

/// Deepest chain of includes.
const INCLUDE_DEPTH_MAX: usize = 64;
/// What begins the macro of a feature: `sheen` is `FEATURE_SHEEN`.
const FEATURE_PREFIX: &str = "FEATURE_";
/// Versions of the language that are read, by what `#version` says.
const VERSIONS: [i64; 17] =
    [100, 110, 120, 130, 140, 150, 300, 310, 320, 330, 400, 410, 420, 430, 440, 450, 460];

/// What the preprocessor makes of a root.
#[derive(Debug, Default)]
pub struct Preprocessed {
    /// All tokens that are left.
    pub tokens: Vec<Token>,
    /// `vertex` of `#pragma shader_stage(vertex)`.
    pub stage: Option<Token>,
    /// Features that the loaded files name.
    pub features: BTreeSet<String>,
}

/// Preprocesses the file `root` with all it includes; what is wrong is left in `sources`.
pub fn preprocess(
    sources: &mut Sources<'_, '_>,
    root: usize,
    program: &Program,
    features: &BTreeSet<String>,
) -> Preprocessed {
    let mut preprocessor = Preprocessor {
        sources,
        program,
        features,
        macros: Macros::default(),
        out: Preprocessed::default(),
        run: Vec::new(),
        stack: Vec::new(),
        once: BTreeSet::new(),
        conditions: Vec::new(),
        stopped: false,
    };
    preprocessor.predefine(root);
    for path in &program.prelude {
        preprocessor.prelude(path);
    }
    preprocessor.file(root);
    preprocessor.out
}

/// An `#if` that is open.
struct Condition {
    /// Its line.
    place: Place,
    /// Whether what stands here is kept.
    active: bool,
    /// Whether a branch was kept before, or none can be, because the surroundings are not.
    settled: bool,
    /// Whether `#else` was seen.
    ended: bool,
}

struct Preprocessor<'p, 's, 'r> {
    sources: &'p mut Sources<'s, 'r>,
    program: &'p Program,
    features: &'p BTreeSet<String>,
    macros: Macros,
    out: Preprocessed,
    /// Text since the last directive, not yet expanded.
    run: Vec<Token>,
    /// Paths of files that are open, root first.
    stack: Vec<String>,
    /// Paths that said `#pragma once`.
    once: BTreeSet<String>,
    /// Open conditions of the file that is read.
    conditions: Vec<Condition>,
    /// Set when a limit is passed: what follows would only repeat it.
    stopped: bool,
}

impl Preprocessor<'_, '_, '_> {
    fn error(&mut self, place: Place, message: impl Into<String>) {
        let diagnostic = self.sources.error(place, message);
        self.sources.diagnostics.push(diagnostic);
    }

    fn error_with_help(&mut self, place: Place, message: impl Into<String>, help: impl Into<String>) {
        let diagnostic = self.sources.error(place, message).with_help(help);
        self.sources.diagnostics.push(diagnostic);
    }

    fn predefine(&mut self, root: usize) {
        let text = Arc::clone(&self.sources.files[root].text);
        let (version, is_es) = version_of(&lex::tokenize(root, &text).unwrap_or_default());
        let mut defines: Vec<(String, String)> = vec![("__VERSION__".to_owned(), version)];
        let switches: &[&str] =
            if is_es { &["GL_ES", "GL_FRAGMENT_PRECISION_HIGH"] } else { &["GL_core_profile"] };
        let switches = switches.iter().chain(&extension::ACCEPTED).map(|name| (*name).to_owned());
        let features = self.features.iter().map(|name| format!("{FEATURE_PREFIX}{}", upper(name)));
        defines
            .extend(switches.chain(features).chain(["KILN".to_owned()]).map(|name| (name, "1".to_owned())));
        defines.extend(self.program.defines.iter().cloned());
        for (name, value) in defines {
            let mut body = lex::tokenize(root, &value).unwrap_or_default();
            // Nobody's file has these tokens: they point at nothing until they are used.
            body.iter_mut().for_each(|token| token.place = Place { file: root, start: 0, end: 0 });
            self.macros.definitions.insert(Rc::from(name), Macro { parameters: None, body });
        }
    }

    fn prelude(&mut self, path: &str) {
        match self.sources.look_up(path) {
            Some(text) => {
                let index = self.sources.add(path, text, None);
                self.file(index);
            }
            None => {
                let message = format!("library `{path}` does not exist");
                self.sources.diagnostics.push(Diagnostic::error(message).in_file(path));
            }
        }
    }

    /// Reads a whole file.
    fn file(&mut self, index: usize) {
        let file = &self.sources.files[index];
        let (path, text) = (file.path.clone(), Arc::clone(&file.text));
        let tokens = match lex::tokenize(index, &text) {
            Ok(tokens) => tokens,
            Err(OpenComment(at)) => {
                return self.error(Place { file: index, start: at, end: at + 2 }, "`/*` is never closed");
            }
        };
        self.out.features.extend(features_in(&tokens));
        let starts = text.match_indices('\n').map(|(at, _)| at + 1);
        self.macros.line_starts.insert(index, std::iter::once(0).chain(starts).collect());
        self.stack.push(path);
        let outer = std::mem::take(&mut self.conditions);
        let mut at = 0;
        while at < tokens.len() && !self.stopped {
            let token = &tokens[at];
            if token.starts_line && token.is("#") {
                let rest = &tokens[at + 1..];
                let len = rest.iter().position(|token| token.starts_line).unwrap_or(rest.len());
                self.directive(token, &rest[..len], &text);
                at += len + 1;
            } else {
                if self.is_active() {
                    self.run.push(token.clone());
                }
                at += 1;
            }
        }
        self.flush();
        if let Some(open) = std::mem::replace(&mut self.conditions, outer).pop() {
            self.error(open.place, "this condition has no `#endif`");
        }
        self.stack.pop();
    }

    fn is_active(&self) -> bool {
        self.conditions.last().is_none_or(|condition| condition.active)
    }

    /// Expands the text before a directive, with the definitions of that point.
    fn flush(&mut self) {
        let run = std::mem::take(&mut self.run);
        let expanded = self.expand(&run);
        self.out.tokens.extend(expanded);
    }

    fn expand(&mut self, tokens: &[Token]) -> Vec<Token> {
        match self.macros.expand(tokens) {
            Ok(expanded) => {
                let pasted = std::mem::take(&mut self.macros.pasted);
                let names = pasted.iter().filter_map(|name| name.strip_prefix(FEATURE_PREFIX));
                self.out.features.extend(names.map(str::to_ascii_lowercase));
                expanded
            }
            Err(fault) => {
                self.error(fault.place, fault.message);
                self.stopped |= self.macros.is_exhausted();
                Vec::new()
            }
        }
    }

    /// `hash` is the `#`, `line` what follows it in the same line.
    fn directive(&mut self, hash: &Token, line: &[Token], text: &str) {
        let Some(name) = line.first() else { return };
        let rest = &line[1..];
        let place = hash.place.to(name.place);
        match &*name.text {
            "if" | "ifdef" | "ifndef" => self.open(name, rest, place),
            "elif" => self.other_branch(name, Some(rest), place),
            "else" => self.other_branch(name, None, place),
            "endif" => {
                if self.is_active() {
                    self.flush();
                }
                if self.conditions.pop().is_none() {
                    self.error(place, "`#endif` without an `#if` before it");
                }
            }
            _ if !self.is_active() => {}
            _ => {
                self.flush();
                self.active_directive(name, rest, place, text);
            }
        }
    }

    fn active_directive(&mut self, name: &Token, rest: &[Token], place: Place, text: &str) {
        let whole = rest.last().map_or(place, |last| place.to(last.place));
        match &*name.text {
            "define" => self.define(rest, place),
            "undef" => match rest.first() {
                Some(name) if name.is_word() => {
                    self.macros.definitions.remove(&name.text);
                }
                _ => self.error(place, "`#undef` names a macro"),
            },
            "include" => self.include(name, text),
            "error" => {
                let said = text[name.place.end..whole.end.max(name.place.end)].trim().to_owned();
                self.error(whole, format!("#error: {said}"));
            }
            "version" => self.version(rest, whole),
            "extension" => self.extension(rest, whole),
            "pragma" => self.pragma(rest),
            // Diagnostics point at the file that is really there.
            "line" => {}
            other => {
                let known = ["define", "include", "ifdef", "ifndef", "endif", "pragma", "extension", "error"];
                let message = format!("unknown directive `#{other}`");
                match crate::suggest::closest(other, known.into_iter()) {
                    Some(name) => self.error_with_help(place, message, format!("did you mean `#{name}`?")),
                    None => self.error(place, message),
                }
            }
        }
    }

    fn open(&mut self, name: &Token, rest: &[Token], place: Place) {
        let active = self.is_active();
        let holds = active && {
            self.flush();
            match (&*name.text, rest) {
                ("if", _) => self.evaluate(rest, place),
                (_, [macro_name, ..]) if macro_name.is_word() => {
                    self.macros.definitions.contains_key(&macro_name.text) == name.is("ifdef")
                }
                _ => {
                    self.error(place, format!("`#{}` names a macro", name.text));
                    false
                }
            }
        };
        self.conditions.push(Condition { place, active: holds, settled: holds || !active, ended: false });
    }

    /// `#elif` with its condition, or `#else`.
    fn other_branch(&mut self, name: &Token, condition: Option<&[Token]>, place: Place) {
        if self.is_active() {
            self.flush();
        }
        let Some(open) = self.conditions.last_mut() else {
            return self.error(place, format!("`#{}` without an `#if` before it", name.text));
        };
        if std::mem::replace(&mut open.ended, condition.is_none()) {
            return self.error(place, format!("`#{}` after `#else`", name.text));
        }
        let open_before = !std::mem::replace(&mut open.active, false) && !open.settled;
        let holds = open_before && condition.is_none_or(|condition| self.evaluate(condition, place));
        if let Some(open) = self.conditions.last_mut() {
            open.active = holds;
            open.settled |= holds;
        }
    }

    fn evaluate(&mut self, tokens: &[Token], place: Place) -> bool {
        let tokens = self.without_defined(tokens);
        let expanded = self.expand(&tokens);
        if self.stopped {
            return false;
        }
        match condition::evaluate(&expanded) {
            Ok(value) => value != 0,
            Err(fault) => {
                let place = expanded.get(fault.at).map_or(place, |token| token.place);
                self.error(place, fault.message);
                false
            }
        }
    }

    /// Replaces `defined X` and `defined(X)` by 1 or 0: their operand is not expanded.
    fn without_defined(&self, tokens: &[Token]) -> Vec<Token> {
        let mut out = Vec::new();
        let mut at = 0;
        while at < tokens.len() {
            let (name, len) = match &tokens[at..] {
                [word, open, name, close, ..] if word.is("defined") && open.is("(") && close.is(")") => {
                    (Some(name), 4)
                }
                [word, name, ..] if word.is("defined") && name.is_word() => (Some(name), 2),
                _ => (None, 1),
            };
            out.push(match name {
                Some(name) => {
                    let value = i64::from(self.macros.definitions.contains_key(&name.text));
                    Token::new(Kind::Number, value.to_string(), name.place)
                }
                None => tokens[at].clone(),
            });
            at += len;
        }
        out
    }

    fn define(&mut self, rest: &[Token], place: Place) {
        let Some(name) = rest.first().filter(|name| name.is_word()) else {
            return self.error(place, "`#define` names a macro");
        };
        if ["defined", "__LINE__", "__FILE__", "__VERSION__"].iter().any(|word| name.is(word)) {
            return self.error(name.place, format!("`{}` cannot be defined", name.text));
        }
        let mut body = &rest[1..];
        let mut parameters = None;
        if body.first().is_some_and(|token| token.is("(") && !token.spaced) {
            let Some(close) = body.iter().position(|token| token.is(")")) else {
                return self.error(name.place, "the parameters of this macro have no end");
            };
            let names = lex::split_commas(&body[1..close]);
            if let Some(wrong) = names.iter().find(|name| name.len() != 1 || !name[0].is_word()) {
                let place = wrong.first().map_or(name.place, |token| token.place);
                return self.error(place, "parameters of a macro are names, separated by commas");
            }
            parameters = Some(names.iter().map(|name| Rc::clone(&name[0].text)).collect());
            body = &body[close + 1..];
        }
        if let Some(mark) = body.first().into_iter().chain(body.last()).find(|token| token.is("##")) {
            return self.error(mark.place, "`##` stands between two tokens");
        }
        let new = Macro { parameters, body: body.to_vec() };
        let known = self.macros.definitions.get(&name.text);
        if known.is_some_and(|known| !known.equals(&new)) {
            let message = format!("macro `{}` is defined already, as something else", name.text);
            let help = format!("write `#undef {0}` first, or `#ifndef {0}` around", name.text);
            return self.error_with_help(name.place, message, help);
        }
        self.macros.definitions.insert(Rc::clone(&name.text), new);
    }

    fn include(&mut self, word: &Token, text: &str) {
        let after = word.place.end;
        let skipped = text[after..].len() - text[after..].trim_start_matches([' ', '\t']).len();
        let start = after + skipped;
        let Some((name, quotes, len)) = include::parse(&text[start..]) else {
            return self.error_with_help(
                word.place,
                "`#include` without a file name",
                "write `#include \"file.glsl\"` or `#include <file.glsl>`",
            );
        };
        let place = Place { file: word.place.file, start, end: start + len };
        let includer = self.sources.files[word.place.file].path.clone();
        let candidates = include::candidates(&includer, name, quotes, &self.program.include_dirs);
        if candidates.is_empty() {
            return self.error(place, format!("`{name}` names no file inside the project"));
        }
        for candidate in &candidates {
            if let Some(text) = self.sources.look_up(candidate) {
                return self.include_file(candidate, text, place);
            }
        }
        let diagnostic = self
            .sources
            .error(place, format!("included file `{name}` was not found"))
            .with_note(format!("searched: {}", candidates.join(", ")))
            .with_help("create one of these, or correct the name");
        self.sources.diagnostics.push(diagnostic);
    }

    fn include_file(&mut self, path: &str, text: Arc<str>, place: Place) {
        if self.once.contains(path) {
            return;
        }
        if let Some(start) = self.stack.iter().position(|open| open == path) {
            let guard = guard_of(&text);
            if guard.is_some_and(|guard| self.macros.definitions.contains_key(&*guard)) {
                return;
            }
            let mut chain = self.stack[start..].to_vec();
            chain.push(path.to_owned());
            let message = format!("files include each other: {}", chain.join(" → "));
            return self.error_with_help(place, message, "write `#pragma once` at the top of each");
        }
        let too_deep = self.stack.len() >= INCLUDE_DEPTH_MAX;
        if too_deep || self.sources.files.len() >= limits::MODULE_COUNT_MAX {
            let (what, limit) =
                if too_deep { ("deep", INCLUDE_DEPTH_MAX) } else { ("often", limits::MODULE_COUNT_MAX) };
            self.error(place, format!("files are included too {what}, the limit is {limit}"));
            self.stopped = true;
            return;
        }
        let index = self.sources.add(path, text, Some(place));
        self.file(index);
    }

    fn version(&mut self, rest: &[Token], place: Place) {
        let number = rest.first().and_then(|token| condition::integer(&token.text));
        if !number.is_some_and(|number| VERSIONS.contains(&number)) {
            self.error_with_help(
                place,
                "this is no version of GLSL",
                "write `#version 450`, or another from 330 to 460, or `#version 300 es`",
            );
        }
    }

    fn extension(&mut self, rest: &[Token], place: Place) {
        let (name, behaviour) = match rest {
            [name, colon, behaviour] if name.is_word() && colon.is(":") => (name, &*behaviour.text),
            _ => return self.error(place, "write `#extension NAME : require`"),
        };
        if !["require", "enable", "warn", "disable"].contains(&behaviour) {
            return self.error(place, format!("`{behaviour}` is none of require, enable, warn and disable"));
        }
        let is_known = name.is("all") || extension::ACCEPTED.contains(&&*name.text);
        if behaviour == "disable" || is_known {
            return;
        }
        if let Some(help) = extension::replacement(&name.text) {
            let message = format!("extension `{}` is not supported", name.text);
            return self.error_with_help(name.place, message, help);
        }
        let message = format!("extension `{}` is not known", name.text);
        if behaviour == "require" {
            let close = crate::suggest::closest(&name.text, extension::ACCEPTED.into_iter());
            let mut diagnostic = self.sources.error(name.place, message);
            diagnostic.help = close.map(|name| format!("did you mean `{name}`?"));
            self.sources.diagnostics.push(diagnostic);
        } else {
            let diagnostic = self.sources.warning(name.place, message);
            self.sources.diagnostics.push(diagnostic);
        }
    }

    fn pragma(&mut self, rest: &[Token]) {
        match rest {
            [once] if once.is("once") => self.once.extend(self.stack.last().cloned()),
            [word, open, stage, close] if word.is("shader_stage") && open.is("(") && close.is(")") => {
                self.out.stage = Some(stage.clone());
            }
            // Other pragmas are for other compilers.
            _ => {}
        }
    }
}

/// What `#version` at the beginning says: its number as text, and whether it is the embedded profile.
fn version_of(tokens: &[Token]) -> (String, bool) {
    let line = tokens.windows(3).find(|line| line[0].starts_line && line[0].is("#") && line[1].is("version"));
    let Some([_, word, number]) = line else { return ("110".to_owned(), false) };
    let after = tokens
        .iter()
        .find(|token| token.place.start >= number.place.end && token.place.file == word.place.file);
    let profile = after.is_some_and(|token| token.is("es") && !token.starts_line);
    (number.text.to_string(), profile || number.is("100"))
}

/// The macro that guards a file which begins with `#ifndef`.
fn guard_of(text: &str) -> Option<Rc<str>> {
    match &lex::tokenize(0, text).ok()?[..] {
        [hash, word, name, ..] if hash.is("#") && word.is("ifndef") => Some(Rc::clone(&name.text)),
        _ => None,
    }
}

fn upper(name: &str) -> String {
    name.to_ascii_uppercase()
}

/// Features that the text of `file` names under any condition.
pub fn named_features(file: usize, text: &str) -> BTreeSet<String> {
    features_in(&lex::tokenize(file, text).unwrap_or_default())
}

/// Features that conditions name, or macros that conditions may use. Elsewhere the author may call what he likes so.
fn features_in(tokens: &[Token]) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for line in tokens.chunk_by(|_, next| !next.starts_line) {
        let words = match line {
            [hash, word, rest @ ..] if hash.is("#") => match &*word.text {
                "if" | "elif" | "ifdef" | "ifndef" => rest,
                "define" => rest.get(1..).unwrap_or_default(),
                _ => continue,
            },
            _ => continue,
        };
        let names = words.iter().filter_map(|token| token.text.strip_prefix(FEATURE_PREFIX));
        found.extend(names.filter(|name| !name.is_empty()).map(str::to_ascii_lowercase));
    }
    found
}

/// Names of files that the text of `file` includes under any condition, with how they are spelled.
pub fn included_names(file: usize, text: &str) -> Vec<(String, include::Quotes)> {
    let tokens = lex::tokenize(file, text).unwrap_or_default();
    let mut names = BTreeMap::new();
    for pair in tokens.windows(2) {
        if pair[0].starts_line && pair[0].is("#") && pair[1].is("include") {
            let rest = text[pair[1].place.end..].trim_start_matches([' ', '\t']);
            if let Some((name, quotes, _)) = include::parse(rest) {
                names.insert(pair[1].place.start, (name.to_owned(), quotes));
            }
        }
    }
    names.into_values().collect()
}
