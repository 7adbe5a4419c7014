//! naga's validation errors in the author's words: types by name, no handles.

use std::error::Error;

use naga::common::wgsl::{TryToWgsl, TypeContext};
use naga::front::Typifier;
use naga::proc::{ResolveContext, TypeResolution};
use naga::valid::{CallError, EntryPointError, ExpressionError, FunctionError, ValidationError};
use naga::{Expression, Function, Handle, Module, Type, TypeInner, UnaryOperator};

/// What is wrong, then by which way it was found, innermost first.
pub fn validation_error(module: &Module, error: &ValidationError) -> (String, Vec<String>) {
    let mut messages = chain(error);
    let innermost = messages.pop().unwrap_or_default();
    let message = known(module, error).unwrap_or(innermost);
    messages.reverse();
    messages.retain(|note| !["expression is invalid", "call to is invalid"].contains(&note.as_str()));
    (message, messages)
}

/// An error's message and those of its causes, outermost first.
fn chain(error: &dyn Error) -> Vec<String> {
    let mut messages = vec![clean(&error.to_string())];
    let mut cause = error.source();
    while let Some(error) = cause {
        messages.push(clean(&error.to_string()));
        cause = error.source();
    }
    messages
}

/// Messages that are clearer with the module at hand.
fn known(module: &Module, error: &ValidationError) -> Option<String> {
    let (function, error) = match error {
        ValidationError::Function { handle, source, .. } => (&module.functions[*handle], source),
        ValidationError::EntryPoint { stage, name, source: EntryPointError::Function(source) } => {
            let mut entries = module.entry_points.iter();
            let entry = entries.find(|entry| entry.stage == *stage && entry.name == *name)?;
            (&entry.function, source)
        }
        ValidationError::EntryPoint { source: EntryPointError::BindingCollision(handle), .. } => {
            let name = module.global_variables[*handle].name.as_deref().unwrap_or_default();
            return Some(format!("`{name}` has the group and binding of another variable"));
        }
        _ => return None,
    };
    Types { module, function }.function_error(error)
}

/// Types of a function's expressions by name.
struct Types<'a> {
    module: &'a Module,
    function: &'a Function,
}

impl Types<'_> {
    fn function_error(&self, error: &FunctionError) -> Option<String> {
        Some(match error {
            FunctionError::Expression { source, .. } => return self.expression_error(source),
            FunctionError::InvalidReturnType { expression: None, expected_ty: Some(ty) } => {
                format!("this function can end without returning its `{}`", self.name(*ty))
            }
            FunctionError::InvalidReturnType { expression: Some(value), expected_ty: Some(ty) } => {
                format!("the function returns `{}`, this value is {}", self.name(*ty), self.a(*value))
            }
            FunctionError::InvalidReturnType { expression: Some(_), expected_ty: None } => {
                "the function returns nothing, but this value".to_owned()
            }
            FunctionError::InvalidCall {
                function,
                error: CallError::ArgumentType { index, required, seen_expression },
            } => {
                let callee = self.module.functions[*function].name.as_deref().unwrap_or_default();
                let (number, ty) = (index + 1, self.name(*required));
                format!(
                    "argument {number} of `{callee}` must be `{ty}`, this value is {}",
                    self.a(*seen_expression)
                )
            }
            FunctionError::InvalidIfType(condition) => {
                format!("the condition of `if` must be `bool`, this is {}", self.a(*condition))
            }
            _ => return None,
        })
    }

    fn expression_error(&self, error: &ExpressionError) -> Option<String> {
        Some(match error {
            ExpressionError::InvalidBinaryOperandTypes { op, lhs_type, rhs_type, .. } => {
                let [left, right] = [lhs_type, rhs_type].map(|ty| self.inner_name(ty));
                format!("`{}` does not take `{left}` and `{right}`", sign(&format!("{op:?}")))
            }
            ExpressionError::InvalidUnaryOperandType(op, operand) => {
                let sign = match op {
                    UnaryOperator::Negate => "-",
                    UnaryOperator::LogicalNot => "!",
                    UnaryOperator::BitwiseNot => "~",
                };
                format!("`{sign}` does not take {}", self.a(*operand))
            }
            ExpressionError::SelectValuesTypeMismatch { accept, reject } => {
                let [accept, reject] = [accept, reject].map(|ty| self.inner_name(ty));
                format!("`select` takes two values of one type, these are `{reject}` and `{accept}`")
            }
            ExpressionError::SelectConditionNotABool { actual } => {
                format!("the condition of `select` must be `bool`, this is `{}`", self.inner_name(actual))
            }
            ExpressionError::InvalidArgumentType(function, index, argument) => {
                let name = function.try_to_wgsl()?;
                format!("argument {} of `{name}` cannot be {}", index + 1, self.a(*argument))
            }
            _ => return None,
        })
    }

    fn name(&self, ty: Handle<Type>) -> String {
        self.module.to_ctx().type_to_string(ty)
    }

    fn inner_name(&self, ty: &TypeInner) -> String {
        self.module.to_ctx().type_resolution_to_string(&TypeResolution::Value(ty.clone()))
    }

    /// The type of an expression, or of what it points to, as in "this is `f32`".
    fn a(&self, expression: Handle<Expression>) -> String {
        let Function { expressions, local_variables, arguments, .. } = self.function;
        let mut types = Typifier::new();
        let context = ResolveContext::with_locals(self.module, local_variables, arguments);
        if types.grow(expression, expressions, &context).is_err() {
            return "of another type".to_owned();
        }
        let name = match (&types[expression], types[expression].inner_with(&self.module.types)) {
            (_, TypeInner::Pointer { base, .. }) => self.name(*base),
            (_, TypeInner::ValuePointer { size: Some(size), scalar, .. }) => {
                self.inner_name(&TypeInner::Vector { size: *size, scalar: *scalar })
            }
            (_, TypeInner::ValuePointer { size: None, scalar, .. }) => {
                self.inner_name(&TypeInner::Scalar(*scalar))
            }
            (resolution, _) => self.module.to_ctx().type_resolution_to_string(resolution),
        };
        format!("`{name}`")
    }
}

/// What naga's front end says while it works out constants, as `LogicalAnd(u32, _)`: the types that it knows.
pub fn parse_error(message: &str) -> String {
    let message = clean(message);
    let operands = || {
        let operation = message.strip_prefix("incompatible operands: ")?.strip_suffix(')')?;
        let (operator, types) = operation.split_once('(')?;
        let known = types.split(", ").filter(|ty| *ty != "_").map(|ty| format!("`{ty}`"));
        Some(format!("`{}` does not take {}", sign(operator), known.collect::<Vec<_>>().join(" and ")))
    };
    operands().unwrap_or(message)
}

/// The sign of an operator that naga calls `name`.
pub fn sign(name: &str) -> &str {
    match name {
        "Add" => "+",
        "Subtract" => "-",
        "Multiply" => "*",
        "Divide" => "/",
        "Modulo" => "%",
        "Equal" => "==",
        "NotEqual" => "!=",
        "Less" => "<",
        "LessEqual" => "<=",
        "Greater" => ">",
        "GreaterEqual" => ">=",
        "And" => "&",
        "ExclusiveOr" => "^",
        "InclusiveOr" => "|",
        "LogicalAnd" => "&&",
        "LogicalOr" => "||",
        "ShiftLeft" => "<<",
        "ShiftRight" => ">>",
        other => other,
    }
}

/// Removes what only naga's authors can read: handles as `[7]` and `Some([7])`, a last one becomes `it`;
/// starts in lower case, ends without a full stop.
pub fn clean(message: &str) -> String {
    let message = message.trim_end_matches('.');
    let mut words: Vec<&str> = message.split(' ').collect();
    if let Some(last) = words.last_mut().filter(|last| is_handle(last)) {
        *last = "it";
    }
    words.retain(|word| !is_handle(word));
    let text = words.join(" ");
    let mut characters = text.chars();
    let first = characters.next().map(|first| first.to_lowercase().to_string()).unwrap_or_default();
    first + characters.as_str()
}

fn is_handle(word: &str) -> bool {
    let word = word.trim_end_matches(',');
    let word = word.strip_prefix("Some(").and_then(|word| word.strip_suffix(')')).unwrap_or(word);
    let number = word.strip_prefix('[').and_then(|word| word.strip_suffix(']'));
    number.is_some_and(|number| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()))
}
