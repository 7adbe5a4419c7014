// Values of a channel as display values. Alpha is the share of the pixel that something covers; values are multiplied by it.

struct Display {
    // 0 colour, 1 data, 2 direction, 3 texture coordinates, 4 level.
    encoding: u32,
    level_colors: array<vec4f, 8>,
}

@group(0) @binding(0) var values: texture_2d<f32>;
@group(0) @binding(1) var<uniform> display: Display;

@vertex
fn vs_main(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// IEC 61966-2-1.
fn to_srgb(linear: vec3f) -> vec3f {
    let x = saturate(linear);
    let curve = 1.055 * pow(max(x, vec3f(0.0031308)), vec3f(1.0 / 2.4)) - 0.055;
    return select(curve, 12.92 * x, x <= vec3f(0.0031308));
}

fn encoded(value: vec3f, pixel: vec2f) -> vec3f {
    // Pixels are not negative. Branches that hang on uniforms alone make lavapipe compile anew for each frame.
    switch display.encoding + u32(max(-pixel.x, 0.0)) {
        case 0u: { return to_srgb(value); }
        case 2u: { return saturate(value * 0.5 + 0.5); }
        case 3u: { return vec3f(fract(value.xy), 0.0); }
        case 4u: {
            let level = clamp(value.x, 0.0, 7.0);
            let below = u32(level);
            return mix(display.level_colors[below].rgb, display.level_colors[min(below + 1u, 7u)].rgb, fract(level));
        }
        default: { return saturate(value); }
    }
}

@fragment
fn fs_main(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let texel = textureLoad(values, vec2i(position.xy), 0);
    let square = (u32(position.x) / 16u + u32(position.y) / 16u) & 1u;
    let nothing = vec3f(select(0.10, 0.12, square == 1u));
    // Also false for what is no number.
    if !(texel.a > 0.0) {
        return vec4f(nothing, 1.0);
    }
    let value = encoded(texel.rgb / texel.a, position.xy);
    return vec4f(mix(nothing, value, saturate(texel.a)), 1.0);
}
