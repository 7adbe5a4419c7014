// Sample points and importance sampling. Directions are local: z is the normal. Every method is a pair `sample_X`, `pdf_X`;
// densities are per steradian of what the method returns. u lies in [0, 1)².

import lib::brdf::{d_charlie, d_ggx, smith_half};
import lib::constants::{ALPHA_MIN, PI};
import lib::vector::normalize_or;

// Van der Corput's sequence in base 2: the bits of `index` mirrored at the binary point. Niederreiter 1992, "Random Number
// Generation and Quasi-Monte Carlo Methods", section 3.1. Indices from 2^24 on lose their lowest digits; the
// result stays below 1, which rounding all 32 bits would not.
fn radical_inverse(index: u32) -> f32 {
    return f32(reverseBits(index) >> 8u) * 5.9604645e-8;
}

// Point `index` of `count` of Hammersley's set: (index / count, radical inverse). Hammersley 1960, "Monte Carlo Methods for Solving
// Multivariable Problems".
fn hammersley(index: u32, count: u32) -> vec2f {
    return vec2f(f32(index) / f32(max(count, 1u)), radical_inverse(index));
}

// Columns tangent, bitangent and `normal`, which has unit length. Duff et al. 2017, "Building an Orthonormal Basis, Revisited",
// listing 3: the divisor is at least 1 in size, at the poles too.
fn orthonormal_basis(normal: vec3f) -> mat3x3f {
    let s = select(-1.0, 1.0, normal.z >= 0.0);
    // kiln: allow(domain) s has the sign of normal.z, so the sum is at least 1 in size
    let a = -1.0 / (s + normal.z);
    let b = normal.x * normal.y * a;
    let tangent = vec3f(1.0 + s * normal.x * normal.x * a, s * b, -s * normal.x);
    let bitangent = vec3f(b, s + normal.y * normal.y * a, -normal.y);
    return mat3x3f(tangent, bitangent, normal);
}

// The direction at azimuth 2π `turn` with the given sine and cosine of the angle from z.
fn spherical_direction(sin_theta: f32, cos_theta: f32, turn: f32) -> vec3f {
    let phi = 2.0 * PI * turn;
    return vec3f(sin_theta * cos(phi), sin_theta * sin(phi), cos_theta);
}

// Light directions distributed as cos θ / π. Pharr, Jakob and Humphreys 2016, "Physically Based Rendering", 3rd edition,
// section 13.6.3 (Malley's method).
fn sample_cosine(u: vec2f) -> vec3f {
    return spherical_direction(sqrt(saturate(u.y)), sqrt(saturate(1.0 - u.y)), u.x);
}

fn pdf_cosine(cos_theta: f32) -> f32 {
    return max(cos_theta, 0.0) / PI;
}

// Half vectors distributed as D (n·h) of GGX. Walter et al. 2007, equation 35, tan²θ = alpha² u / (1 - u), as sine and cosine
// without a difference: near the peak 1 - cos²θ would have no digits.
fn sample_ggx(u: vec2f, alpha: f32) -> vec3f {
    let a = max(alpha, ALPHA_MIN);
    let cosine2 = saturate(1.0 - u.y);
    let sine2 = a * a * saturate(u.y);
    let inverse = inverseSqrt(max(cosine2 + sine2, 1e-30));
    return spherical_direction(sqrt(sine2) * inverse, sqrt(cosine2) * inverse, u.x);
}

fn pdf_ggx(n_dot_h: f32, n_cross_h_squared: f32, alpha: f32) -> f32 {
    return d_ggx(n_dot_h, n_cross_h_squared, alpha) * max(n_dot_h, 0.0);
}

// Half vectors of GGX as `view` (unit, z ≥ 0) sees them. Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with Spherical
// Caps", listing 3: the view is stretched to a hemisphere, whose visible part is a cap around it. Has no special case at
// view = z, where Heitz 2018 divides by zero.
fn sample_ggx_visible(view: vec3f, u: vec2f, alpha: f32) -> vec3f {
    let a = max(alpha, ALPHA_MIN);
    let stretched = normalize_or(vec3f(a * view.xy, view.z), vec3f(0.0, 0.0, 1.0));
    // How far below the pole of the cap: kept as it is, because 1 - z of a rounded z has no digits near the pole.
    let depth = u.y * (1.0 + stretched.z);
    let sine = sqrt(max(depth * (2.0 - depth), 0.0));
    let h = spherical_direction(sine, 1.0 - depth, u.x) + stretched;
    return normalize_or(vec3f(a * h.xy, max(h.z, 0.0)), vec3f(0.0, 0.0, 1.0));
}

// G_1(n·v) (v·h) D / (n·v). Heitz 2018, "Sampling the GGX Distribution of Visible Normals", equation 3. Of light directions
// reflected at h it is a quarter of this over v·h.
fn pdf_ggx_visible(n_dot_v: f32, v_dot_h: f32, n_dot_h: f32, n_cross_h_squared: f32, alpha: f32) -> f32 {
    let masked = 2.0 * max(v_dot_h, 0.0) / max(smith_half(n_dot_v, alpha), ALPHA_MIN);
    return masked * d_ggx(n_dot_h, n_cross_h_squared, alpha);
}

// Half vectors distributed as D (n·h) of Charlie: sin θ = u^(alpha / (2 alpha + 1)). Inverted from Estevez and Kulla 2017, equation 2.
fn sample_charlie(u: vec2f, alpha: f32) -> vec3f {
    let a = max(alpha, ALPHA_MIN);
    // ln sin²θ; log has no value at 0, and the smallest normal f32 is as good.
    let x = 2.0 * a / (2.0 * a + 1.0) * log(max(u.y, 1.1754944e-38));
    return spherical_direction(exp(0.5 * x), sqrt(one_minus_exp(x)), u.x);
}

fn pdf_charlie(n_dot_h: f32, n_cross_h_squared: f32, alpha: f32) -> f32 {
    return d_charlie(n_cross_h_squared, alpha) * max(n_dot_h, 0.0);
}

// 1 - exp(x) for x ≤ 0. Near 0 by Taylor's series, whose first term left out is 1.5e-9 of the sum at -1/4: the difference would
// have no digits.
fn one_minus_exp(x: f32) -> f32 {
    let series = 1.0 + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0 * (1.0 + x / 6.0 * (1.0 + x / 7.0)))));
    return select(1.0 - exp(x), -x * series, x > -0.25);
}
