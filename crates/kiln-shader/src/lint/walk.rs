//! The way through one function: what is known at the statement it has come to.

use std::collections::BTreeMap;

use naga::valid::FunctionInfo;
use naga::{Expression, Function, Handle, LocalVariable, Span, TypeInner};
use rustc_hash::FxHashMap;

use super::Lint;
use super::number::{self, Numbering};
use super::range::Range;
use super::value::Value;

/// The way through one function, with given arguments.
pub struct Walk<'l, 'm> {
    pub lint: &'l mut Lint<'m>,
    pub function: &'m Function,
    pub info: &'m FunctionInfo,
    pub arguments: Vec<Value>,
    pub numbers: Numbering,
    /// Whether findings and calls count; not so in the first rounds of a loop, and in calls for their result.
    pub records: bool,
    /// Calls that led here for their result.
    pub call_depth: usize,
    /// Whether it runs for pixels.
    pub in_fragment: bool,
    /// The condition by which invocations may have parted, where they may.
    pub divergence: Option<Span>,
    /// The same, where some may have left the function for good.
    pub parted: Option<Span>,
    /// Iterations of the loops around, as far as they are known.
    pub iterations: f64,
    pub values: Vec<Option<Value>>,
    /// The local variable that a pointer leads into.
    pub roots: Vec<Option<Handle<LocalVariable>>>,
    pub locals: Vec<Local>,
    /// Former contents of changed variables.
    pub journal: Vec<(usize, Local)>,
    /// What conditions say, by value number.
    pub facts: FxHashMap<number::Value, Range>,
    pub former_facts: Vec<(number::Value, Option<Range>)>,
    /// Boolean variables that naga makes of `&&` and `||`.
    pub shortcuts: BTreeMap<usize, Shortcut>,
    pub targets: Vec<Target>,
    pub returned: Option<Value>,
    /// The only expression that uses each, if that is its only use.
    pub sole_users: Option<Vec<Option<Handle<Expression>>>>,
    pub writes: u32,
    /// When memory outside of the function was last written.
    pub memory: u32,
    pub loop_depth: usize,
}

/// Content of a variable, and when it was written.
#[derive(Clone, Debug)]
pub struct Local {
    pub value: Value,
    pub written: u32,
}

/// If a variable is `value`, then `condition` holds and `right` is `value`.
#[derive(Clone, Copy, Debug)]
pub struct Shortcut {
    pub value: bool,
    pub condition: Handle<Expression>,
    pub right: Handle<Expression>,
}

/// A loop or switch that `break` leaves.
#[derive(Debug, Default)]
pub struct Target {
    pub is_loop: bool,
    pub written: Vec<usize>,
    /// Variables where it is left.
    pub exit: Option<Vec<Local>>,
    /// Variables where it goes round.
    pub next: Option<Vec<Local>>,
    /// Whether some invocations may go before others.
    pub divergence: Option<Span>,
}

impl<'l, 'm> Walk<'l, 'm> {
    pub fn new(
        lint: &'l mut Lint<'m>,
        function: &'m Function,
        info: &'m FunctionInfo,
        arguments: Vec<Value>,
    ) -> Walk<'l, 'm> {
        let count = function.expressions.len();
        let mut walk = Walk {
            lint,
            function,
            info,
            arguments,
            numbers: Numbering::new(count),
            records: false,
            call_depth: 0,
            in_fragment: false,
            divergence: None,
            parted: None,
            iterations: 1.0,
            values: vec![None; count],
            roots: vec![None; count],
            locals: Vec::new(),
            journal: Vec::new(),
            facts: FxHashMap::default(),
            former_facts: Vec::new(),
            shortcuts: BTreeMap::new(),
            targets: Vec::new(),
            returned: None,
            sole_users: None,
            writes: 0,
            memory: 0,
            loop_depth: 0,
        };
        walk.enter();
        walk
    }

    /// What the function returns; nothing, if it never does.
    pub fn run(mut self) -> Option<Value> {
        let function = self.function;
        self.block(&function.body);
        self.returned
    }

    fn enter(&mut self) {
        let function = self.function;
        for (handle, expression) in function.expressions.iter() {
            self.roots[handle.index()] = match *expression {
                Expression::LocalVariable(local) => Some(local),
                Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => {
                    self.roots[base.index()]
                }
                _ => None,
            };
            if expression.needs_pre_emit() {
                self.emit(handle);
            }
        }
        for (_, local) in function.local_variables.iter() {
            let value = match local.init {
                Some(init) => {
                    self.emit_constant(init);
                    self.value(init)
                }
                None => self.lint.types.zero(local.ty),
            };
            self.locals.push(Local { value, written: 0 });
        }
    }

    /// Initialisers are not part of any statement.
    fn emit_constant(&mut self, handle: Handle<Expression>) {
        if self.values[handle.index()].is_some() {
            return;
        }
        match &self.function.expressions[handle] {
            Expression::Compose { components, .. } => {
                components.iter().for_each(|component| self.emit_constant(*component));
            }
            Expression::Splat { value, .. } => self.emit_constant(*value),
            _ => {}
        }
        self.emit(handle);
    }

    pub fn emit(&mut self, handle: Handle<Expression>) {
        let expression = &self.function.expressions[handle];
        let written = match *expression {
            Expression::Load { pointer } => self.written(pointer),
            _ => 0,
        };
        self.numbers.add(handle, expression, written);
        self.values[handle.index()] = Some(self.evaluate(handle));
    }

    /// What is known of a local variable.
    pub fn local_range(&self, local: Handle<LocalVariable>) -> Range {
        self.locals[local.index()].value.range()
    }

    /// The expression that alone uses the value of `handle`.
    pub fn sole_user(&mut self, handle: Handle<Expression>) -> Option<Handle<Expression>> {
        let (function, info) = (self.function, self.info);
        let users = self.sole_users.get_or_insert_with(|| {
            let mut users = vec![None; function.expressions.len()];
            for (user, expression) in function.expressions.iter() {
                for operand in operands(expression) {
                    users[operand.index()] = (info[operand].ref_count == 1).then_some(user);
                }
            }
            users
        });
        users[handle.index()]
    }

    pub fn inner(&self, handle: Handle<Expression>) -> &'m TypeInner {
        self.info[handle].ty.inner_with(&self.lint.module.types)
    }

    pub fn any(&self, handle: Handle<Expression>, uniform: bool) -> Value {
        self.lint.types.any_of(&self.info[handle].ty, uniform)
    }

    /// Where it was evaluated, narrowed by the conditions that hold now.
    pub fn value(&self, handle: Handle<Expression>) -> Value {
        let Some(value) = &self.values[handle.index()] else { return self.any(handle, false) };
        match (value, self.facts.get(&self.numbers.of(handle))) {
            (Value::Number(range), Some(fact)) => Value::Number(range.meet(*fact)),
            _ => value.clone(),
        }
    }

    pub fn range(&self, handle: Handle<Expression>) -> Range {
        self.value(handle).range()
    }

    pub fn is_evaluated(&self, handle: Handle<Expression>) -> bool {
        self.values[handle.index()].is_some()
    }

    pub fn fact_mark(&self) -> usize {
        self.former_facts.len()
    }

    pub fn drop_facts(&mut self, mark: usize) {
        for (number, former) in self.former_facts.drain(mark..).rev() {
            match former {
                Some(former) => self.facts.insert(number, former),
                None => self.facts.remove(&number),
            };
        }
    }

    /// Adds to what is known of an expression's value.
    pub fn add_fact(&mut self, handle: Handle<Expression>, fact: Range) {
        let number = self.numbers.of(handle);
        let former = self.facts.get(&number).copied();
        let fact = former.map_or(fact, |former| former.meet(fact));
        self.facts.insert(number, fact);
        self.former_facts.push((number, former));
    }

    pub fn shortcut(
        &self,
        local: Handle<LocalVariable>,
    ) -> Option<(bool, Handle<Expression>, Handle<Expression>)> {
        self.shortcuts.get(&local.index()).map(|found| (found.value, found.condition, found.right))
    }
}

/// Operands of what only computes.
fn operands(expression: &Expression) -> Vec<Handle<Expression>> {
    match *expression {
        Expression::Compose { ref components, .. } => components.clone(),
        Expression::AccessIndex { base, .. } => vec![base],
        Expression::Splat { value, .. } => vec![value],
        Expression::Swizzle { vector, .. } => vec![vector],
        Expression::Unary { expr, .. } | Expression::As { expr, .. } => vec![expr],
        Expression::Binary { left, right, .. } => vec![left, right],
        Expression::Select { condition, accept, reject } => vec![condition, accept, reject],
        Expression::Math { arg, arg1, arg2, arg3, .. } => {
            [Some(arg), arg1, arg2, arg3].into_iter().flatten().collect()
        }
        _ => Vec::new(),
    }
}
