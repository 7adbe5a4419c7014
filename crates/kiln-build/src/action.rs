//! Actions and the graph they form.

use std::sync::Arc;

use kiln_diagnostic::Diagnostic;
use serde_json::Value;

use crate::engine::Engine;
use crate::{Digest, Error};

/// Names an action within its [`Graph`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ActionId(pub(crate) usize);

/// One thing an action reads.
#[derive(Clone, Debug)]
pub enum Input {
    /// A source file with the content it had when the graph was planned.
    Source {
        /// Project-relative.
        path: String,
        /// `None`: the file is missing, and the action knows what that means.
        digest: Option<Digest>,
    },
    /// An output of another action.
    Output {
        /// Which action.
        action: ActionId,
        /// Which of its outputs.
        output: String,
    },
}

/// The code of an action: reads its inputs by position, returns what it made.
pub type Perform = dyn Fn(&Inputs) -> Result<ActionOutput, Error> + Send + Sync;

/// A pure step.
#[derive(Clone)]
pub struct Action {
    /// For people, unique in the graph: `prefilter env/sky/specular mip 3`.
    pub name: String,
    /// What kind of step it is; with `recipe` it names the code behind `perform`.
    pub kind: &'static str,
    /// Version of that code: raise it whenever the same inputs may give other bytes.
    pub recipe: u32,
    /// Everything besides inputs that decides the result: a JSON object.
    pub params: Value,
    /// What it reads, in the order `perform` expects.
    pub inputs: Vec<Input>,
    /// Among ready actions the lowest rank goes first.
    pub rank: u32,
    /// The code.
    pub perform: Arc<Perform>,
}

/// What an action made: nothing, if its input is at fault, and then the diagnostics say how.
#[derive(Clone, Debug, Default)]
pub struct ActionOutput {
    /// Name and bytes of each output.
    pub outputs: Vec<(String, Vec<u8>)>,
    /// Facts about them, for manifests and panels.
    pub meta: Value,
    /// What the user should know.
    pub diagnostics: Vec<Diagnostic>,
}

/// Actions in an order in which every input comes before its reader.
#[derive(Default)]
pub struct Graph {
    pub(crate) actions: Vec<Action>,
}

impl Graph {
    /// Adds an action. Its inputs can only name actions added before it, so a graph has no cycles.
    pub fn add(&mut self, action: Action) -> ActionId {
        self.actions.push(action);
        ActionId(self.actions.len() - 1)
    }

    /// The action named `id`.
    pub fn action(&self, id: ActionId) -> &Action {
        &self.actions[id.0]
    }

    /// All actions with their names.
    pub fn iter(&self) -> impl Iterator<Item = (ActionId, &Action)> {
        self.actions.iter().enumerate().map(|(index, action)| (ActionId(index), action))
    }

    /// Number of actions.
    pub fn len(&self) -> usize {
        self.actions.len()
    }

    /// Whether there is nothing to do.
    pub fn is_empty(&self) -> bool {
        self.actions.is_empty()
    }
}

/// The declared inputs of an action that runs; nothing else can be read through it.
pub struct Inputs<'a> {
    pub(crate) engine: &'a Engine,
    pub(crate) declared: Vec<DeclaredInput>,
}

pub(crate) enum DeclaredInput {
    Source { path: String, digest: Option<Digest> },
    Blob { digest: Digest, held: Option<Arc<[u8]>> },
}

impl Inputs<'_> {
    /// The bytes of input `index`; `None` if it is a missing source.
    pub fn bytes(&self, index: usize) -> Result<Option<Arc<[u8]>>, Error> {
        match &self.declared[index] {
            DeclaredInput::Source { digest: None, .. } => Ok(None),
            DeclaredInput::Source { path, digest: Some(digest) } => {
                crate::sources::read_declared(self.engine.sources(), path, *digest).map(Some)
            }
            DeclaredInput::Blob { held: Some(bytes), .. } => Ok(Some(bytes.clone())),
            DeclaredInput::Blob { digest, held: None } => match self.engine.store().get(digest)? {
                Some(bytes) => Ok(Some(bytes)),
                None => Err(Error::Action {
                    action: format!("read {}", digest.short()),
                    reason: "the store's copy was damaged and has been dropped; build again".to_owned(),
                }),
            },
        }
    }

    /// The bytes of an input that cannot be missing.
    pub fn required(&self, index: usize) -> Result<Arc<[u8]>, Error> {
        self.bytes(index)?.ok_or_else(|| Error::Action {
            action: format!("input {index}"),
            reason: "a missing source was planned as an input that must be there".to_owned(),
        })
    }
}
