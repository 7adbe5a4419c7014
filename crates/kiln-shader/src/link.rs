//! Loads a module with all it imports, and checks that imports and names fit.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use kiln_diagnostic::{Diagnostic, Span};

use crate::condition::Mode;
use crate::library::{Library, View};
use crate::module::{Import, Name, QualifiedName};
use crate::{Dependency, limits, resolve, scope, suggest};

/// Reads a file of the project, by its path relative to it.
pub type Read<'a> = dyn FnMut(&str) -> Option<Arc<str>> + 'a;

/// A loaded module.
#[derive(Debug, Default)]
pub struct Module {
    /// Path relative to the project.
    pub path: String,
    /// Its text.
    pub text: Arc<str>,
    /// What it imports and declares under the given features.
    pub view: Arc<View>,
    /// Imported names, as they are called here: module and name there.
    pub names: BTreeMap<String, (usize, String)>,
    /// Imported modules, as they are called here.
    namespaces: BTreeMap<String, usize>,
    /// Names with a path, by their bytes: module and name there.
    pub paths: Vec<(Range<usize>, (usize, String))>,
    /// What the linked text has in place of some bytes, in their order.
    pub renames: Vec<(Range<usize>, String)>,
    /// The first import that led here.
    imported_by: Option<(usize, Range<usize>)>,
}

impl Module {
    /// Whether every name it imports is called here as it is there.
    pub fn has_plain_names(&self) -> bool {
        self.paths.is_empty() && self.names.iter().all(|(local, (_, name))| local == name)
    }
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
    pub fn load(root: &str, mode: Mode<'_>, library: &mut Library, read: &mut Read<'_>) -> Graph {
        let (graph, known, stack) = (Graph::default(), BTreeMap::new(), Vec::new());
        let mut loader = Loader { mode, library, read, graph, known, stack };
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
        let mut faults = scope::resolve(&mut graph);
        graph.diagnostics.append(&mut faults);
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
            for item in module.view.outline.imports.iter().flat_map(|import| &import.items) {
                let Some((target, _)) = module.names.get(&item.local().name) else { continue };
                found.extend(self.check_imported_name(index, *target, &item.name));
            }
            for qualified in &module.view.outline.qualified {
                let target = module.paths.iter().find(|(range, _)| *range == qualified.range);
                found.extend(
                    target.and_then(|(_, (target, _))| {
                        self.check_imported_name(index, *target, &qualified.name)
                    }),
                );
            }
        }
        self.diagnostics.append(&mut found);
    }

    fn check_imported_name(&self, importer: usize, target: usize, item: &Name) -> Option<Diagnostic> {
        let module = &self.modules[target];
        if module.view.outline.declarations.iter().any(|declaration| declaration.name.name == item.name) {
            return None;
        }
        let message = format!("module `{}` does not declare `{}`", module.path, item.name);
        let diagnostic = self.error_at(importer, item.range.clone(), message);
        if module.view.hidden.contains(&item.name) {
            return Some(diagnostic.with_help(format!(
                "`{}` is declared there under an `@if` that does not hold; put this import under the same `@if`",
                item.name
            )));
        }
        let names = module.view.outline.declarations.iter().map(|declaration| declaration.name.name.as_str());
        Some(match suggest::closest(&item.name, names) {
            Some(name) => diagnostic.with_help(format!("did you mean `{name}`?")),
            None => diagnostic,
        })
    }
}

struct Loader<'a, 'r> {
    mode: Mode<'a>,
    library: &'a mut Library,
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
        let module = Module { path: path.to_owned(), text, imported_by, ..Module::default() };
        self.graph.modules.push(module);
        let view = self.view(index);
        self.stack.push(index);
        for import in &view.outline.imports {
            self.import(index, import);
        }
        for qualified in &view.outline.qualified {
            self.resolve_qualified(index, qualified);
        }
        self.stack.pop();
        self.graph.order.push(index);
        index
    }

    /// Gives a module what it imports and declares, and reports what is wrong with it.
    fn view(&mut self, index: usize) -> Arc<View> {
        let module = &mut self.graph.modules[index];
        let view = self.library.view(&module.path, &module.text, self.mode);
        module.view = Arc::clone(&view);
        self.graph.features.extend(view.features.iter().cloned());
        for diagnostic in &view.diagnostics {
            let mut diagnostic = diagnostic.clone();
            diagnostic.notes.extend(self.graph.import_chain(index));
            self.graph.diagnostics.push(diagnostic);
        }
        view
    }

    /// Finds and loads what `import` of module `importer` names: a module that has the items, or modules called like them.
    fn import(&mut self, importer: usize, import: &Import) {
        // `import super::k` names no module but the folder of one.
        let is_folder = import.path.iter().all(|part| ["super", "package"].contains(&part.as_str()));
        let found = match is_folder {
            true => Found::Nowhere(Vec::new()),
            false => self.find(importer, &import.path, &import.path_range),
        };
        match found {
            Found::Module(target) => {
                for item in &import.items {
                    let (local, meaning) = (item.local(), (target, item.name.name.clone()));
                    let known =
                        self.graph.modules[importer].names.insert(local.name.clone(), meaning.clone());
                    if known.is_some_and(|known| known != meaning) {
                        let message = format!("`{}` is imported from two modules", local.name);
                        let help = format!("call one of them something else: `{} as …`", item.name.name);
                        self.refuse(importer, &local.range, message, Some(help));
                    }
                }
            }
            Found::Refused => {}
            Found::Nowhere(searched) => {
                for item in &import.items {
                    let mut path = import.path.clone();
                    path.push(item.name.name.clone());
                    let range = import.path_range.start..item.name.range.end;
                    if let Found::Module(target) = self.find(importer, &path, &range) {
                        self.graph.modules[importer].namespaces.insert(item.local().name.clone(), target);
                    } else {
                        return self.push_missing(importer, &import.path, &import.path_range, &searched);
                    }
                }
            }
        }
    }

    /// Finds and loads the module of a name with a path.
    fn resolve_qualified(&mut self, importer: usize, qualified: &QualifiedName) {
        let QualifiedName { path, name, range } = qualified;
        let namespace = self.graph.modules[importer].namespaces.get(&path[0]).copied();
        let path_range = range.start..name.range.start.saturating_sub(2).max(range.start + 1);
        let found = match namespace.filter(|_| path.len() == 1) {
            Some(target) => Found::Module(target),
            None => self.find(importer, path, &path_range),
        };
        match found {
            Found::Module(target) => {
                let meaning = (target, name.name.clone());
                self.graph.modules[importer].paths.push((range.clone(), meaning));
            }
            Found::Refused => {}
            Found::Nowhere(searched) => self.push_missing(importer, path, &path_range, &searched),
        }
    }

    /// The module at a path, as seen from `importer`, where the path stands at `range`.
    fn find(&mut self, importer: usize, path: &[String], range: &Range<usize>) -> Found {
        let from = self.graph.modules[importer].path.clone();
        let Some(candidates) = resolve::candidates(&from, path) else {
            let message = format!("`{}` names no module inside the project", path.join("::"));
            return self.refuse(importer, range, message, None);
        };
        for candidate in &candidates {
            let target = match self.look_up(candidate) {
                Known::Missing => continue,
                Known::Text(_) if self.graph.modules.len() >= limits::MODULE_COUNT_MAX => {
                    let message = format!("more than {} modules are imported", limits::MODULE_COUNT_MAX);
                    return self.refuse(importer, range, message, None);
                }
                Known::Text(text) => self.load_module(candidate, text, Some((importer, range.clone()))),
                Known::Module(index) => {
                    self.check_cycle(importer, range, index);
                    index
                }
            };
            return Found::Module(target);
        }
        Found::Nowhere(candidates)
    }

    fn check_cycle(&mut self, importer: usize, range: &Range<usize>, target: usize) {
        let Some(start) = self.stack.iter().position(|index| *index == target) else { return };
        let chain = self.stack[start..].iter().chain([&target]);
        let paths: Vec<&str> = chain.map(|index| self.graph.modules[*index].path.as_str()).collect();
        let message = format!("modules import each other: {}", paths.join(" → "));
        let help = "move what both need into a third module".to_owned();
        self.refuse(importer, range, message, Some(help));
    }

    fn push_missing(&mut self, importer: usize, path: &[String], range: &Range<usize>, searched: &[String]) {
        let message = format!("module `{}` was not found", path.join("::"));
        let mut diagnostic = self.graph.error_at(importer, range.clone(), message);
        diagnostic.notes.insert(0, format!("searched: {}", searched.join(", ")));
        self.graph.diagnostics.push(diagnostic.with_help("create one of these, or correct the path"));
    }

    fn refuse(
        &mut self,
        importer: usize,
        range: &Range<usize>,
        message: String,
        help: Option<String>,
    ) -> Found {
        let mut diagnostic = self.graph.error_at(importer, range.clone(), message);
        diagnostic.help = help;
        self.graph.diagnostics.push(diagnostic);
        Found::Refused
    }
}

/// What looking for a module gave.
enum Found {
    Module(usize),
    /// No file; these were looked for.
    Nowhere(Vec<String>),
    /// It was said why.
    Refused,
}
