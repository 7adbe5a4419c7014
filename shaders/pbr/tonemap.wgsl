// Linear radiance to display values: exposure, tone curve, sRGB.

import lib::colour::{to_srgb, within_f16};
import lib::colour::{tone_map_aces_fitted, tone_map_agx, tone_map_pbr_neutral, tone_map_reinhard_extended};
import lib::frame::{frame, hdr_color};
import lib::fullscreen::fullscreen_position;

// The grade of the picture: a factor on linear red, green and blue before the tone curve.
const WHITE_BALANCE = vec3f(1.0, 1.0, 1.0);

// Luminance that the Reinhard curve maps to white.
const REINHARD_WHITE = 4.0;

// No uniform: lavapipe compiles a shader anew for every frame whose branches hang on uniforms alone.
override tone_mapper: u32 = 0u; // @choice(0, neutral, agx, aces, reinhard, none) how radiance becomes display values

fn tone_map(linear: vec3f) -> vec3f {
    switch tone_mapper {
        case 1u: { return tone_map_agx(linear); }
        case 2u: { return tone_map_aces_fitted(linear); }
        case 3u: { return tone_map_reinhard_extended(linear, REINHARD_WHITE); }
        case 4u: { return linear; }
        default: { return tone_map_pbr_neutral(linear); }
    }
}

@vertex
fn vs_main(@builtin(vertex_index) vertex_index: u32) -> @builtin(position) vec4f {
    return vec4f(fullscreen_position(vertex_index), 0.0, 1.0);
}

@fragment
fn fs_main(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let texel = textureLoad(hdr_color, vec2i(position.xy), 0);
    let radiance = within_f16(texel.rgb);
    // No curve has a value for less than nothing, which a grade may make.
    let graded = max(radiance * WHITE_BALANCE * frame.exposure, vec3f(0.0));
    return vec4f(to_srgb(tone_map(graded)), texel.a);
}
