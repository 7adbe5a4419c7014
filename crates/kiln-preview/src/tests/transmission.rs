//! What is seen through glass: the scene behind it, and the environment through the scene's gaps.

use image::{Rgba, RgbaImage};
use serde_json::{Value, json};

use super::effects::picture;
use super::fixture::{Build, SIX_COLORS, Sphere, gpu};
use super::frames::STEPS_MAX;
use crate::{Background, Ground, HeadlessViewer};

/// Glass of this index that reflects nothing.
fn glass(transmission: f32, ior: f32, roughness: f32) -> Value {
    json!({
        "pbrMetallicRoughness": { "metallicFactor": 0, "roughnessFactor": roughness },
        "extensions": {
            "KHR_materials_transmission": { "transmissionFactor": transmission },
            "KHR_materials_ior": { "ior": ior },
            "KHR_materials_specular": { "specularFactor": 0 },
        },
    })
}

/// Shows one colour whatever the light.
fn lamp(color: [f32; 3]) -> Value {
    let [red, green, blue] = color;
    json!({
        "pbrMetallicRoughness": { "baseColorFactor": [red, green, blue, 1.0] },
        "extensions": { "KHR_materials_unlit": {} },
    })
}

/// A sphere of glass, behind it a small one of its own colour.
fn before_a_lamp(glass: Value, faces: [[f32; 3]; 6]) -> Option<RgbaImage> {
    let sphere = Sphere {
        material: glass,
        others: vec![(lamp([1.0, 0.0, 0.0]), [0.0, 0.0, -3.0], 0.8)],
        ..Sphere::default()
    };
    picture(&sphere, faces)
}

fn is_red([red, green, blue, _]: [u8; 4]) -> bool {
    red > 150 && green < 60 && blue < 60
}

#[test]
fn what_stands_behind_glass_is_seen_through_it() {
    let Some(clear) = before_a_lamp(glass(1.0, 1.0, 0.0), SIX_COLORS) else { return };
    assert!(is_red(clear.get_pixel(160, 90).0), "{:?}", clear.get_pixel(160, 90));
    // Half of it is white plaster before dark glass.
    let half = before_a_lamp(glass(0.5, 1.0, 0.0), SIX_COLORS).expect("there is a device");
    assert!(!is_red(half.get_pixel(160, 90).0));
    let none = before_a_lamp(glass(0.0, 1.0, 0.0), SIX_COLORS).expect("there is a device");
    assert!(!is_red(none.get_pixel(160, 90).0), "{:?}", none.get_pixel(160, 90));
}

#[test]
fn thin_clear_glass_is_invisible() {
    let Some(with) = before_a_lamp(glass(1.0, 1.0, 0.0), SIX_COLORS) else { return };
    let far_away = Sphere {
        material: lamp([1.0, 0.0, 0.0]),
        others: vec![(lamp([1.0, 0.0, 0.0]), [0.0, 0.0, -3.0], 0.8)],
        scale: Some([1e-3; 3]),
        ..Sphere::default()
    };
    let without = picture(&far_away, SIX_COLORS).expect("there is a device");
    let differing = |a: &RgbaImage, b: &RgbaImage| {
        let differs = |(a, b): &(&Rgba<u8>, &Rgba<u8>)| (0..3).any(|at| a[at].abs_diff(b[at]) > STEPS_MAX);
        a.pixels().zip(b.pixels()).filter(differs).count()
    };
    // Reads between texels differ from samples of them at the lamp's rim, a circle of some 130 pixels, and where cube faces meet.
    assert!(differing(&with, &without) < 400, "{}", differing(&with, &without));
    let tinted = before_a_lamp(glass(0.9, 1.0, 0.0), SIX_COLORS).expect("there is a device");
    assert!(differing(&tinted, &without) > 2000, "{}", differing(&tinted, &without));
}

#[test]
fn rough_glass_blurs_what_stands_behind() {
    let colours_along_the_middle = |roughness| {
        // An index of 1 would not blur.
        let picture = before_a_lamp(glass(1.0, 1.5, roughness), [[0.0; 3]; 6])?;
        let mut values: Vec<u8> = (120..200).map(|x| picture.get_pixel(x, 90)[0]).collect();
        values.sort_unstable();
        values.dedup();
        Some(values.len())
    };
    let Some(sharp) = colours_along_the_middle(0.0) else { return };
    let blurred = colours_along_the_middle(0.5).expect("there is a device");
    assert!(blurred > 2 * sharp, "{blurred} shades of red, without blur {sharp}");
}

#[test]
fn white_furnace_hides_glass_of_any_roughness_before_white_things() {
    for roughness in [0.0, 0.3, 1.0] {
        let sphere = Sphere {
            material: glass(1.0, 1.0, roughness),
            others: vec![(lamp([0.5; 3]), [0.3, 0.2, -2.0], 0.5)],
            ..Sphere::default()
        };
        let Some(picture) = picture(&sphere, [[0.5; 3]; 6]) else { return };
        let first = *picture.get_pixel(0, 0);
        let spread = picture.pixels().map(|pixel| pixel[0].abs_diff(first[0])).max();
        assert!(spread <= Some(STEPS_MAX), "roughness {roughness}: {spread:?}");
    }
}

#[test]
fn scene_without_glass_draws_no_picture_for_it() {
    let reads = |material| {
        let mut viewer = HeadlessViewer::new(gpu()?, [16, 9]);
        let glb = Sphere { material, ..Sphere::default() }.glb();
        let mut build = Build::new();
        build.shaders_of(&glb).lut().env("sky", SIX_COLORS).scene("ball", "sky", glb);
        viewer.apply(&build.revision());
        Some(viewer.draws_scene_color())
    };
    assert_ne!(reads(glass(0.0, 1.5, 0.0)), Some(true));
    assert_ne!(reads(glass(1.0, 1.5, 0.0)), Some(false));
}

#[test]
fn frame_of_one_sample_a_pixel_is_that_of_several_but_for_its_edges() {
    let Some(gpu) = gpu() else { return };
    let lamp = (lamp([1.0, 0.0, 0.0]), [0.0, 0.0, -3.0], 0.8);
    let sphere = Sphere { material: glass(1.0, 1.5, 0.0), others: vec![lamp], ..Sphere::default() };
    let mut build = Build::new();
    let glb = sphere.glb();
    build.env("six", SIX_COLORS).lut().shaders_of(&glb).scene("ball", "six", glb);
    let mut viewer = HeadlessViewer::new(gpu.clone(), [320, 180]);
    assert_eq!(viewer.apply(&build.revision()).diagnostics, vec![]);
    for (background, ground) in [
        (Background::Environment, Ground::default()),
        (Background::Checker, Ground { has_grid: true, catches_shadow: true }),
    ] {
        (viewer.view.background, viewer.view.ground) = (background, ground);
        let several = viewer.render().expect("the device reads back");
        let mut single = HeadlessViewer::new(gpu.clone(), [320, 180]);
        single.draw_single_samples();
        single.apply(&build.revision());
        single.view = viewer.view.clone();
        let one = single.render().expect("the device reads back");
        assert_eq!(gpu.take_errors(), Vec::<String>::new());
        let differs = |(a, b): &(&Rgba<u8>, &Rgba<u8>)| (0..3).any(|at| a[at].abs_diff(b[at]) > STEPS_MAX);
        let count = several.pixels().zip(one.pixels()).filter(differs).count();
        // Rims of two spheres, seen and refracted, and the lines of a grid.
        assert!((50..4000).contains(&count), "{background:?}: {count} pixels differ");
    }
}
