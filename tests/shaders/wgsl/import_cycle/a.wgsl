import b::g;
fn f() -> f32 { return g(); }
