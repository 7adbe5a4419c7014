//! What variables hold, and when they were written.

use std::collections::{BTreeMap, BTreeSet};

use naga::{Block, Expression, GlobalVariable, Handle, LocalVariable, Statement, TypeInner};

use super::flow::inner_blocks;
use super::range::Range;
use super::value::{Value, components};
use super::walk::{Local, Walk};

impl<'m> Walk<'_, 'm> {
    /// When what a pointer leads to was last written.
    pub fn written(&self, pointer: Handle<Expression>) -> u32 {
        match self.roots[pointer.index()] {
            Some(local) => self.locals[local.index()].written,
            None if self.global_of(pointer).is_some_and(|global| self.lint.is_constant(global)) => 0,
            None => self.memory,
        }
    }

    pub fn root(&self, pointer: Handle<Expression>) -> Option<Handle<LocalVariable>> {
        self.roots[pointer.index()]
    }

    fn global_of(&self, mut pointer: Handle<Expression>) -> Option<Handle<GlobalVariable>> {
        loop {
            match self.function.expressions[pointer] {
                Expression::GlobalVariable(global) => return Some(global),
                Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => pointer = base,
                _ => return None,
            }
        }
    }

    pub fn load(&self, handle: Handle<Expression>, pointer: Handle<Expression>) -> Value {
        let Some(local) = self.roots[pointer.index()] else {
            let global = self.global_of(pointer);
            let uniform =
                global.is_some_and(|global| self.lint.is_constant(global)) && self.index_is_uniform(pointer);
            return self.any(handle, uniform);
        };
        let (path, part) = self.path(pointer);
        let mut value = self.locals[local.index()].value.clone();
        for member in path {
            value = value.member(member as usize);
        }
        match (value, self.any(handle, false)) {
            (Value::Number(range), Value::Number(any)) => {
                let near = if part { 0.0 } else { range.near };
                let count = components(self.inner(handle));
                // Widening leaves the type's limits.
                let range = Range { lo: range.lo.max(any.lo), hi: range.hi.min(any.hi), near, ..range };
                Value::Number(
                    range.settled(count).with_uniform(range.uniform && self.index_is_uniform(pointer)),
                )
            }
            (Value::Number(_), any) => any,
            (value, _) => value,
        }
    }

    fn index_is_uniform(&self, mut pointer: Handle<Expression>) -> bool {
        loop {
            match self.function.expressions[pointer] {
                Expression::Access { base, index } => {
                    if !self.range(index).uniform {
                        return false;
                    }
                    pointer = base;
                }
                Expression::AccessIndex { base, .. } => pointer = base,
                _ => return true,
            }
        }
    }

    /// Members on the way from a variable, and whether the way ends in a part of what they name.
    fn path(&self, mut pointer: Handle<Expression>) -> (Vec<u32>, bool) {
        let (mut path, mut part) = (Vec::new(), false);
        loop {
            let (base, index) = match self.function.expressions[pointer] {
                Expression::AccessIndex { base, index } => (base, Some(index)),
                Expression::Access { base, .. } => (base, None),
                _ => break,
            };
            match (self.pointee(base), index) {
                (Some(TypeInner::Struct { .. }), Some(index)) => path.push(index),
                _ => part = true,
            }
            pointer = base;
        }
        path.reverse();
        (path, part)
    }

    fn pointee(&self, pointer: Handle<Expression>) -> Option<&'m TypeInner> {
        match self.inner(pointer) {
            TypeInner::Pointer { base, .. } => Some(&self.lint.module.types[*base].inner),
            _ => None,
        }
    }

    pub fn set(&mut self, local: usize, value: Value) {
        self.writes += 1;
        self.set_written(local, Local { value, written: self.writes });
    }

    pub fn set_written(&mut self, local: usize, content: Local) {
        self.lint.spend(1);
        let former = std::mem::replace(&mut self.locals[local], content);
        self.journal.push((local, former));
    }

    pub fn store(&mut self, pointer: Handle<Expression>, value: Handle<Expression>) {
        let Some(local) = self.roots[pointer.index()] else {
            self.writes += 1;
            self.memory = self.writes;
            return;
        };
        let stored = self.value(value).and_uniform(self.divergence.is_none());
        let (path, part) = self.path(pointer);
        let former = self.locals[local.index()].value.clone();
        let stored = if part {
            let mut there = former.clone();
            for member in &path {
                there = there.member(*member as usize);
            }
            let joined = there.join(&stored).and_uniform(self.index_is_uniform(pointer));
            match joined {
                // A vector with another component has another length.
                Value::Number(range) => {
                    Value::Number(Range { near: 0.0, far: f64::INFINITY, ..range }.settled(16))
                }
                joined => joined,
            }
        } else {
            stored
        };
        self.set(local.index(), former.with_member(&path, stored));
    }

    /// Takes back what changed since the journal had `mark` entries, and returns it.
    pub fn take_back(&mut self, mark: usize) -> BTreeMap<usize, Local> {
        let mut changed = BTreeMap::new();
        for (local, former) in self.journal.drain(mark..).rev() {
            let last = std::mem::replace(&mut self.locals[local], former);
            changed.entry(local).or_insert(last);
        }
        changed
    }

    /// Variables as they are here, narrowed by the conditions that hold.
    pub fn contents(&mut self, locals: &[usize]) -> Vec<Local> {
        self.lint.spend(locals.len());
        locals.iter().map(|local| self.narrowed(*local)).collect()
    }

    pub fn narrowed(&self, local: usize) -> Local {
        let Local { value, written } = &self.locals[local];
        let fact = self.numbers.of_local(local, *written).and_then(|number| self.facts.get(&number));
        let value = match (value, fact) {
            (Value::Number(range), Some(fact)) => Value::Number(range.meet(*fact)),
            _ => value.clone(),
        };
        Local { value, written: *written }
    }

    pub fn set_contents(&mut self, locals: &[usize], contents: Vec<Local>) {
        for (local, content) in locals.iter().zip(contents) {
            self.set_written(*local, content);
        }
    }

    /// What a variable holds where two ways meet.
    pub fn joined(&mut self, ours: &Local, theirs: &Local) -> Local {
        let value = ours.value.join(&theirs.value);
        if ours.written == theirs.written {
            return Local { value, written: ours.written };
        }
        self.writes += 1;
        Local { value, written: self.writes }
    }

    /// Variables that statements write, each once.
    pub fn written_in(&mut self, blocks: &[&'m Block]) -> Vec<usize> {
        let mut written = BTreeSet::new();
        let mut open: Vec<&Block> = blocks.to_vec();
        while let Some(block) = open.pop() {
            self.lint.spend(block.len());
            for statement in block {
                match statement {
                    Statement::Store { pointer, .. } => written.extend(self.root(*pointer)),
                    Statement::Call { arguments, .. } => {
                        written.extend(arguments.iter().filter_map(|argument| self.root(*argument)));
                    }
                    _ => open.extend(inner_blocks(statement)),
                }
            }
        }
        written.into_iter().map(Handle::index).collect()
    }
}
