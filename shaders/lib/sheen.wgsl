// Directional albedo of the sheen lobe without a table.

// Albedo of Charlie's distribution with Ashikhmin's visibility, clamped to 1 (the model itself reaches 3 at
// grazing views of roughness 0.1). At the horizon opposite the view the half vector has
// sin²θ_h = (1 + sin θ_v) / 2; that power of D carries most of the shape, and 1 / albedo is what is left: nearly a
// polynomial. Own fit to quadrature; largest error 0.04 for perceptual roughness 0.1 to 1.
fn charlie_albedo(n_dot_v: f32, perceptual_roughness: f32) -> f32 {
    // Below 0.1 the lobe is a sliver at the horizon, and the fit was not made for it.
    let r = clamp(perceptual_roughness, 0.1, 1.0);
    let sin_theta = sqrt(saturate(1.0 - n_dot_v * n_dot_v));
    let peak = pow(0.5 + 0.5 * sin_theta, 0.5 / (r * r));
    let c0 = 0.297 + r * (2.005 - 0.618 * r);
    let c1 = 3.770 + r * (4.466 * r - 3.683) - 0.175 / r;
    let c2 = 5.856 - r * (6.785 + 3.852 * r) + 2.949 / r;
    // kiln: allow(domain) the polynomial is at least 0.49 for all inputs in range
    return min(peak / (c0 + n_dot_v * (c1 + n_dot_v * c2)), 1.0);
}
