//! Intervals: what is known of a number, or of all components of a vector at once.
//!
//! Bounds hold for `f32` arithmetic: results are rounded outwards, and what a GPU may flush to zero counts as
//! zero. Whether a value is NaN is not followed.

/// Components of a unit vector, and lengths, may be off by this much: a GPU's `inverseSqrt` is exact to 2 units
/// in the last place only.
const UNIT_ERROR: f64 = 1e-6;

/// Smallest positive `f32`: what `x > 0` leaves of x.
pub const TINY: f64 = 1.401_298_464_324_817e-45;

/// Bounds of a scalar, vector, matrix or of the elements of an array.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Least value of any component.
    pub lo: f64,
    /// Greatest value of any component.
    pub hi: f64,
    /// Least length; for a scalar that is its magnitude. Above 0, the value is not zero.
    pub near: f64,
    /// Greatest length.
    pub far: f64,
    /// Whether all invocations of a draw have the same value.
    pub uniform: bool,
}

/// What numbers of a type can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    /// `f32`, or what behaves like it.
    Float,
    /// `i32`.
    Signed,
    /// `u32`.
    Unsigned,
    /// `bool`, as 0 or 1.
    Bool,
}

impl Number {
    /// Every value there is.
    pub fn any(self) -> Range {
        match self {
            Number::Float => Range::between(f64::NEG_INFINITY, f64::INFINITY),
            Number::Signed => Range::between(f64::from(i32::MIN), f64::from(i32::MAX)),
            Number::Unsigned => Range::between(0.0, f64::from(u32::MAX)),
            Number::Bool => Range::between(0.0, 1.0),
        }
    }

    /// The value after `x`.
    pub fn next(self, x: f64) -> f64 {
        match self {
            Number::Float if x.is_finite() => f64::from(round_down(x).next_up()),
            Number::Float => x,
            _ => x + 1.0,
        }
    }

    /// The value before `x`.
    pub fn previous(self, x: f64) -> f64 {
        -self.next(-x)
    }
}

impl Range {
    /// Components from `lo` to `hi`, of unknown length.
    pub fn between(lo: f64, hi: f64) -> Range {
        Range { lo, hi, near: 0.0, far: f64::INFINITY, uniform: false }
    }

    /// Nothing is known.
    pub fn any() -> Range {
        Range::between(f64::NEG_INFINITY, f64::INFINITY)
    }

    /// One value in all components.
    pub fn point(value: f64) -> Range {
        Range { uniform: true, ..Range::between(value, value) }.settled(1)
    }

    /// A unit vector.
    pub fn unit() -> Range {
        let (near, far) = (1.0 - UNIT_ERROR, 1.0 + UNIT_ERROR);
        Range { lo: -far, hi: far, near, far, uniform: false }
    }

    /// The same with another uniformity.
    pub fn with_uniform(self, uniform: bool) -> Range {
        Range { uniform, ..self }
    }

    /// The value, if there is only one.
    pub fn as_point(&self) -> Option<f64> {
        (self.lo == self.hi).then_some(self.lo)
    }

    /// Whether the length is 1.
    pub fn is_unit(&self) -> bool {
        self.near >= 1.0 - 4.0 * UNIT_ERROR && self.far <= 1.0 + 4.0 * UNIT_ERROR
    }

    /// Whether no component is zero.
    pub fn is_free_of_zero(&self, components: usize) -> bool {
        self.lo > 0.0 || self.hi < 0.0 || (components == 1 && self.near > 0.0)
    }

    /// What holds for both of two values.
    pub fn join(self, other: Range) -> Range {
        Range {
            lo: self.lo.min(other.lo),
            hi: self.hi.max(other.hi),
            near: self.near.min(other.near),
            far: self.far.max(other.far),
            uniform: self.uniform && other.uniform,
        }
    }

    /// What two facts about one value say together; `self` where they contradict each other, which is in code
    /// that never runs.
    pub fn meet(self, other: Range) -> Range {
        let met = Range {
            lo: self.lo.max(other.lo),
            hi: self.hi.min(other.hi),
            near: self.near.max(other.near),
            far: self.far.min(other.far),
            uniform: self.uniform || other.uniform,
        };
        if met.lo <= met.hi && met.near <= met.far { met } else { self }
    }

    /// `next` with each bound that moved away from `self` gone.
    pub fn widen(self, next: Range, number: Number) -> Range {
        let any = number.any();
        Range {
            lo: if next.lo < self.lo { any.lo } else { self.lo },
            hi: if next.hi > self.hi { any.hi } else { self.hi },
            near: if next.near < self.near { 0.0 } else { self.near },
            far: if next.far > self.far { f64::INFINITY } else { self.far },
            uniform: self.uniform && next.uniform,
        }
    }

    /// Lets components and length bound each other.
    pub fn settled(self, components: usize) -> Range {
        let nearest = if self.lo > 0.0 { self.lo } else { (-self.hi).max(0.0) };
        let largest = self.lo.abs().max(self.hi.abs());
        #[expect(clippy::cast_precision_loss, reason = "at most 16")]
        let span = (components as f64).sqrt();
        let near = self.near.max(nearest);
        // Not below `near`, which may have been rounded another way.
        let far = self.far.min(largest * span).max(near);
        let (mut lo, mut hi) = (self.lo.max(-far), self.hi.min(far));
        if components == 1 && lo >= 0.0 {
            lo = lo.max(near).min(hi);
        } else if components == 1 && hi <= 0.0 {
            hi = hi.min(-near).max(lo);
        }
        Range { lo, hi, near, far, uniform: self.uniform }
    }

    /// The result of an operation, as a machine may have rounded it.
    pub fn rounded(self, number: Number, components: usize) -> Range {
        if number != Number::Float {
            let any = number.any();
            // Integers wrap.
            let fits = any.lo <= self.lo && self.hi <= any.hi;
            return if fits { self } else { any.with_uniform(self.uniform) }.settled(components);
        }
        let near = f64::from(flush(round_down(self.near))).max(0.0);
        let far = f64::from(round_up(self.far));
        let (lo, hi) = (f64::from(flush_down(round_down(self.lo))), f64::from(flush_up(round_up(self.hi))));
        Range { lo, hi, near, far, uniform: self.uniform }.settled(components)
    }

    /// -x.
    pub fn negated(self) -> Range {
        Range { lo: -self.hi, hi: -self.lo, ..self }
    }

    /// |x|, by component.
    pub fn magnitude(self) -> Range {
        let lo = self.lo.max(-self.hi).max(0.0);
        Range { lo, hi: self.lo.abs().max(self.hi.abs()), ..self }
    }

    /// a + b.
    pub fn plus(self, other: Range) -> Range {
        Range {
            lo: sum(self.lo, other.lo, f64::NEG_INFINITY),
            hi: sum(self.hi, other.hi, f64::INFINITY),
            // A sum of vectors is at least as long as their lengths differ.
            near: (self.near - other.far).max(other.near - self.far).max(0.0),
            far: self.far + other.far,
            uniform: self.uniform && other.uniform,
        }
    }

    /// a · b by component, one of them a scalar or both scalars; for two vectors `lengths` is false.
    pub fn times(self, other: Range, lengths: bool) -> Range {
        let products = [
            product(self.lo, other.lo),
            product(self.lo, other.hi),
            product(self.hi, other.lo),
            product(self.hi, other.hi),
        ];
        let (near, far) = if lengths {
            (product(self.near, other.near), product(self.far, other.far))
        } else {
            (0.0, f64::INFINITY)
        };
        let uniform = self.uniform && other.uniform;
        Range { lo: least(products), hi: greatest(products), near, far, uniform }
    }

    /// x · x of one value.
    pub fn squared(self, is_scalar: bool) -> Range {
        let magnitude = self.magnitude();
        Range { lo: product(magnitude.lo, magnitude.lo), ..magnitude.times(magnitude, is_scalar) }
    }

    /// 1 / x by component.
    pub fn reciprocal(self, is_scalar: bool) -> Range {
        let (lo, hi) = if self.lo >= 0.0 {
            (1.0 / self.hi, if self.lo > 0.0 { 1.0 / self.lo } else { f64::INFINITY })
        } else if self.hi <= 0.0 {
            (if self.hi < 0.0 { 1.0 / self.hi } else { f64::NEG_INFINITY }, 1.0 / self.lo)
        } else {
            (f64::NEG_INFINITY, f64::INFINITY)
        };
        let (near, far) = if is_scalar {
            (1.0 / self.far, if self.near > 0.0 { 1.0 / self.near } else { f64::INFINITY })
        } else {
            (0.0, f64::INFINITY)
        };
        Range { lo, hi, near, far, uniform: self.uniform }
    }

    /// A function that never falls, by component.
    pub fn mapped(self, function: impl Fn(f64) -> f64) -> Range {
        Range { uniform: self.uniform, ..Range::between(function(self.lo), function(self.hi)) }
    }

    /// min(a, b).
    pub fn least(self, other: Range) -> Range {
        let uniform = self.uniform && other.uniform;
        Range::between(self.lo.min(other.lo), self.hi.min(other.hi)).with_uniform(uniform)
    }

    /// max(a, b).
    pub fn greatest(self, other: Range) -> Range {
        let uniform = self.uniform && other.uniform;
        Range::between(self.lo.max(other.lo), self.hi.max(other.hi)).with_uniform(uniform)
    }

    /// a^b for a ≥ 0; what is below counts as 0.
    pub fn power(self, exponent: Range) -> Range {
        let base = Range { lo: self.lo.max(0.0), hi: self.hi.max(0.0), ..self };
        let corners =
            [(base.lo, exponent.lo), (base.lo, exponent.hi), (base.hi, exponent.lo), (base.hi, exponent.hi)];
        let corners = corners.map(|(base, exponent)| base.powf(exponent));
        let uniform = self.uniform && exponent.uniform;
        Range::between(least(corners).max(0.0), greatest(corners)).with_uniform(uniform)
    }

    /// Sum of the products of `components` pairs.
    pub fn dot(self, other: Range, components: usize) -> Range {
        #[expect(clippy::cast_precision_loss, reason = "at most 4")]
        let count = components as f64;
        let each = self.times(other, false);
        let far = product(self.far, other.far);
        let (lo, hi) = (product(each.lo, count).max(-far), product(each.hi, count).min(far));
        Range::between(lo, hi).with_uniform(each.uniform)
    }
}

/// `-0.4 … inf`
impl std::fmt::Display for Range {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} … {}", shown(self.lo), shown(self.hi))
    }
}

fn shown(value: f64) -> String {
    let rounded = round_down(value);
    if rounded != 0.0 && rounded.is_finite() && !(1e-4..1e6).contains(&rounded.abs()) {
        format!("{rounded:e}")
    } else {
        format!("{}", rounded + 0.0)
    }
}

fn sum(a: f64, b: f64, otherwise: f64) -> f64 {
    let sum = a + b;
    if sum.is_nan() { otherwise } else { sum }
}

/// 0 · inf is 0: the bound belongs to values that are themselves finite.
fn product(a: f64, b: f64) -> f64 {
    if a == 0.0 || b == 0.0 { 0.0 } else { a * b }
}

fn least(values: [f64; 4]) -> f64 {
    values.into_iter().fold(f64::INFINITY, f64::min)
}

fn greatest(values: [f64; 4]) -> f64 {
    values.into_iter().fold(f64::NEG_INFINITY, f64::max)
}

#[expect(clippy::cast_possible_truncation, reason = "the neighbour is taken where it rounds the wrong way")]
fn round_down(x: f64) -> f32 {
    if x.is_nan() {
        return f32::NEG_INFINITY;
    }
    let rounded = x as f32;
    if f64::from(rounded) > x { rounded.next_down() } else { rounded }
}

fn round_up(x: f64) -> f32 {
    if x.is_nan() { f32::INFINITY } else { -round_down(-x) }
}

/// GPUs may make zeros of numbers this small.
fn flush(x: f32) -> f32 {
    if x.abs() < f32::MIN_POSITIVE { 0.0 } else { x }
}

fn flush_down(x: f32) -> f32 {
    if x > 0.0 { flush(x) } else { x }
}

fn flush_up(x: f32) -> f32 {
    if x < 0.0 { flush(x) } else { x }
}
