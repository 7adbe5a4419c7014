// Marks and counts pixels with radiance that no display can show. Samples are read one by one: an average could hide them.

struct Limits {
    // 0: samples hold radiance; 1: `faults` of shaders/lib/inspect.wgsl, found before 16 bits could hide what they were.
    are_classified: u32,
    radiance_max: f32,
}

@group(0) @binding(0) var samples: texture_multisampled_2d<f32>;
@group(0) @binding(1) var<uniform> limits: Limits;
// Pixels that are no number, infinite, negative, over the limit.
@group(0) @binding(2) var<storage, read_write> counts: array<atomic<u32>, 4>;

@vertex
fn vs_main(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// By bits: a compiler may take for granted that nothing is NaN.
fn classes(radiance: vec3f) -> vec4<bool> {
    let infinity = vec3u(0x7f800000u);
    let magnitude = bitcast<vec3u>(radiance) & vec3u(0x7fffffffu);
    let is_negative = (bitcast<vec3u>(radiance) != magnitude) & (magnitude != vec3u(0u));
    let limit = vec3u(bitcast<u32>(limits.radiance_max));
    return vec4<bool>(
        any(magnitude > infinity),
        any(magnitude == infinity),
        any(is_negative & (magnitude <= infinity)),
        any((magnitude < infinity) & !is_negative & (magnitude > limit)),
    );
}

@fragment
fn fs_main(@builtin(position) position: vec4f) -> @location(0) vec4f {
    var found = vec4<bool>(false);
    // Pixels are not negative. Branches that hang on uniforms alone make lavapipe compile anew for each frame.
    let are_classified = limits.are_classified + u32(max(-position.x, 0.0));
    for (var index = 0u; index < textureNumSamples(samples); index++) {
        let texel = textureLoad(samples, vec2i(position.xy), index);
        if are_classified == 1u {
            found |= texel > vec4f(0.5);
        } else {
            found |= classes(texel.rgb);
        }
    }
    if !any(found) {
        discard;
    }
    for (var class_index = 0u; class_index < 4u; class_index++) {
        if found[class_index] {
            atomicAdd(&counts[class_index], 1u);
        }
    }
    // Stripes in the worst class' colour and black: seen on any picture.
    let is_dark = (u32(position.x) + u32(position.y)) / 4u % 2u == 1u;
    if is_dark {
        return vec4f(0.0, 0.0, 0.0, 1.0);
    }
    if found.x { return vec4f(1.0, 0.0, 1.0, 1.0); }
    if found.y { return vec4f(1.0, 1.0, 0.0, 1.0); }
    if found.z { return vec4f(0.0, 0.4, 1.0, 1.0); }
    return vec4f(1.0, 0.1, 0.0, 1.0);
}
