// Colour spaces and tone mapping. Linear values are Rec. 709, D65.

import lib::vector::max_component;

// Relative luminance, ITU-R BT.709-6, section 3.2.
fn luminance(color: vec3f) -> f32 {
    return dot(color, vec3f(0.2126, 0.7152, 0.0722));
}

// IEC 61966-2-1, linear to encoded. Values outside [0, 1] are clamped: a display has no others, and pow has
// no value for a negative base.
fn to_srgb(linear: vec3f) -> vec3f {
    let x = saturate(linear);
    let curve = 1.055 * pow(x, vec3f(1.0 / 2.4)) - 0.055;
    return select(curve, 12.92 * x, x <= vec3f(0.0031308));
}

// IEC 61966-2-1, encoded to linear. Values outside [0, 1] are clamped.
fn from_srgb(encoded: vec3f) -> vec3f {
    let x = saturate(encoded);
    let curve = pow((x + 0.055) / 1.055, vec3f(2.4));
    return select(curve, x / 12.92, x <= vec3f(0.04045));
}

// Khronos PBR Neutral tone mapper (KhronosGroup/ToneMapping, PBR_Neutral/README.md): keeps base colours
// below 0.8 as they are and compresses highlights towards white. Input finite and not negative.
fn tone_map_pbr_neutral(linear: vec3f) -> vec3f {
    let start_compression = 0.8 - 0.04;
    let desaturation = 0.15;
    let low = min(linear.x, min(linear.y, linear.z));
    let offset = select(0.04, low - 6.25 * low * low, low < 0.08);
    let color = linear - offset;
    let peak = max_component(color);
    if peak < start_compression {
        return color;
    }
    let d = 1.0 - start_compression;
    let new_peak = 1.0 - d * d / (peak + d - start_compression);
    let whiteness = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0);
    return mix(color * (new_peak / peak), vec3f(new_peak), whiteness);
}

// ACES reference and output transform for sRGB displays, fitted by Stephen Hill (TheRealMJP/BakingLab,
// ACES.hlsl). Input not negative; output linear, in [0, 1].
fn tone_map_aces_fitted(linear: vec3f) -> vec3f {
    // Columns; sRGB → XYZ → D65 to D60 → AP1 → saturation of the reference transform.
    let input = mat3x3f(
        0.59719, 0.07600, 0.02840,
        0.35458, 0.90834, 0.13383,
        0.04823, 0.01566, 0.83777,
    );
    let output = mat3x3f(
        1.60475, -0.10208, -0.00327,
        -0.53108, 1.10813, -0.07276,
        -0.07367, -0.00605, 1.07602,
    );
    let v = input * linear;
    // The fit is a quotient of quadratics: 1e6 squared is far from f32's end, and it has levelled off long before.
    let x = min(v, vec3f(1e6));
    let fitted = (x * (x + 0.0245786) - 0.000090537) / (x * (0.983729 * x + 0.4329510) + 0.238081);
    return saturate(output * fitted);
}

// What an f16 target can hold: beyond 65504 it has infinity, and blending makes infinity times 0 of it. A display shows
// no difference.
fn within_f16(radiance: vec3f) -> vec3f {
    return clamp(radiance, vec3f(0.0), vec3f(65504.0));
}
