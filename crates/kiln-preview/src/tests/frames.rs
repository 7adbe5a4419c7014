//! Pictures that physics predicts.

use std::f32::consts::FRAC_PI_2;

use image::{Rgb, RgbaImage};
use serde_json::json;

use super::fixture::{Build, SIX_COLORS, gpu};
use crate::{HeadlessViewer, OrbitCamera};

/// Straight from the front, far enough for a sphere of radius 1 to fill half the height.
pub(super) const FRONT: OrbitCamera =
    OrbitCamera { distance: 4.0, field_of_view_rad: 0.9, ..OrbitCamera::BACKGROUND_ONLY };

/// Two steps of 255: rounding of f16 maps, of the f16 picture, and of the output.
pub(super) const STEPS_MAX: u8 = 2;

fn furnace_material(metallic: f32, base_color: f32) -> serde_json::Value {
    json!({ "pbrMetallicRoughness": {
        "metallicFactor": metallic, "roughnessFactor": 0.7, "baseColorFactor": [base_color, base_color, base_color, 1.0],
    } })
}

/// The picture of a sphere in an environment of radiance 0.5 from everywhere.
fn furnace(material: serde_json::Value) -> Option<RgbaImage> {
    let mut viewer = HeadlessViewer::new(gpu()?, [160, 90]);
    let mut build = Build::ball(material);
    let report = viewer.apply(&build.env("sky", [[0.5; 3]; 6]).revision());
    assert_eq!((report.diagnostics, report.notes), (vec![], vec![]));
    viewer.view.camera = Some(FRONT);
    Some(viewer.render().expect("the device reads back"))
}

/// Largest difference of any channel of any pixel from the first pixel.
fn spread(picture: &RgbaImage) -> u8 {
    let first = *picture.get_pixel(0, 0);
    let difference = |pixel: &image::Rgba<u8>| (0..3).map(|i| pixel[i].abs_diff(first[i])).max().unwrap_or(0);
    picture.pixels().map(difference).max().unwrap_or(u8::MAX)
}

#[test]
fn white_furnace_hides_a_white_rough_metal() {
    let Some(picture) = furnace(furnace_material(1.0, 1.0)) else { return };
    assert!(spread(&picture) <= STEPS_MAX, "spread {}", spread(&picture));
    assert!((150..220).contains(&picture.get_pixel(80, 45)[0]), "grey {:?}", picture.get_pixel(80, 45));
}

#[test]
fn white_furnace_hides_a_white_rough_dielectric() {
    let Some(picture) = furnace(furnace_material(0.0, 1.0)) else { return };
    assert!(spread(&picture) <= STEPS_MAX, "spread {}", spread(&picture));
}

#[test]
fn white_furnace_check_sees_a_metal_that_absorbs() {
    let Some(picture) = furnace(furnace_material(1.0, 0.9)) else { return };
    assert!(spread(&picture) > 2 * STEPS_MAX, "spread {}", spread(&picture));
}

/// Names the face of [`SIX_COLORS`] that a pixel shows.
pub(super) fn face_at(picture: &RgbaImage, x: u32, y: u32) -> &'static str {
    const NAMES: [&str; 6] = ["+X", "-X", "+Y", "-Y", "+Z", "-Z"];
    let pixel = picture.get_pixel(x, y);
    let lit = [0, 1, 2].map(|channel| pixel[channel] > 100);
    let face = SIX_COLORS.iter().position(|color| color.map(|value| value > 0.0) == lit);
    face.map_or("none", |face| NAMES[face])
}

fn mirror_viewer() -> Option<HeadlessViewer> {
    let mirror = json!({ "pbrMetallicRoughness": { "metallicFactor": 1.0, "roughnessFactor": 0.0 } });
    let mut viewer = HeadlessViewer::new(gpu()?, [320, 180]);
    let report = viewer.apply(&Build::ball(mirror).revision());
    assert_eq!((report.diagnostics, report.notes), (vec![], vec![]));
    viewer.view.camera = Some(FRONT);
    Some(viewer)
}

#[test]
fn mirror_sphere_and_background_show_the_faces_where_they_are() {
    let Some(mut viewer) = mirror_viewer() else { return };
    let picture = viewer.render().expect("the device reads back");
    // The sphere spans about 93 pixels around (160, 90); 3/4 of its radius reflects sideways.
    assert_eq!(face_at(&picture, 160, 90), "+Z", "the sphere's middle looks back at the camera");
    assert_eq!(face_at(&picture, 195, 90), "+X", "the sphere's right reflects what is right");
    assert_eq!(face_at(&picture, 125, 90), "-X", "the sphere's left reflects what is left");
    assert_eq!(face_at(&picture, 160, 55), "+Y", "the sphere's top reflects what is above");
    assert_eq!(face_at(&picture, 160, 125), "-Y", "the sphere's bottom reflects what is below");
    assert_eq!(face_at(&picture, 160, 20), "-Z", "the background above the sphere is what is ahead");
    viewer.view.camera = Some(OrbitCamera { field_of_view_rad: 1.9, ..FRONT });
    let picture = viewer.render().expect("the device reads back");
    assert_eq!(face_at(&picture, 315, 90), "+X", "a wide view sees the right side");
    assert_eq!(face_at(&picture, 5, 90), "-X", "a wide view sees the left side");
    assert_eq!(face_at(&picture, 160, 2), "+Y", "a wide view sees the top");
}

#[test]
fn turning_the_environment_by_a_quarter_brings_the_right_side_ahead() {
    let Some(mut viewer) = mirror_viewer() else { return };
    viewer.view.environment_rotation_rad = FRAC_PI_2;
    let picture = viewer.render().expect("the device reads back");
    assert_eq!(face_at(&picture, 160, 20), "+X");
    assert_eq!(face_at(&picture, 160, 90), "-X");
}

#[test]
fn power_of_two_scale_of_a_cube_is_undone() {
    let Some(gpu) = gpu() else { return };
    let mut viewer = HeadlessViewer::new(gpu, [8, 8]);
    let mut build = Build::new();
    build.shaders(&[&[]]).env("sky", [[0.25; 3]; 6]);
    viewer.apply(&build.revision());
    let plain = *viewer.render().expect("the device reads back").get_pixel(4, 4);
    build.cube("env/sky/skybox", 4, 3, 10, [[0.25 / 1024.0; 3]; 6]);
    viewer.apply(&build.revision());
    assert_eq!(*viewer.render().expect("the device reads back").get_pixel(4, 4), plain);
}

#[test]
fn packed_texels_are_shown_as_what_they_stand_for() {
    let Some(gpu) = gpu() else { return };
    let mut viewer = HeadlessViewer::new(gpu, [8, 8]);
    let mut build = Build::new();
    build.shaders(&[&[]]).env("sky", [[0.25, 0.5, 0.125]; 6]);
    viewer.apply(&build.revision());
    let plain = *viewer.render().expect("the device reads back").get_pixel(4, 4);
    let texel = kiln_image::texel::rgb9e5::encode([0.25, 0.5, 0.125]);
    let other = kiln_image::texel::rgb9e5::encode([0.25, 0.125, 0.5]);
    for (texel, is_same) in [(texel, true), (other, false)] {
        let meta = json!({ "size": 4, "levels": 1, "format": "rgb9e5" });
        let texels = texel.repeat(6 * 4 * 4);
        viewer.apply(&build.target("env/sky/skybox", "cube", meta, &[("mip0", texels)]).revision());
        let shown = *viewer.render().expect("the device reads back").get_pixel(4, 4);
        assert_eq!(shown == plain, is_same, "{shown:?} for {plain:?}");
    }
}

#[test]
fn exposure_of_one_stop_doubles_radiance() {
    let Some(gpu) = gpu() else { return };
    let mut viewer = HeadlessViewer::new(gpu, [8, 8]);
    let mut build = Build::new();
    build.shaders(&[&[]]).env("sky", [[0.25; 3]; 6]);
    viewer.apply(&build.revision());
    viewer.view.exposure_ev = 1.0;
    let brighter = *viewer.render().expect("the device reads back").get_pixel(4, 4);
    viewer.view.exposure_ev = 0.0;
    viewer.apply(&build.env("sky", [[0.5; 3]; 6]).revision());
    assert_eq!(*viewer.render().expect("the device reads back").get_pixel(4, 4), brighter);
}

#[test]
fn sun_beyond_half_range_stays_white_and_finite() {
    let Some(gpu) = gpu() else { return };
    let mut viewer = HeadlessViewer::new(gpu, [8, 8]);
    let mut build = Build::new();
    build.shaders(&[&[]]).env("sky", [[0.25; 3]; 6]);
    build.cube("env/sky/skybox", 4, 3, 20, [[1000.0; 3]; 6]);
    viewer.apply(&build.revision());
    let pixel = viewer.render().expect("the device reads back").get_pixel(4, 4).0;
    assert!(pixel[..3].iter().all(|&channel| channel >= 253), "{pixel:?}");
}

#[test]
fn colours_of_an_unlit_material_reach_the_picture_unlit() {
    let Some(gpu) = gpu() else { return };
    let unlit = json!({
        "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.25, 0.125, 1.0] },
        "extensions": { "KHR_materials_unlit": {} },
    });
    let mut build = Build::ball(unlit);
    build.shaders(&[&["unlit"]]);
    let mut viewer = HeadlessViewer::new(gpu, [64, 64]);
    viewer.view.camera = Some(FRONT);
    let report = viewer.apply(&build.revision());
    assert_eq!(report.diagnostics, vec![]);
    let in_six_colors = *viewer.render().expect("the device reads back").get_pixel(32, 32);
    viewer.apply(&build.env("sky", [[4.0; 3]; 6]).revision());
    assert_eq!(*viewer.render().expect("the device reads back").get_pixel(32, 32), in_six_colors);
    let Rgb([red, green, blue]) = Rgb([in_six_colors[0], in_six_colors[1], in_six_colors[2]]);
    assert!(red > green && green > blue && blue > 20, "{in_six_colors:?}");
}
