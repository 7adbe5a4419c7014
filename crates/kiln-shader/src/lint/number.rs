//! Value numbers: expressions with the same number have the same value, wherever they stand.
//!
//! So a guard on `length(v)` protects a later `length(v)`, and `x * x` is a square though `x` is loaded twice.

use naga::{BinaryOperator, Expression, Handle, Literal, MathFunction, UnaryOperator, VectorSize};
use rustc_hash::FxHashMap;

/// A value number.
pub type Value = u32;

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum Key {
    Literal(u8, u64),
    Constant(usize),
    Argument(u32),
    Global(usize),
    Local(usize),
    /// Of a pointer, when what it points to was last written.
    Load(Value, u32),
    Access(Value, Value),
    AccessIndex(Value, u32),
    Splat(VectorSize, Value),
    Swizzle(Value, VectorSize, [u8; 4]),
    Unary(UnaryOperator, Value),
    Binary(BinaryOperator, Value, Value),
    Select(Value, Value, Value),
    Math(MathFunction, [Option<Value>; 4]),
    /// Like nothing else.
    Own(usize),
}

/// Numbers of a function's expressions.
pub struct Numbering {
    numbers: Vec<Value>,
    known: FxHashMap<Key, Value>,
}

impl Numbering {
    pub fn new(expression_count: usize) -> Numbering {
        Numbering { numbers: vec![Value::MAX; expression_count], known: FxHashMap::default() }
    }

    /// Number of an expression that [`Numbering::add`] has seen.
    pub fn of(&self, handle: Handle<Expression>) -> Value {
        self.numbers[handle.index()]
    }

    pub fn same(&self, a: Handle<Expression>, b: Handle<Expression>) -> bool {
        self.of(a) == self.of(b) && self.of(a) != Value::MAX
    }

    /// Number of a load of a whole local variable, if there was one since it was written.
    pub fn of_local(&self, local: usize, written: u32) -> Option<Value> {
        let pointer = self.known.get(&Key::Local(local))?;
        self.known.get(&Key::Load(*pointer, written)).copied()
    }

    /// Numbers an expression after its operands. `written` tells when what a load reads was last written.
    pub fn add(&mut self, handle: Handle<Expression>, expression: &Expression, written: u32) {
        let key = self.key(handle, expression, written);
        let next = Value::try_from(self.known.len()).unwrap_or(Value::MAX);
        self.numbers[handle.index()] = *self.known.entry(key).or_insert(next);
    }

    fn key(&self, handle: Handle<Expression>, expression: &Expression, written: u32) -> Key {
        match *expression {
            Expression::Literal(literal) => literal_key(literal).unwrap_or(Key::Own(handle.index())),
            Expression::Constant(constant) => Key::Constant(constant.index()),
            Expression::FunctionArgument(index) => Key::Argument(index),
            Expression::GlobalVariable(global) => Key::Global(global.index()),
            Expression::LocalVariable(local) => Key::Local(local.index()),
            Expression::Load { pointer } => Key::Load(self.of(pointer), written),
            Expression::Access { base, index } => Key::Access(self.of(base), self.of(index)),
            Expression::AccessIndex { base, index } => Key::AccessIndex(self.of(base), index),
            Expression::Splat { size, value } => Key::Splat(size, self.of(value)),
            // Where patterns differ beyond their size the numbers do too, which only says less.
            Expression::Swizzle { size, vector, pattern } => {
                Key::Swizzle(self.of(vector), size, pattern.map(|component| component as u8))
            }
            Expression::Unary { op, expr } => Key::Unary(op, self.of(expr)),
            Expression::Binary { op, left, right } => Key::Binary(op, self.of(left), self.of(right)),
            Expression::Select { condition, accept, reject } => {
                Key::Select(self.of(condition), self.of(accept), self.of(reject))
            }
            Expression::Math { fun, arg, arg1, arg2, arg3 } => {
                Key::Math(fun, [Some(arg), arg1, arg2, arg3].map(|arg| arg.map(|arg| self.of(arg))))
            }
            _ => Key::Own(handle.index()),
        }
    }
}

fn literal_key(literal: Literal) -> Option<Key> {
    Some(match literal {
        Literal::F32(value) => Key::Literal(0, value.to_bits().into()),
        Literal::U32(value) => Key::Literal(1, value.into()),
        Literal::I32(value) => Key::Literal(2, u64::from(value.cast_unsigned())),
        Literal::Bool(value) => Key::Literal(3, value.into()),
        _ => return None,
    })
}
