// Microfacet terms in closed form. Cosines are clamped to [0, 1] by the caller; alpha = perceptual roughness².

import lib::vector::one_minus_pow5;

const PI: f32 = 3.14159265358979;

// GGX, per steradian. Walter et al. 2007, "Microfacet Models for Refraction", equation 33, as
//     D = alpha² / (π (alpha² cos²θ + sin²θ)²).
// `n_cross_h_squared` is |n × h|² = sin²θ: computed from the cross product it keeps all its digits near the
// peak, where 1 - (n·h)² has none left. Needs alpha > 0.
fn d_ggx(n_dot_h: f32, n_cross_h_squared: f32, alpha: f32) -> f32 {
    // alpha / (…) first: alpha² alone underflows in half precision, and the quotient is at most 1 / alpha.
    let ratio = alpha / (alpha * alpha * n_dot_h * n_dot_h + n_cross_h_squared);
    return ratio * ratio / PI;
}

// Smith's height-correlated masking and shadowing over 4 (n·l)(n·v). Heitz 2014, "Understanding the
// Masking-Shadowing Function", equation 99; this form from Lagarde and de Rousiers 2014,
// "Moving Frostbite to Physically Based Rendering".
fn v_smith_height_correlated(n_dot_l: f32, n_dot_v: f32, alpha: f32) -> f32 {
    let alpha2 = alpha * alpha;
    let light = n_dot_v * sqrt(n_dot_l * n_dot_l * (1.0 - alpha2) + alpha2);
    let view = n_dot_l * sqrt(n_dot_v * n_dot_v * (1.0 - alpha2) + alpha2);
    // Zero only where both directions graze; n·l then makes the product with V vanish, so the bound is free.
    return 0.5 / max(light + view, 1e-7);
}

// Schlick 1994, "An Inexpensive BRDF Model for Physically-based Rendering", equation 15, with a grazing value.
fn f_schlick(f0: vec3f, f90: f32, v_dot_h: f32) -> vec3f {
    return f0 + (vec3f(f90) - f0) * one_minus_pow5(v_dot_h);
}

// Schlick's term for prefiltered light, dimmed by roughness at grazing views. Lagarde 2011, "Adopting a
// physically based shading model"; Fdez-Agüera 2019 uses it too. Where a table already integrates Fresnel
// (lut_ggx), use the table instead.
fn f_schlick_roughness(f0: vec3f, n_dot_v: f32, perceptual_roughness: f32) -> vec3f {
    let f90 = max(vec3f(1.0 - perceptual_roughness), f0);
    return f0 + (f90 - f0) * one_minus_pow5(n_dot_v);
}

// Charlie, per steradian. Estevez and Kulla 2017, "Production Friendly Microfacet Sheen BRDF", equation 2:
//     D = (2 + 1/alpha) sin(θ)^(1/alpha) / 2π.
// Takes sin²θ = |n × h|²; in logarithms, because sin^(1/alpha) underflows for small alpha. Needs alpha > 0.
fn d_charlie(n_cross_h_squared: f32, alpha: f32) -> f32 {
    let inverse_alpha = 1.0 / alpha;
    // log2 is undefined at 0; the smallest normal f32 gives 2^(-63 / alpha), as good as 0.
    let log2_sin = 0.5 * log2(max(n_cross_h_squared, 1.1754944e-38));
    return (2.0 + inverse_alpha) * exp2(inverse_alpha * log2_sin) / (2.0 * PI);
}

// Ashikhmin and Premoze 2007, "Distribution-based BRDFs": 1 / (4 (n·l + n·v - (n·l)(n·v))).
fn v_ashikhmin(n_dot_l: f32, n_dot_v: f32) -> f32 {
    // Zero only where both directions graze, as for Smith's term.
    return 0.25 / max(n_dot_l + n_dot_v - n_dot_l * n_dot_v, 1e-7);
}

// Reflectance at normal incidence of a dielectric in air; Fresnel's equations at θ = 0. ior = 0 gives 1,
// which is what KHR_materials_ior asks for.
fn f0_of_ior(ior: f32) -> f32 {
    let ratio = (ior - 1.0) / (ior + 1.0);
    return ratio * ratio;
}

// Widens alpha² by the normal's variation within a pixel. Tokuyoshi and Kaplanyan 2019, "Improved Geometric
// Specular Antialiasing": pixel filter variance 1/2π, widening at most 0.18. Call it in uniform control flow.
fn alpha2_filtered(alpha2: f32, normal: vec3f) -> f32 {
    let dx = dpdx(normal);
    let dy = dpdy(normal);
    let variance = 0.15915494 * (dot(dx, dx) + dot(dy, dy));
    // min also bounds the derivatives that extrapolation gives at a triangle's edge.
    return min(alpha2 + min(2.0 * variance, 0.18), 1.0);
}
