//! Functions at the edge of their domain.

use naga::{BinaryOperator, Expression, Handle, MathFunction, Span};

use super::Rule;
use super::range::{Number, Range};
use super::value::{components, number};
use super::walk::Walk;

/// How many operations a value may go through before a `select` that drops it.
const SELECT_STEPS_MAX: usize = 8;

/// An argument that may leave a domain.
struct Hazard {
    message: String,
    help: &'static str,
}

impl Walk<'_, '_> {
    /// Reports what is wrong with an expression that has just been evaluated.
    pub fn check(&mut self, handle: Handle<Expression>) {
        if !self.lint.reports {
            return;
        }
        self.check_cost(handle);
        let Some(hazard) = self.hazard(handle) else { return };
        if self.is_deselected(handle) {
            return;
        }
        let span = self.span(handle);
        self.lint.warn(Rule::Domain, span, hazard.message, hazard.help, None);
    }

    /// Where an expression stands. naga's GLSL front end does not know it for calls of functions: then where the operand
    /// that was read last stands.
    pub fn span(&self, handle: Handle<Expression>) -> Span {
        let before = self.function.expressions.iter();
        let before = before.rev().skip_while(|(at, _)| at.index() > handle.index());
        let mut spans = before.map(|(at, _)| self.function.expressions.get_span(at));
        spans.find(|span| span.is_defined()).unwrap_or_default()
    }

    fn hazard(&self, handle: Handle<Expression>) -> Option<Hazard> {
        match self.function.expressions[handle] {
            Expression::Binary { op: BinaryOperator::Divide, right, .. } => self.zero(right, "division"),
            Expression::Binary { op: BinaryOperator::Modulo, right, .. } => {
                self.zero(right, "remainder of a division")
            }
            Expression::Math { fun, arg, arg1, .. } => self.function_hazard(fun, arg, arg1),
            _ => None,
        }
    }

    fn zero(&self, divisor: Handle<Expression>, what: &str) -> Option<Hazard> {
        let (range, inner) = (self.range(divisor), self.inner(divisor));
        // For integers WGSL says what comes out.
        if number(inner) != Number::Float || range.is_free_of_zero(components(inner)) {
            return None;
        }
        let message = format!("{what} by a value that may be 0: {range}");
        let help = if range.lo >= 0.0 {
            "bound it, as `max(x, 1e-6)`, or branch on `x > 0.0`"
        } else {
            "branch on `x != 0.0`, or keep it away from 0"
        };
        Some(Hazard { message, help })
    }

    fn function_hazard(
        &self,
        fun: MathFunction,
        arg: Handle<Expression>,
        arg1: Option<Handle<Expression>>,
    ) -> Option<Hazard> {
        use MathFunction as F;
        let (x, count) = (self.range(arg), components(self.inner(arg)));
        let positive = x.lo > 0.0 || (x.lo >= 0.0 && x.is_free_of_zero(count));
        let hazard = |name: &str, edge: &str, help| {
            Some(Hazard { message: format!("`{name}` of a value that may be {edge}: {x}"), help })
        };
        match fun {
            F::Sqrt if x.lo < 0.0 => hazard("sqrt", "negative", "bound it: `sqrt(max(x, 0.0))`"),
            F::InverseSqrt if !positive => {
                hazard("inverseSqrt", not_positive(&x), "bound it: `inverseSqrt(max(x, 1e-12))`")
            }
            F::Log if !positive => hazard("log", not_positive(&x), "bound it: `log(max(x, 1e-12))`"),
            F::Log2 if !positive => hazard("log2", not_positive(&x), "bound it: `log2(max(x, 1e-12))`"),
            F::Acos if leaves_unit(&x) => {
                hazard("acos", "outside -1 … 1", "bound it: `acos(clamp(x, -1.0, 1.0))`")
            }
            F::Asin if leaves_unit(&x) => {
                hazard("asin", "outside -1 … 1", "bound it: `asin(clamp(x, -1.0, 1.0))`")
            }
            F::Acosh if x.lo < 1.0 => hazard("acosh", "less than 1", "bound it: `acosh(max(x, 1.0))`"),
            F::Atanh if x.lo <= -1.0 || x.hi >= 1.0 => {
                hazard("atanh", "-1 or 1 or outside", "bound it, as `atanh(clamp(x, -0.999, 0.999))`")
            }
            F::Normalize if x.near <= 0.0 => Some(Hazard {
                message: "`normalize` of a vector that may be zero".to_owned(),
                help: "branch on `dot(v, v) > 0.0`, and say what a zero vector gives",
            }),
            F::Pow => self.power_hazard(x, self.range(arg1?), count),
            _ => None,
        }
    }

    fn power_hazard(&self, base: Range, exponent: Range, count: usize) -> Option<Hazard> {
        if base.lo < 0.0 {
            let message = format!("`pow` of a base that may be negative: {base}");
            return Some(Hazard { message, help: "bound it: `pow(max(x, 0.0), y)`" });
        }
        if !base.is_free_of_zero(count) && exponent.lo <= 0.0 {
            let message = format!("`pow` of 0 with an exponent that may be 0 or negative: {exponent}");
            return Some(Hazard {
                message,
                help: "bound the base, as `pow(max(x, 1e-6), y)`, or the exponent",
            });
        }
        None
    }

    /// Whether the value goes only into a `select` that takes the other one where the hazard is real.
    fn is_deselected(&mut self, handle: Handle<Expression>) -> bool {
        let mut at = handle;
        for _ in 0..SELECT_STEPS_MAX {
            let Some(user) = self.sole_user(at) else { return false };
            if let Expression::Select { condition, accept, reject } = self.function.expressions[user] {
                if at == condition {
                    return false;
                }
                let mark = self.fact_mark();
                self.assume(condition, at == accept && at != reject);
                let safe = self.hazard(handle).is_none();
                self.drop_facts(mark);
                if safe {
                    return true;
                }
            }
            at = user;
        }
        false
    }
}

fn not_positive(range: &Range) -> &'static str {
    if range.lo < 0.0 { "0 or negative" } else { "0" }
}

fn leaves_unit(range: &Range) -> bool {
    range.lo < -1.0 || range.hi > 1.0
}
