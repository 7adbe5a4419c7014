//! Loads a module with all it imports, and checks that imports and names fit.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use kiln_diagnostic::{Diagnostic, Span};

use crate::condition::{self, Mode};
use crate::limits;
use crate::module::{self, Import, Name, Outline};
use crate::resolve;
use crate::token::{self, OpenComment};
use crate::{Dependency, suggest};

/// Reads a file of the project, by its path relative to it.
pub type Read<'a> = dyn FnMut(&str) -> Option<Arc<str>> + 'a;

/// A loaded module.
#[derive(Debug)]
pub struct Module {
    /// Path relative to the project.
    pub path: String,
    /// Its text.
    pub text: Arc<str>,
    /// What it imports and declares under the given features.
    pub outline: Outline,
    /// Names that conditions cut away.
    hidden: BTreeSet<String>,
    /// What conditions cut.
    pub cuts: Vec<Range<usize>>,
    /// Module of each of the outline's imports.
    targets: Vec<Option<usize>>,
    /// The first import that led here.
    imported_by: Option<(usize, Range<usize>)>,
}

/// All modules that a root needs, each after those it imports.
#[derive(Debug, Default)]
pub struct Graph {
    /// Modules, in the order of loading: the root first.
    pub modules: Vec<Module>,
    /// Indices of modules, each after those it imports.
    pub order: Vec<usize>,
    /// Files looked at.
    pub dependencies: Vec<Dependency>,
    /// Features that conditions name.
    pub features: BTreeSet<String>,
    /// What is wrong with modules and imports.
    pub diagnostics: Vec<Diagnostic>,
}

impl Graph {
    /// Loads `root` and, transitively, what it imports.
    pub fn load(root: &str, mode: Mode<'_>, read: &mut Read<'_>) -> Graph {
        let mut loader =
            Loader { mode, read, graph: Graph::default(), known: BTreeMap::new(), stack: Vec::new() };
        match loader.read_file(root) {
            Some(text) => {
                loader.load_module(root, text, None);
            }
            None => {
                let message = format!("shader `{root}` does not exist");
                loader.graph.diagnostics.push(Diagnostic::error(message).in_file(root));
            }
        }
        let mut graph = loader.graph;
        graph.check_imported_names();
        graph.check_duplicates();
        graph
    }

    /// `imported by …` from module `index` up to the root.
    pub fn import_chain(&self, index: usize) -> Vec<String> {
        let mut notes = Vec::new();
        let mut at = index;
        while let Some((importer, range)) = &self.modules[at].imported_by {
            let module = &self.modules[*importer];
            let line = Span::new(&module.text, range.clone()).line;
            notes.push(format!("imported by {}:{line}", module.path));
            at = *importer;
        }
        notes
    }

    /// An error at `range` of module `index`, with its import chain.
    pub fn error_at(&self, index: usize, range: Range<usize>, message: impl Into<String>) -> Diagnostic {
        let module = &self.modules[index];
        let mut diagnostic = Diagnostic::error(message).at(&module.path, &module.text, range);
        diagnostic.notes = self.import_chain(index);
        diagnostic
    }

    fn check_imported_names(&mut self) {
        let mut found = Vec::new();
        for (index, module) in self.modules.iter().enumerate() {
            for (import, target) in module.outline.imports.iter().zip(&module.targets) {
                let Some(target) = target else { continue };
                for item in &import.items {
                    found.extend(self.check_imported_name(index, *target, item));
                }
            }
        }
        self.diagnostics.append(&mut found);
    }

    fn check_imported_name(&self, importer: usize, target: usize, item: &Name) -> Option<Diagnostic> {
        let module = &self.modules[target];
        if module.outline.declarations.iter().any(|name| name.name == item.name) {
            return None;
        }
        let message = format!("module `{}` does not declare `{}`", module.path, item.name);
        let diagnostic = self.error_at(importer, item.range.clone(), message);
        if module.hidden.contains(&item.name) {
            return Some(diagnostic.with_help(format!(
                "`{}` is declared there under an `@if` that does not hold; put this import under the same `@if`",
                item.name
            )));
        }
        let names = module.outline.declarations.iter().map(|name| name.name.as_str());
        Some(match suggest::closest(&item.name, names) {
            Some(name) => diagnostic.with_help(format!("did you mean `{name}`?")),
            None => diagnostic,
        })
    }

    fn check_duplicates(&mut self) {
        let mut first: BTreeMap<&str, (usize, &Name)> = BTreeMap::new();
        let mut found = Vec::new();
        for (index, module) in self.modules.iter().enumerate() {
            for name in &module.outline.declarations {
                let Some((other, earlier)) = first.get(name.name.as_str()) else {
                    first.insert(&name.name, (index, name));
                    continue;
                };
                let other = &self.modules[*other];
                let place = Span::new(&other.text, earlier.range.clone());
                let message = format!("`{}` is declared twice", name.name);
                let note = format!("first declared at {}:{}:{}", other.path, place.line, place.column);
                found.push(self.error_at(index, name.range.clone(), message).with_note(note));
            }
        }
        self.diagnostics.append(&mut found);
    }
}

struct Loader<'a, 'r> {
    mode: Mode<'a>,
    read: &'a mut Read<'r>,
    graph: Graph,
    /// What reading each path gave, so that a path is read once.
    known: BTreeMap<String, Known>,
    /// Modules being loaded, root first.
    stack: Vec<usize>,
}

#[derive(Clone)]
enum Known {
    Missing,
    Text(Arc<str>),
    Module(usize),
}

impl Loader<'_, '_> {
    fn look_up(&mut self, path: &str) -> Known {
        if let Some(known) = self.known.get(path) {
            return known.clone();
        }
        let known = (self.read)(path).map_or(Known::Missing, Known::Text);
        let found = matches!(known, Known::Text(_));
        self.graph.dependencies.push(Dependency { path: path.to_owned(), found });
        self.known.insert(path.to_owned(), known.clone());
        known
    }

    fn read_file(&mut self, path: &str) -> Option<Arc<str>> {
        match self.look_up(path) {
            Known::Text(text) => Some(text),
            Known::Missing | Known::Module(_) => None,
        }
    }

    fn load_module(
        &mut self,
        path: &str,
        text: Arc<str>,
        imported_by: Option<(usize, Range<usize>)>,
    ) -> usize {
        let index = self.graph.modules.len();
        self.known.insert(path.to_owned(), Known::Module(index));
        let outline = Outline::default();
        let (path, hidden) = (path.to_owned(), BTreeSet::new());
        let module =
            Module { path, text, outline, hidden, cuts: Vec::new(), targets: Vec::new(), imported_by };
        self.graph.modules.push(module);
        self.outline(index);
        self.stack.push(index);
        for import in self.graph.modules[index].outline.imports.clone() {
            let target = self.import(index, &import);
            self.graph.modules[index].targets.push(target);
        }
        self.stack.pop();
        self.graph.order.push(index);
        index
    }

    fn outline(&mut self, index: usize) {
        let Module { path, text, .. } = &self.graph.modules[index];
        let (path, text) = (path.clone(), Arc::clone(text));
        let mut diagnostics = Vec::new();
        match self.tokens(&path, &text) {
            Ok(tokens) => {
                let decided = condition::decide(&path, &text, &tokens, self.mode, &mut diagnostics);
                let outline = module::outline(&path, &text, &decided.kept, &mut diagnostics);
                let module = &mut self.graph.modules[index];
                module.hidden = hidden_names(&path, &text, &tokens, &outline);
                (module.outline, module.cuts) = (outline, decided.cuts);
                self.graph.features.extend(decided.features);
            }
            Err(diagnostic) => diagnostics.push(*diagnostic),
        }
        let chain = self.graph.import_chain(index);
        for mut diagnostic in diagnostics {
            diagnostic.notes.extend(chain.iter().cloned());
            self.graph.diagnostics.push(diagnostic);
        }
    }

    fn tokens(&self, path: &str, text: &str) -> Result<Vec<token::Token>, Box<Diagnostic>> {
        if text.len() > limits::MODULE_BYTES_MAX {
            let (limit, actual) = (limits::MODULE_BYTES_MAX, text.len());
            let message = format!("module has {actual} bytes, the limit is {limit}");
            return Err(Box::new(Diagnostic::error(message).in_file(path)));
        }
        if let Some(at) = text.find(['\0', char::REPLACEMENT_CHARACTER]) {
            let diagnostic = Diagnostic::error("this is not a UTF-8 text");
            return Err(Box::new(diagnostic.in_file(path).with_note(format!("first at byte {at}"))));
        }
        let tokens = token::tokenize(text).map_err(|OpenComment(at)| {
            Box::new(Diagnostic::error("`/*` is never closed").at(path, text, at..at + 2))
        })?;
        limits::check_nesting(text, &tokens).map_err(|fault| Box::new(nesting_error(path, text, fault)))?;
        Ok(tokens)
    }

    /// Finds and loads the module that `import` of module `importer` names.
    fn import(&mut self, importer: usize, import: &Import) -> Option<usize> {
        let path = self.graph.modules[importer].path.clone();
        let Some(candidates) = resolve::candidates(&path, &import.path) else {
            let message = format!("`{}` names no module inside the project", import.path.join("::"));
            self.push_error(importer, import, message, None, None);
            return None;
        };
        for candidate in &candidates {
            match self.look_up(candidate) {
                Known::Missing => {}
                Known::Text(text) => return self.load_limited(importer, import, candidate, text),
                Known::Module(index) => {
                    self.check_cycle(importer, import, index);
                    return Some(index);
                }
            }
        }
        let message = format!("module `{}` was not found", import.path.join("::"));
        let note = format!("searched: {}", candidates.join(", "));
        let help = self.help_for_missing(&path, import);
        self.push_error(importer, import, message, Some(note), Some(help));
        None
    }

    fn load_limited(
        &mut self,
        importer: usize,
        import: &Import,
        path: &str,
        text: Arc<str>,
    ) -> Option<usize> {
        if self.graph.modules.len() >= limits::MODULE_COUNT_MAX {
            let message = format!("more than {} modules are imported", limits::MODULE_COUNT_MAX);
            self.push_error(importer, import, message, None, None);
            return None;
        }
        Some(self.load_module(path, text, Some((importer, import.range.clone()))))
    }

    fn check_cycle(&mut self, importer: usize, import: &Import, target: usize) {
        let Some(start) = self.stack.iter().position(|index| *index == target) else { return };
        let chain = self.stack[start..].iter().chain([&target]);
        let paths: Vec<&str> = chain.map(|index| self.graph.modules[*index].path.as_str()).collect();
        let message = format!("modules import each other: {}", paths.join(" → "));
        let help = "move what both need into a third module".to_owned();
        self.push_error(importer, import, message, None, Some(help));
    }

    /// `import lib::brdf;` is a likely slip for `import lib::brdf::{…};`.
    fn help_for_missing(&mut self, importer: &str, import: &Import) -> String {
        let mut longer = import.path.clone();
        longer.extend(import.items.first().map(|item| item.name.clone()));
        let files = resolve::candidates(importer, &longer).unwrap_or_default();
        if files.iter().any(|file| !matches!(self.look_up(file), Known::Missing)) {
            return format!("name what you import: `import {}::{{…}};`", longer.join("::"));
        }
        "create one of these, or correct the import".to_owned()
    }

    fn push_error(
        &mut self,
        importer: usize,
        import: &Import,
        message: String,
        note: Option<String>,
        help: Option<String>,
    ) {
        let mut diagnostic = self.graph.error_at(importer, import.path_range.clone(), message);
        diagnostic.notes.splice(0..0, note);
        diagnostic.help = help;
        self.graph.diagnostics.push(diagnostic);
    }
}

fn nesting_error(path: &str, text: &str, fault: limits::Fault) -> Diagnostic {
    let diagnostic = Diagnostic::error(&fault.message).at(path, text, fault.range);
    if let Some(opened) = fault.opened {
        let span = Span::new(text, opened.clone());
        let note = format!("`{}` was opened at {path}:{}:{}", &text[opened], span.line, span.column);
        return diagnostic.with_note(note);
    }
    if fault.message.starts_with("expression") {
        return diagnostic.with_help("split it with `let`, or end an `else if` chain with `switch`");
    }
    diagnostic
}

/// Names that the module declares under other features only.
fn hidden_names(path: &str, text: &str, tokens: &[token::Token], kept: &Outline) -> BTreeSet<String> {
    // Diagnostics of this second look would repeat those of the first.
    let mut ignored = Vec::new();
    let all = condition::decide(path, text, tokens, Mode::Everything, &mut ignored);
    let outline = module::outline(path, text, &all.kept, &mut ignored);
    let visible: BTreeSet<&str> = kept.declarations.iter().map(|name| name.name.as_str()).collect();
    let names = outline.declarations.into_iter().map(|name| name.name);
    names.filter(|name| !visible.contains(name.as_str())).collect()
}
