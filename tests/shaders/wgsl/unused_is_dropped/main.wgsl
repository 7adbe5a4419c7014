import lib::many::used;
const UNUSED = 3.0;
@group(0) @binding(0) var unused_texture: texture_2d<f32>;
fn also_unused() -> f32 { return UNUSED; }
@fragment fn fs_main() -> @location(0) vec4f { return vec4f(used()); }
