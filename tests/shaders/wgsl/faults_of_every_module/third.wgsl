fn half(x: f32) -> f32 { return 0.5 * x; }
