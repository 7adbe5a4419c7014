//! Lobes at the ends of their parameters, natively and in the shader library.

use std::f64::consts::PI;

use kiln_bake::{Masking, RoughnessLaw, SheenVisibility, roughness_of_level};
use kiln_brdf::{Precision, d_charlie, d_ggx, dfg, dfg_multiscatter, f_schlick, sampling, sheen_albedo};
use kiln_sphere::{Cancel, kernel_charlie};

use crate::maps::Random;
use crate::record::{hold, hold_wgsl, relative, worst};
use crate::reference::{d_anisotropic, isotropic, lambda, weight};
use crate::support::{COSINES, Comparison, alphas, first_infinite, gpu, grid};

fn scalar(x: f64) -> [f64; 4] {
    [x, 0.0, 0.0, 0.0]
}

fn usable(alpha: f64) -> f64 {
    alpha.max(1e-8)
}

#[test]
fn roughness_at_and_beyond_its_ends_gives_albedos() {
    let inside = |roughness: f64| roughness.clamp(0.0, 1.0);
    for roughness in [0.0, 1e-4, 1.0, -1.0, -1e-300, 1.0 + 1e-15, 7.0, f64::NAN, f64::INFINITY] {
        for n_dot_v in [0.0, 1e-12, 0.3, 1.0] {
            for masking in Masking::ALL {
                let [bias, albedo] = dfg_multiscatter(masking, n_dot_v, roughness, Precision::Table);
                assert!(
                    bias >= 0.0 && bias <= albedo && albedo <= 1.0 + 1e-4,
                    "{masking:?} {n_dot_v} {roughness}"
                );
                if !roughness.is_nan() {
                    let nearest = dfg_multiscatter(masking, n_dot_v, inside(roughness), Precision::Table);
                    assert_eq!([bias, albedo], nearest, "{roughness} is taken for its nearest end");
                }
            }
            let sheen = sheen_albedo(SheenVisibility::Clamped, n_dot_v, roughness, Precision::Table);
            // Smooth cloth at grazing views reflects up to twice what arrives, by its model.
            assert!((0.0..=2.0).contains(&sheen), "{n_dot_v} {roughness}: {sheen}");
        }
    }
    let mirror = |n_dot_v: f64| {
        let smooth = dfg(Masking::SmithCorrelated, n_dot_v, 1e-4, Precision::Full);
        relative(smooth[0] + smooth[1], 1.0, 1.0)
    };
    hold("roughness_at_and_beyond_its_ends_gives_albedos", "f64", worst([0.2, 0.5, 1.0].map(mirror)));
}

#[test]
fn alpha_squared_that_underflows_leaves_ggx_its_digits() {
    // α² of 1e-30 is no f32 and of 1e-4 no f16.
    assert_eq!(1e-30f32 * 1e-30, 0.0);
    assert_eq!(half::f16::from_f32(1e-4) * half::f16::from_f32(1e-4), half::f16::ZERO);
    let distribution = Comparison {
        function: "lib::brdf::d_ggx",
        // Over its peak, so that all α count alike.
        call: "vec4f(d_ggx(sqrt(1.0 - a.y * max(a.x, 1e-8) * max(a.x, 1e-8)), a.y * max(a.x, 1e-8) * max(a.x, 1e-8), a.x) * max(a.x, 1e-8) * max(a.x, 1e-8), 0.0, 0.0, 0.0)",
        arguments: grid(&[&[0.0, 1e-30, 1e-8, 1e-6, 1e-4, 0.01, 0.3, 1.0], &[0.0, 1e-3, 0.1, 0.9]]),
        truth: |a| scalar(d_ggx(usable(a[0]), a[1] * usable(a[0]).powi(2)) * usable(a[0]).powi(2)),
        wrong: |a| scalar(d_ggx(1.001 * usable(a[0]), a[1] * usable(a[0]).powi(2)) * usable(a[0]).powi(2)),
        tolerance: 1e-5,
        least: 1e-3,
    };
    // Sines over α: what is left of a narrow lobe's samples.
    let samples = Comparison {
        function: "lib::sampling::sample_ggx",
        call: "vec4f(sample_ggx(a.xy, a.z) / vec3f(vec2f(max(a.z, 1e-8)), 1.0), 0.0)",
        arguments: grid(&[&[0.0, 0.25, 0.7], &[0.0, 0.3, 0.999], &alphas()]),
        truth: |a| {
            let [x, y, z] = sampling::sample_ggx([a[0], a[1]], usable(a[2]));
            [x / usable(a[2]), y / usable(a[2]), z, 0.0]
        },
        wrong: |a| {
            let [x, y, z] = sampling::sample_ggx([a[0], a[1]], 1.001 * usable(a[2]));
            [x / usable(a[2]), y / usable(a[2]), z, 0.0]
        },
        tolerance: 1e-5,
        least: 1.0,
    };
    hold_wgsl("alpha_squared_that_underflows_leaves_ggx_its_digits", &[distribution, samples]);
    let Some(gpu) = gpu() else { return };
    // A half vector of no length has neither a cosine nor a sine.
    let none = "vec4f(d_ggx(0.0, 0.0, a.x), d_ggx(1.0, 0.0, a.x), 0.0, 0.0)";
    assert_eq!(first_infinite(gpu, "lib::brdf::d_ggx", none, &grid(&[&alphas()])), None);
    let grazing = "vec4f(pdf_ggx_visible(a.x, a.z, 1.0, 0.0, a.y))";
    let views = grid(&[&COSINES, &alphas(), &[0.0, 1.0]]);
    assert_eq!(first_infinite(gpu, "lib::sampling::pdf_ggx_visible", grazing, &views), None);
}

#[test]
fn no_shader_computes_in_half_precision() {
    // Where α², n·v or sums of light are halves, they underflow, are NaN or lose light: there are none.
    let folder = crate::support::repository().join("shaders");
    let mut count = 0;
    for sub in ["lib", "pbr", "bake"] {
        for entry in std::fs::read_dir(folder.join(sub)).unwrap() {
            let text = std::fs::read_to_string(entry.unwrap().path()).unwrap();
            count += 1;
            assert!(!uses_half(&text), "a shader of {sub} enables f16");
        }
    }
    assert!(count > 30, "{count}");
    assert!(uses_half("enable f16;\nfn f(x: f16) {}") && uses_half("let x = 1.0h;"), "the check itself");
}

fn uses_half(text: &str) -> bool {
    let code =
        text.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    let is_literal = |at: usize| {
        let before = code[..at].chars().next_back();
        let after = code[at + 1..].chars().next();
        before.is_some_and(|it| it.is_ascii_digit() || it == '.')
            && !after.is_some_and(|it| it.is_alphanumeric())
    };
    code.contains("enable f16")
        || code.contains(": f16")
        || code.match_indices('h').any(|(at, _)| is_literal(at))
}

#[test]
fn distribution_near_its_peak_is_no_rounding_noise() {
    let mut random = Random(3);
    let mut errors = Vec::new();
    let mut naive = 0.0f64;
    for _ in 0..2000 {
        let alpha = random.between(1e-6, 1.0);
        let sin2 = (random.between(1e-3, 10.0) * alpha * alpha).min(0.5);
        // D = (α / (π (α² + (1 − α²) s²)²))…: the same by tan², which has no difference of near numbers either.
        let tan2 = sin2 / (1.0 - sin2);
        let cos4 = (1.0 - sin2).powi(2);
        let truth = 1.0 / (PI * alpha * alpha * cos4 * (1.0 + tan2 / (alpha * alpha)).powi(2));
        errors.push(relative(d_ggx(alpha, sin2), truth, 0.0));
        let cosine = (1.0 - sin2).sqrt();
        naive = naive.max(relative(d_ggx(alpha, 1.0 - cosine * cosine), truth, 0.0));
    }
    assert!(naive > 1e-6, "1 − cos² loses the digits: {naive:e}");
    hold("distribution_near_its_peak_is_no_rounding_noise", "f64", worst(errors));
    let wgsl = Comparison {
        function: "lib::brdf::d_ggx",
        call: "vec4f(a.x * a.x * d_ggx(sqrt(1.0 - a.y * a.x * a.x), a.y * a.x * a.x, a.x), 0.0, 0.0, 0.0)",
        arguments: grid(&[&[1e-6, 1e-4, 1e-2, 0.3], &[1e-4, 1e-2, 0.5, 1.0, 3.0, 9.0]]),
        truth: |a| scalar(a[0] * a[0] * d_ggx(a[0], a[1] * a[0] * a[0])),
        wrong: |a| scalar(a[0] * a[0] * d_ggx(a[0], 1.001 * a[1] * a[0] * a[0])),
        tolerance: 1e-5,
        least: 1e-4,
    };
    hold_wgsl("distribution_near_its_peak_is_no_rounding_noise", &[wgsl]);
}

#[test]
fn smith_is_finite_where_view_and_light_graze() {
    let masked = |alpha: f64, v: f64, l: f64| Masking::ALL.map(|masking| masking.scattered(alpha, v, l));
    for alpha in [1e-8, 1e-4, 0.3, 1.0] {
        for (v, l) in [(0.0, 0.0), (0.0, 0.5), (0.5, 0.0), (1e-300, 1e-300), (1.0, 1.0)] {
            assert!(
                masked(alpha, v, l).iter().all(|value| value.is_finite() && *value >= 0.0),
                "{alpha} {v} {l}"
            );
        }
    }
    let visible = Comparison {
        function: "lib::brdf::v_smith_height_correlated",
        call: "vec4f(v_smith_height_correlated(a.x, a.y, a.z) * a.x * a.y, 0.0, 0.0, 0.0)",
        arguments: grid(&[&COSINES[1..13], &COSINES[1..13], &alphas()]),
        truth: |a| scalar(0.25 / (1.0 + lambda(isotropic(a[0], a[2])) + lambda(isotropic(a[1], a[2])))),
        wrong: |a| {
            scalar(0.25 / (1.0 + lambda(isotropic(a[0], a[2]))) / (1.0 + lambda(isotropic(a[1], a[2]))))
        },
        tolerance: 1e-5,
        least: 1e-6,
    };
    hold_wgsl("smith_is_finite_where_view_and_light_graze", &[visible]);
    let Some(gpu) = gpu() else { return };
    let all = grid(&[&COSINES, &COSINES, &alphas()]);
    let names = "lib::brdf::{d_ggx, v_schlick_ggx, v_smith_height_correlated, v_smith_separable}";
    let call = "vec4f(a.x * d_ggx(1.0, 0.0, a.z) * v_smith_height_correlated(a.x, a.y, a.z), \
                a.x * d_ggx(1.0, 0.0, a.z) * v_smith_separable(a.x, a.y, a.z), \
                a.x * d_ggx(1.0, 0.0, a.z) * v_schlick_ggx(a.x, a.y, 0.5 * a.z), 0.0)";
    assert_eq!(first_infinite(gpu, names, call, &all), None);
    let unguarded = "vec4f(a.x / (a.x * a.y))";
    assert!(first_infinite(gpu, "lib::brdf::d_ggx", unguarded, &all).is_some(), "the check sees 0/0");
}

#[test]
fn visible_normals_of_a_view_along_the_normal_are_ggx() {
    // Heitz 2018 divides by the length of the view's tangential part: 0 here.
    let mut random = Random(4);
    let mut errors = Vec::new();
    for _ in 0..1000 {
        let (u, alpha) = ([random.unit(), random.unit()], random.between(1e-4, 1.0));
        let tilt = [0.0, 1e-300, 1e-12][random.bits() as usize % 3];
        let half = sampling::sample_ggx_visible([tilt, 0.0, 1.0], u, alpha);
        assert!(half.iter().all(|x| x.is_finite()), "{u:?} {alpha}");
        // G_1 is 1 there, so both densities are one; and u maps to the same angle.
        let expected = sampling::sample_ggx(u, alpha);
        errors.push(relative(half[2], expected[2], 1.0));
        errors.push(relative(
            sampling::pdf_ggx_visible([0.0, 0.0, 1.0], half, alpha),
            sampling::pdf_ggx(half, alpha),
            1e-9,
        ));
    }
    hold("visible_normals_of_a_view_along_the_normal_are_ggx", "f64", worst(errors));
    let along = Comparison {
        function: "lib::sampling::sample_ggx_visible",
        call: "vec4f(sample_ggx_visible(vec3f(0.0, 0.0, 1.0), a.xy, a.z), 0.0)",
        arguments: grid(&[&[0.0, 0.25, 0.7], &[0.0, 1e-6, 0.3, 0.999], &alphas()]),
        truth: |a| {
            let [x, y, z] = sampling::sample_ggx_visible([0.0, 0.0, 1.0], [a[0], a[1]], usable(a[2]));
            [x, y, z, 0.0]
        },
        wrong: |a| {
            let [x, y, z] = sampling::sample_ggx_visible([0.1, 0.0, 0.99], [a[0], a[1]], usable(a[2]));
            [x, y, z, 0.0]
        },
        tolerance: 2e-5,
        least: 1.0,
    };
    hold_wgsl("visible_normals_of_a_view_along_the_normal_are_ggx", &[along]);
}

#[test]
fn charlie_tends_to_a_rim_as_roughness_tends_to_zero() {
    for alpha in [1e-8, 1e-6, 1e-4, 1e-2] {
        // 1/α overflows no exponent: sin^(1/α) is 0 off the rim, and the density of sample 0 is a number.
        for sine in [0.0, 1e-300, 0.5, 1.0 - 1e-12, 1.0] {
            assert!(d_charlie(alpha, sine).is_finite(), "{alpha} {sine}");
        }
        for u in [0.0, 1e-300, 0.5, 1.0 - 1e-16] {
            let half = sampling::sample_charlie([0.3, u], alpha);
            let pdf = sampling::pdf_charlie(half, alpha);
            assert!(
                half.iter().all(|x| x.is_finite()) && pdf.is_finite() && pdf >= 0.0,
                "{alpha} {u} {half:?} {pdf}"
            );
        }
        let kernel = kernel_charlie(alpha.max(1e-4), 16, Cancel::NEVER).unwrap();
        assert!(kernel.kappa.iter().all(|k| k.is_finite() && k.abs() <= 1.0 + 1e-9), "{alpha}");
        hold("charlie_tends_to_a_rim_as_roughness_tends_to_zero", "f64", relative(kernel.kappa[0], 1.0, 1.0));
    }
    let lobe = Comparison {
        function: "lib::brdf::d_charlie",
        call: "vec4f(d_charlie(a.y, a.x), 0.0, 0.0, 0.0)",
        arguments: grid(&[&[1e-3, 0.01, 0.25, 1.0], &[0.0, 0.5, 0.9, 0.999, 1.0]]),
        truth: |a| scalar(d_charlie(a[0], a[1].sqrt())),
        wrong: |a| scalar(d_charlie(1.01 * a[0], a[1].sqrt())),
        tolerance: 1e-3,
        least: 1e-2,
    };
    let samples = Comparison {
        function: "lib::sampling::sample_charlie",
        call: "vec4f(sample_charlie(a.xy, a.z), 0.0)",
        arguments: grid(&[&[0.0, 0.3], &[0.0, 0.25, 0.9], &[0.0, 1e-4, 0.25, 1.0]]),
        truth: |a| {
            let [x, y, z] = sampling::sample_charlie([a[0], a[1]], usable(a[2]));
            [x, y, z, 0.0]
        },
        wrong: |a| {
            let [x, y, z] = sampling::sample_charlie([a[0], a[1]], usable(a[2]) + 0.001);
            [x, y, z, 0.0]
        },
        tolerance: 1e-5,
        least: 1.0,
    };
    hold_wgsl("charlie_tends_to_a_rim_as_roughness_tends_to_zero", &[lobe, samples]);
    let Some(gpu) = gpu() else { return };
    let arguments = grid(&[&[0.0, 1e-30, 1e-8, 1e-4, 1.0], &[0.0, 1e-38, 0.5, 1.0], &COSINES[..13]]);
    for (names, call) in [
        (
            "lib::brdf::{d_charlie, v_charlie}",
            "vec4f(d_charlie(a.y, a.x), a.z * v_charlie(a.z, a.z, a.x), 0.0, 0.0)",
        ),
        (
            "lib::sampling::{pdf_charlie, sample_charlie}",
            "vec4f(sample_charlie(a.yz, a.x), pdf_charlie(a.z, a.y, a.x))",
        ),
    ] {
        assert_eq!(first_infinite(gpu, names, call, &arguments), None);
    }
}

#[test]
fn anisotropic_distribution_does_not_overflow() {
    // Burley's form: x²/a² alone is 1e16 at the least width, and its square no f32 away from overflow of a sum of such.
    let distribution = Comparison {
        function: "lib::anisotropy::d_ggx_anisotropic",
        call: "vec4f(d_ggx_anisotropic(normalize(a.xyz), vec2f(a.w, b.x)) * max(a.w, 1e-8) * max(b.x, 1e-8), 0.0, 0.0, 0.0)",
        arguments: grid(&[&[0.0, 0.5], &[0.0, 0.7], &[1.0], &[0.0, 1e-4, 0.3, 1.0], &[0.0, 1e-4, 0.3, 1.0]]),
        truth: |a| {
            let half = crate::support::unit([a[0], a[1], a[2]]);
            let widths = [usable(a[3]), usable(a[4])];
            scalar(d_anisotropic(half, widths) * widths[0] * widths[1])
        },
        wrong: |a| {
            let half = crate::support::unit([a[1], a[0], a[2]]);
            let widths = [usable(a[3]), usable(a[4])];
            scalar(d_anisotropic(half, widths) * widths[0] * widths[1])
        },
        tolerance: 1e-5,
        least: 1e-3,
    };
    hold_wgsl("anisotropic_distribution_does_not_overflow", &[distribution]);
    let Some(gpu) = gpu() else { return };
    let widths = grid(&[&COSINES, &COSINES, &alphas(), &alphas()]);
    // A half vector of rounded length too, and both directions along the surface.
    let call = "vec4f(d_ggx_anisotropic(vec3f(0.0, 0.0, 1.0), a.zw), d_ggx_anisotropic(vec3f(0.0, 0.0, 1e-20), a.zw), \
                v_smith_anisotropic(vec3f(1.0, 0.0, a.x), vec3f(0.0, 1.0, a.y), a.zw), 0.0)";
    let names = "lib::anisotropy::{d_ggx_anisotropic, v_smith_anisotropic}";
    assert_eq!(first_infinite(gpu, names, call, &widths), None);
}

#[test]
fn schlick_of_a_cosine_above_one_is_f0() {
    let fresnel = Comparison {
        function: "lib::brdf::f_schlick",
        call: "vec4f(f_schlick(vec3f(a.y), 1.0, a.x), 0.0)",
        arguments: grid(&[&[0.0, 0.5, 1.0, 1.000_000_1, 1.000_1, 1.5], &[0.0, 0.04, 1.0]]),
        truth: |a| {
            let f = a[1] + (1.0 - a[1]) * weight(a[0]);
            [f, f, f, 0.0]
        },
        // Without the clamp a cosine of 1.5 darkens by a thirtieth.
        wrong: |a| {
            let f = f_schlick(a[1], a[0]);
            [f, f, f, 0.0]
        },
        tolerance: 1e-6,
        least: 1e-2,
    };
    hold_wgsl("schlick_of_a_cosine_above_one_is_f0", &[fresnel]);
}

#[test]
fn chain_of_one_level_is_a_mirror() {
    assert_eq!(roughness_of_level(0, 1), 0.0, "and not 0/0");
    for law in [RoughnessLaw::Linear, RoughnessLaw::Filament, RoughnessLaw::Eevee] {
        for count in [0, 1, 2] {
            for roughness in [0.0, 0.5, 1.0, 2.0, -1.0] {
                let level = law.level(roughness, count);
                assert!(
                    (0.0..=(count.max(1) - 1) as f64).contains(&level),
                    "{law:?} {count} {roughness}: {level}"
                );
            }
            assert!((0.0..=1.0).contains(&law.roughness(5, count)), "{law:?} {count}");
        }
        assert_eq!(law.roughness(0, 1), 0.0);
    }
    let custom = RoughnessLaw::custom(vec![0.5]).unwrap();
    assert_eq!((custom.roughness(0, 1), custom.level(0.2, 1)), (0.5, 0.0));
}
