// Half the size: 36 texels, weighted so that a small bright one does not blink as it moves. Jimenez 2014, "Next Generation Post
// Processing in Call of Duty: Advanced Warfare": five overlapping boxes of 4 × 4, the middle one counted most.

@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var source_sampler: sampler;

struct Varying {
    @builtin(position) position: vec4f,
    @location(0) uv: vec2f,
}

@vertex
fn vs_main(@builtin(vertex_index) index: u32) -> Varying {
    let corner = vec2f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0);
    return Varying(vec4f(corner, 0.0, 1.0), vec2f(0.5, -0.5) * corner + vec2f(0.5));
}

fn read(uv: vec2f, x: f32, y: f32) -> vec4f {
    let texel = vec2f(1.0) / vec2f(textureDimensions(source));
    return textureSampleLevel(source, source_sampler, uv + vec2f(x, y) * texel, 0.0);
}

@fragment
fn fs_main(in: Varying) -> @location(0) vec4f {
    let uv = in.uv;
    let inner = read(uv, -1.0, -1.0) + read(uv, 1.0, -1.0) + read(uv, -1.0, 1.0) + read(uv, 1.0, 1.0);
    let edges = read(uv, -2.0, 0.0) + read(uv, 2.0, 0.0) + read(uv, 0.0, -2.0) + read(uv, 0.0, 2.0);
    let corners = read(uv, -2.0, -2.0) + read(uv, 2.0, -2.0) + read(uv, -2.0, 2.0) + read(uv, 2.0, 2.0);
    return read(uv, 0.0, 0.0) * 0.125 + inner * 0.125 + edges * 0.0625 + corners * 0.03125;
}
