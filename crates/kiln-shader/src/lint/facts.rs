//! What a condition tells of the values in it.

use naga::{BinaryOperator, Expression, Handle, MathFunction, RelationalFunction, TypeInner, UnaryOperator};

use super::range::{Number, Range, TINY};
use super::value::number;
use super::walk::Walk;

impl Walk<'_, '_> {
    /// Adds what follows from `condition` being `truth`.
    pub fn assume(&mut self, condition: Handle<Expression>, truth: bool) {
        use BinaryOperator as Op;
        self.lint.spend(1);
        match self.function.expressions[condition] {
            Expression::Unary { op: UnaryOperator::LogicalNot, expr } => self.assume(expr, !truth),
            Expression::Relational { fun: RelationalFunction::All, argument } if truth => {
                self.assume(argument, true);
            }
            Expression::Relational { fun: RelationalFunction::Any, argument } if !truth => {
                self.assume(argument, false);
            }
            Expression::Binary { op, left, right } => match op {
                Op::LogicalAnd | Op::And if truth => {
                    self.assume(left, true);
                    self.assume(right, true);
                }
                Op::LogicalOr | Op::InclusiveOr if !truth => {
                    self.assume(left, false);
                    self.assume(right, false);
                }
                _ => self.compare(if truth { Some(op) } else { negated(op) }, left, right),
            },
            Expression::Load { pointer } => {
                let Expression::LocalVariable(local) = self.function.expressions[pointer] else { return };
                if let Some((value, condition, right)) = self.shortcut(local).filter(|found| found.0 == truth)
                {
                    self.assume(condition, true);
                    self.assume(right, value);
                }
            }
            _ => {}
        }
    }

    fn compare(&mut self, op: Option<BinaryOperator>, left: Handle<Expression>, right: Handle<Expression>) {
        use BinaryOperator as Op;
        if !self.is_evaluated(left) || !self.is_evaluated(right) {
            return;
        }
        let (a, b, kind) = (self.range(left), self.range(right), number(self.inner(left)));
        let at_most = |hi| Range { hi, ..Range::any() };
        let at_least = |lo| Range { lo, ..Range::any() };
        match op {
            Some(Op::Less) => {
                self.refine(left, at_most(kind.previous(b.hi)));
                self.refine(right, at_least(kind.next(a.lo)));
            }
            Some(Op::LessEqual) => {
                self.refine(left, at_most(b.hi));
                self.refine(right, at_least(a.lo));
            }
            Some(Op::Greater) => self.compare(Some(Op::Less), right, left),
            Some(Op::GreaterEqual) => self.compare(Some(Op::LessEqual), right, left),
            Some(Op::Equal) => {
                self.refine(left, Range { uniform: false, ..b });
                self.refine(right, Range { uniform: false, ..a });
            }
            Some(Op::NotEqual) => {
                let not_zero = Range { near: if kind == Number::Float { TINY } else { 1.0 }, ..Range::any() };
                if b.as_point() == Some(0.0) {
                    self.refine(left, not_zero);
                }
                if a.as_point() == Some(0.0) {
                    self.refine(right, not_zero);
                }
            }
            _ => {}
        }
    }

    /// Adds a fact and what it tells of the expression's operands.
    fn refine(&mut self, handle: Handle<Expression>, fact: Range) {
        let inner = self.inner(handle);
        let fact = self.range(handle).meet(fact).settled(super::value::components(inner));
        let fact = Range { uniform: false, ..fact };
        self.add_fact(handle, fact);
        let length = |near: f64, far: f64| Range { near: near.max(0.0), far, ..Range::any() };
        match self.function.expressions[handle] {
            Expression::Unary { op: UnaryOperator::Negate, expr } => self.refine(expr, fact.negated()),
            Expression::Splat { value, .. } => {
                self.refine(value, Range { near: 0.0, far: f64::INFINITY, ..fact });
            }
            Expression::AccessIndex { base, .. } if matches!(self.inner(base), TypeInner::Vector { .. }) => {
                self.refine(base, length(fact.near, f64::INFINITY));
            }
            Expression::Math { fun: MathFunction::Abs, arg, .. } if matches!(inner, TypeInner::Scalar(_)) => {
                self.refine(arg, length(fact.lo, fact.hi));
            }
            Expression::Math { fun: MathFunction::Length, arg, .. } => {
                self.refine(arg, length(fact.lo, fact.hi));
            }
            Expression::Math { fun: MathFunction::Sqrt, arg, .. } => {
                self.refine(
                    arg,
                    Range {
                        lo: (fact.lo * fact.lo).max(if fact.lo > 0.0 { TINY } else { 0.0 }),
                        ..Range::any()
                    },
                );
            }
            Expression::Math { fun: MathFunction::Dot, arg, arg1: Some(other), .. }
                if self.numbers.same(arg, other) =>
            {
                self.refine(arg, length(fact.lo.sqrt(), fact.hi.sqrt()));
            }
            _ => {}
        }
    }
}

/// What holds where a comparison does not; NaN is not followed.
fn negated(op: BinaryOperator) -> Option<BinaryOperator> {
    use BinaryOperator as Op;
    Some(match op {
        Op::Less => Op::GreaterEqual,
        Op::LessEqual => Op::Greater,
        Op::Greater => Op::LessEqual,
        Op::GreaterEqual => Op::Less,
        Op::Equal => Op::NotEqual,
        Op::NotEqual => Op::Equal,
        _ => return None,
    })
}
