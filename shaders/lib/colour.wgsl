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
    // The line below 0.0031308 is taken instead of the curve, so the curve need not know 0.
    let curve = 1.055 * pow(max(x, vec3f(0.0031308)), vec3f(1.0 / 2.4)) - 0.055;
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

// The fit of the ACES transforms that is most often seen: one quotient a channel. Narkowicz 2016, "ACES Filmic Tone Mapping
// Curve". Input not negative; output linear, in [0, 1].
fn tone_map_aces_narkowicz(linear: vec3f) -> vec3f {
    // Levelled off long before 1e6, whose square is far from f32's end.
    let x = min(linear, vec3f(1e6));
    return saturate((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14));
}

// Reinhard et al. 2002, "Photographic Tone Reproduction for Digital Images", equation 3, on each channel. Input not negative.
fn tone_map_reinhard(linear: vec3f) -> vec3f {
    // As 1 - 1 / (1 + x): the quotient of two infinities never arises.
    return 1.0 - 1.0 / (1.0 + linear);
}

// The same paper's equation 4 on luminance: `white` is the luminance that is mapped to 1. Input not negative.
fn tone_map_reinhard_extended(linear: vec3f, white: f32) -> vec3f {
    let l = luminance(linear);
    return linear * ((1.0 + l / max(white * white, 1e-6)) / (1.0 + l));
}

// AgX by Troy Sobotka (sobotka/AgX) with its base contrast; the curve as the polynomial of degree 6 that Benjamin Wrensch
// fitted, "Minimal AgX Implementation", 2023 (RMS error 2e-3). Input not negative; output linear, in [0, 1].
fn tone_map_agx(linear: vec3f) -> vec3f {
    // Columns. The inset draws the primaries in, so that bright colours go towards white; the outset undoes it.
    let inset = mat3x3f(
        0.842479062253094, 0.0423282422610123, 0.0423756549057051,
        0.0784335999999992, 0.878468636469772, 0.0784336,
        0.0792237451477643, 0.0791661274605434, 0.879142973793104,
    );
    let outset = mat3x3f(
        1.19687900512017, -0.0528968517574562, -0.0529716355144438,
        -0.0980208811401368, 1.15190312990417, -0.0980434501171241,
        -0.0990297440797205, -0.0989611768448433, 1.15107367264116,
    );
    // 16.5 stops around middle grey; 2^-12.47 is also what keeps log2 away from 0.
    let stop_min = -12.47393;
    let stop_max = 4.026069;
    let inside = clamp(inset * linear, vec3f(exp2(stop_min)), vec3f(exp2(stop_max)));
    let x = saturate((log2(inside) - stop_min) / (stop_max - stop_min));
    let curve = ((((((15.5 * x - 40.14) * x + 31.96) * x - 6.868) * x + 0.4298) * x + 0.1191) * x) - 0.00232;
    // The curve ends at display values of exponent 2.2. Black itself is a little below 0, where pow has no value.
    let encoded = clamp(outset * curve, vec3f(1e-6), vec3f(1.0));
    return pow(encoded, vec3f(2.2));
}

// What an f16 target can hold: beyond 65504 it has infinity, and blending makes infinity times 0 of it. A display shows
// no difference.
fn within_f16(radiance: vec3f) -> vec3f {
    return clamp(radiance, vec3f(0.0), vec3f(65504.0));
}
