//! Actions and the graph they form.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use kiln_diagnostic::Diagnostic;
use serde_json::Value;

use crate::engine::Engine;
use crate::survey::upstream_of;
use crate::{Command, Digest, Error};

/// Names an action within its [`Graph`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ActionId(pub(crate) usize);

impl ActionId {
    /// Its place in the graph's order.
    pub fn index(self) -> usize {
        self.0
    }
}

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

/// How much memory an action takes while it runs, in bytes, from the lengths of its inputs. An upper estimate: actions
/// that together would exceed the limit of the run do not run at once.
pub type MemoryNeed = dyn Fn(&[u64]) -> u64 + Send + Sync;

/// A pure step.
#[derive(Clone)]
pub struct Action {
    /// For people, unique in the graph: `prefilter env/sky/specular mip 3`.
    pub name: String,
    /// What is done: kind and recipe version name the code behind `perform`. Raise the version whenever the same inputs
    /// may give other bytes.
    pub command: Command,
    /// What it reads, in the order `perform` expects.
    pub inputs: Vec<Input>,
    /// Among ready actions the lowest rank goes first.
    pub rank: u32,
    /// What it needs beyond a few MiB.
    pub memory: Arc<MemoryNeed>,
    /// The code.
    pub perform: Arc<Perform>,
}

/// For actions that need little.
pub fn little_memory() -> Arc<MemoryNeed> {
    Arc::new(|_| 0)
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
    /// By action: whether its outputs are wanted for themselves.
    pub(crate) wanted: Vec<bool>,
    /// By action: whether it goes before those that are not; empty if none does.
    pub(crate) urgent: Vec<bool>,
}

impl Graph {
    /// Adds an action. Its inputs can only name actions added before it, so a graph has no cycles.
    pub fn add(&mut self, action: Action) -> ActionId {
        self.actions.push(action);
        self.wanted.push(false);
        ActionId(self.actions.len() - 1)
    }

    /// Says that an action's outputs are wanted for themselves. Those of an action that others read are otherwise made
    /// only for them: while every reader is up to date they may be gone from the store.
    pub fn want(&mut self, id: ActionId) {
        self.wanted[id.0] = true;
    }

    /// Lets these actions, and all that they read from, go before all others, whatever their ranks; when they are settled
    /// a run says so ([`crate::Progress::UrgentSettled`]).
    pub fn hurry(&mut self, first: &[ActionId]) {
        self.urgent.resize(self.len(), false);
        for id in self.with_upstream(first) {
            self.urgent[id.0] = true;
        }
    }

    /// Whether an action goes before those that are not urgent.
    pub(crate) fn is_urgent(&self, index: usize) -> bool {
        self.urgent.get(index).copied().unwrap_or(false)
    }

    /// The action named `id`.
    pub fn action(&self, id: ActionId) -> &Action {
        &self.actions[id.0]
    }

    /// All actions with their names.
    pub fn iter(&self) -> impl Iterator<Item = (ActionId, &Action)> {
        self.actions.iter().enumerate().map(|(index, action)| (ActionId(index), action))
    }

    /// These actions and all that they read from, directly or not: nearest first.
    pub fn with_upstream(&self, first: &[ActionId]) -> Vec<ActionId> {
        let mut is_found = vec![false; self.len()];
        let mut found: Vec<ActionId> = Vec::new();
        let mut add = |id: ActionId, found: &mut Vec<ActionId>| {
            if !std::mem::replace(&mut is_found[id.0], true) {
                found.push(id);
            }
        };
        first.iter().for_each(|id| add(*id, &mut found));
        let mut at = 0;
        while at < found.len() {
            upstream_of(self.action(found[at])).for_each(|id| add(id, &mut found));
            at += 1;
        }
        found
    }

    /// The graph of these actions alone, and which action of this one each is. They must be closed under what they read
    /// from, as [`Graph::with_upstream`] makes them.
    pub fn only(&self, wanted: &[ActionId]) -> (Graph, Vec<ActionId>) {
        let mut kept = wanted.to_vec();
        kept.sort();
        let mut graph = Graph::default();
        for id in &kept {
            let mut action = self.action(*id).clone();
            for input in &mut action.inputs {
                if let Input::Output { action: upstream, .. } = input {
                    let at = kept.binary_search(upstream);
                    *upstream = ActionId(at.unwrap_or_else(|_| panic!("{} is not closed", action.name)));
                }
            }
            let added = graph.add(action);
            graph.wanted[added.0] = self.wanted[id.0];
            graph.urgent.push(self.is_urgent(id.0));
        }
        (graph, kept)
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
    pub(crate) cancel: &'a AtomicBool,
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
            DeclaredInput::Blob { digest, held: None } => match self.engine.store().get(digest) {
                Some(bytes) => Ok(Some(bytes)),
                None => Err(Error::Lost { what: format!("blob {}", digest.short()) }),
            },
        }
    }

    /// Set when the result is not wanted any more: a long action looks at it every few milliseconds and then returns
    /// [`Error::Cancelled`].
    pub fn cancel(&self) -> &AtomicBool {
        self.cancel
    }

    /// `Err` if the result is not wanted any more.
    pub fn check_cancelled(&self) -> Result<(), Error> {
        if self.cancel.load(Ordering::Relaxed) { Err(Error::Cancelled) } else { Ok(()) }
    }

    /// The bytes of an input that cannot be missing.
    pub fn required(&self, index: usize) -> Result<Arc<[u8]>, Error> {
        self.bytes(index)?.ok_or_else(|| Error::Action {
            action: format!("input {index}"),
            reason: "a missing source was planned as an input that must be there".to_owned(),
        })
    }
}
