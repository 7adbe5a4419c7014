// Brushed surfaces: GGX with two widths. KHR_materials_anisotropy. t and b are tangent and bitangent of the brush.

import lib::brdf::GRAZING_MIN;
import lib::constants::{ALPHA_MIN, PI};
import lib::vector::normalize_or;

// Widths along tangent and bitangent for a strength in [0, 1]. KHR_materials_anisotropy: mix(alpha, 1, strength²) and alpha.
fn anisotropic_alpha(alpha: f32, strength: f32) -> vec2f {
    return vec2f(mix(alpha, 1.0, strength * strength), alpha);
}

// Anisotropic GGX, per steradian. Burley 2012, "Physically-Based Shading at Disney", appendix B.2, as
//     D = 1 / (π a b ((t·h / a)² + (b·h / b)² + (n·h)²)²).
// `tbn_h` is the half vector in the brush's frame, of unit length: the sum is at least 1, so nothing overflows.
fn d_ggx_anisotropic(tbn_h: vec3f, alpha_tb: vec2f) -> f32 {
    let a = max(alpha_tb, vec2f(ALPHA_MIN));
    let scaled = vec3f(tbn_h.xy / a, tbn_h.z);
    let s = max(dot(scaled, scaled), 1.0);
    return 1.0 / (PI * a.x * a.y * s * s);
}

// Height-correlated Smith for it. Heitz 2014, "Understanding the Masking-Shadowing Function", equation 99, where alpha is
// that seen along each direction.
fn v_smith_anisotropic(tbn_l: vec3f, tbn_v: vec3f, alpha_tb: vec2f) -> f32 {
    let light = tbn_v.z * length(vec3f(alpha_tb * tbn_l.xy, tbn_l.z));
    let view = tbn_l.z * length(vec3f(alpha_tb * tbn_v.xy, tbn_v.z));
    return 0.5 / max(light + view, GRAZING_MIN);
}

// A normal bent against the brush, so that its mirror direction lies within the stretched lobe: what an isotropic chain is
// read with. McAuley 2015, "Rendering the World of Far Cry 4"; the weight as in the Khronos sample viewer.
fn anisotropic_normal(normal: vec3f, bitangent: vec3f, view: vec3f, strength: f32, perceptual_roughness: f32) -> vec3f {
    // The view without its part along the bitangent; along the bitangent itself there is no side to bend to.
    let bent = normalize_or(cross(cross(bitangent, view), bitangent), normal);
    let sharp = 1.0 - strength * (1.0 - perceptual_roughness);
    let sharp2 = sharp * sharp;
    return normalize_or(mix(bent, normal, sharp2 * sharp2), normal);
}
