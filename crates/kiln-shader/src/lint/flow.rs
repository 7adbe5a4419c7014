//! Follows the statements of a function: branches, loops, calls, and who has left.

use std::collections::{BTreeMap, BTreeSet};

use naga::{Block, Expression, Function, Handle, Span, Statement};

use super::value::Value;
use super::walk::{Local, Shortcut, Target, Walk};

/// A deeper loop is entered with nothing known of what it writes, so that work does not multiply with depth.
const PRECISE_LOOP_DEPTH: usize = 3;

impl<'m> Walk<'_, 'm> {
    /// Follows a block; whether its end is reached. Facts that it adds are dropped.
    pub fn block(&mut self, block: &'m Block) -> bool {
        let mark = self.fact_mark();
        let falls_through = self.statements(block, 0);
        self.drop_facts(mark);
        falls_through
    }

    fn statements(&mut self, block: &'m Block, from: usize) -> bool {
        for (statement, span) in block.span_iter().skip(from) {
            self.lint.spend(1);
            if self.lint.is_exhausted() || !self.statement(statement, *span) {
                return false;
            }
        }
        true
    }

    fn statement(&mut self, statement: &'m Statement, span: Span) -> bool {
        match statement {
            Statement::Emit(range) => {
                range.clone().for_each(|handle| self.emit(handle));
                self.lint.spend(range.clone().count());
                if self.records {
                    range.clone().for_each(|handle| self.check(handle));
                }
            }
            // What an early exit in it tells still holds behind it.
            Statement::Block(inner) => return self.statements(inner, 0),
            Statement::If { condition, accept, reject } => return self.branch(*condition, accept, reject),
            Statement::Switch { selector, cases } => {
                // `case 1, 2` is an empty case that falls through, and another.
                let bodies = cases.iter().filter(|case| !case.fall_through).map(|case| &case.body);
                return self.switch(*selector, bodies.collect());
            }
            Statement::Loop { body, continuing, break_if } => {
                return self.repeat(body, continuing, *break_if, span);
            }
            Statement::Break => self.leave(false),
            Statement::Continue => self.leave(true),
            Statement::Return { value } => self.leave_function(*value),
            Statement::Store { pointer, value } => self.store(*pointer, *value),
            Statement::Call { function, arguments, result } => {
                self.call(*function, arguments, *result, span);
            }
            Statement::Atomic { result: Some(result), .. }
            | Statement::WorkGroupUniformLoad { result, .. }
            | Statement::SubgroupBallot { result, .. }
            | Statement::SubgroupGather { result, .. }
            | Statement::SubgroupCollectiveOperation { result, .. } => {
                self.emit(*result);
                self.memory_changes();
            }
            _ => self.memory_changes(),
        }
        !matches!(
            statement,
            Statement::Break | Statement::Continue | Statement::Return { .. } | Statement::Kill
        )
    }

    fn call(
        &mut self,
        callee: Handle<Function>,
        arguments: &[Handle<Expression>],
        result: Option<Handle<Expression>>,
        span: Span,
    ) {
        let values: Vec<Value> = arguments.iter().map(|argument| self.value(*argument)).collect();
        if self.records {
            self.lint.note_call(callee, &values, self.divergence.map(|_| span), self.in_fragment);
        }
        let returned = self.lint.result_of(callee, values, self.call_depth);
        for argument in arguments {
            let Some(local) = self.root(*argument) else { continue };
            let ty = self.function.local_variables[local].ty;
            let any = self.lint.types.any(ty, false);
            self.set(local.index(), any);
        }
        self.memory_changes();
        if let Some(result) = result {
            self.emit(result);
            self.values[result.index()] = returned.or_else(|| Some(self.any(result, false)));
        }
    }

    fn memory_changes(&mut self) {
        self.writes += 1;
        self.memory = self.writes;
    }

    fn branch(&mut self, condition: Handle<Expression>, accept: &'m Block, reject: &'m Block) -> bool {
        let around = self.divergence;
        self.diverge(condition);
        let (journal, facts) = (self.journal.len(), self.fact_mark());
        self.assume(condition, true);
        let accepted = self.block(accept);
        self.drop_facts(facts);
        let accept_changes = self.take_back(journal);
        self.assume(condition, false);
        let rejected = self.block(reject);
        self.drop_facts(facts);
        let reject_changes = self.take_back(journal);
        self.divergence = self.rejoined(around);
        match (accepted, rejected) {
            (false, false) => return false,
            (true, false) => {
                self.change(accept_changes);
                self.assume(condition, true);
            }
            (false, true) => {
                self.change(reject_changes);
                self.assume(condition, false);
            }
            (true, true) => {
                self.merge(condition, accept_changes, reject_changes);
                self.remember_shortcut(condition, accept, reject);
            }
        }
        true
    }

    fn change(&mut self, changes: BTreeMap<usize, Local>) {
        for (local, content) in changes {
            self.set_written(local, content);
        }
    }

    fn merge(
        &mut self,
        condition: Handle<Expression>,
        mut accepted: BTreeMap<usize, Local>,
        mut rejected: BTreeMap<usize, Local>,
    ) {
        let changed: BTreeSet<usize> = accepted.keys().chain(rejected.keys()).copied().collect();
        // What one way leaves alone is as the condition says there: `if d < 0.1 { d = 0.1; }`.
        for (truth, side) in [(true, &mut accepted), (false, &mut rejected)] {
            let mark = self.fact_mark();
            self.assume(condition, truth);
            for local in &changed {
                side.entry(*local).or_insert_with(|| self.narrowed(*local));
            }
            self.drop_facts(mark);
        }
        for local in changed {
            let joined = self.joined(&accepted[&local], &rejected[&local]);
            self.set_written(local, joined);
        }
    }

    /// naga writes `a && b` as `if a { t = b } else { t = false }`, and `a || b` as `if !a { t = b } else
    /// { t = true }`.
    fn remember_shortcut(&mut self, condition: Handle<Expression>, accept: &Block, reject: &Block) {
        let stored = |block: &Block| match block.last() {
            Some(Statement::Store { pointer, value }) => Some((*pointer, *value)),
            _ => None,
        };
        let (Some((pointer, right)), Some((other, otherwise))) = (stored(accept), stored(reject)) else {
            return;
        };
        let expressions = &self.function.expressions;
        let Expression::LocalVariable(local) = expressions[pointer] else { return };
        let Expression::Literal(naga::Literal::Bool(otherwise)) = expressions[otherwise] else { return };
        let is_made = self.function.local_variables[local].name.is_none() && reject.len() == 1;
        if is_made && self.roots[other.index()] == Some(local) {
            self.shortcuts.insert(local.index(), Shortcut { value: !otherwise, condition, right });
        }
    }

    fn switch(&mut self, selector: Handle<Expression>, cases: Vec<&'m Block>) -> bool {
        let around = self.divergence;
        self.diverge(selector);
        let written = self.written_in(&cases);
        self.targets.push(Target { written: written.clone(), ..Target::default() });
        let journal = self.journal.len();
        for case in cases {
            if self.block(case) {
                self.leave(false);
            }
            self.take_back(journal);
        }
        let exit = self.targets.pop().and_then(|target| target.exit);
        self.divergence = self.rejoined(around);
        let goes_on = exit.is_some();
        self.set_contents(&written, exit.unwrap_or_default());
        goes_on
    }

    fn repeat(
        &mut self,
        body: &'m Block,
        continuing: &'m Block,
        break_if: Option<Handle<Expression>>,
        span: Span,
    ) -> bool {
        let written = self.written_in(&[body, continuing]);
        let (around, around_iterations) = (self.divergence, self.iterations);
        if let Some(count) = self.trip_count(body, continuing) {
            self.iterations *= count;
            self.check_iterations(around_iterations, span);
        }
        let mut head: Vec<Value> = self.contents(&written).into_iter().map(|local| local.value).collect();
        let mut divergence = around;
        self.loop_depth += 1;
        let precise = self.loop_depth <= PRECISE_LOOP_DEPTH;
        // Until what the end gives is what the head has: at worst nothing is known in the third round.
        for round in 0..if precise { 3 } else { 0 } {
            let records = std::mem::replace(&mut self.records, false);
            let target = self.round(&written, &head, body, continuing, break_if, divergence);
            self.records = records;
            divergence = divergence.or(target.divergence).or(self.parted);
            let Some(next) = target.next else { break };
            let wide: Vec<Value> =
                head.iter().zip(&next).map(|(head, next)| head.widen(&head.join(&next.value))).collect();
            if wide == head {
                break;
            }
            head = wide;
            if round == 1 {
                head = self.any_contents(&written);
            }
        }
        if !precise {
            head = self.any_contents(&written);
        }
        let target = self.round(&written, &head, body, continuing, break_if, divergence);
        self.loop_depth -= 1;
        self.iterations = around_iterations;
        self.divergence = self.rejoined(around);
        let goes_on = target.exit.is_some();
        self.set_contents(&written, target.exit.unwrap_or_default());
        goes_on
    }

    fn any_contents(&self, locals: &[usize]) -> Vec<Value> {
        let variables: Vec<_> =
            self.function.local_variables.iter().map(|(_, variable)| variable.ty).collect();
        locals.iter().map(|local| self.lint.types.any(variables[*local], false)).collect()
    }

    /// One round of a loop that is entered with `head`; variables are as before when it returns.
    fn round(
        &mut self,
        written: &[usize],
        head: &[Value],
        body: &'m Block,
        continuing: &'m Block,
        break_if: Option<Handle<Expression>>,
        divergence: Option<Span>,
    ) -> Target {
        let (journal, facts) = (self.journal.len(), self.fact_mark());
        self.divergence = divergence;
        self.memory_changes();
        for (local, value) in written.iter().zip(head) {
            self.set(*local, value.clone());
        }
        self.targets.push(Target { is_loop: true, written: written.to_vec(), ..Target::default() });
        // Nothing goes on from before the end of these, so what they tell also holds in `continuing`.
        let guards = body.iter().take_while(|statement| !goes_on(statement)).count();
        let mut falls_through = true;
        for (statement, span) in body.span_iter().take(guards) {
            falls_through = falls_through && self.statement(statement, *span);
        }
        let inner = self.fact_mark();
        if falls_through && self.statements(body, guards) {
            self.leave(true);
        }
        self.drop_facts(inner);
        let next = self.targets.last_mut().and_then(|target| target.next.take());
        if let Some(next) = next {
            self.set_contents(written, next);
            if self.statements(continuing, 0) {
                self.go_round(break_if);
            }
        }
        self.drop_facts(facts);
        self.take_back(journal);
        self.memory_changes();
        self.targets.pop().unwrap_or_default()
    }

    fn go_round(&mut self, break_if: Option<Handle<Expression>>) {
        if let Some(condition) = break_if {
            let mark = self.fact_mark();
            self.assume(condition, true);
            let around = self.divergence;
            self.diverge(condition);
            self.leave(false);
            self.divergence = around;
            self.drop_facts(mark);
            self.assume(condition, false);
        }
        self.leave(true);
    }

    /// What remains of divergence behind a branch: those who left are not back.
    fn rejoined(&self, around: Option<Span>) -> Option<Span> {
        around.or(self.parted).or_else(|| self.targets.iter().find_map(|target| target.divergence))
    }

    fn diverge(&mut self, condition: Handle<Expression>) {
        if !self.value(condition).is_uniform() {
            let span = self.span(condition);
            self.divergence = self.divergence.or(Some(span));
        }
    }

    /// `break` or `continue`.
    fn leave(&mut self, goes_round: bool) {
        let position = self.targets.iter().rposition(|target| target.is_loop || !goes_round);
        let Some(position) = position else { return };
        let written = std::mem::take(&mut self.targets[position].written);
        let contents = self.contents(&written);
        let target = &mut self.targets[position];
        target.written = written;
        target.divergence = target.divergence.or(self.divergence);
        let former = if goes_round { target.next.take() } else { target.exit.take() };
        let joined = match former {
            Some(former) => former.iter().zip(&contents).map(|(a, b)| self.joined(a, b)).collect(),
            None => contents,
        };
        let target = &mut self.targets[position];
        *(if goes_round { &mut target.next } else { &mut target.exit }) = Some(joined);
    }

    fn leave_function(&mut self, value: Option<Handle<Expression>>) {
        self.parted = self.parted.or(self.divergence);
        let Some(value) = value else { return };
        let value = self.value(value).and_uniform(self.divergence.is_none());
        self.returned = Some(match self.returned.take() {
            Some(former) => former.join(&value),
            None => value,
        });
    }
}

/// Whether a statement may go on with the next round of the loop around it.
fn goes_on(statement: &Statement) -> bool {
    match statement {
        Statement::Continue => true,
        Statement::Loop { .. } => false,
        _ => inner_blocks(statement).into_iter().flatten().any(goes_on),
    }
}

/// Blocks of a statement.
pub fn inner_blocks(statement: &Statement) -> Vec<&Block> {
    match statement {
        Statement::Block(block) => vec![block],
        Statement::If { accept, reject, .. } => vec![accept, reject],
        Statement::Switch { cases, .. } => cases.iter().map(|case| &case.body).collect(),
        Statement::Loop { body, continuing, .. } => vec![body, continuing],
        _ => Vec::new(),
    }
}
