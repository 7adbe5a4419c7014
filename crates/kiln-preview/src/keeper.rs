//! Device resources by content: what did not change is reused, what fails keeps its last good form.

use std::collections::{HashMap, HashSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use kiln_build::Digest;
use kiln_diagnostic::Diagnostic;
use kiln_gpu::Gpu;
use kiln_link::{RevisionTable, Target};

/// Content of a target: digests of its parts and its description.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Key {
    digests: Vec<Digest>,
    meta: String,
}

impl Key {
    /// The content of `target`.
    pub fn of(target: &Target) -> Self {
        let digests = target.parts.iter().map(|part| part.digest).collect();
        Key { digests, meta: target.meta.to_string() }
    }
}

/// What came of a target.
#[derive(Debug)]
pub(crate) struct Resolved<T> {
    /// The resource, or its last good form.
    pub resource: Option<Arc<T>>,
    /// Whether it is new on the device.
    pub made: bool,
    /// Why it could not be made.
    pub diagnostic: Option<Diagnostic>,
}

/// Resources of one kind.
#[derive(Debug)]
pub(crate) struct Keeper<T> {
    by_content: HashMap<Key, Arc<T>>,
    last_good: HashMap<String, Arc<T>>,
}

impl<T> Default for Keeper<T> {
    fn default() -> Self {
        Keeper { by_content: HashMap::new(), last_good: HashMap::new() }
    }
}

impl<T> Keeper<T> {
    /// The resource for the content `key` of target `name`, made on first use; when that fails, the last good one
    /// of that name and why.
    pub fn resolve(
        &mut self,
        gpu: &Gpu,
        name: &str,
        key: Key,
        make: impl FnOnce() -> Result<T, Diagnostic>,
    ) -> Resolved<T> {
        if let Some(resource) = self.by_content.get(&key) {
            self.last_good.insert(name.to_owned(), Arc::clone(resource));
            return Resolved { resource: Some(Arc::clone(resource)), made: false, diagnostic: None };
        }
        match make_checked(gpu, name, make) {
            Ok(resource) => {
                let resource = Arc::new(resource);
                self.by_content.insert(key, Arc::clone(&resource));
                self.last_good.insert(name.to_owned(), Arc::clone(&resource));
                Resolved { resource: Some(resource), made: true, diagnostic: None }
            }
            Err(diagnostic) => {
                Resolved { resource: self.last_good(name), made: false, diagnostic: Some(diagnostic) }
            }
        }
    }

    /// What the target `name` was when it last could be used.
    pub fn last_good(&self, name: &str) -> Option<Arc<T>> {
        self.last_good.get(name).cloned()
    }

    /// Forgets content that is not in `table` (last good forms stay for the names that `is_kept`).
    pub fn retain(&mut self, table: &RevisionTable, is_kept: impl Fn(&str) -> bool) {
        let parts = table.targets.values().flat_map(|target| &target.parts);
        let present: HashSet<Digest> = parts.map(|part| part.digest).collect();
        self.by_content.retain(|key, _| key.digests.iter().all(|digest| present.contains(digest)));
        self.last_good.retain(|name, _| is_kept(name));
    }
}

/// Runs `make`; errors of wgpu and panics of its shader compiler become diagnostics too.
pub(crate) fn make_checked<T>(
    gpu: &Gpu,
    name: &str,
    make: impl FnOnce() -> Result<T, Diagnostic>,
) -> Result<T, Diagnostic> {
    // What a panicking `make` leaves behind is dropped with it: nothing it touched outlives this call.
    let (made, fault) = gpu.catch_errors(|| catch_unwind(AssertUnwindSafe(make)));
    let refused = || Diagnostic::error(format!("the graphics device does not accept `{name}`"));
    let resource =
        made.map_err(|_| refused().with_note("the graphics library failed on it; please report this"))??;
    match fault {
        None => Ok(resource),
        Some(fault) => {
            Err(fault.lines().filter(|line| !line.trim().is_empty()).fold(refused(), Diagnostic::with_note))
        }
    }
}
