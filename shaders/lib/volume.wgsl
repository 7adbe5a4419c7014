// Light through a medium: absorption, refraction, dispersion. KHR_materials_volume, KHR_materials_dispersion.

// Share of light left after `distance` through a medium that leaves `color` after `attenuation_distance`. Beer-Lambert, as in
// KHR_materials_volume: color^(distance / attenuation_distance). An attenuation distance of 0 stands for none at all.
fn volume_attenuation(distance: f32, color: vec3f, attenuation_distance: f32) -> vec3f {
    if attenuation_distance <= 0.0 || distance <= 0.0 {
        return vec3f(1.0);
    }
    // A finite number: 2^-126 of anything is black.
    let ratio = min(distance / max(attenuation_distance, 1e-30), 1e30);
    let clear = clamp(color, vec3f(0.0), vec3f(1.0));
    // log2 has no value at 0; a channel that lets nothing through is black at any distance.
    let left = exp2(max(ratio * log2(max(clear, vec3f(1.1754944e-38))), vec3f(-126.0)));
    return select(left, vec3f(0.0), clear <= vec3f(0.0));
}

// Roughness of a lobe refracted into a medium: none in a medium like air, all of it at index 1.5 and above. Khronos sample
// viewer, applyIorToRoughness.
fn roughness_refracted(perceptual_roughness: f32, ior: f32) -> f32 {
    return perceptual_roughness * saturate(2.0 * ior - 2.0);
}

// Indices for red, green and blue. KHR_materials_dispersion: `dispersion` is 20 over the Abbe number V_d, and
// n_F - n_C = (n_d - 1) / V_d is the spread from red to blue.
fn dispersed_ior(ior: f32, dispersion: f32) -> vec3f {
    let half_spread = (ior - 1.0) * 0.025 * dispersion;
    // Below 1 light might not enter at all.
    return max(vec3f(ior - half_spread, ior, ior + half_spread), vec3f(1.0));
}
