fn one() -> f32 { return 1.0; }
fn two() -> f32 { return one() + tow; }
