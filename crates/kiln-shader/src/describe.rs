//! naga's validation errors in the author's words: types by name, no handles.

use std::error::Error;

use naga::common::wgsl::TypeContext;
use naga::valid::{CallError, EntryPointError, FunctionError, ValidationError};
use naga::{Handle, Module, Type};

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
    let function_error = match error {
        ValidationError::Function { source, .. } => source,
        ValidationError::EntryPoint { source: EntryPointError::Function(source), .. } => source,
        ValidationError::EntryPoint { source: EntryPointError::BindingCollision(handle), .. } => {
            let name = module.global_variables[*handle].name.as_deref().unwrap_or_default();
            return Some(format!("`{name}` has the group and binding of another variable"));
        }
        _ => return None,
    };
    match function_error {
        FunctionError::InvalidReturnType { expression: None, expected_ty: Some(ty) } => {
            Some(format!("this function can end without returning its `{}`", name(module, *ty)))
        }
        FunctionError::InvalidReturnType { expression: Some(_), expected_ty: Some(ty) } => {
            Some(format!("the function returns `{}`, this value has another type", name(module, *ty)))
        }
        FunctionError::InvalidReturnType { expression: Some(_), expected_ty: None } => {
            Some("the function returns nothing, but this value".to_owned())
        }
        FunctionError::InvalidCall { function, error: CallError::ArgumentType { index, required, .. } } => {
            let callee = module.functions[*function].name.as_deref().unwrap_or_default();
            let (number, ty) = (index + 1, name(module, *required));
            Some(format!("argument {number} of `{callee}` must be `{ty}`, this value has another type"))
        }
        _ => None,
    }
}

fn name(module: &Module, ty: Handle<Type>) -> String {
    module.to_ctx().type_to_string(ty)
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
