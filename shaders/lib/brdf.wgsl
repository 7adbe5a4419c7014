// Reflectance terms in closed form. Cosines are clamped to [0, 1] by the caller; alpha = perceptual roughness², and
// below ALPHA_MIN is taken for it. V is the visibility G / (4 (n·l)(n·v)), so that a specular lobe is D · V · F.

import lib::constants::{ALPHA_MIN, PI};
import lib::vector::one_minus_pow5;

// A product of V with n·l and n·v smaller than this is beyond the cosines' own rounding (1e-7 each): bounding the
// denominator of V by it moves no result, and keeps D · V · (n·l) finite where both directions graze.
const GRAZING_MIN: f32 = 1e-14;

// GGX, per steradian. Walter et al. 2007, "Microfacet Models for Refraction", equation 33, as
//     D = alpha² / (π (alpha² cos²θ + sin²θ)²).
// `n_cross_h_squared` is |n × h|² = sin²θ: computed from the cross product it keeps all its digits near the
// peak, where 1 - (n·h)² has none left.
fn d_ggx(n_dot_h: f32, n_cross_h_squared: f32, alpha: f32) -> f32 {
    let a = max(alpha, ALPHA_MIN);
    // a / (…) first: a² alone underflows in half precision, and the quotient is at most 1 / a.
    let ratio = a / max(a * a * n_dot_h * n_dot_h + n_cross_h_squared, ALPHA_MIN * ALPHA_MIN);
    return ratio * ratio / PI;
}

// Smith's height-correlated masking and shadowing over 4 (n·l)(n·v). Heitz 2014, "Understanding the
// Masking-Shadowing Function", equation 99; this form from Lagarde and de Rousiers 2014,
// "Moving Frostbite to Physically Based Rendering".
fn v_smith_height_correlated(n_dot_l: f32, n_dot_v: f32, alpha: f32) -> f32 {
    let alpha2 = alpha * alpha;
    let light = n_dot_v * sqrt(n_dot_l * n_dot_l * (1.0 - alpha2) + alpha2);
    let view = n_dot_l * sqrt(n_dot_v * n_dot_v * (1.0 - alpha2) + alpha2);
    return 0.5 / max(light + view, GRAZING_MIN);
}

// 2x / G_1(x) of Smith's masking for GGX, x = n·l or n·v. Walter et al. 2007, equation 34, with
// tan²θ = (1 - x²) / x² multiplied out.
fn smith_half(cosine: f32, alpha: f32) -> f32 {
    let alpha2 = alpha * alpha;
    return cosine + sqrt(alpha2 + (1.0 - alpha2) * cosine * cosine);
}

// Smith's separable masking and shadowing, G_1(n·l) G_1(n·v) over 4 (n·l)(n·v). Walter et al. 2007, equations 23 and 34.
fn v_smith_separable(n_dot_l: f32, n_dot_v: f32, alpha: f32) -> f32 {
    return 1.0 / max(smith_half(n_dot_l, alpha) * smith_half(n_dot_v, alpha), GRAZING_MIN);
}

// Schlick's rational G_1(x) = x / (x (1 - k) + k) for both directions, over 4 (n·l)(n·v). Schlick 1994, equation 19; for k
// see the two below.
fn v_schlick_ggx(n_dot_l: f32, n_dot_v: f32, k: f32) -> f32 {
    let light = n_dot_l * (1.0 - k) + k;
    let view = n_dot_v * (1.0 - k) + k;
    return 0.25 / max(light * view, GRAZING_MIN);
}

// k under an environment: alpha / 2. Karis 2013, "Real Shading in Unreal Engine 4", equation 4.
fn schlick_k_environment(alpha: f32) -> f32 {
    return 0.5 * alpha;
}

// k under lights, after Disney's remapping of roughness: (perceptual roughness + 1)² / 8. Karis 2013, equation 4; not for
// environments, whose grazing reflections it darkens far too much.
fn schlick_k_light(perceptual_roughness: f32) -> f32 {
    let r = perceptual_roughness + 1.0;
    return r * r / 8.0;
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
// Takes sin²θ = |n × h|²; in logarithms, because sin^(1/alpha) underflows for small alpha. The rounding of sin² grows by
// 1 / (2 alpha): the lobe keeps three digits down to alpha = 1e-4.
fn d_charlie(n_cross_h_squared: f32, alpha: f32) -> f32 {
    let inverse_alpha = 1.0 / max(alpha, ALPHA_MIN);
    // log2 is undefined at 0; the smallest normal f32 gives 2^(-63 / alpha), as good as 0.
    let log2_sin = 0.5 * log2(max(n_cross_h_squared, 1.1754944e-38));
    return (2.0 + inverse_alpha) * exp2(inverse_alpha * log2_sin) / (2.0 * PI);
}

// Ashikhmin and Premoze 2007, "Distribution-based BRDFs": 1 / (4 (n·l + n·v - (n·l)(n·v))).
fn v_ashikhmin(n_dot_l: f32, n_dot_v: f32) -> f32 {
    return 0.25 / max(n_dot_l + n_dot_v - n_dot_l * n_dot_v, GRAZING_MIN);
}

// The same bounded by 1, its value where n·l + n·v - (n·l)(n·v) = 1/4: Neubelt and Pettineo 2013, "Crafting a Next-gen
// Material Pipeline for The Order: 1886", as Filament computes it. Unbounded the albedo reaches 3 at grazing views.
fn v_neubelt(n_dot_l: f32, n_dot_v: f32) -> f32 {
    return min(v_ashikhmin(n_dot_l, n_dot_v), 1.0);
}

// Charlie's own masking and shadowing, 1 / (1 + Λ(n·l) + Λ(n·v)) over 4 (n·l)(n·v). Estevez and Kulla 2017, section 4.
fn v_charlie(n_dot_l: f32, n_dot_v: f32, alpha: f32) -> f32 {
    let shadowing = 1.0 + charlie_lambda(n_dot_l, alpha) + charlie_lambda(n_dot_v, alpha);
    return 0.25 / max(shadowing * n_dot_l * n_dot_v, GRAZING_MIN);
}

// Λ is exp L(x) below cosine 1/2 and mirrored there: exp(2 L(1/2) - L(1 - x)) above.
fn charlie_lambda(cosine: f32, alpha: f32) -> f32 {
    if cosine < 0.5 {
        return exp(charlie_l(cosine, alpha));
    }
    return exp(2.0 * charlie_l(0.5, alpha) - charlie_l(1.0 - cosine, alpha));
}

// L(x) = a / (1 + b x^c) + d x + e with the parameters of the paper's table 1 for alpha = 1 and 0, interpolated by (1 - alpha)².
fn charlie_l(x: f32, alpha: f32) -> f32 {
    let t = (1.0 - alpha) * (1.0 - alpha);
    let a = mix(21.5473, 25.3245, t);
    let b = mix(3.82987, 3.32435, t);
    let c = mix(0.19823, 0.16801, t);
    let d = mix(-1.97760, -1.27393, t);
    let e = mix(-4.32054, -4.85967, t);
    // pow has no value at 0; x^c is 3e-8 at the smallest normal f32, as good as 0 beside 1.
    return a / (1.0 + b * pow(max(x, 1.1754944e-38), c)) + d * x + e;
}

// Lambert's diffuse lobe per albedo, 1/π. Lambert 1760, "Photometria".
fn diffuse_lambert() -> f32 {
    return 1.0 / PI;
}

// Disney's diffuse lobe per albedo. Burley 2012, "Physically-Based Shading at Disney", section 5.3. Brighter than Lambert's
// at grazing angles of rough surfaces: it does not keep to energy conservation.
fn diffuse_burley(n_dot_l: f32, n_dot_v: f32, v_dot_h: f32, perceptual_roughness: f32) -> f32 {
    let excess = 2.0 * perceptual_roughness * v_dot_h * v_dot_h - 0.5;
    let light = 1.0 + excess * one_minus_pow5(n_dot_l);
    let view = 1.0 + excess * one_minus_pow5(n_dot_v);
    return light * view / PI;
}

// Unpolarised reflectance of a smooth dielectric, `ior` that of the far side over the near one's. Fresnel 1823; written with
// g as in Walter et al. 2007, equation 22. 1 beyond the critical angle.
fn f_dielectric(v_dot_h: f32, ior: f32) -> f32 {
    let c = saturate(v_dot_h);
    let g2 = ior * ior - (1.0 - c * c);
    if g2 <= 0.0 {
        return 1.0;
    }
    let g = sqrt(g2);
    let a = (g - c) / (g + c);
    let b = (c * (g + c) - 1.0) / (c * (g - c) + 1.0);
    return 0.5 * a * a * (1.0 + b * b);
}

// Reflectance at normal incidence of a dielectric in air; Fresnel's equations at θ = 0. ior = 0 gives 1,
// which is what KHR_materials_ior asks for.
fn f0_of_ior(ior: f32) -> f32 {
    let ratio = (ior - 1.0) / (max(ior, 0.0) + 1.0);
    return ratio * ratio;
}

// Schlick's term solved for f0: what gives reflectance `f` at this angle. At grazing angles, where every f0 gives f90, the
// result is bounded.
fn f0_of_schlick(f: vec3f, f90: f32, v_dot_h: f32) -> vec3f {
    let weight = min(one_minus_pow5(v_dot_h), 0.9999);
    return saturate((f - f90 * weight) / (1.0 - weight));
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
