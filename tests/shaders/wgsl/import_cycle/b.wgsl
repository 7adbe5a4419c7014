import a::f;
fn g() -> f32 { return f(); }
