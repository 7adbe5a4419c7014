//! Punctual lights: what arrives of one, and what each lobe makes of it.

use kiln_brdf::{d_charlie, d_ggx, f_schlick};

use crate::reference::d_anisotropic;
use crate::support::{Arguments, Comparison, ROUGHNESSES, check_all, first_infinite, gpu, grid, unit};

const ALPHA_MIN: f64 = 0.002;

fn scalar(value: f64) -> [f64; 4] {
    [value, 0.0, 0.0, 0.0]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[test]
fn intensity_falls_with_the_square_and_ends_at_range_and_cone() {
    check_all(&[
        Comparison {
            function: "lib::punctual::distance_attenuation",
            call: "vec4f(distance_attenuation(a.x, a.y), 0.0, 0.0, 0.0)",
            // At the lamp and beyond all numbers too; ranges of no end, 100, 2, 1 and 3 mm.
            arguments: grid(&[
                &[0.0, 1e-8, 1e-6, 1e-3, 0.5, 1.0, 4.0, 100.0, 1e6, 1e12, 1e20, 3e38],
                &[0.0, 1e-4, 0.25, 1.0, 1e5],
            ]),
            truth: |a| {
                let distance = a[0].clamp(1e-6, 1e18).sqrt();
                let window = (1.0 - (distance * a[1].sqrt()).powi(4)).clamp(0.0, 1.0);
                scalar(window / distance.powi(2))
            },
            wrong: |a| scalar(1.0 / a[0].clamp(1e-6, 1e18)),
            tolerance: 1e-6,
            least: 1e-30,
        },
        Comparison {
            function: "lib::punctual::cone_attenuation",
            call: "vec4f(cone_attenuation(vec3f(a.x, 0.0, a.y), vec3f(0.0, 0.0, 1.0), a.z, a.w), 0.0, 0.0, 0.0)",
            arguments: cones(),
            truth: |a| scalar(ramp(a).powi(2)),
            wrong: |a| scalar(ramp(a)),
            tolerance: 1e-4,
            least: 1.0,
        },
        Comparison {
            function: "lib::{frame::PunctualLight, punctual::incident_light}",
            call: "vec4f(incident_light(PunctualLight(vec4f(1.0, 2.0, 3.0, a.w), vec3f(0.0, b.x, 0.0), 1e-2, \
                   vec3f(0.0, -1.0, 0.0), 1.0, 3.0), a.xyz).direction, incident_light(PunctualLight(vec4f(1.0, 2.0, \
                   3.0, a.w), vec3f(0.0, b.x, 0.0), 1e-2, vec3f(0.0, -1.0, 0.0), 1.0, 3.0), a.xyz).irradiance.y)",
            arguments: grid(&[&[-1.0, 1.0, 40.0], &[0.0, 2.0], &[-5.0, 3.0], &[0.0, 1.0], &[2.0]]),
            truth: |a| incident(a, 10.0),
            wrong: |a| incident(a, 11.0),
            tolerance: 2e-6,
            least: 1e-6,
        },
    ]);
}

/// Sine and cosine from the axis, versine of the outer cone and scale, for angles in degrees, away from hard edges.
fn cones() -> Vec<[f32; 8]> {
    let mut found = Vec::new();
    for (inner, outer) in
        [(0.0, 0.5), (0.2, 1.0), (1.0, 1.0), (0.0, 45.0), (20.0, 45.0), (45.0, 45.0), (10.0, 90.0)]
    {
        let versine = |degrees: f64| 2.0 * (degrees.to_radians() / 2.0).sin().powi(2);
        let ramp = (versine(outer) - versine(inner)).max(1e-3 * versine(outer));
        for share in [0.0, 0.1, 0.5, 0.9, 0.99, 1.01, 1.5, 2.0] {
            let (sine, cosine) = (outer * share).to_radians().sin_cos();
            found.push([sine, cosine, versine(outer), 1.0 / ramp, 0.0, 0.0, 0.0, 0.0].map(|it| it as f32));
        }
    }
    // Without a cone, straight ahead and straight back.
    found.extend([1.0, -1.0].map(|cosine| [0.0, cosine, 3.0, 1.0, 0.0, 0.0, 0.0, 0.0]));
    found
}

fn ramp(a: Arguments) -> f64 {
    let angle = a[0].atan2(a[1]);
    ((a[2] - 2.0 * (angle / 2.0).sin().powi(2)) * a[3]).clamp(0.0, 1.0)
}

/// A lamp at (1, 2, 3) that shines down as far as `range`, or what is infinitely far in that direction.
fn incident(a: Arguments, range: f64) -> [f64; 4] {
    let to_light = [1.0 - a[3] * a[0], 2.0 - a[3] * a[1], 3.0 - a[3] * a[2]];
    let distance = dot(to_light, to_light).sqrt();
    let [x, y, z] = if distance == 0.0 { [0.0, 1.0, 0.0] } else { unit(to_light) };
    if a[3] == 0.0 {
        return [x, y, z, a[4] * if range == 10.0 { 1.0 } else { 0.0 }];
    }
    // 1e-2 is not quite a hundredth as an f32.
    let window = 1.0 - (distance.powi(2) * f64::from(1e-2_f32) * (10.0 / range).powi(2)).powi(2);
    [x, y, z, a[4] * window.max(0.0) / distance.powi(2).max(1e-6)]
}

/// Pairs of directions around +z with a width: light in `a`, view in `b`, width along x in a.w and along y in b.w.
fn pairs() -> Vec<[f32; 8]> {
    let zeniths = [0.0, 1e-3, 0.1, 0.7, 1.3, 1.55, std::f64::consts::FRAC_PI_2, 1.7, 3.0];
    let direction = |zenith: f64, turn: f64| {
        [zenith.sin() * turn.cos(), zenith.sin() * turn.sin(), zenith.cos()].map(|it| it as f32)
    };
    let mut found = Vec::new();
    for light in zeniths {
        for view in zeniths {
            for turn in [0.0, 0.9, std::f64::consts::PI] {
                let ([lx, ly, lz], [vx, vy, vz]) = (direction(light, 0.3), direction(view, 0.3 + turn));
                for [along, across] in [[0.0, 0.3], [0.01, 0.01], [0.3, 0.04], [1.0, 1.0]] {
                    found.push([lx, ly, lz, along, vx, vy, vz, across]);
                }
            }
        }
    }
    found
}

/// Light and view in front, by the widths of both directions.
fn smith([al, bl]: [f64; 2], l: [f64; 3], v: [f64; 3]) -> f64 {
    let seen = |d: [f64; 3]| (al * al * d[0] * d[0] + bl * bl * d[1] * d[1] + d[2] * d[2]).sqrt();
    0.5 / (v[2] * seen(l) + l[2] * seen(v)).max(1e-14)
}

fn in_front([x, y, z]: [f64; 3]) -> [f64; 3] {
    [x, y, z.max(0.0)]
}

fn half(l: [f64; 3], v: [f64; 3]) -> [f64; 3] {
    let sum: [f64; 3] = std::array::from_fn(|i| l[i] + v[i]);
    if dot(sum, sum) < 1e-30 { [0.0, 0.0, 1.0] } else { unit(sum) }
}

fn reflected(l: [f64; 3], v: [f64; 3], alpha: f64) -> f64 {
    if l[2] <= 0.0 {
        return 0.0;
    }
    let h = half(l, v);
    let d = alpha * alpha
        / (std::f64::consts::PI
            * (alpha * alpha * h[2].max(0.0).powi(2) + h[0] * h[0] + h[1] * h[1]).powi(2));
    // Isotropic masking sees cosines alone.
    let seen = |cosine: f64| (cosine * cosine * (1.0 - alpha * alpha) + alpha * alpha).sqrt();
    let (nl, nv) = (l[2], v[2].max(0.0));
    nl * d * 0.5 / (nv * seen(nl) + nl * seen(nv)).max(1e-14)
}

fn brushed(l: [f64; 3], v: [f64; 3], widths: [f64; 2]) -> f64 {
    let widths = widths.map(|width| width.max(ALPHA_MIN));
    l[2].max(0.0) * d_anisotropic(half(l, v), widths) * smith(widths, in_front(l), in_front(v))
}

fn light(a: Arguments) -> [f64; 3] {
    [a[0], a[1], a[2]]
}

fn view(a: Arguments) -> [f64; 3] {
    [a[4], a[5], a[6]]
}

fn mirrored([x, y, z]: [f64; 3]) -> [f64; 3] {
    [x, y, -z]
}

#[test]
fn lobes_of_one_light_agree_from_mirror_to_grazing_and_are_dark_behind() {
    check_all(&[
        Comparison {
            function: "lib::punctual::punctual_alpha",
            call: "vec4f(punctual_alpha(a.x), 0.0, 0.0, 0.0)",
            arguments: grid(&[&ROUGHNESSES]),
            truth: |a| scalar((a[0] * a[0]).max(ALPHA_MIN)),
            wrong: |a| scalar(a[0] * a[0]),
            tolerance: 1e-6,
            least: 1e-6,
        },
        Comparison {
            function: "lib::punctual::half_vector",
            call: "vec4f(half_vector(a.xyz, b.xyz, vec3f(0.0, 0.0, 1.0)), half_vector(a.xyz, -a.xyz, b.xyz).y)",
            arguments: pairs(),
            truth: |a| {
                let [x, y, z] = half(light(a), view(a));
                [x, y, z, a[5]]
            },
            wrong: |a| [a[0], a[1], a[2], a[5]],
            tolerance: 1e-6,
            least: 1.0,
        },
        Comparison {
            function: "lib::punctual::{ggx_reflected, punctual_alpha}",
            call: "vec4f(ggx_reflected(vec3f(0.0, 0.0, 1.0), b.xyz, a.xyz, punctual_alpha(a.w)), 0.0, 0.0, 0.0)",
            arguments: pairs(),
            truth: |a| scalar(reflected(light(a), view(a), (a[3] * a[3]).max(ALPHA_MIN))),
            wrong: |a| scalar(reflected(light(a), view(a), (a[3] * a[3]).max(1.01 * ALPHA_MIN))),
            tolerance: 2e-3,
            least: 1e-2,
        },
        Comparison {
            function: "lib::punctual::ggx_transmitted",
            call: "vec4f(ggx_transmitted(vec3f(0.0, 0.0, 1.0), b.xyz, a.xyz, max(a.w, 0.002)), 0.0, 0.0, 0.0)",
            arguments: pairs(),
            truth: |a| scalar(reflected(mirrored(light(a)), view(a), a[3].max(ALPHA_MIN))),
            wrong: |a| scalar(reflected(light(a), view(a), a[3].max(ALPHA_MIN))),
            tolerance: 2e-3,
            least: 1e-2,
        },
        Comparison {
            function: "lib::punctual::ggx_reflected_anisotropic",
            call: "vec4f(ggx_reflected_anisotropic(b.xyz, a.xyz, max(vec2f(a.w, b.w), vec2f(0.002))), 0.0, 0.0, 0.0)",
            arguments: pairs(),
            truth: |a| scalar(brushed(light(a), view(a), [a[3], a[7]])),
            wrong: |a| scalar(brushed(light(a), view(a), [a[7], a[3]])),
            tolerance: 2e-3,
            least: 1e-2,
        },
        Comparison {
            function: "lib::punctual::charlie_reflected",
            call: "vec4f(charlie_reflected(vec3f(0.0, 0.0, 1.0), b.xyz, a.xyz, max(a.w, 0.002)), 0.0, 0.0, 0.0)",
            arguments: pairs(),
            truth: |a| scalar(cloth(light(a), view(a), a[3].max(ALPHA_MIN))),
            wrong: |a| scalar(cloth(light(a), view(a), 1.02 * a[3].max(ALPHA_MIN))),
            tolerance: 2e-3,
            least: 1e-2,
        },
    ]);
}

fn cloth(l: [f64; 3], v: [f64; 3], alpha: f64) -> f64 {
    let (nl, nv) = (l[2].max(0.0), v[2].max(0.0));
    if nl == 0.0 {
        return 0.0;
    }
    let h = half(l, v);
    let d = d_charlie(alpha, (h[0] * h[0] + h[1] * h[1]).sqrt().min(1.0));
    // Both grazing, closer than cosines are known.
    nl * d * 0.25 / (nl + nv - nl * nv).max(1e-14)
}

#[test]
fn isotropic_brush_reflects_as_no_brush() {
    // Views from behind have no masking: what stands in for it differs, and nobody sees it.
    for a in pairs().into_iter().filter(|a| a[6] >= 0.0) {
        let a = a.map(f64::from);
        // Unit to an f32's rounding, so the masking's two forms differ by that.
        let [plain, brush] = [reflected(light(a), view(a), 0.2), brushed(light(a), view(a), [0.2, 0.2])];
        assert!((plain - brush).abs() <= 1e-5 * plain.max(1.0), "{a:?}: {plain} {brush}");
    }
    let metal = reflected([0.0, 0.0, 1.0], [0.0, 0.0, 1.0], 0.2) * f_schlick(1.0, 1.0);
    assert!((metal - d_ggx(0.2, 0.0) / 4.0).abs() < 1e-12, "head on: D / 4");
}

#[test]
fn nothing_of_a_light_is_infinite() {
    let Some(gpu) = gpu() else { return };
    let names =
        "lib::punctual::{charlie_reflected, ggx_reflected, ggx_reflected_anisotropic, punctual_alpha}";
    let call = "vec4f(charlie_reflected(vec3f(0.0, 0.0, 1.0), b.xyz, a.xyz, punctual_alpha(a.w)), \
        ggx_reflected(vec3f(0.0, 0.0, 1.0), b.xyz, a.xyz, punctual_alpha(a.w)), \
        ggx_reflected_anisotropic(b.xyz, a.xyz, vec2f(punctual_alpha(a.w), 1.0)), 1e6)";
    assert_eq!(first_infinite(gpu, names, call, &pairs()), None);
    let unguarded = "vec4f(ggx_reflected(vec3f(0.0, 0.0, 1.0), b.xyz, a.xyz, 0.1) / a.w, charlie_reflected(a.xyz, b.xyz, b.xyz, punctual_alpha(a.w)), ggx_reflected_anisotropic(b.xyz, a.xyz, vec2f(1.0)), 1.0)";
    assert!(first_infinite(gpu, names, unguarded, &pairs()).is_some(), "the check sees an infinity");
}
