//! Spheres under one light beside the same shading in `f64`.

use std::f32::consts::FRAC_PI_2;
use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use kiln_scene::{Bounds, Light, LightKind, Scene};
use kiln_shader::Member;
use serde_json::{Value, json};

use super::fixture::{Build, LUT_SIZE, Sphere, gpu, lut_texel};
use super::frames::FRONT;
use crate::HeadlessViewer;
use crate::lights::{block, capacity, strongest};

const SIZE: [u32; 2] = [320, 180];
const BLACK: [[f32; 3]; 6] = [[0.0; 3]; 6];

/// Radiance of red as its root, which eight bits hold to half a percent.
const ROOT: &str = "
@group(0) @binding(0) var hdr_color: texture_2d<f32>;
@vertex fn vs_main(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}
@fragment fn fs_main(@builtin(position) position: vec4f) -> @location(0) vec4f {
    return vec4f(sqrt(saturate(textureLoad(hdr_color, vec2i(position.xy), 0).rgb)), 1.0);
}";

/// A white or grey sphere in the dark.
#[derive(Clone, Copy)]
struct Ball {
    metallic: f64,
    roughness: f64,
    color: f64,
}

impl Ball {
    fn material(self) -> Value {
        let Ball { metallic, roughness, color } = self;
        json!({ "pbrMetallicRoughness": {
            "metallicFactor": metallic, "roughnessFactor": roughness, "baseColorFactor": [color, color, color, 1.0],
        } })
    }
}

fn build(sphere: &Sphere) -> Build {
    let glb = sphere.glb();
    let mut build = Build::new();
    build.shaders_of(&glb).lut().env("sky", BLACK).scene("ball", "sky", glb);
    build.cube("env/sky/sheen", 4, 3, 0, BLACK).shader_text("tonemap", "tonemap", ROOT);
    build
}

/// Red radiance of each pixel.
fn radiance(sphere: &Sphere) -> Option<Vec<f64>> {
    let mut viewer = HeadlessViewer::new(gpu()?, SIZE);
    let report = viewer.apply(&build(sphere).revision());
    assert_eq!(report.diagnostics, vec![]);
    viewer.view.camera = Some(FRONT);
    let picture = viewer.render().expect("the device reads back");
    Some(picture.pixels().map(|pixel| (f64::from(pixel[0]) / 255.0).powi(2)).collect())
}

/// Where the ray through a pixel's middle meets the unit sphere, away from its rim; there it is also the normal.
fn hit(x: u32, y: u32) -> Option<DVec3> {
    let half = (f64::from(FRONT.field_of_view_rad) / 2.0).tan();
    let at = |pixel: u32, size: u32| 2.0 * (f64::from(pixel) + 0.5) / f64::from(size) - 1.0;
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let ray = DVec3::new(at(x, SIZE[0]) * half * aspect, -at(y, SIZE[1]) * half, -1.0).normalize();
    let eye = DVec3::new(0.0, 0.0, f64::from(FRONT.distance));
    let along = -ray.dot(eye);
    let depth2 = 1.0 - (eye + ray * along).length_squared();
    (depth2 > 0.05).then(|| eye + ray * (along - depth2.sqrt()))
}

/// The split sum's table as a device reads it.
fn scale_bias(n_dot_v: f64, roughness: f64) -> [f64; 2] {
    let place = |value: f64| (value * LUT_SIZE as f64 - 0.5).clamp(0.0, (LUT_SIZE - 1) as f64);
    let (x, y) = (place(n_dot_v), place(roughness));
    let texel = |dx: usize, dy: usize| {
        let at = |value: f64, step: usize| (value as usize + step).min(LUT_SIZE - 1);
        lut_texel(at(x, dx), at(y, dy)).map(f64::from)
    };
    let mix = |a: [f64; 2], b: [f64; 2], t: f64| [0, 1].map(|i| a[i] + (b[i] - a[i]) * t);
    mix(mix(texel(0, 0), texel(1, 0), x.fract()), mix(texel(0, 1), texel(1, 1), x.fract()), y.fract())
}

/// Radiance towards the eye of the point whose normal it is, in light of `irradiance` from `light`.
fn shade(ball: Ball, normal: DVec3, widening: f64, light: DVec3, irradiance: f64) -> f64 {
    let view = (DVec3::Z * f64::from(FRONT.distance) - normal).normalize();
    let (n_dot_l, n_dot_v) = (normal.dot(light).max(0.0), normal.dot(view).max(0.0));
    let alpha2 = (ball.roughness.powi(4) + widening).min(1.0);
    let roughness = alpha2.sqrt().sqrt();
    let alpha2 = alpha2.max(0.002f64.powi(2));
    let f0 = 0.04 + (ball.color - 0.04) * ball.metallic;
    let [scale, bias] = scale_bias(n_dot_v, roughness);
    let single = f0 * scale + bias;
    let average = f0 + (1.0 - f0) / 21.0;
    let missing = (1.0 - scale - bias).max(0.0);
    let multiple = single * average * missing / (1.0 - average * missing);
    let half = (light + view).normalize_or_zero();
    let fresnel = f0 + (1.0 - f0) * (1.0 - view.dot(half)).powi(5);
    let distribution =
        alpha2 / (PI * (alpha2 * normal.dot(half).powi(2) + normal.cross(half).length_squared()).powi(2));
    let seen = |cosine: f64| (alpha2 + (1.0 - alpha2) * cosine * cosine).sqrt();
    let visibility = 0.5 / (n_dot_v * seen(n_dot_l) + n_dot_l * seen(n_dot_v)).max(1e-14);
    let diffuse = ball.color * (1.0 - ball.metallic) * (1.0 - single - multiple);
    irradiance * n_dot_l * (fresnel * distribution * visibility + (multiple + diffuse) / PI)
}

/// RMS difference to what `arrives` at each point (direction and irradiance) makes of the ball, relative to the latter's RMS.
fn error(pixels: &[f64], ball: Ball, arrives: &dyn Fn(DVec3) -> (DVec3, f64)) -> f64 {
    let (mut difference, mut sum, mut largest) = (0.0, 0.0, 0.0_f64);
    for (x, y) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))) {
        // Derivatives are those of the pixel's block of four.
        let (left, top) = (x & !1, y & !1);
        let block = [hit(left, y), hit(left + 1, y), hit(x, top), hit(x, top + 1)];
        let (Some(normal), [Some(a), Some(b), Some(c), Some(d)]) = (hit(x, y), block) else { continue };
        let widening = (((b - a).length_squared() + (d - c).length_squared()) / PI).min(0.18);
        let (light, irradiance) = arrives(normal);
        let expected = shade(ball, normal, widening, light, irradiance);
        let actual = pixels[(y * SIZE[0] + x) as usize];
        difference += (actual - expected).powi(2);
        sum += expected.powi(2);
        largest = largest.max(expected);
    }
    assert!((0.1..1.0).contains(&largest), "{largest} is dark or clipped");
    (difference / sum).sqrt()
}

#[track_caller]
fn check(
    ball: Ball,
    light: (Value, Value),
    arrives: &dyn Fn(DVec3) -> (DVec3, f64),
    otherwise: &dyn Fn(DVec3) -> (DVec3, f64),
) {
    let sphere = Sphere { material: ball.material(), lights: vec![light], ..Sphere::default() };
    let Some(pixels) = radiance(&sphere) else { return };
    let (right, wrong) = (error(&pixels, ball, arrives), error(&pixels, ball, otherwise));
    assert!(right <= 0.01, "{right}");
    assert!(wrong > 0.01, "the check sees another light: {wrong}");
}

/// A turn around +Y that points −Z to −(sin, 0, cos).
fn turned(angle: f64) -> Value {
    json!([0.0, (angle / 2.0).sin(), 0.0, (angle / 2.0).cos()])
}

#[test]
fn sphere_under_a_directional_light_is_as_its_twin() {
    let towards = |angle: f64| DVec3::new(angle.sin(), 0.0, angle.cos());
    for ball in [
        Ball { metallic: 0.0, roughness: 0.6, color: 0.8 },
        Ball { metallic: 1.0, roughness: 0.5, color: 0.9 },
        Ball { metallic: 1.0, roughness: 1.0, color: 1.0 },
    ] {
        let light = (json!({ "type": "directional", "intensity": 0.7 }), json!({ "rotation": turned(0.6) }));
        check(ball, light, &|_| (towards(0.6), 0.7), &|_| (towards(0.62), 0.7));
    }
}

#[test]
fn sphere_under_a_point_light_is_as_its_twin() {
    let lamp = DVec3::new(1.0, 1.2, 1.5);
    let arrives = |range: f64| {
        move |point: DVec3| {
            let to_light = lamp - point;
            let distance = to_light.length();
            (to_light / distance, 2.0 * (1.0 - (distance / range).powi(4)).max(0.0) / distance.powi(2))
        }
    };
    let light = (
        json!({ "type": "point", "intensity": 2.0, "range": 2.5 }),
        json!({ "translation": lamp.to_array() }),
    );
    let ball = Ball { metallic: 0.0, roughness: 0.5, color: 0.7 };
    check(ball, light, &arrives(2.5), &arrives(1e9));
}

#[test]
fn sphere_under_a_spot_light_is_as_its_twin() {
    let lamp = DVec3::new(3.0 * 0.4_f64.sin(), 0.0, 3.0 * 0.4_f64.cos());
    let arrives = |outer: f64| {
        move |point: DVec3| {
            let to_light = lamp - point;
            let distance = to_light.length();
            let cosine = (to_light / distance).dot(lamp / 3.0);
            let ramp = ((cosine - outer.cos()) / (0.1_f64.cos() - outer.cos())).clamp(0.0, 1.0);
            (to_light / distance, 8.0 * ramp * ramp / distance.powi(2))
        }
    };
    let spot =
        json!({ "type": "spot", "intensity": 8.0, "spot": { "innerConeAngle": 0.1, "outerConeAngle": 0.3 } });
    let light = (spot, json!({ "translation": lamp.to_array(), "rotation": turned(0.4) }));
    let ball = Ball { metallic: 0.0, roughness: 0.8, color: 0.5 };
    check(ball, light, &arrives(0.3), &arrives(0.32));
}

#[test]
fn light_that_is_off_leaves_no_trace_in_shader_bindings_and_picture() {
    let lamp = |intensity: f64| {
        let light = json!({ "type": "point", "intensity": intensity });
        let material = json!({ "pbrMetallicRoughness": { "roughnessFactor": 0.5 } });
        Sphere { material, lights: vec![(light, json!({ "translation": [0, 0, 3] }))], ..Sphere::default() }
    };
    let words = |build: &Build, variant: &str| {
        let revision = build.revision();
        let part =
            |part: &str| revision.part(&format!("shader/pbr/{variant}"), part).map(|bytes| bytes.to_vec());
        let text = [part("wgsl"), part("reflection")].map(|part| String::from_utf8(part.unwrap_or_default()));
        text.map(|text| text.expect("it is text")).concat().to_lowercase()
    };
    let (off, on) = (build(&lamp(0.0)), build(&lamp(1.0)));
    assert!(!words(&off, "base").contains("light"), "a variant without lights has their words");
    assert!(words(&on, "punctual_lights").contains("light"), "the check sees lights");
    assert!(words(&off, "punctual_lights").is_empty());
    let none = Sphere { lights: vec![], ..lamp(0.0) };
    let Some(pixels) = radiance(&lamp(0.0)) else { return };
    assert!(radiance(&none).as_ref() == Some(&pixels) && radiance(&lamp(1.0)).as_ref() != Some(&pixels));
}

#[test]
fn every_layer_is_lit_and_finite() {
    let layers = [
        json!({}),
        json!({ "KHR_materials_clearcoat": { "clearcoatFactor": 1 } }),
        json!({ "KHR_materials_sheen": { "sheenColorFactor": [1, 1, 1], "sheenRoughnessFactor": 0.3 } }),
        json!({ "KHR_materials_anisotropy": { "anisotropyStrength": 0.7 } }),
        json!({ "KHR_materials_iridescence": { "iridescenceFactor": 1, "iridescenceIor": 1.8 } }),
        json!({ "KHR_materials_specular": { "specularFactor": 0 } }),
        json!({ "KHR_materials_transmission": { "transmissionFactor": 1 } }),
        json!({ "KHR_materials_diffuse_transmission": { "diffuseTransmissionFactor": 1 } }),
    ];
    // From the front, and from behind, which shows what passes alone.
    let lit = |extensions: &Value, angle: f64| {
        let material = json!({ "extensions": extensions, "pbrMetallicRoughness":
            { "metallicFactor": 0, "roughnessFactor": 0.4, "baseColorFactor": [0.5, 0.5, 0.5, 1] } });
        let light =
            (json!({ "type": "directional", "intensity": 1.0 }), json!({ "rotation": turned(angle) }));
        radiance(&Sphere { material, lights: vec![light], ..Sphere::default() })
    };
    let middle = (SIZE[1] / 2 * SIZE[0] + SIZE[0] / 2) as usize;
    let mut seen: Vec<Vec<f64>> = Vec::new();
    for (at, layer) in layers.iter().enumerate() {
        let (Some(front), Some(back)) = (lit(layer, 0.3), lit(layer, PI)) else { return };
        assert!(front.iter().any(|&value| value > 0.01) || at >= 6, "{layer} is dark");
        assert!(!seen.contains(&front), "{layer} does nothing");
        let passes = at >= 6;
        assert_eq!(back[middle] > 0.01, passes, "{layer}: {}", back[middle]);
        seen.push(front);
    }
}

#[test]
fn lights_beyond_the_room_of_a_shader_are_the_weakest_and_a_note_counts_them() {
    let light = |intensity: f32, x: f32| Light {
        intensity: [intensity; 3],
        position: Vec3::X * x,
        direction: Vec3::NEG_Z,
        kind: LightKind::Point,
        range: None,
    };
    let scene = Scene { bounds: Some(Bounds { min: Vec3::splat(-1.0), max: Vec3::ONE }), ..Scene::default() };
    let lights = [light(1.0, 1.0), light(8.0, 4.0), light(2.0, 1.0), light(3.0, 2.0)];
    let kept: Vec<f32> = strongest(&lights, &scene, 2).iter().map(|light| light.intensity[0]).collect();
    assert_eq!(kept, [1.0, 2.0], "by what arrives, in the file's order");
    assert_eq!(strongest(&lights, &scene, 4).len(), 4);
    let Some(gpu) = gpu() else { return };
    let lamp = |_| (json!({ "type": "point" }), json!({ "translation": [0, 0, 3] }));
    let material = json!({ "pbrMetallicRoughness": {} });
    for (count, left_out) in [(64, false), (66, true)] {
        let sphere = Sphere {
            material: material.clone(),
            lights: (0..count).map(lamp).collect(),
            ..Sphere::default()
        };
        let notes = HeadlessViewer::new(gpu.clone(), SIZE).apply(&build(&sphere).revision()).notes;
        assert_eq!(notes.iter().any(|note| note.contains("the 2 weakest")), left_out, "{notes:?}");
    }
}

fn record(light: Light) -> Vec<f32> {
    let block = block(&[light]);
    assert_eq!((block.len(), block[0]), (16 + 64, 1));
    let record: Vec<f32> = bytemuck::pod_collect_to_vec(&block[16..]);
    assert!(record.iter().all(|value| value.is_finite()), "{record:?}");
    record
}

#[test]
fn records_are_finite_for_any_light() {
    let light = |kind, intensity, range| Light {
        intensity: [intensity; 3],
        position: Vec3::new(1.0, 2.0, 3.0),
        direction: Vec3::NEG_Y,
        kind,
        range,
    };
    let spot = |inner_cone_rad, outer_cone_rad| LightKind::Spot { inner_cone_rad, outer_cone_rad };
    let sun = record(light(LightKind::Directional, 2.0, Some(0.5)));
    assert_eq!(sun[..8], [0.0, 1.0, 0.0, 0.0, 2.0, 2.0, 2.0, 0.0], "towards it, without a range");
    let lamp = record(light(LightKind::Point, 2.0, Some(0.5)));
    assert_eq!(lamp[..8], [1.0, 2.0, 3.0, 1.0, 2.0, 2.0, 2.0, 4.0]);
    assert_eq!(lamp[11..13], [1.0, 3.0], "without a cone");
    for (inner, outer) in [(0.0, 0.0), (0.3, 0.3), (0.5, 0.3), (0.0, 1e-4), (0.0, FRAC_PI_2)] {
        let record = record(light(spot(inner, outer), 1.0, None));
        assert!(record[11] > 0.0 && record[12] <= 1.0 + 1e-6, "{inner} {outer}: {record:?}");
    }
    // 0.5°, where 1 − cosine in single precision has three digits.
    let [scale, versine] =
        [11, 12].map(|at| f64::from(record(light(spot(0.0, 0.008_726_646), 1.0, None))[at]));
    assert!(
        (versine / (1.0 - 0.008_726_646_f64.cos()) - 1.0).abs() < 1e-6
            && (versine * scale - 1.0).abs() < 1e-6
    );
    for (intensity, range) in [(f32::INFINITY, Some(0.0)), (f32::NAN, Some(1e-30)), (-1.0, Some(f32::MAX))] {
        assert!(record(light(LightKind::Point, intensity, range))[4] >= 0.0);
    }
}

#[test]
fn block_of_lights_has_a_count_and_records_of_64_bytes() {
    let member = |name: &str, ty: &str, offset_bytes, size_bytes| Member {
        name: name.into(),
        ty: ty.into(),
        offset_bytes,
        size_bytes,
    };
    let of =
        |items: u32| [member("count", "u32", 0, 4), member("items", "array<PunctualLight, 3>", 16, items)];
    assert_eq!(capacity(16 + 192, &of(192)), Ok(3));
    assert!(capacity(16 + 190, &of(190)).is_err(), "half a record");
    assert!(capacity(100, &of(192)).is_err(), "records beyond the block");
    assert!(capacity(16, &of(0)).is_err() && capacity(192, &of(192)[1..]).is_err());
    let Some(gpu) = gpu() else { return };
    let text = "
        @group(0) @binding(3) var<uniform> lights: vec4f;
        @vertex fn vs_main(@location(0) position: vec3f) -> @builtin(position) vec4f { return vec4f(position, 1.0); }
        @fragment fn fs_main() -> @location(0) vec4f { return lights; }";
    let mut build = Build::ball(json!({}));
    build.shader_text("pbr", "material", text);
    let said = HeadlessViewer::new(gpu, SIZE).apply(&build.revision()).diagnostics;
    assert!(said.iter().any(|fault| fault.message.contains("`lights` otherwise than as")), "{said:?}");
}
