// Linear radiance to display values: exposure, Khronos PBR Neutral, sRGB.

import lib::colour::{to_srgb, within_f16, tone_map_pbr_neutral};
import lib::frame::{frame, hdr_color};
import lib::fullscreen::fullscreen_position;

// The grade of the picture: a factor on linear red, green and blue before the tone curve.
const WHITE_BALANCE = vec3f(1.0, 1.0, 1.0);

@vertex
fn vs_main(@builtin(vertex_index) vertex_index: u32) -> @builtin(position) vec4f {
    return vec4f(fullscreen_position(vertex_index), 0.0, 1.0);
}

@fragment
fn fs_main(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let texel = textureLoad(hdr_color, vec2i(position.xy), 0);
    let radiance = within_f16(texel.rgb);
    return vec4f(to_srgb(tone_map_pbr_neutral(radiance * WHITE_BALANCE * frame.exposure)), texel.a);
}
