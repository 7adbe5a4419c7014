//! What anisotropy, iridescence, volume, dispersion and diffuse transmission do to a sphere.

use std::f32::consts::FRAC_PI_2;

use image::{Rgba, RgbaImage};
use serde_json::{Value, json};

use super::fixture::{Build, SIX_COLORS, Sphere, gpu};
use super::frames::{FRONT, STEPS_MAX, face_at};
use crate::HeadlessViewer;

/// Radiance 0.5 from everywhere.
const FURNACE: [[f32; 3]; 6] = [[0.5; 3]; 6];

/// A material with these extensions of `KHR_materials_…`.
fn material(metallic: f32, roughness: f32, extensions: Value) -> Value {
    let named = extensions.as_object().expect("extensions have names").iter();
    let named: serde_json::Map<String, Value> =
        named.map(|(name, values)| (format!("KHR_materials_{name}"), values.clone())).collect();
    json!({ "pbrMetallicRoughness": { "metallicFactor": metallic, "roughnessFactor": roughness }, "extensions": named })
}

/// The sphere's picture with the variant that its values call for.
pub(super) fn picture(sphere: &Sphere, faces: [[f32; 3]; 6]) -> Option<RgbaImage> {
    let mut viewer = HeadlessViewer::new(gpu()?, [320, 180]);
    let glb = sphere.glb();
    let mut build = Build::new();
    build.shaders_of(&glb).lut().env("sky", faces).scene("ball", "sky", glb);
    let report = viewer.apply(&build.revision());
    assert_eq!(report.diagnostics, vec![]);
    viewer.view.camera = Some(FRONT);
    Some(viewer.render().expect("the device reads back"))
}

fn plain(material: Value) -> Sphere {
    Sphere { material, ..Sphere::default() }
}

/// What the sphere's middle shows.
fn middle(picture: &RgbaImage) -> [u8; 3] {
    let Rgba([red, green, blue, _]) = *picture.get_pixel(160, 90);
    [red, green, blue]
}

/// Largest difference of any channel of any pixel.
fn difference(a: &RgbaImage, b: &RgbaImage) -> u8 {
    a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(u8::MAX)
}

#[test]
fn extension_without_effect_leaves_every_pixel_as_it_is() {
    let Some(without) = picture(&plain(material(0.0, 0.5, json!({}))), SIX_COLORS) else { return };
    let nothing = json!({
        "anisotropy": { "anisotropyStrength": 0, "anisotropyRotation": 1 },
        "iridescence": { "iridescenceFactor": 0, "iridescenceIor": 2 },
        "volume": { "thicknessFactor": 0, "attenuationColor": [0, 0, 0], "attenuationDistance": 1 },
        "dispersion": { "dispersion": 5 },
        "diffuse_transmission": { "diffuseTransmissionFactor": 0 },
    });
    let with = picture(&plain(material(0.0, 0.5, nothing)), SIX_COLORS).expect("there is a device");
    assert!(with == without);
    let something = json!({ "diffuse_transmission": { "diffuseTransmissionFactor": 0.5 } });
    let with = picture(&plain(material(0.0, 0.5, something)), SIX_COLORS).expect("there is a device");
    assert!(with != without, "the check sees an effect");
}

/// Where mirror directions go on a brushed metal, above and right of the sphere's middle.
fn brushed(anisotropy: Value, texels: Vec<[u8; 4]>) -> Option<[&'static str; 2]> {
    let material = material(1.0, 0.0, json!({ "anisotropy": anisotropy }));
    let picture = picture(&Sphere { material, texels, ..Sphere::default() }, SIX_COLORS)?;
    Some([face_at(&picture, 160, 55), face_at(&picture, 195, 90)])
}

#[test]
fn brush_spreads_reflections_along_itself() {
    // Normals that tilt along the brush reflect as if they faced the eye.
    let Some(eastwards) = brushed(json!({ "anisotropyStrength": 1 }), vec![]) else { return };
    assert_eq!(eastwards, ["+Y", "+Z"]);
    let northwards = brushed(json!({ "anisotropyStrength": 1, "anisotropyRotation": FRAC_PI_2 }), vec![]);
    assert_eq!(northwards, Some(["+Z", "+X"]));
    assert_eq!(brushed(json!({ "anisotropyStrength": 0 }), vec![]), Some(["+Y", "+X"]));
}

#[test]
fn brush_texture_gives_direction_and_strength() {
    let textured = || json!({ "anisotropyStrength": 1, "anisotropyTexture": { "index": 0 } });
    let Some(north) = brushed(textured(), vec![[128, 255, 255, 255]]) else { return };
    assert_eq!(north, ["+Z", "+X"]);
    assert_eq!(brushed(textured(), vec![[255, 128, 255, 255]]), Some(["+Y", "+Z"]));
    assert_eq!(brushed(textured(), vec![[255, 128, 1, 255]]), Some(["+Y", "+X"]), "hardly any strength");
}

/// Difference between the largest and smallest channel of the sphere's middle in white light.
fn chroma(extensions: Value) -> Option<u8> {
    let middle = middle(&picture(&plain(material(1.0, 0.2, extensions)), FURNACE)?);
    Some(middle.into_iter().max()? - middle.into_iter().min()?)
}

#[test]
fn film_colours_a_grey_metal_in_white_light() {
    let Some(bare) = chroma(json!({})) else { return };
    assert!(bare <= STEPS_MAX, "{bare}");
    let grey = |thickness: f64| json!({ "iridescence": { "iridescenceFactor": 1, "iridescenceIor": 1.8, "iridescenceThicknessMaximum": thickness } });
    let film = |thickness| {
        let mut metal = material(1.0, 0.2, grey(thickness));
        metal["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.5, 0.5, 0.5, 1.0]);
        middle(&picture(&plain(metal), FURNACE).expect("there is a device"))
    };
    let (thin, thick) = (film(250.0), film(400.0));
    for [red, green, blue] in [thin, thick] {
        let spread = red.max(green).max(blue) - red.min(green).min(blue);
        assert!(spread > 10 * STEPS_MAX, "{thin:?} {thick:?}");
    }
    assert!((0..3).any(|channel| thin[channel].abs_diff(thick[channel]) > 10), "{thin:?} {thick:?}");
}

/// Red glass, `thickness` deep in the object's units.
fn glass(thickness: f64, scale: Option<[f32; 3]>) -> Option<[u8; 3]> {
    let material = material(
        0.0,
        0.0,
        json!({ "transmission": { "transmissionFactor": 1 },
            "volume": { "thicknessFactor": thickness, "attenuationDistance": 1, "attenuationColor": [1, 0.5, 0.25] } }),
    );
    Some(middle(&picture(&Sphere { material, scale, ..Sphere::default() }, FURNACE)?))
}

#[test]
fn medium_absorbs_by_its_thickness_in_the_world() {
    let (Some(clear), Some(one), Some(two)) = (glass(0.0, None), glass(1.0, None), glass(2.0, None)) else {
        return;
    };
    assert!(clear[0] - clear[2] <= STEPS_MAX, "{clear:?}");
    assert!(one[0] > one[1] && one[1] > one[2], "{one:?}");
    assert!(one[1] > two[1] && one[2] > two[2], "{one:?} {two:?}");
    // Seen from +Z: what counts is how deep the object is stretched there.
    for (scale, thickness) in [([2.0; 3], 1.0), ([0.5, 0.5, 2.0], 1.0), ([3.0, 3.0, 1.0], 2.0)] {
        let scaled = glass(thickness, Some(scale)).expect("there is a device");
        let error = (0..3).map(|channel| scaled[channel].abs_diff(two[channel])).max();
        assert!(error <= Some(STEPS_MAX), "{scale:?}: {scaled:?} {two:?}");
    }
}

#[test]
fn dispersion_parts_colours_where_directions_differ_and_nowhere_else() {
    let prism = |dispersion: f64| {
        plain(material(
            0.0,
            0.0,
            json!({ "transmission": { "transmissionFactor": 1 }, "volume": { "thicknessFactor": 1 },
                "dispersion": { "dispersion": dispersion } }),
        ))
    };
    // White before black: what lies between the edges of red, green and blue is coloured.
    let mut half = [[0.5; 3]; 6];
    half[5] = [0.0; 3];
    let (Some(without), Some(with)) = (picture(&prism(0.0), half), picture(&prism(5.0), half)) else {
        return;
    };
    let coloured = |picture: &RgbaImage| {
        let is_coloured = |pixel: &&Rgba<u8>| pixel[0].abs_diff(pixel[2]) > 20;
        picture.pixels().filter(is_coloured).count()
    };
    assert_eq!(coloured(&without), 0);
    assert!(coloured(&with) > 40, "{}", coloured(&with));
    let furnace = |dispersion| picture(&prism(dispersion), FURNACE).expect("there is a device");
    assert!(difference(&furnace(5.0), &furnace(0.0)) <= STEPS_MAX);
}

#[test]
fn leaf_before_a_light_glows_in_its_own_colour() {
    let leaf = |extensions| {
        let mut behind = [[0.0; 3]; 6];
        behind[5] = [0.5; 3];
        picture(&plain(material(0.0, 1.0, extensions)), behind).map(|picture| middle(&picture))
    };
    let Some(opaque) = leaf(json!({})) else { return };
    assert!(opaque.into_iter().max() <= Some(20), "{opaque:?}");
    let color = json!({ "diffuseTransmissionFactor": 1, "diffuseTransmissionColorFactor": [0.1, 1, 0.4] });
    let [red, green, blue] = leaf(json!({ "diffuse_transmission": color })).expect("there is a device");
    assert!(green > blue && blue > red && green > 100, "{:?}", [red, green, blue]);
}

/// Both spheres must look alike, and unlike the third.
#[track_caller]
fn check_texture_is_factor(texel: [u8; 4], textured: Value, by_factor: Value, unlike: Value) {
    let draw = |extensions, texels| {
        let material = material(0.0, 0.3, extensions);
        picture(&Sphere { material, texels, ..Sphere::default() }, SIX_COLORS)
    };
    let Some(textured) = draw(textured, vec![texel]) else { return };
    let by_factor = draw(by_factor, vec![]).expect("there is a device");
    let error = difference(&textured, &by_factor);
    assert!(error <= STEPS_MAX, "{error}");
    let unlike = draw(unlike, vec![]).expect("there is a device");
    assert!(difference(&textured, &unlike) > 2 * STEPS_MAX, "the texture does nothing");
}

#[test]
fn texture_of_thickness_of_film_is_read_between_its_bounds() {
    let film = |minimum: f64, maximum: f64| json!({ "iridescenceFactor": 1, "iridescenceThicknessMinimum": minimum, "iridescenceThicknessMaximum": maximum });
    let mut textured = film(200.0, 455.0);
    textured["iridescenceThicknessTexture"] = json!({ "index": 0 });
    let named = |film: Value| json!({ "iridescence": film });
    check_texture_is_factor(
        [9, 51, 9, 255],
        named(textured),
        named(film(0.0, 251.0)),
        named(film(200.0, 455.0)),
    );
}

#[test]
fn texture_of_film_dims_it_by_red() {
    let film = |factor: f64| json!({ "iridescenceFactor": factor, "iridescenceIor": 2.0 });
    let mut textured = film(1.0);
    textured["iridescenceTexture"] = json!({ "index": 0 });
    let named = |film: Value| json!({ "iridescence": film });
    check_texture_is_factor([51, 255, 255, 255], named(textured), named(film(0.2)), named(film(1.0)));
}

#[test]
fn texture_of_thickness_thins_a_medium_by_green() {
    let medium = |thickness: f64| {
        json!({ "transmission": { "transmissionFactor": 1 }, "volume":
            { "thicknessFactor": thickness, "attenuationDistance": 1, "attenuationColor": [0.3, 0.5, 0.2] } })
    };
    let mut textured = medium(2.0);
    textured["volume"]["thicknessTexture"] = json!({ "index": 0 });
    check_texture_is_factor([255, 51, 255, 255], textured, medium(0.4), medium(2.0));
}

#[test]
fn textures_of_diffuse_transmission_give_share_by_alpha_and_colour() {
    let leaf = |share: f64, red: f64| {
        json!({ "diffuse_transmission":
            { "diffuseTransmissionFactor": share, "diffuseTransmissionColorFactor": [red, 1, 1] } })
    };
    let mut shared = leaf(1.0, 1.0);
    shared["diffuse_transmission"]["diffuseTransmissionTexture"] = json!({ "index": 0 });
    check_texture_is_factor([0, 0, 0, 51], shared, leaf(0.2, 1.0), leaf(1.0, 1.0));
    let mut colored = leaf(1.0, 1.0);
    colored["diffuse_transmission"]["diffuseTransmissionColorTexture"] = json!({ "index": 0 });
    // sRGB code 124 is 0.2 in linear light.
    check_texture_is_factor([124, 255, 255, 0], colored, leaf(1.0, 0.2), leaf(1.0, 1.0));
}
