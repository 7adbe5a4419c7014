//! Distributions, visibilities and Fresnel terms.

use std::f64::consts::PI;

use kiln_brdf::{Masking, d_charlie, d_ggx, f_schlick, v_ashikhmin};

use crate::reference::{
    burley, charlie_lambda, d_anisotropic, f_dielectric, iridescence, isotropic, lambda, stretched, weight,
};
use crate::support::{
    Arguments, COSINES, Comparison, ROUGHNESSES, alphas, check_all, first_infinite, gpu, grid, unit,
};

const ALPHA_MIN: f64 = 1e-8;

fn scalar(value: f64) -> [f64; 4] {
    [value, 0.0, 0.0, 0.0]
}

/// (n·h, |n × h|², α) around the peak and far from it.
fn half_vectors() -> Vec<[f32; 8]> {
    let sines2 = [0.0, 1e-18, 1e-14, 1e-10, 1e-7, 1e-5, 1e-3, 0.03, 0.2, 0.5, 0.9, 0.999, 1.0];
    let with = |alpha: f32| {
        sines2.map(|sin2: f32| [(1.0 - f64::from(sin2)).sqrt() as f32, sin2, alpha, 0.0, 0.0, 0.0, 0.0, 0.0])
    };
    alphas().into_iter().flat_map(with).collect()
}

#[test]
fn distributions_keep_their_digits_from_mirror_to_horizon() {
    check_all(&[
        Comparison {
            function: "lib::brdf::d_ggx",
            call: "vec4f(d_ggx(a.x, a.y, a.z), 0.0, 0.0, 0.0)",
            arguments: half_vectors(),
            truth: |a| scalar(d_ggx(a[2].max(ALPHA_MIN), a[1])),
            // With 1 − cos²: the peak's digits are gone.
            wrong: |a| scalar(d_ggx(a[2].max(ALPHA_MIN), 1.0 - a[0] * a[0])),
            tolerance: 4e-6,
            least: 1e-30,
        },
        Comparison {
            function: "lib::brdf::d_charlie",
            call: "vec4f(d_charlie(a.x, a.y), 0.0, 0.0, 0.0)",
            arguments: grid(&[
                &[0.0, 1e-6, 1e-3, 0.1, 0.4, 0.7, 0.9, 0.99, 1.0],
                &[0.01, 0.04, 0.09, 0.25, 0.64, 1.0],
            ]),
            truth: |a| scalar(d_charlie(a[1], a[0].sqrt())),
            wrong: |a| scalar(d_charlie(a[1] * 1.01, a[0].sqrt())),
            tolerance: 2e-4,
            least: 1e-6,
        },
        Comparison {
            function: "lib::anisotropy::d_ggx_anisotropic",
            call: "vec4f(d_ggx_anisotropic(a.xyz, b.xy), 0.0, 0.0, 0.0)",
            arguments: brushed_half_vectors(),
            truth: |a| scalar(d_anisotropic([a[0], a[1], a[2]], [a[4].max(ALPHA_MIN), a[5].max(ALPHA_MIN)])),
            wrong: |a| scalar(d_anisotropic([a[1], a[0], a[2]], [a[4].max(ALPHA_MIN), a[5].max(ALPHA_MIN)])),
            tolerance: 4e-6,
            least: 1e-30,
        },
    ]);
}

/// Unit vectors around the normal.
fn half_directions() -> Vec<[f32; 3]> {
    let mut found = vec![[0.0, 0.0, 1.0]];
    for sine in [1e-7, 1e-4, 0.01, 0.3, 0.9, 1.0_f64] {
        for turn in [0.0, 0.11, 0.37, 0.8] {
            let (y, x) = (2.0 * PI * turn).sin_cos();
            found.push([sine * x, sine * y, (1.0 - sine * sine).sqrt()].map(|x| x as f32));
        }
    }
    found
}

/// The same for brushes of all widths.
fn brushed_half_vectors() -> Vec<[f32; 8]> {
    let widths = grid(&[&[0.0, 1e-4, 0.04, 0.5, 1.0], &[0.0, 1e-3, 0.2, 1.0]]);
    let with = |[x, y, z]: [f32; 3]| widths.iter().map(move |&[a, b, ..]| [x, y, z, 0.0, a, b, 0.0, 0.0]);
    half_directions().into_iter().flat_map(with).collect()
}

/// V · n·l, which is what a lobe is made of, and finite where V is not.
fn scattered(masking: Masking, a: Arguments) -> [f64; 4] {
    scalar(masking.scattered(a[2], a[1], a[0]))
}

/// n·l and n·v in [0, 1].
fn cosines_and_alphas() -> Vec<[f32; 8]> {
    let cosines = &COSINES[..COSINES.len() - 1];
    let mut all = grid(&[cosines, cosines, &alphas()]);
    // Directions that graze a mirror to within the rounding of a cosine: there it is enough to be finite.
    all.retain(|a| (a[0] + a[2]) * (a[1] + a[2]) > 1e-12);
    all
}

#[test]
fn visibilities_are_right_down_to_grazing_views() {
    check_all(&[
        Comparison {
            function: "lib::brdf::v_smith_height_correlated",
            call: "vec4f(a.x * v_smith_height_correlated(a.x, a.y, a.z), 0.0, 0.0, 0.0)",
            arguments: cosines_and_alphas(),
            truth: |a| scattered(Masking::SmithCorrelated, a),
            wrong: |a| scattered(Masking::SmithSeparable, a),
            tolerance: 2e-6,
            least: 1e-9,
        },
        Comparison {
            function: "lib::brdf::v_smith_separable",
            call: "vec4f(a.x * v_smith_separable(a.x, a.y, a.z), 0.0, 0.0, 0.0)",
            arguments: cosines_and_alphas(),
            truth: |a| {
                let g = |x: f64| 1.0 / (1.0 + lambda(isotropic(x, a[2])));
                let has_angles = a[0] > 0.0 && a[1] > 0.0;
                if has_angles {
                    scalar(g(a[0]) * g(a[1]) / (4.0 * a[1]))
                } else {
                    scattered(Masking::SmithSeparable, a)
                }
            },
            wrong: |a| scattered(Masking::SmithCorrelated, a),
            tolerance: 3e-6,
            least: 1e-9,
        },
        Comparison {
            function: "lib::brdf::{schlick_k_environment, v_schlick_ggx}",
            call: "vec4f(a.x * v_schlick_ggx(a.x, a.y, schlick_k_environment(a.z)), 0.0, 0.0, 0.0)",
            arguments: cosines_and_alphas(),
            truth: |a| scattered(Masking::SchlickIbl, a),
            wrong: |a| scattered(Masking::SchlickLights, a),
            tolerance: 2e-6,
            least: 1e-9,
        },
        Comparison {
            function: "lib::brdf::{schlick_k_light, v_schlick_ggx}",
            call: "vec4f(a.x * v_schlick_ggx(a.x, a.y, schlick_k_light(a.w)), 0.0, 0.0, 0.0)",
            arguments: grid(&[&COSINES[..13], &COSINES[..13], &[0.0], &ROUGHNESSES]),
            truth: |a| scattered(Masking::SchlickLights, [a[0], a[1], a[3] * a[3], 0.0, 0.0, 0.0, 0.0, 0.0]),
            wrong: |a| scattered(Masking::SchlickIbl, [a[0], a[1], a[3] * a[3], 0.0, 0.0, 0.0, 0.0, 0.0]),
            tolerance: 2e-6,
            least: 1e-9,
        },
        Comparison {
            function: "lib::brdf::v_ashikhmin",
            call: "vec4f(a.x * v_ashikhmin(a.x, a.y), 0.0, 0.0, 0.0)",
            arguments: grid(&[&COSINES[..13], &COSINES[..13]]),
            truth: |a| scalar(if a[0] == 0.0 { 0.0 } else { a[0] * v_ashikhmin(a[1], a[0]) }),
            wrong: |a| scalar(if a[0] == 0.0 { 0.0 } else { a[0] * v_ashikhmin(a[1], a[0]).min(1.0) }),
            tolerance: 2e-6,
            least: 1e-9,
        },
        Comparison {
            function: "lib::brdf::v_neubelt",
            call: "vec4f(v_neubelt(a.x, a.y), 0.0, 0.0, 0.0)",
            arguments: grid(&[&COSINES[..13], &COSINES[..13]]),
            truth: |a| scalar(v_ashikhmin(a[1], a[0]).min(1.0)),
            wrong: |a| scalar(v_ashikhmin(a[1], a[0])),
            tolerance: 2e-6,
            least: 1e-9,
        },
        Comparison {
            function: "lib::brdf::v_charlie",
            call: "vec4f(a.x * a.y * v_charlie(a.x, a.y, a.z), 0.0, 0.0, 0.0)",
            arguments: grid(&[&COSINES[2..13], &COSINES[2..13], &alphas()]),
            truth: |a| scalar(0.25 / (1.0 + charlie_lambda(a[0], a[2]) + charlie_lambda(a[1], a[2]))),
            wrong: |a| {
                scalar(0.25 / ((1.0 + charlie_lambda(a[0], a[2])) * (1.0 + charlie_lambda(a[1], a[2]))))
            },
            tolerance: 5e-5,
            least: 1e-9,
        },
        Comparison {
            function: "lib::anisotropy::v_smith_anisotropic",
            call: "vec4f(v_smith_anisotropic(a.xyz, vec3f(a.w, b.xy), b.zw), 0.0, 0.0, 0.0)",
            arguments: anisotropic_pairs(),
            truth: |a| {
                let (l, v, widths) = ([a[0], a[1], a[2]], [a[3], a[4], a[5]], [a[6], a[7]]);
                let g = 1.0 / (1.0 + lambda(stretched(l, widths)) + lambda(stretched(v, widths)));
                scalar(g / (4.0 * l[2] * v[2]))
            },
            wrong: |a| {
                let (l, v, widths) = ([a[0], a[1], a[2]], [a[3], a[4], a[5]], [a[7], a[6]]);
                let g = 1.0 / (1.0 + lambda(stretched(l, widths)) + lambda(stretched(v, widths)));
                scalar(g / (4.0 * l[2] * v[2]))
            },
            tolerance: 3e-6,
            least: 1e-9,
        },
    ]);
}

/// Light, view and widths of a brush.
fn anisotropic_pairs() -> Vec<[f32; 8]> {
    let vectors = [[0.0, 0.0, 1.0], [0.3, 0.1, 0.9], [-0.8, 0.2, 0.3], [0.1, 0.99, 0.001], [0.99, 0.1, 1e-5]]
        .map(|v| unit(v).map(|x| x as f32));
    let mut found = Vec::new();
    for [lx, ly, lz] in vectors {
        for [vx, vy, vz] in vectors {
            for [a, b] in [[0.0, 0.0], [1e-4, 0.5], [0.04, 1.0], [1.0, 0.2], [0.5, 0.5]] {
                found.push([lx, ly, lz, vx, vy, vz, a, b]);
            }
        }
    }
    found
}

#[test]
fn fresnel_and_diffuse_terms_are_right_at_and_beyond_one() {
    check_all(&[
        Comparison {
            function: "lib::brdf::f_schlick",
            call: "vec4f(f_schlick(vec3f(a.y, 0.04, 1.0), 1.0, a.x), 0.0)",
            arguments: grid(&[&COSINES, &[0.0, 0.02, 0.5]]),
            truth: |a| {
                let x = a[0].min(1.0);
                [f_schlick(a[1], x), f_schlick(f64::from(0.04_f32), x), 1.0, 0.0]
            },
            wrong: |a| [f_schlick(a[1], 1.0 - a[0].min(1.0)), 0.04, 1.0, 0.0],
            tolerance: 1e-6,
            least: 1e-6,
        },
        Comparison {
            function: "lib::brdf::f_schlick_roughness",
            call: "vec4f(f_schlick_roughness(vec3f(a.y), a.x, a.z), 0.0)",
            arguments: grid(&[&COSINES, &[0.0, 0.04, 0.5, 1.0], &ROUGHNESSES]),
            truth: |a| {
                let f90 = (1.0 - a[2]).max(a[1]);
                let f = a[1] + (f90 - a[1]) * weight(a[0]);
                [f, f, f, 0.0]
            },
            wrong: |a| [f_schlick(a[1], a[0].min(1.0)); 4],
            tolerance: 1e-6,
            least: 1e-6,
        },
        Comparison {
            function: "lib::brdf::f_dielectric",
            call: "vec4f(f_dielectric(a.x, a.y), 0.0, 0.0, 0.0)",
            arguments: grid(&[&COSINES, &[0.5, 0.75, 1.1, 1.33, 1.5, 2.42]]),
            truth: |a| scalar(f_dielectric(a[0], a[1])),
            wrong: |a| scalar(f_schlick(((a[1] - 1.0) / (a[1] + 1.0)).powi(2), a[0].min(1.0))),
            tolerance: 3e-5,
            least: 1e-3,
        },
        Comparison {
            function: "lib::brdf::f0_of_schlick",
            call: "vec4f(f0_of_schlick(vec3f(a.z + (a.y - a.z) * a.w, 0.0, 1.0), a.y, a.x), 0.0)",
            arguments: schlick_and_weights(),
            truth: |a| {
                let solved = |f: f64| ((f - a[1] * weight(a[0])) / (1.0 - weight(a[0]))).clamp(0.0, 1.0);
                [solved(a[2] + (a[1] - a[2]) * a[3]), solved(0.0), solved(1.0), 0.0]
            },
            wrong: |a| [a[2] + (a[1] - a[2]) * a[3], 0.0, 1.0, 0.0],
            tolerance: 3e-6,
            least: 1.0,
        },
        Comparison {
            function: "lib::brdf::f0_of_ior",
            call: "vec4f(f0_of_ior(a.x), 0.0, 0.0, 0.0)",
            arguments: grid(&[&[0.0, 0.5, 1.0, 1.1, 1.33, 1.5, 2.42, 100.0]]),
            truth: |a| scalar(((a[0] - 1.0) / (a[0] + 1.0)).powi(2)),
            wrong: |a| scalar(((a[0] - 1.0) / (a[0] + 1.0)).abs()),
            tolerance: 2e-6,
            least: 1e-6,
        },
        Comparison {
            function: "lib::brdf::{diffuse_burley, diffuse_lambert}",
            call: "vec4f(diffuse_burley(a.x, a.y, a.z, a.w), diffuse_lambert(), 0.0, 0.0)",
            arguments: grid(&[&COSINES, &COSINES, &[0.0, 0.5, 1.0], &ROUGHNESSES]),
            truth: |a| [burley(a[0], a[1], a[2], a[3]), 1.0 / PI, 0.0, 0.0],
            wrong: |_| [1.0 / PI, 1.0 / PI, 0.0, 0.0],
            tolerance: 2e-6,
            least: 1e-3,
        },
        Comparison {
            function: "lib::iridescence::f_iridescence",
            call: "vec4f(f_iridescence(a.x, vec3f(a.y, 0.5, 1.0), a.z, a.w), 0.0)",
            arguments: grid(&[
                &COSINES,
                &[0.0, 0.04, 0.95],
                &[0.8, 1.0, 1.3, 1.8],
                &[0.0, 0.01, 10.0, 100.0, 400.0, 1200.0],
            ]),
            truth: |a| {
                let [r, g, b] = iridescence(a[0], [a[1], 0.5, 1.0], a[2], a[3]);
                [r, g, b, 0.0]
            },
            wrong: |a| {
                let [r, g, b] = iridescence(a[0], [a[1], 0.5, 1.0], a[2], a[3] * 1.001);
                [r, g, b, 0.0]
            },
            // Films of 1200 nm turn f32's rounding of some 40 radians into colour.
            tolerance: 2e-3,
            least: 0.1,
        },
    ]);
}

/// Cosine, f90, f0 and Schlick's weight of the cosine, from 0.1 on: below, every f0 gives nearly f90.
fn schlick_and_weights() -> Vec<[f32; 8]> {
    let mut all = grid(&[&[0.1, 0.3, 0.6, 0.9, 1.0], &[0.5, 1.0], &[0.0, 0.04, 0.5]]);
    for arguments in &mut all {
        arguments[3] = weight(f64::from(arguments[0])) as f32;
    }
    all
}

#[test]
fn nothing_is_infinite_at_any_edge() {
    let Some(gpu) = gpu() else { return };
    let lobes = "vec4f(a.x * d_ggx(1.0, 0.0, a.z) * v_smith_height_correlated(a.x, a.y, a.z),
        a.x * d_ggx(1.0, 0.0, a.z) * v_smith_separable(a.x, a.y, a.z),
        a.x * d_ggx(a.x, 1.0 - a.x * a.x, a.z) * v_schlick_ggx(a.x, a.y, schlick_k_environment(a.z)),
        a.x * d_charlie(1.0, a.z) * v_charlie(a.x, a.y, a.z) + a.x * d_charlie(0.0, a.z) * v_ashikhmin(a.x, a.y))";
    let names = "lib::brdf::{d_charlie, d_ggx, schlick_k_environment, v_ashikhmin, v_charlie, v_schlick_ggx, \
                 v_smith_height_correlated, v_smith_separable}";
    let isotropic = grid(&[&COSINES, &COSINES, &alphas()]);
    assert_eq!(first_infinite(gpu, names, lobes, &isotropic), None);
    let fresnel = "vec4f(f_dielectric(a.x, a.y))";
    assert_eq!(
        first_infinite(gpu, "lib::brdf::f_dielectric", fresnel, &grid(&[&COSINES, &[0.0, 1.0, 1e6]])),
        None
    );
    let names = "lib::anisotropy::{d_ggx_anisotropic, v_smith_anisotropic}";
    let brushed = "vec4f(d_ggx_anisotropic(vec3f(0.0, 0.0, 1.0), a.zw), \
                   v_smith_anisotropic(vec3f(1.0, 0.0, a.x), vec3f(0.0, 1.0, a.y), a.zw), 0.0, 0.0)";
    let anisotropic = grid(&[&COSINES, &COSINES, &alphas(), &alphas()]);
    assert_eq!(first_infinite(gpu, names, brushed, &anisotropic), None);
    let unguarded = first_infinite(gpu, "lib::brdf::d_ggx", "vec4f(d_ggx(1.0, 0.0, 1.0) / a.x)", &isotropic);
    assert!(unguarded.is_some_and(|text| text.contains("inf")), "the check sees an infinity");
}
