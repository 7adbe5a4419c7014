//! Colour spaces and tone curves in f64.

use crate::support::{Arguments, Comparison, check_all, grid};

/// Linear values from black to far beyond what a half holds.
const LINEAR: [f32; 11] = [0.0, 1e-6, 1e-3, 0.0031308, 0.04, 0.18, 0.5, 0.9, 1.0, 16.0, 65504.0];

fn colours() -> Vec<[f32; 8]> {
    grid(&[&LINEAR, &LINEAR, &LINEAR])
}

fn each(a: Arguments, f: impl Fn(f64) -> f64) -> [f64; 4] {
    [f(a[0]), f(a[1]), f(a[2]), 0.0]
}

fn to_srgb(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

fn from_srgb(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

/// Product of a matrix given by rows.
fn product(rows: [[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    rows.map(|row| row.iter().zip(v).map(|(weight, value)| weight * value).sum())
}

fn luminance(a: Arguments) -> f64 {
    0.2126 * a[0] + 0.7152 * a[1] + 0.0722 * a[2]
}

fn pbr_neutral(a: Arguments) -> [f64; 4] {
    let low = a[0].min(a[1]).min(a[2]);
    let offset = if low < 0.08 { low - 6.25 * low * low } else { 0.04 };
    let color = [a[0] - offset, a[1] - offset, a[2] - offset];
    let peak = color[0].max(color[1]).max(color[2]);
    if peak < 0.76 {
        return [color[0], color[1], color[2], 0.0];
    }
    let new_peak = 1.0 - 0.24 * 0.24 / (peak + 0.24 - 0.76);
    let g = 1.0 - 1.0 / (0.15 * (peak - new_peak) + 1.0);
    let mapped = color.map(|x| (1.0 - g) * x * new_peak / peak + g * new_peak);
    [mapped[0], mapped[1], mapped[2], 0.0]
}

fn aces(a: Arguments) -> [f64; 4] {
    let v = product(
        [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]],
        [a[0], a[1], a[2]],
    );
    let fitted = v.map(|x| (x * (x + 0.0245786) - 0.000090537) / (x * (0.983729 * x + 0.4329510) + 0.238081));
    let out = product(
        [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]],
        fitted,
    );
    let [r, g, b] = out.map(|x| x.clamp(0.0, 1.0));
    [r, g, b, 0.0]
}

fn agx(a: Arguments) -> [f64; 4] {
    let inset = [
        [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
        [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
        [0.0423756549057051, 0.0784336, 0.879142973793104],
    ];
    let outset = [
        [1.19687900512017, -0.0980208811401368, -0.0990297440797205],
        [-0.0528968517574562, 1.15190312990417, -0.0989611768448433],
        [-0.0529716355144438, -0.0980434501171241, 1.15107367264116],
    ];
    let curve = product(inset, [a[0], a[1], a[2]]).map(|x| {
        let x = ((x.max(1e-10).log2() + 12.47393) / 16.5).clamp(0.0, 1.0);
        15.5 * x.powi(6) - 40.14 * x.powi(5) + 31.96 * x.powi(4) - 6.868 * x.powi(3)
            + 0.4298 * x * x
            + 0.1191 * x
            - 0.00232
    });
    let [r, g, b] = product(outset, curve).map(|x| x.clamp(1e-6, 1.0).powf(2.2));
    [r, g, b, 0.0]
}

#[test]
fn colour_spaces_agree_with_their_twins() {
    check_all(&[
        Comparison {
            function: "lib::colour::to_srgb",
            call: "vec4f(to_srgb(a.xyz), 0.0)",
            arguments: colours(),
            truth: |a| each(a, to_srgb),
            wrong: |a| each(a, |x| x.clamp(0.0, 1.0).powf(1.0 / 2.2)),
            tolerance: 4e-6,
            least: 1e-2,
        },
        Comparison {
            function: "lib::colour::from_srgb",
            call: "vec4f(from_srgb(a.xyz), 0.0)",
            arguments: colours(),
            truth: |a| each(a, from_srgb),
            wrong: |a| each(a, |x| x.clamp(0.0, 1.0).powf(2.2)),
            tolerance: 1e-5,
            least: 1e-3,
        },
        Comparison {
            function: "lib::colour::within_f16",
            call: "vec4f(within_f16(a.xyz), 0.0)",
            arguments: grid(&[&[-1.0, 0.0, 0.5, 65504.0, 1e9], &[0.0, 3.0e38], &[1.0]]),
            truth: |a| each(a, |x| x.clamp(0.0, 65504.0)),
            wrong: |a| each(a, |x| x),
            tolerance: 0.0,
            least: 1.0,
        },
        Comparison {
            function: "lib::colour::luminance",
            call: "vec4f(luminance(a.xyz), 0.0, 0.0, 0.0)",
            arguments: colours(),
            truth: |a| [luminance(a), 0.0, 0.0, 0.0],
            wrong: |a| [0.299 * a[0] + 0.587 * a[1] + 0.114 * a[2], 0.0, 0.0, 0.0],
            tolerance: 1e-6,
            least: 1e-6,
        },
    ]);
}

#[test]
fn tone_curves_agree_with_their_twins() {
    check_all(&[
        Comparison {
            function: "lib::colour::tone_map_pbr_neutral",
            call: "vec4f(tone_map_pbr_neutral(a.xyz), 0.0)",
            arguments: colours(),
            truth: pbr_neutral,
            wrong: |a| each(a, |x| x.clamp(0.0, 1.0)),
            tolerance: 1e-5,
            least: 0.1,
        },
        Comparison {
            function: "lib::colour::tone_map_aces_fitted",
            call: "vec4f(tone_map_aces_fitted(a.xyz), 0.0)",
            arguments: colours(),
            truth: aces,
            wrong: |a| each(a, |x| (x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)).clamp(0.0, 1.0)),
            tolerance: 1e-5,
            least: 0.1,
        },
        Comparison {
            function: "lib::colour::tone_map_aces_narkowicz",
            call: "vec4f(tone_map_aces_narkowicz(a.xyz), 0.0)",
            arguments: colours(),
            truth: |a| each(a, |x| (x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)).clamp(0.0, 1.0)),
            wrong: aces,
            tolerance: 2e-6,
            least: 0.1,
        },
        Comparison {
            function: "lib::colour::tone_map_reinhard",
            call: "vec4f(tone_map_reinhard(a.xyz), 0.0)",
            arguments: colours(),
            truth: |a| each(a, |x| x / (1.0 + x)),
            wrong: |a| each(a, |x| 1.0 - (-x).exp()),
            tolerance: 1e-6,
            least: 0.1,
        },
        Comparison {
            function: "lib::colour::tone_map_reinhard_extended",
            call: "vec4f(tone_map_reinhard_extended(a.xyz, 4.0), 0.0)",
            arguments: colours(),
            truth: |a| {
                let l = luminance(a);
                each(a, |x| x * (1.0 + l / 16.0) / (1.0 + l))
            },
            wrong: |a| each(a, |x| x / (1.0 + x)),
            tolerance: 2e-6,
            least: 0.1,
        },
        Comparison {
            function: "lib::colour::tone_map_agx",
            call: "vec4f(tone_map_agx(a.xyz), 0.0)",
            arguments: colours(),
            truth: agx,
            wrong: aces,
            tolerance: 2e-4,
            least: 0.1,
        },
    ]);
}
