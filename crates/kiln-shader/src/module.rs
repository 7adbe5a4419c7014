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

/// What an import takes from a module: `x`, or `x as y`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Item {
    /// Its name there.
    pub name: Name,
    /// Its name here, if that is another.
    pub alias: Option<Name>,
}

impl Item {
    /// Its name in the importing module.
    pub fn local(&self) -> &Name {
        self.alias.as_ref().unwrap_or(&self.name)
    }
}

/// `import a::b::{x, y as z};`, or a part of `import a::{b::x, c::y};`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Import {
    /// Module path, as `["lib", "brdf"]`; may start with `package` or `super`.
    pub path: Vec<String>,
    /// Bytes of the path.
    pub path_range: Range<usize>,
    /// What is imported from it.
    pub items: Vec<Item>,
}

/// `a::b::x` where a name stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct QualifiedName {
    /// The module, as in an import; may start with the name of an imported module.
    pub path: Vec<String>,
    /// What is meant there.
    pub name: Name,
    /// Bytes of all of it.
    pub range: Range<usize>,
}

/// A name declared at module scope.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Declaration {
    /// The name.
    pub name: Name,
    /// Whether something outside knows it by this name: entry points, variables and overrides.
    pub is_public: bool,
}

/// What the linker needs to know of a module.
#[derive(Clone, Debug, Default)]
pub struct Outline {
    /// Imports in source order.
    pub imports: Vec<Import>,
    /// Bytes of their statements.
    pub import_statements: Vec<Range<usize>>,
    /// Names with a path, in source order.
    pub qualified: Vec<QualifiedName>,
    /// `enable`, `requires` and `diagnostic` directives: linked text must start with them.
    pub directives: Vec<Range<usize>>,
    /// Names declared at module scope, in source order.
    pub declarations: Vec<Declaration>,
}

/// Outlines a module from the tokens that its conditions keep. What it does not understand it leaves to
/// naga, which explains better.
pub fn outline(file: &str, text: &str, tokens: &[Token], diagnostics: &mut Vec<Diagnostic>) -> Outline {
    let mut parser = Parser { file, text, tokens, at: 0 };
    let mut outline = Outline::default();
    let mut declared_before = false;
    while parser.at < tokens.len() {
        let first = parser.at;
        let is_entry_point = parser.skip_attributes();
        let start = parser.at;
        match parser.word() {
            Some("import") => match parser.import(declared_before) {
                Ok(imports) => {
                    outline.imports.extend(imports);
                    outline.import_statements.push(parser.bytes_since(start));
                }
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
                let is_public = is_entry_point || ["var", "override"].contains(&keyword);
                let declared = parser.declared_name(keyword);
                outline.declarations.extend(declared.map(|name| Declaration { name, is_public }));
                parser.skip_declaration();
                parser.collect_qualified(first, &mut outline.qualified);
                if KEYWORDS.contains(&keyword) {
                    diagnostics.extend(parser.check_end());
                }
            }
            None => {
                parser.at += 1;
                if start > first {
                    diagnostics.extend(parser.check_end());
                }
            }
        }
    }
    outline
}

/// What declarations begin with.
const KEYWORDS: [&str; 7] = ["fn", "struct", "const", "override", "alias", "var", "const_assert"];

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

    /// Skips `@name` and `@name(…)`. Whether one of them makes an entry point.
    fn skip_attributes(&mut self) -> bool {
        let mut is_entry_point = false;
        while self.is('@') {
            let name = self.word_at(self.at + 1);
            is_entry_point |= name.is_some_and(|name| ["vertex", "fragment", "compute"].contains(&name));
            self.at += 2;
            if self.is('(') {
                self.skip_brackets();
            }
        }
        is_entry_point
    }

    /// Finds `a::b::x` from the token `start` to the present one.
    fn collect_qualified(&self, start: usize, found: &mut Vec<QualifiedName>) {
        let end = self.at.min(self.tokens.len());
        let is_separator = |at: usize| {
            at + 1 < end
                && self.tokens[at].is(':')
                && self.tokens[at + 1].is(':')
                && self.tokens[at].end == self.tokens[at + 1].start
        };
        let mut at = start;
        while at < end {
            let first = at;
            let mut path = Vec::new();
            while let Some(word) = self.word_at(at).filter(|_| at < end && is_separator(at + 1)) {
                path.push(word.to_owned());
                at += 3;
            }
            if let Some(name) = self.word_at(at).filter(|_| !path.is_empty() && at < end) {
                let range = self.tokens[at].range();
                let whole = self.tokens[first].start..range.end;
                found.push(QualifiedName { path, name: Name { name: name.to_owned(), range }, range: whole });
            }
            at += 1;
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

    /// What is wrong if the module ends within what was just skipped: linked, it would go on in the next module.
    fn check_end(&self) -> Option<Diagnostic> {
        let last = self.tokens.last().filter(|last| !(last.is(';') || last.is('}')))?;
        (self.at >= self.tokens.len()).then(|| {
            let fault = Diagnostic::error("this module ends within a declaration");
            let fault = fault.at(self.file, self.text, last.range());
            fault.with_help("a `;` or a body may be missing at its end")
        })
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

    /// One import for each module that the statement names.
    fn import(&mut self, declared_before: bool) -> Result<Vec<Import>, Fault> {
        if declared_before {
            return Err(self.fault("imports stand before all declarations"));
        }
        self.at += 1;
        let mut imports = Vec::new();
        self.import_tree(&mut Vec::new(), &mut imports)?;
        if !self.is(';') {
            return Err(self.fault("expected `;` after an import"));
        }
        self.at += 1;
        Ok(imports)
    }

    /// `a::b::x`, `a::b::x as y` or `a::b::{…}` below `prefix`. Brackets are bounded by `limits`.
    fn import_tree(&mut self, prefix: &mut Vec<Name>, imports: &mut Vec<Import>) -> Result<(), Fault> {
        let depth = prefix.len();
        let name = self.name("a module path")?;
        prefix.push(name);
        while self.is_path_separator() {
            self.at += 2;
            if self.is('{') {
                self.import_list(prefix, imports)?;
                prefix.truncate(depth);
                return Ok(());
            }
            let name = self.name("a name or `{`")?;
            prefix.push(name);
        }
        let alias = self.alias()?;
        let Some(name) = prefix.pop() else { return Ok(()) };
        self.push_item(prefix, Item { name, alias }, imports)?;
        prefix.truncate(depth);
        Ok(())
    }

    fn import_list(&mut self, prefix: &mut Vec<Name>, imports: &mut Vec<Import>) -> Result<(), Fault> {
        self.at += 1;
        if self.is('}') {
            return Err(self.fault("this import takes nothing"));
        }
        while !self.is('}') {
            self.import_tree(prefix, imports)?;
            if self.is(',') {
                self.at += 1;
            } else if !self.is('}') {
                return Err(self.fault("expected `,` or `}` in an import"));
            }
        }
        self.at += 1;
        Ok(())
    }

    fn alias(&mut self) -> Result<Option<Name>, Fault> {
        if self.word() != Some("as") {
            return Ok(None);
        }
        self.at += 1;
        self.name("a new name").map(Some)
    }

    fn push_item(&self, path: &[Name], item: Item, imports: &mut Vec<Import>) -> Result<(), Fault> {
        let (Some(first), Some(last)) = (path.first(), path.last()) else {
            let range = item.name.range;
            let fault = Diagnostic::error("an import names a module and what it takes from it");
            return Err(Box::new(
                fault
                    .at(self.file, self.text, range)
                    .with_help("write `import module::name;` or `import module::{a, b};`"),
            ));
        };
        let path_range = first.range.start..last.range.end;
        let path: Vec<String> = path.iter().map(|name| name.name.clone()).collect();
        match imports.last_mut().filter(|import| import.path == path) {
            Some(import) => import.items.push(item),
            None => imports.push(Import { path, path_range, items: vec![item] }),
        }
        Ok(())
    }

    fn name(&mut self, what: &str) -> Result<Name, Fault> {
        let name = self.word().ok_or_else(|| self.fault(format!("expected {what} in an import")))?.to_owned();
        let range = self.tokens[self.at].range();
        self.at += 1;
        Ok(Name { name, range })
    }
}
