//! Joins modules into one text whose every byte knows its origin.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::link::{Graph, Module};
use crate::module::Outline;
use crate::token;

/// Modules joined into one text.
#[derive(Debug, Default)]
pub struct Linked {
    /// The text: directives first, then each module after those it imports.
    pub text: String,
    segments: Vec<Segment>,
}

/// A run of bytes that the linked text shares with a module, or has in place of some there.
#[derive(Clone, Copy, Debug)]
struct Segment {
    linked_start: usize,
    module: usize,
    module_start: usize,
    /// Length in the module.
    len: usize,
}

impl Linked {
    /// Joins the modules of a graph without errors, each after those it imports.
    pub fn join(graph: &Graph) -> Linked {
        let mut linked = Linked::default();
        let mut seen = BTreeSet::new();
        for &index in &graph.order {
            let module = &graph.modules[index];
            for directive in &module.view.outline.directives {
                if seen.insert(&module.text[directive.clone()]) {
                    linked.push(index, &module.text, directive.clone());
                }
            }
        }
        for &index in &graph.order {
            linked.push_module(index, &graph.modules[index]);
        }
        linked
    }

    /// Module and bytes there that `range` of the linked text came from; a range over several pieces of
    /// one module covers what was cut between them, a range over several modules ends with the first.
    pub fn origin(&self, range: Range<usize>) -> Option<(usize, Range<usize>)> {
        let first = self.segment_at(range.start)?;
        let last = self.segment_at(range.end.saturating_sub(1).max(range.start))?;
        let place = |segment: &Segment, at: usize| {
            segment.module_start + (at - segment.linked_start).min(segment.len)
        };
        let start = place(first, range.start);
        let end =
            if last.module == first.module { place(last, range.end) } else { first.module_start + first.len };
        Some((first.module, start..end.max(start)))
    }

    fn segment_at(&self, at: usize) -> Option<&Segment> {
        let after = self.segments.partition_point(|segment| segment.linked_start <= at);
        self.segments.get(after.checked_sub(1)?)
    }

    fn push(&mut self, module: usize, text: &str, range: Range<usize>) {
        let text = &text[range.clone()];
        self.push_in_place_of(module, text, range);
    }

    fn push_in_place_of(&mut self, module: usize, text: &str, range: Range<usize>) {
        let (module_start, len) = (range.start, range.len());
        self.segments.push(Segment { linked_start: self.text.len(), module, module_start, len });
        self.text.push_str(text);
        // Keeps tokens on both sides of a cut apart, and ends a module's last line comment.
        self.text.push('\n');
    }

    fn push_module(&mut self, index: usize, module: &Module) {
        let Outline { import_statements, directives, .. } = &module.view.outline;
        let cuts = module.view.cuts.iter().chain(import_statements).chain(directives).map(|cut| (cut, None));
        let renames = module.renames.iter().map(|(range, name)| (range, Some(name)));
        let mut cuts: Vec<(&Range<usize>, Option<&String>)> = cuts.chain(renames).collect();
        cuts.sort_by_key(|(cut, _)| cut.start);
        let mut at = if module.text.starts_with(token::BYTE_ORDER_MARK) {
            token::BYTE_ORDER_MARK.len_utf8()
        } else {
            0
        };
        for (cut, instead) in cuts {
            if at < cut.start {
                self.push(index, &module.text, at..cut.start);
            }
            // A name inside what was cut is cut too.
            if let Some(name) = instead.filter(|_| at <= cut.start) {
                self.push_in_place_of(index, name, cut.clone());
            }
            at = at.max(cut.end);
        }
        self.push(index, &module.text, at..module.text.len());
    }
}
