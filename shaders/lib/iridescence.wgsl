// Thin films. Belcour and Barla 2017, "A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence", in the
// form of KHR_materials_iridescence: two bounces in the film, sensitivities as Gaussians in Fourier space.

import lib::brdf::f_schlick;
import lib::constants::PI;

// Reflectance of a base of reflectance `base_f0` under a film of `thickness_nm`, seen under the angle of `cos_theta` from outside.
fn f_iridescence(cos_theta: f32, base_f0: vec3f, film_ior: f32, thickness_nm: f32) -> vec3f {
    let cosine = saturate(cos_theta);
    // A film that vanishes has no index of its own.
    let ior = max(mix(1.0, film_ior, smoothstep(0.0, 0.03, thickness_nm)), 1e-3);
    let cosine2_inside = 1.0 - (1.0 - cosine * cosine) / (ior * ior);
    if cosine2_inside < 0.0 {
        return vec3f(1.0);
    }
    let cosine_inside = sqrt(cosine2_inside);

    // From air into the film, and from the film into the base, whose index follows from its reflectance (which stays below 1,
    // where there is none).
    let r12 = f_schlick(vec3f(f0_between(vec3f(ior), 1.0)), 1.0, cosine).x;
    let base_ior = ior_of_f0(base_f0);
    let r23 = f_schlick(f0_between(base_ior, ior), 1.0, cosine_inside);
    // A reflection at a denser medium turns the phase by π.
    let phase21 = select(PI, 0.0, ior < 1.0);
    let phase23 = select(vec3f(0.0), vec3f(PI), base_ior < vec3f(ior));
    let phase = phase21 + phase23;
    let path_nm = 2.0 * ior * thickness_nm * cosine_inside;

    // Airy's series: its constant term and the first two harmonics.
    let r123 = clamp(r12 * r23, vec3f(1e-5), vec3f(0.9999));
    let transmitted = (1.0 - r12) * (1.0 - r12);
    let r_s = transmitted * r23 / (1.0 - r123);
    let amplitude = sqrt(r123);
    let c1 = (r_s - (1.0 - r12)) * amplitude;
    let c2 = c1 * amplitude;
    let sum = r12 + r_s
        + 2.0 * c1 * film_sensitivity(path_nm, phase)
        + 2.0 * c2 * film_sensitivity(2.0 * path_nm, 2.0 * phase);
    // Rec. 709 does not hold all colours of a film.
    return max(sum, vec3f(0.0));
}

// Reflectance at normal incidence between two media.
fn f0_between(transmitted_ior: vec3f, incident_ior: f32) -> vec3f {
    let ratio = (transmitted_ior - incident_ior) / max(transmitted_ior + incident_ior, vec3f(1e-3));
    return ratio * ratio;
}

// Index of a medium that reflects f0 in air; finite for f0 = 1.
fn ior_of_f0(f0: vec3f) -> vec3f {
    let root = sqrt(clamp(f0, vec3f(0.0), vec3f(0.9999)));
    return (1.0 + root) / (1.0 - root);
}

// What an eye sees of a cosine over wave numbers, in Rec. 709: the colour matching functions as Gaussians, transformed. Belcour
// and Barla 2017, section 4, with the fit of their supplement.
fn film_sensitivity(path_nm: f32, shift: vec3f) -> vec3f {
    let phase = 2.0e-9 * PI * path_nm;
    let height = vec3f(5.4856e-13, 4.4201e-13, 5.2481e-13);
    let position = vec3f(1.6810e6, 1.7953e6, 2.2084e6);
    let variance = vec3f(4.3278e9, 9.3046e9, 6.6121e9);
    var xyz = height * sqrt(2.0 * PI * variance) * cos(position * phase + shift) * exp(-variance * (phase * phase));
    // The second, blue peak of x.
    let blue = 9.7470e-14 * sqrt(2.0 * PI * 4.5282e9);
    xyz.x += blue * cos(2.2399e6 * phase + shift.x) * exp(-4.5282e9 * (phase * phase));
    // Columns; XYZ to Rec. 709, D65.
    let rec709_of_xyz = mat3x3f(
        3.2404542, -0.9692660, 0.0556434,
        -1.5371385, 1.8760108, -0.2040259,
        -0.4985314, 0.0415560, 1.0572252,
    );
    return rec709_of_xyz * (xyz / 1.0685e-7);
}
