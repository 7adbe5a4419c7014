//! Modules as they were last read: tokens once for a text, outlines once for each set of features that it names.
//!
//! Variants of a shader differ in few of its modules. Whether a file exists is not remembered: that is asked anew each time.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use kiln_diagnostic::{Diagnostic, Span};

use crate::condition::{self, Mode};
use crate::limits;
use crate::module::{self, Outline};
use crate::token::{self, OpenComment, Token};

/// Text behind all that is remembered; beyond it all is forgotten. An outline takes several times its text, and a worker has
/// a gibibyte: the shipped shaders have a hundredth of this.
const BYTES_MAX: usize = 8 << 20;

/// A module under some features.
#[derive(Debug, Default)]
pub struct View {
    /// All its tokens, also those that conditions cut.
    pub tokens: Arc<[Token]>,
    /// What it imports and declares.
    pub outline: Outline,
    /// What conditions cut.
    pub cuts: Vec<Range<usize>>,
    /// Features that its conditions name.
    pub features: BTreeSet<String>,
    /// Names that it declares under other features only.
    pub hidden: BTreeSet<String>,
    /// What is wrong with it, without the way it was imported.
    pub diagnostics: Vec<Diagnostic>,
}

/// Modules by path.
#[derive(Debug, Default)]
pub struct Library {
    files: BTreeMap<String, File>,
    bytes: usize,
}

#[derive(Debug)]
struct File {
    text: Arc<str>,
    /// With all branches of all conditions.
    whole: Arc<View>,
    /// By those features that hold and that its conditions name.
    views: BTreeMap<BTreeSet<String>, Arc<View>>,
}

impl Library {
    /// The module at `path`, which has this text now.
    pub fn view(&mut self, path: &str, text: &Arc<str>, mode: Mode<'_>) -> Arc<View> {
        if self.bytes > BYTES_MAX {
            *self = Library::default();
        }
        if self.files.get(path).is_none_or(|file| file.text != *text) {
            self.bytes += text.len();
            let whole = Arc::new(whole(path, text));
            self.files
                .insert(path.to_owned(), File { text: Arc::clone(text), whole, views: BTreeMap::new() });
        }
        let Some(File { whole, views, .. }) = self.files.get_mut(path) else { return Arc::default() };
        let Mode::Features(features) = mode else { return Arc::clone(whole) };
        let named = features.intersection(&whole.features).cloned().collect();
        let view = views.entry(named).or_insert_with_key(|named| {
            self.bytes += text.len();
            Arc::new(specialised(path, text, whole, named))
        });
        Arc::clone(view)
    }
}

fn whole(path: &str, text: &str) -> View {
    match tokens(path, text) {
        Ok(tokens) => decided(path, text, tokens.into(), Mode::Everything),
        Err(diagnostic) => View { diagnostics: vec![*diagnostic], ..View::default() },
    }
}

fn specialised(path: &str, text: &str, whole: &View, features: &BTreeSet<String>) -> View {
    if whole.tokens.is_empty() {
        // Nothing to decide: it is empty, or could not be read.
        return View { diagnostics: whole.diagnostics.clone(), ..View::default() };
    }
    let mut view = decided(path, text, Arc::clone(&whole.tokens), Mode::Features(features));
    let names = |view: &View| -> BTreeSet<String> {
        view.outline.declarations.iter().map(|declaration| declaration.name.name.clone()).collect()
    };
    view.hidden = &names(whole) - &names(&view);
    view
}

fn decided(path: &str, text: &str, tokens: Arc<[Token]>, mode: Mode<'_>) -> View {
    let mut diagnostics = Vec::new();
    let decided = condition::decide(path, text, &tokens, mode, &mut diagnostics);
    let outline = module::outline(path, text, &decided.kept, &mut diagnostics);
    let condition::Decided { cuts, features, .. } = decided;
    View { tokens, outline, cuts, features, hidden: BTreeSet::new(), diagnostics }
}

fn tokens(path: &str, text: &str) -> Result<Vec<Token>, Box<Diagnostic>> {
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
