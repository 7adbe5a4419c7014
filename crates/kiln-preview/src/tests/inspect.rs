//! What channels, probes and marks show, against what is known of a sphere.

use glam::Vec3;
use serde_json::{Value, json};

use super::fixture::{Build, SIX_COLORS, Sphere, gpu};
use super::frames::FRONT;
use crate::channel::{Channel, FAULTS_CODE};
use crate::scaling::{FrameQuality, Scaling};
use crate::{Encoding, FaultCounts, HeadlessViewer, InspectionState, PixelProbe, Selection, View};

const SIZE: [u32; 2] = [160, 90];
/// On the sphere, away from its middle.
const ON_SPHERE: [u32; 2] = [90, 35];
/// Beside the sphere.
const BESIDE: [u32; 2] = [5, 5];

fn matte(roughness: f32) -> Value {
    json!({ "pbrMetallicRoughness": {
        "metallicFactor": 0.25, "roughnessFactor": roughness, "baseColorFactor": [0.8, 0.4, 0.2, 1.0],
    } })
}

/// A viewer of the ball, whose shaders can show channels.
pub(super) fn viewer(sphere: &Sphere) -> Option<HeadlessViewer> {
    let mut viewer = HeadlessViewer::new(gpu()?, SIZE);
    let glb = sphere.glb();
    let scene = kiln_scene::load(&glb).expect("what was packed loads");
    let mut build = Build::new();
    build.shaders_of(&glb).lut().env("sky", SIX_COLORS);
    for draw in &scene.draws {
        let effects = scene.effects(draw, scene.material_of(draw, None));
        let features: Vec<&str> = effects.iter().map(|effect| effect.name()).collect();
        build.inspect_shaders(&[&features]);
    }
    let report = viewer.apply(&build.scene("ball", "sky", glb).revision());
    assert_eq!(report.diagnostics, vec![]);
    assert_eq!(report.inspection.state, InspectionState::Ready);
    viewer.view.camera = Some(FRONT);
    Some(viewer)
}

fn ball(material: Value) -> Option<HeadlessViewer> {
    viewer(&Sphere { material, ..Sphere::default() })
}

fn probe(viewer: &mut HeadlessViewer, channel: Option<Channel>, pixel: [u32; 2]) -> PixelProbe {
    viewer.view.channel = channel;
    viewer.probe(pixel).expect("the device reads back").expect("the pixel lies within")
}

/// The channel's value at a pixel, if anything has one there.
fn value(viewer: &mut HeadlessViewer, channel: Channel, pixel: [u32; 2]) -> Option<Vec<f32>> {
    let (shown, value) = probe(viewer, Some(channel), pixel).channel.expect("a channel is shown");
    assert_eq!(shown, channel);
    value
}

#[test]
fn channels_have_the_codes_that_shaders_know_them_by() {
    let module = include_str!("../../../../shaders/lib/inspect.wgsl");
    for channel in Channel::ALL {
        let name = channel.name().replace('-', "_").to_uppercase();
        let declared = format!("const CHANNEL_{name}: u32 = {}u;", channel.code());
        assert!(module.contains(&declared), "{declared}");
        assert_eq!(channel.name().parse(), Ok(channel));
    }
    assert!(module.contains(&format!("const CHANNEL_FAULTS: u32 = {FAULTS_CODE}u;")));
    assert!("rough".parse::<Channel>().is_err_and(|error| error.contains("roughness")));
}

#[test]
fn constant_values_of_a_material_are_shown_exactly() {
    for roughness in [0.5, 0.25] {
        let Some(mut viewer) = ball(matte(roughness)) else { return };
        let mut expect = |channel: Channel, expected: &[f32], bytes: [u8; 3]| {
            let shown = probe(&mut viewer, Some(channel), ON_SPHERE);
            let (_, value) = shown.channel.expect("a channel is shown");
            let value = value.expect("the sphere is there");
            let off = value.iter().zip(expected).map(|(value, expected)| (value - expected).abs());
            assert!(value.len() == expected.len() && off.fold(0.0, f32::max) < 5e-4, "{channel}: {value:?}");
            let off = (0..3).map(|at| shown.srgb[at].abs_diff(bytes[at])).max();
            assert!(off <= Some(1), "{channel}: {:?}", shown.srgb);
            assert_eq!(shown.radiance, None);
        };
        let grey = |value: f32| [(value * 255.0).round() as u8; 3];
        expect(Channel::Roughness, &[roughness], grey(roughness));
        expect(Channel::Metalness, &[0.25], grey(0.25));
        expect(Channel::Alpha, &[1.0], grey(1.0));
        expect(Channel::Occlusion, &[1.0], grey(1.0));
        expect(Channel::BaseColor, &[0.8, 0.4, 0.2], [231, 170, 124]);
        expect(Channel::F0, &[0.23, 0.13, 0.08], [132, 101, 79]);
        expect(Channel::Uv0, &[0.0, 0.0], [0, 0, 0]);
        expect(Channel::Mip, &[0.0], [217, 64, 64]);
        assert_eq!(value(&mut viewer, Channel::Roughness, BESIDE), None, "nothing is beside the sphere");
        assert_eq!(value(&mut viewer, Channel::Tangent, ON_SPHERE), None, "this variant has no tangents");
    }
}

#[test]
fn normals_are_those_of_the_sphere_where_the_probe_says_it_is() {
    let Some(mut viewer) = ball(matte(0.5)) else { return };
    for pixel in [ON_SPHERE, [80, 45], [70, 60]] {
        for channel in [Channel::GeometricNormal, Channel::ShadingNormal] {
            let found = probe(&mut viewer, Some(channel), pixel);
            let position = Vec3::from(found.position.expect("the sphere is there"));
            assert!((position.length() - 1.0).abs() < 2e-3, "{position} is not on the unit sphere");
            let (_, normal) = found.channel.expect("a channel is shown");
            let normal = Vec3::from_slice(&normal.expect("the sphere is there"));
            assert!(normal.distance(position) < 0.02, "{normal} at {position}");
            let shown = Vec3::from(found.srgb.map(f32::from)) / 255.0 * 2.0 - 1.0;
            assert!(shown.distance(position) < 0.03, "{shown} at {position}");
            // Checks the check: another place's normal is another.
            assert!(normal.distance(-position) > 1.0);
        }
    }
}

pub(super) fn layered() -> Sphere {
    let material = json!({
        "pbrMetallicRoughness": { "metallicFactor": 0.2, "roughnessFactor": 0.4, "baseColorFactor": [0.8, 0.4, 0.2, 1.0] },
        "emissiveFactor": [0.1, 0.2, 0.3],
        "extensions": {
            "KHR_materials_clearcoat": { "clearcoatFactor": 0.8, "clearcoatRoughnessFactor": 0.2 },
            "KHR_materials_sheen": { "sheenColorFactor": [0.3, 0.5, 0.4], "sheenRoughnessFactor": 0.6 },
            "KHR_materials_transmission": { "transmissionFactor": 0.5 },
        },
    });
    let lamp = json!({ "type": "point", "intensity": 20.0, "color": [1.0, 0.7, 0.4] });
    Sphere { material, lights: vec![(lamp, json!({ "translation": [1.5, 1.5, 3.0] }))], ..Sphere::default() }
}

const LOBES: [Channel; 6] = [
    Channel::Diffuse,
    Channel::Specular,
    Channel::Transmission,
    Channel::Sheen,
    Channel::Emission,
    Channel::Clearcoat,
];

#[test]
fn lobes_sum_up_to_the_picture_and_none_can_be_left_out() {
    let Some(mut viewer) = viewer(&layered()) else { return };
    for pixel in [ON_SPHERE, [70, 60]] {
        let picture = Vec3::from(probe(&mut viewer, None, pixel).radiance.expect("a picture has radiance"));
        let lobe = |channel| {
            let radiance = probe(&mut viewer, Some(channel), pixel).radiance;
            Vec3::from(radiance.expect("a lobe is radiance"))
        };
        let lobes = LOBES.map(lobe);
        let sum: Vec3 = lobes.iter().sum();
        assert!((sum - picture).abs().max_element() < 0.004 * picture.max_element(), "{sum} for {picture}");
        for (channel, lobe) in LOBES.iter().zip(lobes) {
            assert!(lobe.max_element() > 0.008 * picture.max_element(), "{channel} has nothing: {lobe}");
        }
    }
}

#[test]
fn light_of_lamps_is_what_the_picture_lacks_without_them() {
    let lit = layered();
    let dark = Sphere { lights: Vec::new(), ..layered() };
    let (Some(mut lit), Some(mut dark)) = (viewer(&lit), viewer(&dark)) else { return };
    let radiance = |viewer: &mut HeadlessViewer, channel| {
        Vec3::from(probe(viewer, channel, ON_SPHERE).radiance.expect("it is radiance"))
    };
    let difference = radiance(&mut lit, None) - radiance(&mut dark, None);
    let punctual = radiance(&mut lit, Some(Channel::Punctual));
    assert!(punctual.max_element() > 0.05, "{punctual}");
    assert!((punctual - difference).abs().max_element() < 0.004, "{punctual} for {difference}");
}

#[test]
fn probe_reads_what_the_picture_holds() {
    let Some(mut viewer) = ball(matte(0.5)) else { return };
    viewer.view.exposure_ev = 1.0;
    let picture = viewer.render().expect("the device reads back");
    let radiance = viewer.render_radiance().expect("the device reads back");
    for pixel in [ON_SPHERE, BESIDE] {
        let found = probe(&mut viewer, None, pixel);
        assert_eq!(found.srgb[..], picture.get_pixel(pixel[0], pixel[1]).0[..3]);
        let expected = radiance.texel(pixel[0] as usize, pixel[1] as usize);
        assert_eq!(found.radiance, Some(expected));
        let [red, green, blue] = expected;
        let luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue;
        assert!(found.luminance.is_some_and(|it| (it - luminance).abs() < 1e-5));
        let stops = found.ev_above_middle_grey.expect("there is light");
        assert!((stops - (2.0 * luminance / 0.18).log2()).abs() < 1e-4, "{stops}");
        assert_eq!(found.position.is_some(), pixel == ON_SPHERE);
    }
    assert!(viewer.probe([SIZE[0], 0]).expect("the device reads back").is_none(), "outside");
}

/// Radiance of the author's own: a constant where the normal looks right, something wrong elsewhere.
fn faulty(wrong: &str) -> String {
    format!(
        "struct Frame {{ clip_from_world: mat4x4f }}
@group(0) @binding(0) var<uniform> frame: Frame;
struct Varying {{ @builtin(position) position: vec4f, @location(0) place: vec3f }}
@vertex fn vs_main(@location(0) position: vec3f) -> Varying {{
    return Varying(frame.clip_from_world * vec4f(position, 1.0), position);
}}
@fragment fn fs_main(in: Varying) -> @location(0) vec4f {{
    let zero = max(-abs(in.place.x), 0.0);
    return vec4f(select(vec3f({wrong}), vec3f(0.5), in.place.x > 0.0), 1.0);
}}"
    )
}

#[test]
fn shader_that_divides_by_zero_lights_up() {
    let Some(gpu) = gpu() else { return };
    let count = |wrong: &str| {
        let mut build = Build::ball(matte(0.5));
        build.table.targets.remove("shader/pbr/base");
        build.shader_text("pbr", "material", &faulty(wrong));
        let mut viewer = HeadlessViewer::new(gpu.clone(), SIZE);
        assert_eq!(viewer.apply(&build.revision()).diagnostics, vec![]);
        viewer.view = View { camera: Some(FRONT), fault_limit: Some(1000.0), ..View::default() };
        let counts = viewer.count_faults().expect("the device reads back").expect("the device counts");
        let picture = viewer.render().expect("the device reads back");
        let is_magenta = |pixel: &&image::Rgba<u8>| pixel.0 == [255, 0, 255, 255];
        (counts, picture.pixels().filter(is_magenta).count())
    };
    let none = FaultCounts::default();
    assert_eq!(count("0.25"), (none, 0), "a sound shader has no marks");
    let (counts, magenta) = count("zero / zero");
    assert!(counts.nan > 500 && counts.infinite == 0 && counts.negative == 0, "{counts:?}");
    assert!(magenta as u32 > counts.nan / 4, "{magenta} pixels of {counts:?}");
    let (counts, _) = count("1.0 / zero");
    assert!(counts.infinite > 500 && counts.nan == 0, "{counts:?}");
    let (counts, _) = count("-0.5");
    assert!(counts.negative > 500 && counts.nan + counts.infinite == 0, "{counts:?}");
    let (counts, _) = count("2000.0");
    assert!(counts.over_range > 500 && counts.nan + counts.infinite + counts.negative == 0, "{counts:?}");
}

#[test]
fn radiance_that_the_shipped_shader_mends_is_marked_all_the_same() {
    let glowing = |strength: f32| {
        json!({
            "emissiveFactor": [1.0, 1.0, 1.0],
            "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": strength } },
        })
    };
    for (strength, is_marked) in [(1e6, true), (1e3, false)] {
        let Some(mut viewer) = ball(glowing(strength)) else { return };
        viewer.view.fault_limit = Some(65504.0);
        let counts = viewer.count_faults().expect("the device reads back").expect("the device counts");
        assert_eq!(counts.over_range > 500, is_marked, "{counts:?}");
        assert_eq!((counts.nan, counts.infinite, counts.negative), (0, 0, 0));
        let radiance = viewer.render_radiance().expect("the device reads back");
        let brightest = radiance.rgb.iter().copied().fold(0.0, f32::max);
        assert!(brightest <= 65504.0, "{brightest}: the picture itself holds what 16 bits hold");
    }
}

#[test]
fn what_cannot_be_shown_is_said_and_the_picture_stays() {
    let Some(gpu) = gpu() else { return };
    let mut viewer = HeadlessViewer::new(gpu, SIZE);
    let mut build = Build::ball(matte(0.5));
    let report = viewer.apply(&build.revision());
    assert_eq!(report.inspection.state, InspectionState::NotAsked);
    assert_eq!(report.inspection.refusal(Channel::Roughness), None, "it may be asked for");
    let lacking = report.inspection.refusal(Channel::Sheen).expect("no material has it");
    assert_eq!(lacking, "no material of this scene has sheen");
    let picture = viewer.render().expect("the device reads back");
    viewer.view.channel = Some(Channel::Roughness);
    assert_eq!(viewer.render().expect("the device reads back"), picture);
    // A shader whose author knows nothing of channels.
    build.target("inspect/shaders", "inspect", json!({ "shaders": [] }), &[]);
    let report = viewer.apply(&build.revision());
    let reason = report.inspection.refusal(Channel::Roughness).expect("the shader cannot");
    assert!(reason.contains("`shader.pbr` has no feature `inspect`"), "{reason}");
    assert_eq!(viewer.render().expect("the device reads back"), picture);
}

#[test]
fn variants_have_a_colour_each() {
    let coated = json!({ "extensions": { "KHR_materials_clearcoat": { "clearcoatFactor": 1.0 } } });
    let sphere =
        Sphere { material: matte(0.5), others: vec![(coated, [2.5, 0.0, 0.0], 1.0)], ..Sphere::default() };
    let Some(mut viewer) = viewer(&sphere) else { return };
    let variants = viewer.select(Selection::default()).inspection.variants;
    assert_eq!(variants.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["base", "clearcoat"]);
    for (pixel, expected) in [([80, 45], 0), ([130, 45], 1)] {
        let shown = value(&mut viewer, Channel::Variant, pixel).expect("a sphere is there");
        let off = |color: [f32; 3]| (0..3).map(|at| (shown[at] - color[at]).abs()).fold(0.0, f32::max);
        assert!(off(variants[expected].1) < 1e-3, "{shown:?}, {variants:?}");
        assert!(off(variants[1 - expected].1) > 0.2, "the two cannot be told apart: {variants:?}");
    }
}

#[test]
fn blended_surfaces_show_their_own_values() {
    let glass = |alpha: f32| {
        json!({ "alphaMode": "BLEND", "pbrMetallicRoughness": {
            "roughnessFactor": 0.75, "baseColorFactor": [1.0, 1.0, 1.0, alpha],
        } })
    };
    let Some(mut viewer) = ball(glass(0.25)) else { return };
    let roughness = value(&mut viewer, Channel::Roughness, ON_SPHERE).expect("the sphere is there");
    assert!((roughness[0] - 0.75).abs() < 1e-3, "{roughness:?} is mixed with what lies behind");
    let alpha = value(&mut viewer, Channel::Alpha, ON_SPHERE).expect("the sphere is there");
    assert!((alpha[0] - 0.25).abs() < 1e-3, "{alpha:?}");
}

#[test]
fn passes_of_a_frame_are_timed_where_the_device_has_clocks() {
    let Some(gpu) = gpu() else { return };
    let has_clocks = gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
    let Some(mut viewer) = viewer(&layered()) else { return };
    viewer.draw().expect("the device draws");
    let times = viewer.take_pass_times();
    assert_eq!(times.is_some(), has_clocks);
    let Some(times) = times else { return };
    let names: Vec<&str> = times.iter().map(|time| time.pass.as_str()).collect();
    assert_eq!(names, ["opaque", "downsample", "transmissive and blended", "tonemap"]);
    assert!(times.iter().all(|time| time.ms >= 0.0 && time.ms < 60_000.0), "{times:?}");
    assert!(times.iter().map(|time| time.ms).sum::<f64>() > 0.0, "{times:?}");
    assert_eq!(viewer.take_pass_times(), None, "once");
}

#[test]
fn every_encoding_has_a_channel() {
    use Encoding::{Color, Data, Direction, Level, Radiance, Uv};
    for encoding in [Color, Data, Direction, Level, Radiance, Uv] {
        assert!(Channel::ALL.iter().any(|channel| channel.encoding() == encoding), "{encoding:?}");
    }
}

#[test]
fn moving_frames_save_samples_then_pixels_as_far_as_they_are_slow_and_grow_whole_at_rest() {
    use std::time::{Duration, Instant};
    let whole = FrameQuality::WHOLE;
    let single = |scale| FrameQuality { scale, sample_count: 1 };
    let begin = Instant::now();
    let mut scaling = Scaling::new();
    scaling.change(begin);
    assert_eq!(scaling.quality(begin), whole, "nothing is known yet");
    scaling.note(whole, 10.0);
    assert_eq!(scaling.quality(begin), whole, "frames are fast enough");
    let mut scaling = Scaling::new();
    scaling.note(whole, 132.0);
    assert_eq!(scaling.quality(begin), whole, "nothing moves");
    scaling.change(begin);
    assert_eq!(scaling.quality(begin), single(0.5), "a quarter of the pixels takes a quarter of the time");
    scaling.note(single(0.5), 33.0);
    assert_eq!(scaling.quality(begin), single(0.5), "which is what it takes");
    for _ in 0..20 {
        scaling.note(single(0.5), 8.0);
    }
    assert_eq!(scaling.quality(begin), single(1.0), "one sample a pixel is fast enough");
    let rest = begin + scaling.rest_in(begin).expect("it moves");
    assert_eq!((scaling.quality(rest), scaling.rest_in(rest)), (whole, None));
    for _ in 0..20 {
        scaling.note(single(0.5), 1e6);
    }
    assert_eq!(scaling.quality(begin), single(0.25), "a picture must be left");
    scaling.forget();
    assert_eq!(scaling.quality(begin + Duration::from_millis(1)), whole);
}

#[test]
fn materials_say_which_variant_draws_them_and_why() {
    let coat = json!({ "clearcoatFactor": 0.5 });
    let coated = json!({ "name": "paint", "extensions": { "KHR_materials_clearcoat": coat } });
    let sphere = Sphere {
        material: matte(0.5),
        others: vec![(coated.clone(), [2.5, 0.0, 0.0], 1.0), (coated, [-2.5, 0.0, 0.0], 1.0)],
        ..Sphere::default()
    };
    let Some(mut viewer) = viewer(&sphere) else { return };
    let listed = viewer.select(Selection::default()).materials;
    let [plain, paint, ..] = &listed[..] else { panic!("{listed:?}") };
    assert_eq!((plain.variant.as_str(), plain.effects.len(), plain.draw_count), ("base", 0, 1));
    assert_eq!((paint.name.as_str(), paint.variant.as_str()), ("paint", "clearcoat"));
    assert_eq!(paint.effects, [(kiln_scene::Effect::Clearcoat, "clearcoatFactor 0.5".to_owned())]);
}
