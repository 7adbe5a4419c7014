// What a pixel is made of, shown in place of its radiance: the feature `inspect`. Only variants that somebody wants to look into are
// compiled with it. docs/shader-interface.md, "Debug channels".

struct Inspect {
    // One of those below.
    channel: u32,
    // Radiance above this is over the range that the user set.
    radiance_max: f32,
    // Of this variant, linear.
    variant_color: vec3f,
}

@group(0) @binding(16) var<uniform> inspect: Inspect;

const CHANNEL_FAULTS: u32 = 0u;
const CHANNEL_BASE_COLOR: u32 = 1u;
const CHANNEL_ALPHA: u32 = 2u;
const CHANNEL_ROUGHNESS: u32 = 3u;
const CHANNEL_METALNESS: u32 = 4u;
const CHANNEL_GEOMETRIC_NORMAL: u32 = 5u;
const CHANNEL_SHADING_NORMAL: u32 = 6u;
const CHANNEL_TANGENT: u32 = 7u;
const CHANNEL_UV0: u32 = 8u;
const CHANNEL_UV1: u32 = 9u;
const CHANNEL_OCCLUSION: u32 = 10u;
const CHANNEL_F0: u32 = 11u;
const CHANNEL_MIP: u32 = 12u;
const CHANNEL_VARIANT: u32 = 13u;
const CHANNEL_EMISSION: u32 = 14u;
const CHANNEL_DIFFUSE: u32 = 15u;
const CHANNEL_SPECULAR: u32 = 16u;
const CHANNEL_CLEARCOAT: u32 = 17u;
const CHANNEL_SHEEN: u32 = 18u;
const CHANNEL_TRANSMISSION: u32 = 19u;
const CHANNEL_PUNCTUAL: u32 = 20u;

// Which kinds of value a display cannot show some component of radiance has: no number, infinity, less than 0, more than the
// limit, which is 0 or more. By bits: a compiler may take for granted that nothing is NaN.
fn faults(radiance: vec3f, radiance_max: f32) -> vec4f {
    let infinity = vec3u(0x7f800000u);
    let magnitude = bitcast<vec3u>(radiance) & vec3u(0x7fffffffu);
    let is_negative = (bitcast<vec3u>(radiance) != magnitude) & (magnitude != vec3u(0u));
    let is_finite = magnitude < infinity;
    let limit = vec3u(bitcast<u32>(radiance_max));
    return vec4f(
        f32(any(magnitude > infinity)),
        f32(any(magnitude == infinity)),
        f32(any(is_negative & (magnitude <= infinity))),
        f32(any(is_finite & !is_negative & (magnitude > limit))),
    );
}

// Level of a texture of this size that a trilinear lookup at `uv` reads. OpenGL 4.6, section 8.14.1.
fn mip_level(uv: vec2f, size: vec2u, level_count: u32) -> f32 {
    let along_x = dpdx(uv) * vec2f(size);
    let along_y = dpdy(uv) * vec2f(size);
    let texels_squared = max(dot(along_x, along_x), dot(along_y, along_y));
    return clamp(0.5 * log2(max(texels_squared, 1e-30)), 0.0, f32(level_count - 1u));
}
