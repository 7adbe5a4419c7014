//! The extracted sun: as strong as a directional light, and behind what stands before it.

use std::f32::consts::FRAC_PI_2;
use std::f64::consts::PI;

use glam::{DVec3, Mat4, Vec3, Vec4};
use kiln_bake::{Cancel, SunRequest, extract_sun};
use kiln_image::{Image, Panorama};
use kiln_sphere::panorama_direction;
use serde_json::{Value, json};

use super::fixture::{Build, Sphere, gpu};
use crate::{HeadlessViewer, OrbitCamera};

const SIZE: [u32; 2] = [320, 180];
const BLACK: [[f32; 3]; 6] = [[0.0; 3]; 6];
/// The sun's disc from Earth, in radians.
const DIAMETER: f64 = 0.0093;

/// Down on the ground, from in front.
const ABOVE: OrbitCamera = OrbitCamera {
    target: Vec3::ZERO,
    distance: 9.0,
    yaw_rad: 0.3,
    pitch_rad: 0.9,
    field_of_view_rad: 0.7,
    ..OrbitCamera::BACKGROUND_ONLY
};
const BALL: Vec3 = Vec3::new(0.0, 1.0, 0.0);
const RADIUS: f32 = 0.6;

fn matte() -> Value {
    json!({ "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 },
        "extensions": { "KHR_materials_specular": { "specularFactor": 0.0 } } })
}

/// A white disc of radius 5 at height 0, with a ball above.
fn ball_over_ground() -> Vec<u8> {
    let others = vec![(matte(), BALL.to_array(), RADIUS)];
    Sphere { material: matte(), scale: Some([5.0, 1e-3, 5.0]), others, ..Sphere::default() }.glb()
}

fn ground() -> Vec<u8> {
    Sphere { material: matte(), scale: Some([5.0, 1e-3, 5.0]), ..Sphere::default() }.glb()
}

fn towards(elevation: f32, azimuth: f32) -> Vec3 {
    Vec3::new(elevation.cos() * azimuth.sin(), elevation.sin(), elevation.cos() * azimuth.cos())
}

fn viewer(glb: Vec<u8>, sun: Option<Vec3>) -> Option<HeadlessViewer> {
    let mut build = Build::new();
    build.shaders_of(&glb).sunlit_shaders_of(&glb).lut().env("sky", BLACK).scene("scene", "sky", glb);
    if let Some(sun) = sun {
        build.sun("sky", sun.as_dvec3().to_array(), [3.0; 3], DIAMETER);
    }
    let mut viewer = HeadlessViewer::new(gpu()?, SIZE);
    let report = viewer.apply(&build.revision());
    assert_eq!((report.diagnostics, report.notes), (vec![], vec![]));
    viewer.view.camera = Some(ABOVE);
    Some(viewer)
}

fn radiance(viewer: &mut HeadlessViewer) -> Image {
    let picture = viewer.render_radiance().expect("the device reads back");
    assert_eq!(viewer.gpu().take_errors(), Vec::<String>::new());
    picture
}

fn red(picture: &Image, [x, y]: [usize; 2]) -> f32 {
    picture.rgb[3 * (y * picture.width + x)]
}

/// Eye and direction through a pixel's middle.
fn ray(camera: OrbitCamera, [x, y]: [usize; 2]) -> (Vec3, Vec3) {
    let world_from_clip: Mat4 = camera.clip_from_world(None, SIZE[0] as f32 / SIZE[1] as f32).inverse();
    let at = |pixel: usize, size: u32| 2.0 * (pixel as f32 + 0.5) / size as f32 - 1.0;
    let far = world_from_clip * Vec4::new(at(x, SIZE[0]), -at(y, SIZE[1]), 1.0, 1.0);
    let eye = camera.position();
    (eye, (far.truncate() / far.w - eye).normalize())
}

fn pixels() -> impl Iterator<Item = [usize; 2]> {
    (0..SIZE[1] as usize).flat_map(|y| (0..SIZE[0] as usize).map(move |x| [x, y]))
}

/// The ray through a pixel and where it meets the ground.
fn on_ground(pixel: [usize; 2]) -> ((Vec3, Vec3), Vec3) {
    let (eye, direction) = ray(ABOVE, pixel);
    ((eye, direction), eye - direction * (eye.y / direction.y))
}

/// How far a line passes from the ball's middle.
fn distance_of_ball(from: Vec3, direction: Vec3) -> f32 {
    (BALL - from).cross(direction).length()
}

/// Pixels of the ground that are dark where `sun` reaches or lit where it does not, and how many are dark.
fn faults(picture: &Image, sun: Vec3) -> (usize, usize) {
    /// Half a pixel and what the filter is wide, in the world.
    const EDGE: f32 = 0.04;
    let (mut wrong, mut dark) = (0, 0);
    for pixel in pixels() {
        let ((eye, direction), place) = on_ground(pixel);
        if place.length() > 4.9 || distance_of_ball(eye, direction) < RADIUS + EDGE {
            continue;
        }
        let shadow = distance_of_ball(place, sun);
        let value = red(picture, pixel);
        let (is_dark, is_lit) = (value == 0.0, value > 0.3);
        dark += usize::from(is_dark);
        wrong += usize::from((shadow < RADIUS - EDGE && !is_dark) || (shadow > RADIUS + EDGE && !is_lit));
    }
    (wrong, dark)
}

#[test]
fn ball_throws_its_shadow_where_geometry_says() {
    let sun = towards(0.8, 2.0);
    let Some(mut viewer) = viewer(ball_over_ground(), Some(sun)) else { return };
    let picture = radiance(&mut viewer);
    let (wrong, dark) = faults(&picture, sun);
    assert_eq!(wrong, 0, "of {dark} dark pixels");
    assert!(dark > 300, "{dark}");
    assert!(faults(&picture, towards(0.8, 2.3)).0 > 50, "the check sees a sun that stands elsewhere");
}

#[test]
fn rotation_of_the_environment_turns_the_shadow() {
    let sun = towards(0.8, 2.0);
    let Some(mut viewer) = viewer(ball_over_ground(), Some(sun)) else { return };
    assert_eq!(faults(&radiance(&mut viewer), sun).0, 0);
    viewer.view.environment_rotation_rad = FRAC_PI_2;
    let picture = radiance(&mut viewer);
    assert_eq!(faults(&picture, towards(0.8, 2.0 + FRAC_PI_2)).0, 0);
    assert!(faults(&picture, sun).0 > 50);
}

#[test]
fn without_a_sun_nothing_is_bound_and_no_pass_drawn() {
    let Some(mut dark) = viewer(ball_over_ground(), None) else { return };
    assert!(radiance(&mut dark).rgb.iter().all(|value| *value == 0.0));
    assert!(!dark.draws_shadow());
    let mut lit = viewer(ball_over_ground(), Some(Vec3::Y)).expect("there is a device");
    radiance(&mut lit);
    assert!(lit.draws_shadow());
}

/// The scene under a directional light of 3 lux, which nothing shadows.
fn under_lamp(mut sphere: Sphere, sun: Vec3, camera: OrbitCamera) -> Option<Image> {
    let turn = glam::Quat::from_rotation_arc(Vec3::Z, sun);
    let light = json!({ "type": "directional", "intensity": 3.0 });
    sphere.lights = vec![(light, json!({ "rotation": turn.to_array() }))];
    let mut viewer = viewer(sphere.glb(), None)?;
    viewer.view.camera = Some(camera);
    Some(radiance(&mut viewer))
}

/// Largest difference in units of the largest value, where `other` is lit at all.
fn difference(one: &Image, other: &Image) -> f32 {
    let largest = other.rgb.iter().copied().fold(0.0, f32::max);
    let differences = one.rgb.iter().zip(&other.rgb).map(|(one, other)| (one - other).abs());
    differences.fold(0.0, f32::max) / largest
}

#[test]
fn sun_lights_a_sphere_as_a_directional_light_of_its_irradiance() {
    let sun = towards(0.5, 0.4);
    let camera = OrbitCamera { distance: 4.0, pitch_rad: 0.2, ..ABOVE };
    for roughness in [0.3, 1.0] {
        let material =
            json!({ "pbrMetallicRoughness": { "metallicFactor": 0.5, "roughnessFactor": roughness } });
        let sphere = || Sphere { material: material.clone(), ..Sphere::default() };
        let Some(expected) = under_lamp(sphere(), sun, camera) else { return };
        let mut lit = viewer(sphere().glb(), Some(sun)).expect("there is a device");
        lit.view.camera = Some(camera);
        let error = difference(&radiance(&mut lit), &expected);
        assert!(error <= 0.01, "roughness {roughness}: {error}");
        lit.view.environment_intensity = 1.03;
        assert!(difference(&radiance(&mut lit), &expected) > 0.01, "the check sees another flux");
    }
}

#[test]
fn grazing_sun_leaves_no_acne_on_a_plane() {
    for elevation in [0.02, 0.1, 0.3, 1.2] {
        let sun = towards(elevation, 0.7);
        let plane = Sphere { material: matte(), scale: Some([5.0, 1e-3, 5.0]), ..Sphere::default() };
        let Some(expected) = under_lamp(plane, sun, ABOVE) else { return };
        let mut lit = viewer(ground(), Some(sun)).expect("there is a device");
        let lit = radiance(&mut lit);
        let largest = expected.rgb.iter().copied().fold(0.0, f32::max);
        let on_ground = pixels().filter(|pixel| on_ground(*pixel).1.length() < 4.9);
        let error =
            on_ground.map(|at| (red(&lit, at) - red(&expected, at)).abs() / largest).fold(0.0, f32::max);
        assert!(error <= 0.01, "elevation {elevation}: {error}");
    }
}

/// A panorama of 64 × 32 texels: a sky that brightens upwards, and a sun of about 6°.
fn sky_with_sun(sun: Vec3) -> Panorama {
    let mut rgb = Vec::new();
    for (row, column) in (0..32).flat_map(|row| (0..64).map(move |column| (row, column))) {
        let at = |index: usize, count: usize| (index as f64 + 0.5) / count as f64;
        let [x, y, z] = panorama_direction(at(column, 64), at(row, 32));
        let cosine = sun.as_dvec3().dot(DVec3::new(x, y, z));
        let light = if cosine > 0.05_f64.cos() { 400.0 } else { 0.4 + 0.3 * y };
        rgb.extend([light as f32; 3]);
    }
    Panorama::new(Image { width: 64, height: 32, rgb }).expect("twice as wide as high")
}

/// Irradiance over π towards each texel of a cube, texel by texel.
fn irradiance(panorama: &Panorama, size: usize) -> Vec<[f32; 3]> {
    let (width, height) = (panorama.width(), panorama.height());
    let texel = |index: usize| {
        let at = |index: usize, count: usize| (index as f64 + 0.5) / count as f64;
        let direction = panorama_direction(at(index % width, width), at(index / width, height));
        let rows = [index / width, index / width + 1].map(|row| (PI * row as f64 / height as f64).cos());
        let flux = f64::from(panorama.rgb()[3 * index]) * (rows[0] - rows[1]) * 2.0 * PI / width as f64;
        (DVec3::from(direction), flux)
    };
    let texels: Vec<(DVec3, f64)> = (0..width * height).map(texel).collect();
    let towards = |index: usize| {
        let at = |index: usize| 2.0 * (index as f64 + 0.5) / size as f64 - 1.0;
        let [u, v] = [at(index % size), at(index / size % size)];
        let normal = kiln_sphere::cube_direction(index / (size * size), u, v);
        let sum: f64 =
            texels.iter().map(|(direction, flux)| flux * direction.dot(normal.into()).max(0.0)).sum();
        [(sum / PI) as f32; 3]
    };
    (0..6 * size * size).map(towards).collect()
}

#[test]
fn sky_with_its_sun_kept_and_extracted_light_a_rough_sphere_alike() {
    const SIZE: usize = 32;
    let sky = sky_with_sun(towards(0.7, 0.4));
    let taken = extract_sun(&sky, &SunRequest::USUAL, Cancel::NEVER).expect("nobody cancels");
    let taken = taken.expect("there is a sun");
    let glb = Sphere { material: matte(), ..Sphere::default() }.glb();
    let picture = |panorama: &Panorama, has_sun: bool| {
        let mut build = Build::new();
        build.sunlit_shaders_of(&glb).lut().env("sky", BLACK).scene("scene", "sky", glb.clone());
        build.cube_of("env/sky/irradiance", SIZE as u32, &irradiance(panorama, SIZE));
        if has_sun {
            build.sun("sky", taken.sun.direction, taken.sun.irradiance, taken.sun.angular_diameter);
        }
        let mut viewer = HeadlessViewer::new(gpu()?, [160, 160]);
        assert_eq!(viewer.apply(&build.revision()).diagnostics, vec![]);
        viewer.view.camera = Some(OrbitCamera { distance: 3.2, yaw_rad: 0.4, pitch_rad: 0.7, ..ABOVE });
        Some(radiance(&mut viewer))
    };
    let Some(kept) = picture(&sky, false) else { return };
    let extracted = picture(&taken.remaining, true).expect("there is a device");
    // Where the sun stands low over the surface its disc, here of 6°, sets bit by bit, and texels of 3° are wider still.
    let error = difference(&extracted, &kept);
    assert!(error <= 0.03, "{error}");
    let missing = picture(&taken.remaining, false).expect("there is a device");
    assert!(difference(&missing, &kept) > 0.3, "the check sees that there is no sun");
}

/// How much of the ground is dark under a ball of this material.
fn dark_under(material: Value) -> Option<usize> {
    let sun = towards(0.8, 2.0);
    let others = vec![(material, BALL.to_array(), RADIUS)];
    let glb = Sphere { material: matte(), scale: Some([5.0, 1e-3, 5.0]), others, ..Sphere::default() }.glb();
    let picture = radiance(&mut viewer(glb, Some(sun))?);
    Some(faults(&picture, sun).1)
}

#[test]
fn masked_and_blended_and_clear_balls_cast_the_shadow_of_what_is_opaque_of_them() {
    let with_alpha = |mode: &str, alpha: f64| {
        let mut material = matte();
        material["pbrMetallicRoughness"]["baseColorFactor"] = json!([1, 1, 1, alpha]);
        material["alphaMode"] = json!(mode);
        material
    };
    let Some(whole) = dark_under(with_alpha("MASK", 0.7)) else { return };
    assert_eq!(Some(whole), dark_under(matte()));
    assert!(whole > 300, "{whole}");
    assert_eq!(dark_under(with_alpha("MASK", 0.3)), Some(0), "all of it is discarded");
    assert_eq!(dark_under(with_alpha("BLEND", 0.9)), Some(0));
    let mut glass = matte();
    glass["extensions"]["KHR_materials_transmission"] = json!({ "transmissionFactor": 1.0 });
    assert_eq!(dark_under(glass), Some(0));
}

#[test]
fn sun_that_no_variant_reads_is_said_and_one_that_is_no_light_is_a_fault() {
    let Some(gpu) = gpu() else { return };
    let glb = ground();
    let mut build = Build::new();
    build.shaders_of(&glb).lut().env("sky", BLACK).scene("scene", "sky", glb.clone());
    let mut viewer = HeadlessViewer::new(gpu, SIZE);
    build.sun("sky", [0.0, 1.0, 0.0], [3.0; 3], DIAMETER);
    let report = viewer.apply(&build.revision());
    assert!(
        report.notes.iter().any(|note| note.starts_with("the sun that was taken out of env/sky")),
        "{:?}",
        report.notes
    );
    build.sun("sky", [0.0; 3], [3.0; 3], DIAMETER);
    let report = viewer.apply(&build.revision());
    assert_eq!(report.diagnostics.len(), 1, "{:?}", report.diagnostics);
    let none = json!({ "light": null, "reason": "the panorama is black" }).to_string().into_bytes();
    build.target("env/sky/sun", "light", json!({}), &[("json", none)]);
    let report = viewer.apply(&build.revision());
    assert_eq!((report.diagnostics, report.notes), (vec![], vec![]));
}
