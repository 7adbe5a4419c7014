//! The same of the shader library, as the device computes it.

use std::f64::consts::{PI, TAU};

use kiln_brdf::{Masking, Precision, dfg};
use kiln_gpu::Gpu;
use kiln_sphere::quadrature::gauss_legendre;

use crate::physics::{COSINES, REFLECTANCES, ROUGHNESSES, cell_nodes, chi_square_sigmas, nodes, points};
use crate::record::{hold, relative, worst};
use crate::support::{evaluate, gpu, grid};

/// f32's rounding of a sum of many terms, and of D near its peak.
const TOLERANCE: f64 = 2e-5;

fn of(values: [f64; 4]) -> [f32; 8] {
    let [a, b, c, d] = values.map(|value| value as f32);
    [a, b, c, d, 0.0, 0.0, 0.0, 0.0]
}

/// Σ weight · value over the nodes of ∫₀¹, of a call that takes sin² as `a.x` and α as `a.y`.
fn normalised(gpu: &Gpu, function: &str, call: &str, alpha: f64) -> f64 {
    // What f32 cannot tell from 1 has no part in it.
    let nodes: Vec<(f64, f64)> = nodes().into_iter().filter(|(x, _)| (*x as f32) < 1.0).collect();
    let arguments: Vec<[f32; 8]> = nodes.iter().map(|(x, _)| of([*x, alpha, 0.0, 0.0])).collect();
    let values = evaluate(gpu, function, call, &arguments);
    values.iter().zip(&nodes).map(|(value, (_, weight))| PI * weight * f64::from(value[0])).sum()
}

#[test]
fn distributions_of_the_library_are_normalised() {
    let Some(gpu) = gpu() else { return };
    let mut errors = Vec::new();
    for roughness in ROUGHNESSES {
        let alpha = f64::from((roughness * roughness) as f32);
        let ggx = normalised(gpu, "lib::brdf::d_ggx", "vec4f(d_ggx(sqrt(1.0 - a.x), a.x, a.y))", alpha);
        errors.push(relative(ggx, 1.0, 0.0));
        if roughness >= 0.25 {
            let charlie = normalised(gpu, "lib::brdf::d_charlie", "vec4f(d_charlie(a.x, a.y))", alpha);
            errors.push(relative(charlie, 1.0, 0.0));
        }
    }
    assert!(worst(errors.iter().copied()) <= 1e-3, "{errors:?}");
    hold("distributions_of_the_library_are_normalised", "wgsl", worst(errors));
    let wrong = normalised(gpu, "lib::brdf::d_ggx", "vec4f(d_ggx(1.0 - a.x, a.x, a.y))", 0.25);
    assert!(relative(wrong, 1.0, 0.0) > 2e-3, "the check sees a wrong cosine: {wrong}");
}

/// Scale and bias of the split sum as the library's terms give them, by a product rule over lights; for rough lobes.
fn albedo(gpu: &Gpu, visibility: &str, n_dot_v: f64, alpha: f64) -> [f64; 2] {
    const AZIMUTHS: usize = 128;
    let rule = gauss_legendre(96);
    let sin_v = (1.0 - n_dot_v * n_dot_v).sqrt();
    let (mut arguments, mut weights) = (Vec::new(), Vec::new());
    for (x, weight) in &rule {
        let n_dot_l = 0.5 * (x + 1.0);
        let sin_l = (1.0 - n_dot_l * n_dot_l).sqrt();
        for azimuth in 0..AZIMUTHS {
            let phi = TAU * (azimuth as f64 + 0.5) / AZIMUTHS as f64;
            let v_dot_h = (0.5 * (1.0 + n_dot_l * n_dot_v + sin_l * sin_v * phi.cos())).sqrt();
            arguments.push(of([n_dot_l, n_dot_v, v_dot_h, alpha]));
            weights.push(0.5 * weight * TAU / AZIMUTHS as f64 * n_dot_l);
        }
    }
    let half = "((a.x + a.y) / (2.0 * a.z))";
    let lobe = format!("d_ggx({half}, 1.0 - {half} * {half}, a.w) * {visibility}(a.x, a.y, a.w)");
    let call = format!("vec4f({lobe}) * vec4f(f_schlick(vec3f(0.0), 1.0, a.z), 1.0)");
    let values = evaluate(gpu, &format!("lib::brdf::{{d_ggx, f_schlick, {visibility}}}"), &call, &arguments);
    let sum = |i: usize| {
        values.iter().zip(&weights).map(|(value, weight)| weight * f64::from(value[i])).sum::<f64>()
    };
    let (bias, all) = (sum(0), sum(3));
    [all - bias, bias]
}

#[test]
fn lobes_of_the_library_reflect_what_the_integrals_say_and_no_more() {
    let Some(gpu) = gpu() else { return };
    let mut errors = Vec::new();
    for (visibility, masking) in [
        ("v_smith_height_correlated", Masking::SmithCorrelated),
        ("v_smith_separable", Masking::SmithSeparable),
    ] {
        for roughness in [0.6, 0.8, 1.0] {
            for n_dot_v in [0.3, 0.6, 1.0] {
                let [scale, bias] = albedo(gpu, visibility, n_dot_v, roughness * roughness);
                let exact = dfg(masking, n_dot_v, roughness, Precision::Full);
                errors.extend([relative(scale, exact[0], 0.1), relative(bias, exact[1], 0.1)]);
                for f0 in REFLECTANCES {
                    assert!(f0 * scale + bias <= 1.0 + TOLERANCE, "{visibility} {roughness} {n_dot_v} {f0}");
                }
            }
        }
    }
    hold("lobes_of_the_library_reflect_what_the_integrals_say_and_no_more", "wgsl", worst(errors));
    let [scale, bias] = albedo(gpu, "v_smith_separable", 0.3, 1.0);
    let other = dfg(Masking::SmithCorrelated, 0.3, 1.0, Precision::Full);
    assert!(relative(scale + bias, other[0] + other[1], 0.1) > 1e-2, "the check tells maskings apart");
}

#[test]
fn white_furnace_of_the_library_is_white_with_all_bounces() {
    let Some(gpu) = gpu() else { return };
    let mut errors = Vec::new();
    for roughness in ROUGHNESSES {
        for n_dot_v in COSINES {
            let [scale, bias] = dfg(Masking::SmithCorrelated, n_dot_v, roughness, Precision::Full);
            let call = "vec4f(ggx_albedo(vec3f(1.0), 1.0, a.xy).single.x, ggx_albedo(vec3f(1.0), 1.0, a.xy).multiple.x, 0.0, 0.0)";
            let value =
                evaluate(gpu, "lib::environment::ggx_albedo", call, &[of([scale, bias, 0.0, 0.0])])[0];
            assert!(value[0] <= 1.0 + 1e-6, "single scattering at {roughness} {n_dot_v}");
            errors.push(relative(f64::from(value[0] + value[1]), 1.0, 0.0));
        }
    }
    hold("white_furnace_of_the_library_is_white_with_all_bounces", "wgsl", worst(errors));
}

#[test]
fn lobes_of_the_library_are_reciprocal() {
    let Some(gpu) = gpu() else { return };
    let cosines: Vec<f32> = COSINES.map(|it| it as f32).to_vec();
    let arguments = grid(&[&cosines, &cosines, &[1e-4, 0.01, 0.3, 1.0]]);
    let call = "vec4f(v_smith_height_correlated(a.x, a.y, a.z) / v_smith_height_correlated(a.y, a.x, a.z), \
                v_smith_separable(a.x, a.y, a.z) / v_smith_separable(a.y, a.x, a.z), \
                v_ashikhmin(a.x, a.y) / v_ashikhmin(a.y, a.x), v_charlie(a.x, a.y, a.z) / v_charlie(a.y, a.x, a.z))";
    let names = "lib::brdf::{v_ashikhmin, v_charlie, v_smith_height_correlated, v_smith_separable}";
    let values = evaluate(gpu, names, call, &arguments);
    let errors = values.iter().flatten().map(|ratio| relative(f64::from(*ratio), 1.0, 0.0));
    hold("lobes_of_the_library_are_reciprocal", "wgsl", worst(errors));
}

/// Directions that the device draws, and densities that it gives at the nodes of the cells.
struct Drawn {
    names: &'static str,
    /// Of the point `a.xy` and α `a.z`.
    sample: &'static str,
    /// Of the direction `a.xyz` and α `a.w`.
    pdf: &'static str,
}

const VIEW: &str = "normalize(vec3f(0.5, -0.3, 0.6))";

fn drawn() -> [Drawn; 4] {
    let visible = format!("vec4f(sample_ggx_visible({VIEW}, a.xy, a.z), 0.0)").leak();
    let pdf_visible =
        format!("vec4f(pdf_ggx_visible({VIEW}.z, dot({VIEW}, a.xyz), a.z, dot(a.xy, a.xy), a.w))").leak();
    [
        Drawn {
            names: "lib::sampling::{pdf_cosine, sample_cosine}",
            sample: "vec4f(sample_cosine(a.xy), 0.0)",
            pdf: "vec4f(pdf_cosine(a.z))",
        },
        Drawn {
            names: "lib::sampling::{pdf_ggx, sample_ggx}",
            sample: "vec4f(sample_ggx(a.xy, a.z), 0.0)",
            pdf: "vec4f(pdf_ggx(a.z, dot(a.xy, a.xy), a.w))",
        },
        Drawn {
            names: "lib::sampling::{pdf_charlie, sample_charlie}",
            sample: "vec4f(sample_charlie(a.xy, a.z), 0.0)",
            pdf: "vec4f(pdf_charlie(a.z, dot(a.xy, a.xy), a.w))",
        },
        Drawn {
            names: "lib::sampling::{pdf_ggx_visible, sample_ggx_visible}",
            sample: visible,
            pdf: pdf_visible,
        },
    ]
}

#[test]
fn samples_of_the_library_follow_its_densities_by_chi_square_and_not_a_wrong_one() {
    let Some(gpu) = gpu() else { return };
    const SIGMAS: f64 = 5.0;
    let nodes = cell_nodes();
    for (seed, Drawn { names, sample, pdf }) in (40..).zip(drawn()) {
        let alpha = 0.5;
        let points: Vec<[f32; 8]> = points(seed).iter().map(|u| of([u[0], u[1], alpha, 0.0])).collect();
        let directions: Vec<[f64; 3]> =
            evaluate(gpu, names, sample, &points).iter().map(|d| [d[0], d[1], d[2]].map(f64::from)).collect();
        let density = |alpha: f64| -> Vec<f64> {
            let at: Vec<[f32; 8]> = nodes.iter().map(|(_, [x, y, z], _)| of([*x, *y, *z, alpha])).collect();
            evaluate(gpu, names, pdf, &at).iter().map(|value| f64::from(value[0])).collect()
        };
        let right = chi_square_sigmas(&directions, &density(alpha));
        assert!(right <= SIGMAS, "{names}: χ² is {right} standard deviations off");
        let wrong = chi_square_sigmas(&directions, &density(1.3 * alpha));
        assert!(names.contains("cosine") || wrong > SIGMAS, "{names}: α off by 30 % goes unseen: {wrong}");
    }
}
