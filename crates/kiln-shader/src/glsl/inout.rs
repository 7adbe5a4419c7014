//! `out` and `inout` arguments that are parts of variables: GLSL copies them in and out, naga passes pointers,
//! which WGSL does not have to components of vectors and other backends not to any part.

use naga::{Block, Expression, Function, Handle, LocalVariable, Module, Span, Statement, Type, TypeInner};

/// Gives each such argument a variable of its own, copied from the part before the call and to it after.
pub fn copy_parts(module: &mut Module) {
    // The type behind each pointer parameter, by function.
    let pointees: Vec<Vec<Option<Handle<Type>>>> = module
        .functions
        .iter()
        .map(|(_, function)| {
            let types = function.arguments.iter().map(|argument| match module.types[argument.ty].inner {
                TypeInner::Pointer { base, .. } => Some(base),
                _ => None,
            });
            types.collect()
        })
        .collect();
    for (_, function) in module.functions.iter_mut() {
        let mut body = std::mem::take(&mut function.body);
        block(&pointees, function, &mut body);
        function.body = body;
    }
}

fn block(pointees: &[Vec<Option<Handle<Type>>>], function: &mut Function, body: &mut Block) {
    let mut out = Block::with_capacity(body.len());
    for (mut statement, span) in std::mem::take(body).span_into_iter() {
        let mut after = Vec::new();
        match &mut statement {
            Statement::Block(inner) => block(pointees, function, inner),
            Statement::If { accept, reject, .. } => {
                block(pointees, function, accept);
                block(pointees, function, reject);
            }
            Statement::Loop { body, continuing, .. } => {
                block(pointees, function, body);
                block(pointees, function, continuing);
            }
            Statement::Switch { cases, .. } => {
                cases.iter_mut().for_each(|case| block(pointees, function, &mut case.body));
            }
            Statement::Call { function: callee, arguments, .. } => {
                let types = pointees.get(callee.index()).map(Vec::as_slice).unwrap_or_default();
                for index in 0..arguments.len() {
                    let argument = arguments[index];
                    // One variable given twice has no pointer to each of the two either.
                    let is_repeated = arguments[..index].contains(&argument);
                    let is_whole = !matches!(
                        function.expressions[argument],
                        Expression::Access { .. } | Expression::AccessIndex { .. }
                    );
                    let Some(ty) = types.get(index).copied().flatten() else { continue };
                    if is_whole && !is_repeated {
                        continue;
                    }
                    let local =
                        function.local_variables.append(LocalVariable { name: None, ty, init: None }, span);
                    let own = function.expressions.append(Expression::LocalVariable(local), span);
                    copy(function, &mut out, argument, own, span);
                    arguments[index] = own;
                    after.push((own, argument));
                }
            }
            _ => {}
        }
        out.push(statement, span);
        for (own, part) in after {
            copy(function, &mut out, own, part, span);
        }
    }
    *body = out;
}

fn copy(
    function: &mut Function,
    out: &mut Block,
    from: Handle<Expression>,
    to: Handle<Expression>,
    span: Span,
) {
    let value = function.expressions.append(Expression::Load { pointer: from }, span);
    out.push(Statement::Emit(naga::Range::new_from_bounds(value, value)), span);
    out.push(Statement::Store { pointer: to, value }, span);
}
