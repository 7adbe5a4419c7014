//! Layouts of the sphere, harmonics, and what material and environment lookups are made of.

use kiln_brdf::{Precision, SheenVisibility, sheen_albedo};
use kiln_sphere::{
    cube_direction, cube_face_st, cube_texel_solid_angle_sr, kernel_lambert, panorama_direction, panorama_uv,
    real_harmonics,
};

use crate::support::{Arguments, COSINES, Comparison, ROUGHNESSES, check_all, grid, unit, with_directions};

const NO_MORE: [f32; 5] = [0.0; 5];

fn direction(a: Arguments) -> [f64; 3] {
    [a[0], a[1], a[2]]
}

fn padded([x, y, z]: [f64; 3]) -> [f64; 4] {
    [x, y, z, 0.0]
}

#[test]
fn layouts_agree_with_their_twins() {
    let unit_square = [0.0, 1e-6, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0];
    let face_square = [-1.0, -0.7, 0.0, 1e-6, 0.3, 1.0];
    check_all(&[
        Comparison {
            function: "lib::sphere::panorama_direction",
            call: "vec4f(panorama_direction(a.xy), 0.0)",
            arguments: grid(&[&unit_square, &unit_square]),
            truth: |a| padded(panorama_direction(a[0], a[1])),
            wrong: |a| padded(panorama_direction(a[0] + 0.25, a[1])),
            tolerance: 2e-6,
            least: 1.0,
        },
        Comparison {
            function: "lib::sphere::panorama_uv",
            call: "vec4f(panorama_uv(a.xyz), 0.0, 0.0)",
            arguments: away_from_the_wrap(),
            truth: |a| {
                let [u, v] = panorama_uv(direction(a));
                [u, v, 0.0, 0.0]
            },
            wrong: |a| {
                let [u, v] = panorama_uv(direction(a));
                [u, 1.0 - v, 0.0, 0.0]
            },
            tolerance: 2e-6,
            least: 1.0,
        },
        Comparison {
            function: "lib::sphere::cube_direction",
            call: "vec4f(cube_direction(u32(a.x), a.yz), 0.0)",
            arguments: grid(&[&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0], &face_square, &face_square]),
            truth: |a| padded(cube_direction(a[0] as usize, a[1], a[2])),
            wrong: |a| padded(cube_direction(a[0] as usize, a[1], -a[2])),
            tolerance: 5e-7,
            least: 1.0,
        },
        Comparison {
            function: "lib::sphere::cube_place",
            call: "vec4f(f32(cube_place(a.xyz).face), cube_place(a.xyz).st, 0.0)",
            arguments: with_directions(&[NO_MORE]),
            truth: |a| {
                let (face, [s, t]) = cube_face_st(direction(a));
                [face as f64, s, t, 0.0]
            },
            wrong: |a| {
                let (face, [s, t]) = cube_face_st(direction(a));
                [face as f64, t, s, 0.0]
            },
            tolerance: 5e-7,
            least: 1.0,
        },
        Comparison {
            // To second order in a texel's size: 1/64 here.
            function: "lib::sphere::{cube_texel_centre, cube_texel_solid_angle_sr}",
            call: "vec4f(cube_texel_solid_angle_sr(cube_texel_centre(vec2u(a.xy), 128u), 128u), 0.0, 0.0, 0.0)",
            arguments: grid(&[&[0.0, 1.0, 31.0, 64.0, 100.0, 127.0], &[0.0, 1.0, 31.0, 64.0, 127.0]]),
            truth: |a| [cube_texel_solid_angle_sr(128, a[0] as usize, a[1] as usize), 0.0, 0.0, 0.0],
            wrong: |_| [(2.0f64 / 128.0).powi(2), 0.0, 0.0, 0.0],
            tolerance: 1e-4,
            least: 1e-9,
        },
        Comparison {
            function: "lib::sphere::{octahedral_direction, octahedral_uv}",
            call: "vec4f(octahedral_direction(octahedral_uv(a.xyz)), 0.0)",
            arguments: with_directions(&[NO_MORE]),
            truth: |a| padded(direction(a)),
            wrong: |a| padded([a[0], -a[1], a[2]]),
            tolerance: 1e-6,
            least: 1.0,
        },
        Comparison {
            function: "lib::sphere::octahedral_direction",
            call: "vec4f(octahedral_direction(a.xy), 0.0)",
            arguments: grid(&[&unit_square, &unit_square]),
            truth: |a| padded(octahedral(a[0], a[1])),
            wrong: |a| padded(octahedral(a[1], a[0])),
            tolerance: 1e-6,
            least: 1.0,
        },
    ]);
}

/// Directions at which u does not jump from 0 to 1.
fn away_from_the_wrap() -> Vec<[f32; 8]> {
    let mut all = with_directions(&[NO_MORE]);
    all.retain(|a| a[0].abs() > 1e-6 || a[2] < 0.0 || a[2].abs() < 1e-30);
    all
}

/// The octahedron unfolded, its lower half by where the direction meets the plane |x| + |y| + |z| = 1.
fn octahedral(u: f64, v: f64) -> [f64; 3] {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let y = 1.0 - a.abs() - b.abs();
    if y >= 0.0 {
        return unit([a, y, b]);
    }
    unit([(1.0 - b.abs()).copysign(a), y, (1.0 - a.abs()).copysign(b)])
}

#[test]
fn harmonics_agree_with_their_twins() {
    // c_i = a.w + 0.3 i, for red; green and blue have it weighted.
    let coefficients = "array<vec3f, 9>(vec3f(a.w), vec3f(a.w + 0.3), vec3f(a.w + 0.6), vec3f(a.w + 0.9), vec3f(a.w + 1.2), \
                        vec3f(a.w + 1.5), vec3f(a.w + 1.8), vec3f(a.w + 2.1), vec3f(a.w + 2.4))";
    let evaluate = format!("vec4f(evaluate_harmonics({coefficients}, a.xyz), 0.0)").leak();
    let irradiance = format!("vec4f(irradiance_of_harmonics({coefficients}, a.xyz), 0.0)").leak();
    fn sum(a: Arguments, order: usize, by_degree: impl Fn(usize) -> f64) -> f64 {
        let basis = real_harmonics(direction(a), order);
        let term = |(i, y): (usize, &f64)| (a[3] + 0.3 * i as f64) * y * by_degree(usize::isqrt(i));
        basis.iter().enumerate().map(term).sum()
    }
    check_all(&[
        Comparison {
            function: "lib::sphere::evaluate_harmonics",
            call: evaluate,
            arguments: with_directions(&[NO_MORE, [-3.0, 0.0, 0.0, 0.0, 0.0]]),
            truth: |a| padded([sum(a, 2, |_| 1.0); 3]),
            wrong: |a| padded([sum(a, 1, |_| 1.0); 3]),
            tolerance: 2e-6,
            least: 1.0,
        },
        Comparison {
            function: "lib::sphere::irradiance_of_harmonics",
            call: irradiance,
            arguments: with_directions(&[NO_MORE, [5.0, 0.0, 0.0, 0.0, 0.0]]),
            truth: |a| padded([sum(a, 2, |l| kernel_lambert(2).kappa[l]).max(0.0); 3]),
            wrong: |a| padded([sum(a, 2, |_| 1.0).max(0.0); 3]),
            tolerance: 2e-6,
            least: 1.0,
        },
    ]);
}

#[test]
fn parts_of_materials_and_lookups_agree_with_their_twins() {
    check_all(&[
        Comparison {
            function: "lib::environment::ggx_albedo",
            call: "vec4f(ggx_albedo(vec3f(a.x), a.y, a.zw).single.x, ggx_albedo(vec3f(a.x), a.y, a.zw).multiple.x, 0.0, 0.0)",
            arguments: grid(&[&[0.0, 0.04, 0.5, 1.0], &[0.0, 1.0], &[0.0, 0.3, 0.9, 1.0], &[0.0, 0.01, 0.1]]),
            truth: albedo,
            wrong: |a| [albedo(a)[0], 0.0, 0.0, 0.0],
            tolerance: 1e-5,
            least: 1e-2,
        },
        Comparison {
            function: "lib::environment::dominant_direction",
            call: "vec4f(dominant_direction(vec3f(0.0, 0.0, 1.0), a.xyz, a.w), 0.0)",
            arguments: grid(&[&[0.0, 0.6], &[0.0, -0.6], &[0.0, 0.5, 1.0], &[0.0, 0.3, 0.7, 1.0, 1.000_001]]),
            truth: |a| {
                let alpha = a[3] * a[3];
                let smooth = (1.0 - alpha).max(0.0);
                let weight = smooth * (smooth.sqrt() + alpha);
                padded([a[0] * weight, a[1] * weight, 1.0 - weight + a[2] * weight])
            },
            wrong: |a| padded([a[0], a[1], a[2]]),
            tolerance: 2e-6,
            least: 1.0,
        },
        Comparison {
            // A fit; its own error is 0.04.
            function: "lib::sheen::charlie_albedo",
            call: "vec4f(charlie_albedo(a.x, a.y), 0.0, 0.0, 0.0)",
            arguments: grid(&[&[0.02, 0.1, 0.3, 0.6, 0.9, 1.0], &[0.1, 0.25, 0.5, 0.75, 1.0]]),
            truth: |a| {
                [
                    sheen_albedo(SheenVisibility::Unclamped, a[0], a[1], Precision::Table).min(1.0),
                    0.0,
                    0.0,
                    0.0,
                ]
            },
            wrong: |a| {
                [sheen_albedo(SheenVisibility::Clamped, a[0], a[1], Precision::Table).min(1.0), 0.0, 0.0, 0.0]
            },
            tolerance: 0.041,
            least: 1.0,
        },
        Comparison {
            function: "lib::material::specular_occlusion",
            call: "vec4f(specular_occlusion(a.x, a.y, a.z), 0.0, 0.0, 0.0)",
            arguments: grid(&[&COSINES, &[0.0, 0.3, 1.0], &ROUGHNESSES]),
            truth: |a| {
                let power = (a[0] + a[1]).max(1e-6).powf((-16.0 * a[2] - 1.0).exp2());
                [(power - 1.0 + a[1]).clamp(0.0, 1.0), 0.0, 0.0, 0.0]
            },
            wrong: |a| [a[1], 0.0, 0.0, 0.0],
            tolerance: 2e-5,
            least: 1.0,
        },
        Comparison {
            function: "lib::material::{TangentFrame, mapped_normal}",
            call: "vec4f(mapped_normal(TangentFrame(a.xyz, vec4f(0.0, 0.6, 0.8, -1.0)), b.xyz, a.w), 0.0)",
            arguments: with_directions(&[
                [1.0, 0.5, 0.5, 1.0, 0.0],
                [0.5, 0.25, 0.75, 0.875, 0.0],
                [1.0, 0.5, 0.5, 0.5, 0.0],
                [0.0, 1.0, 1.0, 1.0, 0.0],
            ]),
            truth: |a| padded(mapped(a, -1.0)),
            wrong: |a| padded(mapped(a, 1.0)),
            tolerance: 2e-6,
            least: 1.0,
        },
        Comparison {
            function: "lib::material::texture_coordinate",
            call: "vec4f(texture_coordinate(vec4f(2.0, 0.5, 0.25, a.z), vec4f(-0.5, 3.0, 1.0, a.z), a.xy, vec2f(a.y, 7.0)), 0.0, 0.0)",
            arguments: grid(&[&[-1.0, 0.0, 0.3], &[0.0, 0.7], &[0.0, 1.0]]),
            truth: |a| {
                let [u, v] = if a[2] > 0.5 { [a[1], 7.0] } else { [a[0], a[1]] };
                [2.0 * u + 0.5 * v + 0.25, 3.0 * v - 0.5 * u + 1.0, 0.0, 0.0]
            },
            wrong: |a| [2.0 * a[0] + 0.5 * a[1] + 0.25, 3.0 * a[1] - 0.5 * a[0] + 1.0, 0.0, 0.0],
            tolerance: 1e-6,
            least: 1.0,
        },
        Comparison {
            function: "lib::fullscreen::fullscreen_position",
            call: "vec4f(fullscreen_position(u32(a.x)), 0.0, 0.0)",
            arguments: grid(&[&[0.0, 1.0, 2.0]]),
            truth: |a| [[-1.0, -1.0, 0.0, 0.0], [3.0, -1.0, 0.0, 0.0], [-1.0, 3.0, 0.0, 0.0]][a[0] as usize],
            wrong: |a| [[-1.0, -1.0, 0.0, 0.0], [1.0, -1.0, 0.0, 0.0], [-1.0, 1.0, 0.0, 0.0]][a[0] as usize],
            tolerance: 0.0,
            least: 1.0,
        },
        Comparison {
            function: "lib::vector::{max_component, normalize_or, one_minus_pow5}",
            call: "vec4f(normalize_or(a.xyz * a.w, vec3f(0.0, 1.0, 0.0)), one_minus_pow5(max_component(a.xyz)))",
            arguments: with_directions(&[[0.0; 5], [1.0; 5], [1e-12; 5], [1e-16; 5], [1e15; 5]]),
            truth: |a| {
                let [x, y, z] = if a[3] < 1e-15 { [0.0, 1.0, 0.0] } else { unit(direction(a)) };
                [x, y, z, (1.0 - a[0].max(a[1]).max(a[2])).clamp(0.0, 1.0).powi(5)]
            },
            wrong: |a| {
                let [x, y, z] = unit(direction(a));
                [x, y, z, (1.0 - a[0]).clamp(0.0, 1.0).powi(4)]
            },
            tolerance: 1e-6,
            least: 1.0,
        },
        Comparison {
            function: "lib::volume::volume_attenuation",
            call: "vec4f(volume_attenuation(a.x, vec3f(a.y, 0.5, 0.0), a.z), 0.0)",
            arguments: grid(&[
                &[0.0, 1e-6, 0.1, 1.0, 30.0, 1e30],
                &[0.0, 1e-3, 0.9, 1.0],
                &[0.0, 1e-30, 0.5, 1e4],
            ]),
            truth: |a| {
                let left = |color: f64| match a[2] == 0.0 || a[0] == 0.0 {
                    true => 1.0,
                    false => color.powf(a[0] / a[2]),
                };
                [left(a[1]), left(0.5), left(0.0), 0.0]
            },
            wrong: |a| [(-a[0] * a[1]).exp(), 0.0, 0.0, 0.0],
            tolerance: 5e-6,
            least: 0.1,
        },
        Comparison {
            function: "lib::volume::{dispersed_ior, roughness_refracted}",
            call: "vec4f(dispersed_ior(a.x, a.y), roughness_refracted(a.z, a.x))",
            arguments: grid(&[&[1.0, 1.05, 1.33, 1.5, 2.42], &[0.0, 0.36, 1.0, 20.0], &ROUGHNESSES]),
            truth: |a| {
                // V_d = 20 / dispersion, and half of (n − 1) / V_d to each side.
                let half = 0.5 * (a[0] - 1.0) * a[1] / 20.0;
                let [r, g, b] = [a[0] - half, a[0], a[0] + half].map(|n| n.max(1.0));
                [r, g, b, a[2] * (2.0 * a[0] - 2.0).clamp(0.0, 1.0)]
            },
            wrong: |a| [a[0], a[0], a[0], a[2]],
            tolerance: 2e-6,
            least: 0.1,
        },
        Comparison {
            function: "lib::anisotropy::{anisotropic_alpha, anisotropic_normal}",
            call: "vec4f(anisotropic_normal(vec3f(0.0, 0.0, 1.0), vec3f(0.0, 1.0, 0.0), normalize(a.xyz), a.w, 0.25), anisotropic_alpha(0.1, a.w).x)",
            arguments: grid(&[&[0.0, 0.5], &[0.0, 0.7], &[0.0, 0.2, 1.0], &[0.0, 0.5, 1.0]])
                .into_iter()
                .filter(|a| a[0] + a[1] + a[2] > 0.0)
                .collect(),
            truth: |a| {
                let [x, _, z] = unit(direction(a));
                let bent = if x != 0.0 || z != 0.0 { unit([x, 0.0, z]) } else { [0.0, 0.0, 1.0] };
                let weight = (1.0 - a[3] * 0.75).powi(4);
                let mixed = std::array::from_fn(|i| bent[i] * (1.0 - weight) + [0.0, 0.0, 1.0][i] * weight);
                let [x, y, z] = unit(mixed);
                [x, y, z, 0.1 + 0.9 * a[3] * a[3]]
            },
            wrong: |a| [0.0, 0.0, 1.0, 0.1 + 0.9 * a[3]],
            tolerance: 2e-6,
            least: 1.0,
        },
    ]);
}

/// A normal map's texel b in the frame of normal a and tangent (0, 0.6, 0.8), scaled by a.w.
fn mapped(a: Arguments, sign: f64) -> [f64; 3] {
    let (n, t) = (direction(a), [0.0, f64::from(0.6_f32), f64::from(0.8_f32)]);
    let b = [n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]];
    let texel = [(2.0 * a[4] - 1.0) * a[3], (2.0 * a[5] - 1.0) * a[3], 2.0 * a[6] - 1.0];
    let sum = std::array::from_fn(|i| texel[0] * t[i] + texel[1] * sign * b[i] + texel[2] * n[i]);
    let length2: f64 = sum.iter().map(|x: &f64| x * x).sum();
    if length2 < 1e-30 { unit(n) } else { unit(sum) }
}

fn albedo(a: Arguments) -> [f64; 4] {
    let single = a[0] * a[2] + a[1] * a[3];
    let missing = (1.0 - (a[2] + a[3])).max(0.0);
    let average = a[0] + (a[1] - a[0]) / 21.0;
    [single, single * average * missing / (1.0 - average * missing).max(1e-3), 0.0, 0.0]
}

#[test]
fn faults_of_radiance_are_told_apart() {
    let values =
        [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, -0.0, 0.0, 1e-30, 99.0, 100.0, 101.0, 3e38];
    check_all(&[Comparison {
        function: "lib::inspect::faults",
        call: "faults(a.xyz, a.w)",
        arguments: grid(&[&values, &[0.5, f32::NAN], &[0.5, f32::INFINITY], &[100.0]]),
        truth: |a| {
            let any = |is_so: &dyn Fn(f64) -> bool| f64::from(u8::from(a[..3].iter().any(|x| is_so(*x))));
            [
                any(&|x| x.is_nan()),
                any(&|x| x.is_infinite()),
                any(&|x| x < 0.0),
                any(&|x| x.is_finite() && x > a[3]),
            ]
        },
        wrong: |a| {
            let any = |is_so: &dyn Fn(f64) -> bool| f64::from(u8::from(a[..3].iter().any(|x| is_so(*x))));
            [any(&|x| x.is_nan()), any(&|x| x.is_infinite()), any(&|x| x < 0.0), any(&|x| x > a[3])]
        },
        tolerance: 0.0,
        least: 1.0,
    }]);
}
