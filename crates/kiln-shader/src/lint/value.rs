//! Abstract values: a range, or one value for each member of a struct.

use std::rc::Rc;

use naga::proc::TypeResolution;
use naga::{ArraySize, Handle, Module, ScalarKind, Type, TypeInner};

use super::range::{Number, Range};

/// What is known of a value. All elements of an array, and all components of a vector or matrix, share a range.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Numbers, and all that has no members.
    Number(Range),
    /// A struct.
    Struct(Rc<[Value]>),
}

/// A struct with more numbers than this is followed as if it were one number.
const NUMBERS_MAX: usize = 256;

impl Value {
    /// Nothing is known.
    pub fn any() -> Value {
        Value::Number(Range::any())
    }

    /// The range; of a struct nothing is known.
    pub fn range(&self) -> Range {
        match self {
            Value::Number(range) => *range,
            Value::Struct(_) => Range::any(),
        }
    }

    /// Member `index`.
    pub fn member(&self, index: usize) -> Value {
        match self {
            Value::Number(range) => Value::Number(Range::any().with_uniform(range.uniform)),
            Value::Struct(members) => members.get(index).cloned().unwrap_or_else(Value::any),
        }
    }

    /// The same with `value` at the end of `path`.
    pub fn with_member(&self, path: &[u32], value: Value) -> Value {
        match (self, path) {
            (_, []) => value,
            (Value::Number(range), _) => {
                Value::Number(range.with_uniform(range.uniform && value.is_uniform()))
            }
            (Value::Struct(members), [first, rest @ ..]) => {
                let mut members = members.to_vec();
                if let Some(member) = members.get_mut(*first as usize) {
                    *member = member.with_member(rest, value);
                }
                Value::Struct(members.into())
            }
        }
    }

    /// `number` at each range of two values.
    fn zip(&self, other: &Value, number: &impl Fn(Range, Range) -> Range) -> Value {
        match (self, other) {
            (Value::Struct(a), Value::Struct(b)) if a.len() == b.len() => {
                Value::Struct(a.iter().zip(b.iter()).map(|(a, b)| a.zip(b, number)).collect())
            }
            (a, b) => Value::Number(number(a.range(), b.range())),
        }
    }

    /// What holds for both.
    pub fn join(&self, other: &Value) -> Value {
        self.zip(other, &Range::join)
    }

    /// The next value in a loop, with bounds that still move given up.
    pub fn widen(&self, next: &Value) -> Value {
        self.zip(next, &|a, b| a.widen(b, Number::Float))
    }

    /// Values of divergent control flow differ between invocations.
    pub fn and_uniform(&self, uniform: bool) -> Value {
        if uniform {
            return self.clone();
        }
        match self {
            Value::Number(range) => Value::Number(range.with_uniform(false)),
            Value::Struct(members) => {
                Value::Struct(members.iter().map(|value| value.and_uniform(false)).collect())
            }
        }
    }

    /// Whether all of it is uniform.
    pub fn is_uniform(&self) -> bool {
        match self {
            Value::Number(range) => range.uniform,
            Value::Struct(members) => members.iter().all(Value::is_uniform),
        }
    }
}

/// What can be known of each type.
pub struct Types<'a> {
    module: &'a Module,
    /// Number of ranges in a value of each type.
    sizes: Vec<usize>,
}

impl<'a> Types<'a> {
    /// Types come after what they are made of.
    pub fn new(module: &'a Module) -> Types<'a> {
        let mut sizes: Vec<usize> = Vec::new();
        for (_, ty) in module.types.iter() {
            let size = |ty: Handle<Type>| sizes.get(ty.index()).copied().unwrap_or(1);
            sizes.push(match &ty.inner {
                TypeInner::Struct { members, .. } => {
                    members.iter().fold(0, |sum: usize, member| sum.saturating_add(size(member.ty)))
                }
                TypeInner::Array { base, .. } | TypeInner::BindingArray { base, .. } => size(*base),
                _ => 1,
            });
        }
        Types { module, sizes }
    }

    /// Any value of a type.
    pub fn any(&self, ty: Handle<Type>, uniform: bool) -> Value {
        self.fill(ty, &|inner| number(inner).any().with_uniform(uniform).settled(components(inner)))
    }

    /// Any value of an expression's type.
    pub fn any_of(&self, ty: &TypeResolution, uniform: bool) -> Value {
        match ty {
            TypeResolution::Handle(ty) => self.any(*ty, uniform),
            TypeResolution::Value(inner) => {
                Value::Number(number(inner).any().with_uniform(uniform).settled(components(inner)))
            }
        }
    }

    /// The zero value of a type.
    pub fn zero(&self, ty: Handle<Type>) -> Value {
        self.fill(ty, &|_| Range::point(0.0))
    }

    fn fill(&self, ty: Handle<Type>, leaf: &impl Fn(&TypeInner) -> Range) -> Value {
        if self.sizes.get(ty.index()).is_none_or(|size| *size > NUMBERS_MAX) {
            let uniform = leaf(&TypeInner::Scalar(naga::Scalar::F32)).uniform;
            return Value::Number(Range::any().with_uniform(uniform));
        }
        match &self.module.types[ty].inner {
            TypeInner::Struct { members, .. } => {
                Value::Struct(members.iter().map(|member| self.fill(member.ty, leaf)).collect())
            }
            TypeInner::Array { base, .. } => self.fill(*base, leaf),
            inner => Value::Number(leaf(inner)),
        }
    }
}

/// What numbers a type is made of.
pub fn number(inner: &TypeInner) -> Number {
    match inner.scalar_kind() {
        Some(ScalarKind::Sint) => Number::Signed,
        Some(ScalarKind::Uint) => Number::Unsigned,
        Some(ScalarKind::Bool) => Number::Bool,
        _ => Number::Float,
    }
}

/// How many numbers a scalar, vector or matrix has.
pub fn components(inner: &TypeInner) -> usize {
    match inner {
        TypeInner::Vector { size, .. } => *size as usize,
        TypeInner::Matrix { columns, rows, .. } => *columns as usize * *rows as usize,
        _ => 1,
    }
}

/// Elements of an array that has a fixed number of them.
pub fn array_len(inner: &TypeInner) -> Option<u32> {
    match inner {
        TypeInner::Array { size: ArraySize::Constant(count), .. } => Some(count.get()),
        _ => None,
    }
}
