fn used() -> f32 { return 1.0; }
fn not_used() -> f32 { return 2.0; }
