import third::half;

// The caret stands below the argument.
fn three() -> f32 {
    return half(vec2f(1.0, 2.0));
}
