//! What runs but hurts, and what needs all invocations in step.

use naga::{
    AddressSpace, BinaryOperator, Block, Expression, Handle, LocalVariable, MathFunction, SampleLevel, Span,
    Statement, TypeInner,
};

use super::flow::inner_blocks;
use super::value::array_len;
use super::walk::Walk;
use super::{Lint, Rule};

/// More rounds of a loop than this for each pixel.
const ITERATIONS_MAX: f64 = 4096.0;
/// Larger arrays with computed indices do not stay in registers on any GPU.
const INDEXED_ELEMENTS_MAX: u32 = 64;
/// What OpenGL ES 3.0 and WebGL 2 promise of a uniform block (`GL_MAX_UNIFORM_BLOCK_SIZE`).
const UNIFORM_BYTES_MAX: u32 = 16384;

impl Lint<'_> {
    /// Uniforms that not every device takes.
    pub fn check_uniforms(&mut self) {
        let module = self.module;
        for (handle, variable) in module.global_variables.iter() {
            if variable.space != AddressSpace::Uniform {
                continue;
            }
            let size = module.types[variable.ty].inner.size(module.to_ctx());
            if size > UNIFORM_BYTES_MAX {
                let name = variable.name.as_deref().unwrap_or_default();
                let message =
                    format!("uniform `{name}` has {size} bytes, some devices take {UNIFORM_BYTES_MAX}");
                let help = "use a storage buffer or a texture";
                self.warn(Rule::Cost, module.global_variables.get_span(handle), message, help, None);
            }
        }
    }
}

impl Walk<'_, '_> {
    /// Reports what an expression costs, and whether it may stand here.
    pub fn check_cost(&mut self, handle: Handle<Expression>) {
        match self.function.expressions[handle] {
            Expression::Math { fun: MathFunction::Pow, arg1: Some(exponent), .. } => {
                self.check_power(handle, exponent);
            }
            Expression::Access { base, index } => self.check_indexed(handle, base, index),
            Expression::Derivative { .. } => {
                self.check_in_step(handle, "a derivative", "take the derivative before the branch");
            }
            Expression::ImageSample {
                level: SampleLevel::Auto | SampleLevel::Bias(_), gather: None, ..
            } => {
                let help =
                    "sample before the branch, or name the level: `textureSampleLevel`, `textureSampleGrad`";
                self.check_in_step(handle, "a texture's level", help);
            }
            _ => {}
        }
    }

    fn warn(&mut self, rule: Rule, handle: Handle<Expression>, message: String, help: &str) {
        self.lint.warn(rule, self.span(handle), message, help, None);
    }

    fn check_power(&mut self, handle: Handle<Expression>, exponent: Handle<Expression>) {
        let help = match self.range(exponent).as_point() {
            Some(2.0) => "write `x * x`",
            Some(3.0) => "write `x * x * x`",
            Some(4.0) => "write `let x2 = x * x;` and `x2 * x2`",
            Some(5.0) => "write `let x2 = x * x;` and `x2 * x2 * x`",
            _ => return,
        };
        let message =
            "`pow` with a small whole exponent is slow, and undefined for negative bases".to_owned();
        self.warn(Rule::Cost, handle, message, help);
    }

    fn check_indexed(
        &mut self,
        handle: Handle<Expression>,
        base: Handle<Expression>,
        index: Handle<Expression>,
    ) {
        let inner = match self.inner(base) {
            TypeInner::Pointer { base: pointee, space: AddressSpace::Function } => {
                &self.lint.module.types[*pointee].inner
            }
            inner => inner,
        };
        let constant = self.range(index).as_point().is_some();
        let Some(count) = array_len(inner).filter(|count| *count > INDEXED_ELEMENTS_MAX && !constant) else {
            return;
        };
        let message = format!("a local array of {count} elements is read or written at a computed index");
        self.warn(Rule::Cost, handle, message, "make it a `const`, a uniform or a texture, or a smaller one");
    }

    /// Derivatives compare neighbours, which must all come by here (WGSL, section 15.2, uniformity).
    fn check_in_step(&mut self, handle: Handle<Expression>, what: &str, help: &str) {
        let Some(cause) = self.divergence else { return };
        let message = format!("{what} is taken where neighbouring pixels may not be");
        let span = self.span(handle);
        self.lint.warn(Rule::Uniformity, span, message, help, Some((cause, "they part at")));
    }

    /// Reports a loop that makes more than the limit of iterations out of the `around` that there are.
    pub fn check_iterations(&mut self, around: f64, span: Span) {
        let count = self.iterations;
        let is_first = around <= ITERATIONS_MAX && count > ITERATIONS_MAX;
        if is_first && self.records && self.lint.reports && self.in_fragment {
            let message = format!("{count} rounds of a loop for each pixel");
            let help = "spread them over frames, bake the result, or take fewer samples";
            self.lint.warn(Rule::Cost, span, message, help, None);
        }
    }

    /// How often a loop like `for (var i = 0; i < 64; i++)` runs.
    pub fn trip_count(&self, body: &Block, continuing: &Block) -> Option<f64> {
        let (condition, goes_on) = body.iter().find_map(|statement| match statement {
            Statement::If { condition, accept, reject } if is_break(reject) && accept.is_empty() => {
                Some((*condition, true))
            }
            Statement::If { condition, accept, reject } if is_break(accept) && reject.is_empty() => {
                Some((*condition, false))
            }
            _ => None,
        })?;
        let Expression::Binary { op, left, right } = self.function.expressions[condition] else {
            return None;
        };
        let (counter, limit) = (self.loaded(left)?, self.constant(right)?);
        let step = continuing.iter().find_map(|statement| self.step(statement, counter))?;
        let stores = |block| self.stores(block, counter);
        let start = self.local_range(counter).as_point()?;
        if stores(body) != 0 || stores(continuing) != 1 || step == 0.0 {
            return None;
        }
        use BinaryOperator as Op;
        let rounds = (limit - start) / step;
        let rounds = match (op, goes_on) {
            (Op::Less, true) | (Op::GreaterEqual, false) if step > 0.0 => rounds.ceil(),
            (Op::LessEqual, true) | (Op::Greater, false) if step > 0.0 => rounds.floor() + 1.0,
            (Op::Greater, true) | (Op::LessEqual, false) if step < 0.0 => rounds.ceil(),
            (Op::GreaterEqual, true) | (Op::Less, false) if step < 0.0 => rounds.floor() + 1.0,
            (Op::NotEqual, true) | (Op::Equal, false) => rounds,
            _ => return None,
        };
        Some(rounds.max(0.0))
    }

    fn loaded(&self, handle: Handle<Expression>) -> Option<Handle<LocalVariable>> {
        let Expression::Load { pointer } = self.function.expressions[handle] else { return None };
        match self.function.expressions[pointer] {
            Expression::LocalVariable(local) => Some(local),
            _ => None,
        }
    }

    fn constant(&self, handle: Handle<Expression>) -> Option<f64> {
        let is_constant =
            matches!(self.function.expressions[handle], Expression::Literal(_) | Expression::Constant(_));
        if is_constant { self.range(handle).as_point() } else { None }
    }

    /// What a statement adds to `counter`.
    fn step(&self, statement: &Statement, counter: Handle<LocalVariable>) -> Option<f64> {
        let Statement::Store { pointer, value } = statement else { return None };
        let Expression::Binary { op, left, right } = self.function.expressions[*value] else { return None };
        if self.root(*pointer) != Some(counter) || self.loaded(left) != Some(counter) {
            return None;
        }
        match op {
            BinaryOperator::Add => self.constant(right),
            BinaryOperator::Subtract => self.constant(right).map(|step| -step),
            _ => None,
        }
    }

    fn stores(&self, block: &Block, counter: Handle<LocalVariable>) -> usize {
        let in_statement = |statement: &Statement| match statement {
            Statement::Store { pointer, .. } => usize::from(self.root(*pointer) == Some(counter)),
            Statement::Call { arguments, .. } => {
                arguments.iter().filter(|argument| self.root(**argument) == Some(counter)).count()
            }
            _ => inner_blocks(statement).into_iter().map(|block| self.stores(block, counter)).sum(),
        };
        block.iter().map(in_statement).sum()
    }
}

fn is_break(block: &Block) -> bool {
    matches!(block.first(), Some(Statement::Break)) && block.len() == 1
}
