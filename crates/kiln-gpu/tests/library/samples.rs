//! Sample points, and what they are distributed like.

use kiln_brdf::sampling;

use crate::support::{COSINES, Comparison, alphas, check_all, grid, unit, with_directions};

fn padded([x, y, z]: [f64; 3]) -> [f64; 4] {
    [x, y, z, 0.0]
}

const UNIFORM: [f32; 8] = [0.0, 1e-6, 0.01, 0.25, 0.5, 0.7, 0.9, 0.999];

/// α that a distribution takes for a mirror's.
fn usable(alpha: f64) -> f64 {
    alpha.max(1e-8)
}

#[test]
fn sequences_and_frames_agree_with_their_twins() {
    check_all(&[
        Comparison {
            function: "lib::sampling::{hammersley, radical_inverse}",
            call: "vec4f(hammersley(u32(a.x), u32(a.y)), radical_inverse(u32(a.x)), radical_inverse(0xffffffffu))",
            arguments: grid(&[&[0.0, 1.0, 2.0, 3.0, 511.0, 1023.0, 65535.0, 1e6], &[1024.0, 1_048_576.0]]),
            truth: |a| {
                let [x, y] = sampling::hammersley(a[0] as u32, a[1] as u32);
                [x, y, y, 1.0 - 1.0 / f64::from(1 << 24)]
            },
            // All 32 bits round up to 1.
            wrong: |a| {
                let [x, y] = sampling::hammersley(a[0] as u32, a[1] as u32);
                [x, y, y, 1.0]
            },
            tolerance: 0.0,
            least: 1.0,
        },
        Comparison {
            function: "lib::sampling::orthonormal_basis",
            call: "vec4f(orthonormal_basis(a.xyz)[u32(a.w)], 0.0)",
            arguments: with_directions(&[[0.0; 5], [1.0, 0.0, 0.0, 0.0, 0.0]]),
            truth: |a| padded(sampling::orthonormal_basis([a[0], a[1], a[2]])[a[3] as usize]),
            wrong: |a| padded(sampling::orthonormal_basis([a[1], a[0], a[2]])[a[3] as usize]),
            tolerance: 5e-7,
            least: 1.0,
        },
    ]);
}

#[test]
fn samples_agree_with_their_twins() {
    check_all(&[
        Comparison {
            function: "lib::sampling::sample_cosine",
            call: "vec4f(sample_cosine(a.xy), 0.0)",
            arguments: grid(&[&UNIFORM, &UNIFORM]),
            truth: |a| padded(sampling::sample_cosine([a[0], a[1]])),
            wrong: |a| padded(sampling::sample_cosine([a[0], 1.0 - a[1]])),
            tolerance: 5e-6,
            least: 1.0,
        },
        // Sines over α: what is left of a narrow lobe.
        Comparison {
            function: "lib::sampling::sample_ggx",
            call: "vec4f(sample_ggx(a.xy, a.z) / vec3f(vec2f(max(a.z, 1e-8)), 1.0), 0.0)",
            arguments: grid(&[&UNIFORM, &UNIFORM, &alphas()]),
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
        },
        Comparison {
            function: "lib::sampling::sample_ggx_visible",
            call: "vec4f(sample_ggx_visible(a.xyz, b.xy, a.w), 0.0)",
            arguments: views_and_points(),
            truth: |a| padded(sampling::sample_ggx_visible([a[0], a[1], a[2]], [a[4], a[5]], usable(a[3]))),
            wrong: |a| padded(sampling::sample_ggx([a[4], a[5]], usable(a[3]))),
            // At a grazing view the far end of the cap nearly cancels the view: 1e-7 over 1e-3.
            tolerance: 2e-4,
            least: 1.0,
        },
        Comparison {
            function: "lib::sampling::sample_charlie",
            call: "vec4f(sample_charlie(a.xy, a.z), 0.0)",
            arguments: grid(&[&UNIFORM, &UNIFORM, &[0.0, 1e-4, 0.01, 0.25, 1.0]]),
            truth: |a| padded(sampling::sample_charlie([a[0], a[1]], usable(a[2]))),
            wrong: |a| padded(sampling::sample_charlie([a[0], a[1]], usable(a[2]) + 0.001)),
            tolerance: 1e-5,
            least: 1.0,
        },
    ]);
}

/// Views (z ≥ 0), α and a sample point.
fn views_and_points() -> Vec<[f32; 8]> {
    let views = [[0.0, 0.0, 1.0], [1e-6, 0.0, 1.0], [0.6, -0.2, 0.5], [0.0, 1.0, 0.01], [1.0, 0.0, 0.0]];
    let mut found = Vec::new();
    for [x, y, z] in views.map(|v| unit(v).map(|x| x as f32)) {
        for alpha in alphas() {
            for u in UNIFORM {
                found.extend(UNIFORM.map(|v| [x, y, z, alpha, u, v, 0.0, 0.0]));
            }
        }
    }
    found
}

#[test]
fn densities_agree_with_their_twins() {
    let sines2: [f32; 8] = [0.0, 1e-14, 1e-8, 1e-4, 0.1, 0.5, 0.9, 0.9999];
    check_all(&[
        Comparison {
            function: "lib::sampling::pdf_cosine",
            call: "vec4f(pdf_cosine(a.x), pdf_cosine(-a.x), 0.0, 0.0)",
            arguments: grid(&[&COSINES]),
            truth: |a| [sampling::pdf_cosine(a[0]), 0.0, 0.0, 0.0],
            wrong: |a| [a[0], 0.0, 0.0, 0.0],
            tolerance: 5e-7,
            least: 1e-3,
        },
        Comparison {
            function: "lib::sampling::pdf_ggx",
            call: "vec4f(pdf_ggx(sqrt(1.0 - a.y), a.y, a.x), 0.0, 0.0, 0.0)",
            arguments: grid(&[&alphas(), &sines2]),
            truth: |a| {
                [sampling::pdf_ggx([a[1].sqrt(), 0.0, (1.0 - a[1]).sqrt()], usable(a[0])), 0.0, 0.0, 0.0]
            },
            wrong: |a| [kiln_brdf::d_ggx(usable(a[0]), a[1]), 0.0, 0.0, 0.0],
            tolerance: 1e-5,
            least: 1e-30,
        },
        Comparison {
            function: "lib::sampling::pdf_charlie",
            call: "vec4f(pdf_charlie(sqrt(1.0 - a.y), a.y, a.x), 0.0, 0.0, 0.0)",
            arguments: grid(&[&[0.01, 0.09, 0.25, 1.0], &sines2]),
            truth: |a| [sampling::pdf_charlie([a[1].sqrt(), 0.0, (1.0 - a[1]).sqrt()], a[0]), 0.0, 0.0, 0.0],
            wrong: |a| [kiln_brdf::d_charlie(a[0], a[1].sqrt()), 0.0, 0.0, 0.0],
            tolerance: 2e-4,
            least: 1e-6,
        },
        Comparison {
            function: "lib::sampling::pdf_ggx_visible",
            call: "vec4f(pdf_ggx_visible(a.z, dot(a.xyz, b.xyz), b.z, dot(b.xy, b.xy), a.w), 0.0, 0.0, 0.0)",
            arguments: views_and_halves(),
            truth: |a| {
                let (view, half) = ([a[0], a[1], a[2]], [a[4], a[5], a[6]]);
                [sampling::pdf_ggx_visible(view, half, usable(a[3])), 0.0, 0.0, 0.0]
            },
            wrong: |a| [sampling::pdf_ggx([a[4], a[5], a[6]], usable(a[3])), 0.0, 0.0, 0.0],
            tolerance: 1e-5,
            least: 1e-12,
        },
    ]);
}

/// Views, α and half vectors that face the view.
fn views_and_halves() -> Vec<[f32; 8]> {
    let vectors = [[0.0, 0.0, 1.0], [1e-4, 0.0, 1.0], [0.6, 0.2, 0.5], [0.9, 0.1, 0.01], [1.0, 0.0, 0.0]]
        .map(|v| unit(v).map(|x| x as f32));
    let mut found = Vec::new();
    for [x, y, z] in vectors {
        for [hx, hy, hz] in vectors {
            // At right angles the product of the two is rounding alone.
            if x * hx + y * hy + z * hz > 1e-3 {
                found.extend(alphas().iter().map(|&alpha| [x, y, z, alpha, hx, hy, hz, 0.0]));
            }
        }
    }
    found
}
