override steps: u32 = 8u; // @slider(1, 64) steps of the march

struct Params {
    tint: vec3f, // @color(1.0, 0.5, 0.25)
    // @slider(0, 2, 1.5) how bright
    gain: f32,
    mode: u32, // @choice(0, flat, smooth)
    wrong: f32, // @slider(2, 1)
}

@group(3) @binding(0) var<uniform> params: Params;

@fragment
fn fs_main() -> @location(0) vec4f {
    return vec4f(params.tint * params.gain * f32(params.mode) * params.wrong, f32(steps));
}
