//! One module: its imports, directives and the names it declares, found on tokens.

use std::ops::Range;

use kiln_diagnostic::Diagnostic;

use crate::token::{Kind, Token};

/// A name and where it stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Name {
    /// The name.
    pub name: String,
    /// Its bytes in the module.
    pub range: Range<usize>,
}

/// `import a::b::{x, y};`
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Import {
    /// Module path, as `["lib", "brdf"]`; may start with `package` or `super`.
    pub path: Vec<String>,
    /// Bytes of the path.
    pub path_range: Range<usize>,
    /// What is imported from it.
    pub items: Vec<Name>,
    /// Bytes of the whole statement.
    pub range: Range<usize>,
}

/// What the linker needs to know of a module.
#[derive(Clone, Debug, Default)]
pub struct Outline {
    /// Imports in source order.
    pub imports: Vec<Import>,
    /// `enable`, `requires` and `diagnostic` directives: linked text must start with them.
    pub directives: Vec<Range<usize>>,
    /// Names declared at module scope, in source order.
    pub declarations: Vec<Name>,
}

/// Outlines a module from the tokens that its conditions keep. What it does not understand it leaves to
/// naga, which explains better.
pub fn outline(file: &str, text: &str, tokens: &[Token], diagnostics: &mut Vec<Diagnostic>) -> Outline {
    let mut parser = Parser { file, text, tokens, at: 0 };
    let mut outline = Outline::default();
    let mut declared_before = false;
    while parser.at < tokens.len() {
        parser.skip_attributes();
        let start = parser.at;
        match parser.word() {
            Some("import") => match parser.import(declared_before) {
                Ok(import) => outline.imports.push(import),
                Err(diagnostic) => {
                    diagnostics.push(*diagnostic);
                    parser.at = start;
                    parser.skip_past(';');
                }
            },
            Some("enable" | "requires" | "diagnostic") => {
                parser.skip_past(';');
                outline.directives.push(parser.bytes_since(start));
            }
            Some(keyword) => {
                declared_before = true;
                outline.declarations.extend(parser.declared_name(keyword));
                parser.skip_declaration();
            }
            None => parser.at += 1,
        }
    }
    outline
}

struct Parser<'a> {
    file: &'a str,
    text: &'a str,
    tokens: &'a [Token],
    at: usize,
}

type Fault = Box<Diagnostic>;

impl<'a> Parser<'a> {
    fn is(&self, mark: char) -> bool {
        self.tokens.get(self.at).is_some_and(|token| token.is(mark))
    }

    fn is_path_separator(&self) -> bool {
        let next = self.tokens.get(self.at + 1);
        self.is(':') && next.is_some_and(|token| token.is(':'))
    }

    fn word_at(&self, at: usize) -> Option<&'a str> {
        let token = self.tokens.get(at).filter(|token| token.kind == Kind::Word)?;
        Some(&self.text[token.range()])
    }

    fn word(&self) -> Option<&'a str> {
        self.word_at(self.at)
    }

    fn bytes_since(&self, start: usize) -> Range<usize> {
        let last = self.at.clamp(start + 1, self.tokens.len()) - 1;
        self.tokens[start].start..self.tokens[last].end
    }

    fn fault(&self, message: impl Into<String>) -> Fault {
        let end = self.text.len();
        let range = self.tokens.get(self.at).map_or(end..end, Token::range);
        Box::new(Diagnostic::error(message).at(self.file, self.text, range))
    }

    fn skip_past(&mut self, mark: char) {
        while self.at < self.tokens.len() && !self.is(mark) {
            self.at += 1;
        }
        self.at += 1;
    }

    /// Skips `@name` and `@name(…)`.
    fn skip_attributes(&mut self) {
        while self.is('@') {
            self.at += 2;
            if self.is('(') {
                self.skip_brackets();
            }
        }
    }

    /// Skips from an opening bracket past its closing one.
    fn skip_brackets(&mut self) {
        let mut depth = 0_usize;
        while let Some(token) = self.tokens.get(self.at) {
            self.at += 1;
            match token.kind {
                Kind::Mark('(' | '[' | '{') => depth += 1,
                Kind::Mark(')' | ']' | '}') => depth = depth.saturating_sub(1),
                _ => {}
            }
            if depth == 0 {
                return;
            }
        }
    }

    fn skip_declaration(&mut self) {
        while let Some(token) = self.tokens.get(self.at) {
            match token.kind {
                Kind::Mark(';') => {
                    self.at += 1;
                    return;
                }
                Kind::Mark('{') => return self.skip_brackets(),
                Kind::Mark('(' | '[') => self.skip_brackets(),
                _ => self.at += 1,
            }
        }
    }

    fn declared_name(&self, keyword: &str) -> Option<Name> {
        let at = match keyword {
            "fn" | "struct" | "alias" | "const" | "override" => self.at + 1,
            "var" => self.after_template(self.at + 1),
            _ => return None,
        };
        let name = self.word_at(at)?.to_owned();
        Some(Name { name, range: self.tokens[at].range() })
    }

    /// The token after `<…>`, as in `var<storage, read>`.
    fn after_template(&self, at: usize) -> usize {
        if !self.tokens.get(at).is_some_and(|token| token.is('<')) {
            return at;
        }
        let rest = self.tokens.get(at..).unwrap_or_default();
        rest.iter().position(|token| token.is('>')).map_or(at, |len| at + len + 1)
    }

    fn import(&mut self, declared_before: bool) -> Result<Import, Fault> {
        let start = self.at;
        if declared_before {
            return Err(self.fault("imports stand before all declarations"));
        }
        self.at += 1;
        let mut path = vec![self.name("a module path")?];
        let mut items = Vec::new();
        while self.is_path_separator() {
            self.at += 2;
            if self.is('{') {
                items = self.import_list()?;
                break;
            }
            path.push(self.name("a name or `{`")?);
        }
        if items.is_empty() {
            items.extend(path.pop());
        }
        self.refuse_rename()?;
        if !self.is(';') {
            return Err(self.fault("expected `;` after an import"));
        }
        self.at += 1;
        let (Some(first), Some(last)) = (path.first(), path.last()) else {
            self.at = start + 1;
            let fault = self.fault("an import names a module and what it takes from it");
            return Err(Box::new(
                fault.with_help("write `import module::name;` or `import module::{a, b};`"),
            ));
        };
        let path_range = first.range.start..last.range.end;
        let path = path.into_iter().map(|name| name.name).collect();
        Ok(Import { path, path_range, items, range: self.bytes_since(start) })
    }

    fn name(&mut self, what: &str) -> Result<Name, Fault> {
        let name = self.word().ok_or_else(|| self.fault(format!("expected {what} in an import")))?.to_owned();
        let range = self.tokens[self.at].range();
        self.at += 1;
        Ok(Name { name, range })
    }

    fn import_list(&mut self) -> Result<Vec<Name>, Fault> {
        self.at += 1;
        let mut items = Vec::new();
        while !self.is('}') {
            items.push(self.name("a name")?);
            self.refuse_rename()?;
            if self.is_path_separator() {
                let fault = self.fault("nested imports are not supported");
                return Err(Box::new(fault.with_help("write one `import` per module")));
            }
            if self.is(',') {
                self.at += 1;
            } else if !self.is('}') {
                return Err(self.fault("expected `,` or `}` in an import"));
            }
        }
        if items.is_empty() {
            return Err(self.fault("this import takes nothing"));
        }
        self.at += 1;
        Ok(items)
    }

    fn refuse_rename(&self) -> Result<(), Fault> {
        if self.word() != Some("as") {
            return Ok(());
        }
        let fault = self.fault("`as` is not supported: names stay as they are");
        Err(Box::new(fault.with_help("rename the declaration itself")))
    }
}
