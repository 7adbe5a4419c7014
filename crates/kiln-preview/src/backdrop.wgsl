// What stands behind the scene instead of the environment: squares of two colours, on the screen.

struct Backdrop {
    // Linear radiance.
    first: vec3f,
    // Edge of a square in pixels.
    square: f32,
    second: vec3f,
}

@group(0) @binding(0) var<uniform> backdrop: Backdrop;

@vertex
fn vs_main(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 1.0, 1.0);
}

@fragment
fn fs_main(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let square = vec2u(position.xy / backdrop.square);
    let is_first = ((square.x + square.y) & 1u) == 0u;
    return vec4f(select(backdrop.second, backdrop.first, is_first), 1.0);
}
