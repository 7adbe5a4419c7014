//! A compiler that remembers: what variants of a shader share is worked out once.

use std::collections::{BTreeSet, HashMap};

use crate::front::{self, Fault, LinkedShader};
use crate::library::Library;
use crate::link::Read;
use crate::{Outcome, Program, glsl, wgsl};

/// Linked texts and what they compiled to, in bytes of text; beyond it all are forgotten. What is kept of a text is about as
/// long as it.
const LINKED_BYTES_MAX: usize = 32 << 20;

/// Compiles many shaders. What it remembers of one makes the next faster, and never changes what comes out: it is known by
/// its text. What it takes is bounded.
#[derive(Debug, Default)]
pub struct Compiler {
    pub(crate) library: Library,
    linked: HashMap<(String, bool), Result<LinkedShader, Fault>>,
    linked_bytes: usize,
}

impl Compiler {
    /// [`crate::compile`].
    pub fn compile(
        &mut self,
        program: &Program,
        features: &BTreeSet<String>,
        read: &mut Read<'_>,
    ) -> Outcome {
        self.run(program, features, false, read)
    }

    /// [`crate::lint`].
    pub fn lint(&mut self, program: &Program, features: &BTreeSet<String>, read: &mut Read<'_>) -> Outcome {
        self.run(program, features, true, read)
    }

    fn run(
        &mut self,
        program: &Program,
        features: &BTreeSet<String>,
        lints: bool,
        read: &mut Read<'_>,
    ) -> Outcome {
        match program.is_glsl() {
            true => glsl::compile(program, features, lints, read),
            false => wgsl::compile(self, program.subject(), features, lints, read),
        }
    }

    /// [`front::compile_linked`]: variants often differ in features only that change nothing in the end.
    pub(crate) fn compile_linked(&mut self, text: &str, lints: bool) -> Result<LinkedShader, Fault> {
        let key = (text.to_owned(), lints);
        if let Some(known) = self.linked.get(&key) {
            return known.clone();
        }
        let result = front::compile_linked(text, lints);
        // Whether a thread could be started is not the text's.
        if matches!(result, Err(Fault::Internal(_))) {
            return result;
        }
        if self.linked_bytes > LINKED_BYTES_MAX {
            (self.linked, self.linked_bytes) = (HashMap::new(), 0);
        }
        self.linked_bytes += text.len();
        self.linked.insert(key, result.clone());
        result
    }

    /// How many linked texts it remembers.
    #[cfg(test)]
    pub(crate) fn linked_count(&self) -> usize {
        self.linked.len()
    }
}
