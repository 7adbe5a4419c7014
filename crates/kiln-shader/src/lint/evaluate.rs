//! Ranges of expressions, from the ranges of their operands.

use naga::{
    BinaryOperator, Expression, Handle, ImageClass, ImageQuery, MathFunction, ScalarKind, TypeInner,
    UnaryOperator,
};

use super::range::{Number, Range};
use super::value::{Value, components, number};
use super::walk::Walk;

impl Walk<'_, '_> {
    /// What is known of an expression when it is evaluated.
    pub fn evaluate(&self, handle: Handle<Expression>) -> Value {
        let inner = self.inner(handle);
        let rounded = |range: Range| Value::Number(range.rounded(number(inner), components(inner)));
        match self.function.expressions[handle] {
            Expression::Literal(literal) => Value::Number(literal_range(literal)),
            Expression::Constant(constant) => self.lint.constants[constant.index()].clone(),
            Expression::ZeroValue(ty) => self.lint.types.zero(ty),
            Expression::FunctionArgument(index) => {
                self.arguments.get(index as usize).cloned().unwrap_or_else(|| self.any(handle, false))
            }
            Expression::Override(_) => self.any(handle, true),
            Expression::Load { pointer } => self.load(handle, pointer),
            Expression::Compose { ty, ref components } => self.compose(ty, components),
            Expression::Splat { size, value } => {
                let range = self.range(value);
                #[expect(clippy::cast_precision_loss, reason = "at most 4")]
                let span = (size as usize as f64).sqrt();
                rounded(Range { near: range.near * span, far: range.far * span, ..range })
            }
            Expression::Swizzle { vector, .. } => {
                let range = self.range(vector);
                Value::Number(Range { near: 0.0, far: 2.0 * range.far, ..range }.settled(components(inner)))
            }
            Expression::AccessIndex { base, index } => self.element(handle, base, Some(index)),
            Expression::Access { base, .. } => self.element(handle, base, None),
            Expression::Unary { op, expr } => match op {
                UnaryOperator::Negate => rounded(self.range(expr).negated()),
                UnaryOperator::LogicalNot | UnaryOperator::BitwiseNot => {
                    self.any(handle, self.value(expr).is_uniform())
                }
            },
            Expression::Binary { op, left, right } => rounded(self.binary(op, left, right)),
            Expression::Select { condition, accept, reject } => {
                let joined = self.value(accept).join(&self.value(reject));
                joined.and_uniform(self.value(condition).is_uniform())
            }
            Expression::Math { fun, arg, arg1, arg2, .. } => match self.math(fun, arg, arg1, arg2) {
                Some(range) => rounded(range.with_uniform(self.are_uniform(handle))),
                None => self.any(handle, self.are_uniform(handle)),
            },
            Expression::As { expr, kind, convert } => self.conversion(handle, expr, kind, convert.is_some()),
            Expression::Relational { argument, .. } => self.any(handle, self.value(argument).is_uniform()),
            Expression::ImageSample { depth_ref: Some(_), .. } => {
                Value::Number(Range::between(0.0, 1.0).settled(components(inner)))
            }
            Expression::ImageLoad { image, .. } => {
                let depth =
                    matches!(self.inner(image), TypeInner::Image { class: ImageClass::Depth { .. }, .. });
                if depth {
                    Value::Number(Range::between(0.0, 1.0).settled(1))
                } else {
                    self.any(handle, false)
                }
            }
            // Nothing has no texels.
            Expression::ImageQuery { query: ImageQuery::Size { level: None }, .. }
            | Expression::ImageQuery { query: ImageQuery::NumLevels | ImageQuery::NumLayers, .. }
            | Expression::ArrayLength(_) => {
                rounded(Range { lo: 1.0, uniform: true, ..Number::Unsigned.any() })
            }
            Expression::Derivative { axis: naga::DerivativeAxis::Width, .. } => {
                Value::Number(Range { lo: 0.0, ..Range::any() }.settled(components(inner)))
            }
            Expression::WorkGroupUniformLoadResult { .. } => self.any(handle, true),
            _ => self.any(handle, false),
        }
    }

    /// Whether all operands of a function are.
    fn are_uniform(&self, handle: Handle<Expression>) -> bool {
        let Expression::Math { arg, arg1, arg2, arg3, .. } = self.function.expressions[handle] else {
            return false;
        };
        [Some(arg), arg1, arg2, arg3].into_iter().flatten().all(|operand| self.range(operand).uniform)
    }

    fn compose(&self, ty: Handle<naga::Type>, operands: &[Handle<Expression>]) -> Value {
        let values = operands.iter().map(|operand| self.value(*operand));
        compose(self.lint.module, ty, values)
    }

    /// A member, or one of the elements or components.
    fn element(&self, handle: Handle<Expression>, base: Handle<Expression>, index: Option<u32>) -> Value {
        let value = self.value(base);
        match (self.inner(base), index) {
            (TypeInner::Struct { .. }, Some(index)) => value.member(index as usize),
            (TypeInner::Array { .. }, _) => value,
            (TypeInner::Vector { .. } | TypeInner::Matrix { .. }, _) => {
                let range = Range { near: 0.0, ..value.range() };
                Value::Number(range.settled(components(self.inner(handle))))
            }
            // A pointer.
            _ => Value::any(),
        }
    }

    fn binary(&self, op: BinaryOperator, left: Handle<Expression>, right: Handle<Expression>) -> Range {
        use BinaryOperator as Op;
        let (a, b) = (self.range(left), self.range(right));
        let (a_inner, b_inner) = (self.inner(left), self.inner(right));
        let uniform = a.uniform && b.uniform;
        let same = self.numbers.same(left, right);
        let scalar = |inner: &TypeInner| matches!(inner, TypeInner::Scalar(_));
        let kind = number(a_inner);
        match op {
            Op::Add if kind != Number::Float => counted(a, b, kind.any()),
            Op::Add => a.plus(b),
            Op::Subtract if same => Range::point(0.0).with_uniform(uniform),
            Op::Subtract => a.plus(b.negated()),
            Op::Multiply if same && !is_matrix(a_inner) => a.squared(scalar(a_inner)),
            Op::Multiply => self.product(left, right),
            Op::Divide if kind != Number::Float => integer_quotient(a, b).with_uniform(uniform),
            Op::Divide if self.is_length_of(right, left) => Range::unit().with_uniform(uniform),
            Op::Divide => a.times(b.reciprocal(scalar(b_inner)), scalar(a_inner) || scalar(b_inner)),
            Op::Modulo => {
                let limit = b.magnitude().hi;
                // It has the dividend's sign and is no greater.
                let lo = if a.lo >= 0.0 { 0.0 } else { a.lo.max(-limit) };
                let hi = if a.hi <= 0.0 { 0.0 } else { a.hi.min(limit) };
                Range::between(lo, hi).with_uniform(uniform)
            }
            Op::And if kind == Number::Unsigned => Range::between(0.0, a.hi.min(b.hi)).with_uniform(uniform),
            Op::Equal | Op::NotEqual | Op::Less | Op::LessEqual | Op::Greater | Op::GreaterEqual => {
                Number::Bool.any().with_uniform(uniform)
            }
            _ => kind.any().with_uniform(uniform),
        }
    }

    fn product(&self, left: Handle<Expression>, right: Handle<Expression>) -> Range {
        let (a, b) = (self.range(left), self.range(right));
        let (a_inner, b_inner) = (self.inner(left), self.inner(right));
        let lengths = matches!(a_inner, TypeInner::Scalar(_)) || matches!(b_inner, TypeInner::Scalar(_));
        if self.is_inverse_length_of(right, left) || self.is_inverse_length_of(left, right) {
            return Range::unit().with_uniform(a.uniform && b.uniform);
        }
        match (a_inner, b_inner) {
            (TypeInner::Matrix { .. }, TypeInner::Scalar(_))
            | (TypeInner::Scalar(_), TypeInner::Matrix { .. }) => a.times(b, true),
            (TypeInner::Matrix { columns, .. }, _) => unbounded_dot(a, b, *columns as usize),
            (_, TypeInner::Matrix { rows, .. }) => unbounded_dot(a, b, *rows as usize),
            _ if is_float(a_inner) && self.is_even_power(left, right) => {
                Range { lo: a.times(b, lengths).lo.max(0.0), ..a.times(b, lengths) }
            }
            _ => a.times(b, lengths),
        }
    }

    /// Whether a product of scalars is one of squares and of factors that are not negative, as `(a·a·b)·b`.
    fn is_even_power(&self, left: Handle<Expression>, right: Handle<Expression>) -> bool {
        const FACTORS_MAX: usize = 8;
        let mut open = vec![left, right];
        let mut odd: Vec<Handle<Expression>> = Vec::new();
        let mut seen = 0;
        while let Some(factor) = open.pop() {
            seen += 1;
            if seen > FACTORS_MAX {
                return false;
            }
            match self.function.expressions[factor] {
                _ if self.range(factor).lo >= 0.0 => {}
                Expression::Binary { op: BinaryOperator::Multiply, left, right }
                    if !is_matrix(self.inner(left)) && !is_matrix(self.inner(right)) =>
                {
                    open.extend([left, right]);
                }
                _ => match odd.iter().position(|other| self.numbers.same(*other, factor)) {
                    Some(position) => drop(odd.swap_remove(position)),
                    None => odd.push(factor),
                },
            }
        }
        odd.is_empty()
    }

    /// Whether `length` is `length(v)`.
    fn is_length_of(&self, length: Handle<Expression>, v: Handle<Expression>) -> bool {
        match self.function.expressions[length] {
            Expression::Math { fun: MathFunction::Length, arg, .. } => self.numbers.same(arg, v),
            Expression::Math { fun: MathFunction::Sqrt, arg, .. } => self.is_square_of(arg, v),
            Expression::Splat { value, .. } => self.is_length_of(value, v),
            _ => false,
        }
    }

    fn is_inverse_length_of(&self, inverse: Handle<Expression>, v: Handle<Expression>) -> bool {
        match self.function.expressions[inverse] {
            Expression::Math { fun: MathFunction::InverseSqrt, arg, .. } => self.is_square_of(arg, v),
            _ => false,
        }
    }

    fn is_square_of(&self, square: Handle<Expression>, v: Handle<Expression>) -> bool {
        match self.function.expressions[square] {
            Expression::Math { fun: MathFunction::Dot, arg, arg1: Some(other), .. } => {
                self.numbers.same(arg, other) && self.numbers.same(arg, v)
            }
            _ => false,
        }
    }

    /// Functions of which something is known; their arguments' uniformity is the caller's business.
    fn math(
        &self,
        fun: MathFunction,
        arg: Handle<Expression>,
        arg1: Option<Handle<Expression>>,
        arg2: Option<Handle<Expression>>,
    ) -> Option<Range> {
        use MathFunction as F;
        use std::f64::consts::{FRAC_PI_2, PI};
        let x = self.range(arg);
        let y = arg1.map_or(Range::any(), |arg| self.range(arg));
        let z = arg2.map_or(Range::any(), |arg| self.range(arg));
        let inner = self.inner(arg);
        let count = components(inner);
        let same = arg1.is_some_and(|other| self.numbers.same(arg, other));
        let known = match fun {
            F::Abs => x.magnitude(),
            F::Min => x.least(y),
            F::Max => x.greatest(y),
            F::Clamp => x.greatest(y).least(z),
            F::Saturate => x.mapped(|x| x.clamp(0.0, 1.0)),
            F::Sign | F::Cos | F::Sin | F::Tanh => Range::between(-1.0, 1.0),
            F::Cosh => Range { lo: 1.0, ..Range::any() },
            F::Acos => Range::between(0.0, PI),
            F::Asin | F::Atan => Range::between(-FRAC_PI_2, FRAC_PI_2),
            F::Atan2 => Range::between(-PI, PI),
            F::Acosh => Range { lo: 0.0, ..Range::any() },
            F::Radians => x.times(Range::point(PI / 180.0), true),
            F::Degrees => x.times(Range::point(180.0 / PI), true),
            F::Ceil => x.mapped(f64::ceil),
            F::Floor => x.mapped(f64::floor),
            F::Round => x.mapped(f64::round_ties_even),
            F::Trunc => x.mapped(f64::trunc),
            F::Fract => Range::between(0.0, 1.0),
            F::Exp => x.mapped(f64::exp),
            F::Exp2 => x.mapped(f64::exp2),
            F::Log => x.mapped(|x| x.max(0.0).ln()),
            F::Log2 => x.mapped(|x| x.max(0.0).log2()),
            F::Pow => x.power(y),
            F::Sqrt => x.mapped(|x| x.max(0.0).sqrt()),
            F::InverseSqrt => Range { lo: x.lo.max(0.0), ..x }.mapped_down(|x| 1.0 / x.sqrt()),
            F::Dot if same => Range::between(x.near * x.near, x.far * x.far),
            F::Dot => x.dot(y, count),
            F::Length => Range::between(x.near, x.far),
            F::Distance if same => Range::point(0.0),
            F::Distance => Range::between(0.0, x.far + y.far),
            F::Normalize => Range::unit(),
            F::Cross => Range { far: x.far * y.far, ..x.dot(y, 2).join(x.dot(y, 2).negated()) },
            F::FaceForward => x.join(x.negated()),
            F::Reflect if y.is_unit() && x.is_unit() => Range::unit(),
            F::Reflect => Range { far: x.far * (1.0 + 2.0 * y.far * y.far), ..Range::any() },
            F::Fma => x.times(y, count == 1).plus(z),
            F::Mix => mix(x, y, z),
            F::Step | F::SmoothStep => Range::between(0.0, 1.0),
            F::QuantizeToF16 => x,
            F::Unpack4x8unorm | F::Unpack2x16unorm => Range::between(0.0, 1.0),
            F::Unpack4x8snorm | F::Unpack2x16snorm => Range::between(-1.0, 1.0),
            F::CountOneBits | F::CountLeadingZeros | F::CountTrailingZeros => Range::between(0.0, 32.0),
            _ => return None,
        };
        Some(known)
    }

    fn conversion(
        &self,
        handle: Handle<Expression>,
        operand: Handle<Expression>,
        kind: ScalarKind,
        converts: bool,
    ) -> Value {
        let range = self.range(operand);
        let to = number(self.inner(handle));
        let count = components(self.inner(handle));
        if !converts || kind == ScalarKind::Bool {
            return self.any(handle, range.uniform);
        }
        let any = to.any();
        let converted = match to {
            Number::Float => range,
            // Out of range it is the nearest that there is; in between it is cut off.
            _ => Range { near: 0.0, ..range }.mapped(|x| x.trunc().clamp(any.lo, any.hi)),
        };
        Value::Number(converted.rounded(to, count))
    }
}

impl Range {
    /// A function that never rises.
    fn mapped_down(self, function: impl Fn(f64) -> f64) -> Range {
        Range { uniform: self.uniform, ..Range::between(function(self.hi), function(self.lo)) }
    }
}

/// A composed vector, matrix, array or struct.
pub fn compose(module: &naga::Module, ty: Handle<naga::Type>, values: impl Iterator<Item = Value>) -> Value {
    let inner = &module.types[ty].inner;
    match inner {
        TypeInner::Struct { .. } => Value::Struct(values.collect()),
        TypeInner::Array { .. } => values.reduce(|a, b| a.join(&b)).unwrap_or_else(Value::any),
        _ => {
            let ranges: Vec<Range> = values.map(|value| value.range()).collect();
            let near = ranges.iter().map(|range| range.near).fold(0.0, f64::max);
            let far = ranges.iter().map(|range| range.far * range.far).sum::<f64>().sqrt();
            let joined = ranges.into_iter().reduce(Range::join).unwrap_or_else(Range::any);
            Value::Number(Range { near, far, ..joined }.settled(components(inner)))
        }
    }
}

/// The range of a literal.
pub fn literal_range(literal: naga::Literal) -> Range {
    use naga::Literal;
    match literal {
        Literal::F32(value) => Range::point(value.into()),
        Literal::F64(value) | Literal::AbstractFloat(value) => Range::point(value),
        Literal::U32(value) => Range::point(value.into()),
        Literal::I32(value) => Range::point(value.into()),
        Literal::Bool(value) => Range::point(f64::from(u8::from(value))),
        _ => Range::any(),
    }
}

fn is_matrix(inner: &TypeInner) -> bool {
    matches!(inner, TypeInner::Matrix { .. })
}

fn is_float(inner: &TypeInner) -> bool {
    number(inner) == Number::Float
}

/// A row or column of a product with a matrix, whose length says nothing of its rows'.
fn unbounded_dot(a: Range, b: Range, components: usize) -> Range {
    let far = f64::INFINITY;
    Range { near: 0.0, ..Range { far, ..a }.dot(Range { far, ..b }, components) }
}

/// A sum of integers. Counters are taken not to run over.
fn counted(a: Range, b: Range, any: Range) -> Range {
    const STEP_MAX: f64 = 65536.0;
    let sum = a.plus(b);
    let is_step = |range: Range| range.as_point().is_some_and(|step| (0.0..=STEP_MAX).contains(&step));
    if is_step(a) || is_step(b) { Range { hi: sum.hi.min(any.hi), far: f64::INFINITY, ..sum } } else { sum }
}

fn integer_quotient(a: Range, b: Range) -> Range {
    // Division by 0 gives the dividend.
    let far = a.magnitude().hi;
    let lo = if a.lo >= 0.0 && b.lo >= 0.0 { 0.0 } else { -far };
    Range::between(lo, far)
}

fn mix(x: Range, y: Range, t: Range) -> Range {
    /// Rounding may leave the ends by this much.
    const ERROR: f64 = 2.5e-7;
    if t.lo >= 0.0 && t.hi <= 1.0 {
        let (lo, hi) = (x.lo.min(y.lo), x.hi.max(y.hi));
        let far = x.far.max(y.far) * (1.0 + ERROR);
        return Range { far, ..Range::between(lo - lo.abs() * ERROR, hi + hi.abs() * ERROR) };
    }
    let rest = Range::point(1.0).plus(t.negated());
    let far = f64::INFINITY;
    Range { near: 0.0, far, ..x.times(rest, false).plus(y.times(t, false)) }
}
