//! What a view has behind the scene and below it.

use glam::Vec3;
use kiln_image::Image;
use serde_json::json;

use super::fixture::{Build, SIX_COLORS, Sphere, gpu};
use super::frames::FRONT;
use crate::{Background, Ground, HeadlessViewer, OrbitCamera};

const SIZE: [u32; 2] = [320, 180];

fn viewer(sun: Option<[f64; 3]>) -> Option<HeadlessViewer> {
    let material = json!({ "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 } });
    let glb = Sphere { material, ..Sphere::default() }.glb();
    let mut build = Build::new();
    build.shaders_of(&glb).sunlit_shaders_of(&glb).lut().env("sky", SIX_COLORS).scene("ball", "sky", glb);
    if let Some(sun) = sun {
        build.sun("sky", sun, [2.0; 3], 0.01);
    }
    let mut viewer = HeadlessViewer::new(gpu()?, SIZE);
    assert_eq!(viewer.apply(&build.revision()).diagnostics, vec![]);
    viewer.view.camera = Some(FRONT);
    Some(viewer)
}

fn radiance(viewer: &mut HeadlessViewer) -> Image {
    let picture = viewer.render_radiance().expect("the device reads back");
    assert_eq!(viewer.gpu().take_errors(), Vec::<String>::new());
    picture
}

fn texel(picture: &Image, [x, y]: [usize; 2]) -> [f32; 3] {
    let at = 3 * (y * picture.width + x);
    [picture.rgb[at], picture.rgb[at + 1], picture.rgb[at + 2]]
}

#[test]
fn background_of_one_colour_is_that_colour_at_any_exposure_and_leaves_the_scene() {
    let Some(mut viewer) = viewer(None) else { return };
    let before = radiance(&mut viewer);
    viewer.view.background = "#ff8000".parse().expect("a colour");
    for exposure_ev in [0.0, 2.0, -3.0] {
        viewer.view.exposure_ev = exposure_ev;
        let picture = radiance(&mut viewer);
        let seen = texel(&picture, [5, 5]).map(|value| value * exposure_ev.exp2());
        for (value, expected) in seen.into_iter().zip([1.0, 0.21586, 0.0]) {
            assert!((value - expected).abs() <= 2e-3, "{seen:?} at {exposure_ev}");
        }
        assert_eq!(texel(&picture, [160, 90]), texel(&before, [160, 90]), "the ball is lit as before");
    }
    assert_ne!(texel(&before, [5, 5]), [1.0, 0.21586, 0.0]);
}

#[test]
fn checker_has_squares_of_two_greys() {
    let Some(mut viewer) = viewer(None) else { return };
    viewer.view.background = Background::Checker;
    let picture = radiance(&mut viewer);
    let [first, right, below, across] = [[8, 8], [24, 8], [8, 24], [24, 24]].map(|at| texel(&picture, at));
    assert_eq!((first, right), (across, below));
    assert!((first[0] - 0.3185).abs() < 1e-3 && (right[0] - 0.1329).abs() < 1e-3, "{first:?} {right:?}");
}

#[test]
fn backgrounds_and_grounds_are_read_from_words() {
    assert_eq!("environment".parse(), Ok(Background::Environment));
    assert_eq!("checker".parse(), Ok(Background::Checker));
    assert_eq!("#000000".parse(), Ok(Background::Color([0.0; 3])));
    for wrong in ["", "sky", "#12345", "#1234567", "#+12345", "#ééé"] {
        assert!(wrong.parse::<Background>().is_err(), "{wrong}");
    }
    let both = Ground { has_grid: true, catches_shadow: true };
    assert_eq!(["none".parse(), "grid+shadow".parse()], [Ok(Ground::default()), Ok(both)]);
    assert!("grid shadow".parse::<Ground>().is_err());
}

/// Down on the ground under the ball, which is at height -1.
const ABOVE: OrbitCamera = OrbitCamera { distance: 12.0, pitch_rad: 0.8, ..FRONT };

/// The pixel that shows a place of the world.
fn pixel_of(place: Vec3) -> [usize; 2] {
    let clip = ABOVE.clip_from_world(None, SIZE[0] as f32 / SIZE[1] as f32) * place.extend(1.0);
    let at = |value: f32, size: u32| ((0.5 + 0.5 * value) * size as f32) as usize;
    [at(clip.x / clip.w, SIZE[0]), at(-clip.y / clip.w, SIZE[1])]
}

#[test]
fn grid_has_lines_each_metre_below_a_thing_of_some_metres_and_fades() {
    let Some(mut viewer) = viewer(None) else { return };
    viewer.view.camera = Some(ABOVE);
    viewer.view.background = Background::Color([0.0; 3]);
    let bare = radiance(&mut viewer);
    viewer.view.ground.has_grid = true;
    let picture = radiance(&mut viewer);
    let seen = |x: f32, z: f32| texel(&picture, pixel_of(Vec3::new(x, -1.0, z)))[0];
    assert!(seen(2.0, 2.5) > 0.05 && seen(2.5, 2.0) > 0.05, "{} {}", seen(2.0, 2.5), seen(2.5, 2.0));
    assert!(seen(2.5, 2.5) < 0.01 && seen(3.5, 1.5) < 0.01, "{} {}", seen(2.5, 2.5), seen(3.5, 1.5));
    let middle = [160, 90];
    assert_eq!(texel(&picture, middle), texel(&bare, middle), "the ball hides it");
}

#[test]
fn ground_catches_the_shadow_of_the_sun_alone() {
    let sun = glam::DVec3::new(0.8, 1.0, 0.0).normalize();
    let Some(mut viewer) = viewer(Some(sun.to_array())) else { return };
    viewer.view.camera = Some(ABOVE);
    viewer.view.background = Background::Color([0.5; 3]);
    let bare = radiance(&mut viewer);
    viewer.view.ground.catches_shadow = true;
    let picture = radiance(&mut viewer);
    let kept = |place: Vec3| {
        let at = pixel_of(place);
        texel(&picture, at)[0] / texel(&bare, at)[0]
    };
    // The ball's middle, moved along the light to the ground.
    let shadow = kept(Vec3::new(-0.8, -1.0, 0.0));
    // The six colours' green face is above: its red irradiance is none of what the map has towards +Y.
    assert!(shadow < 0.1, "{shadow}");
    assert_eq!(kept(Vec3::new(2.5, -1.0, 0.5)), 1.0);
    let mut sunless = self::viewer(None).expect("there is a device");
    sunless.view = viewer.view.clone();
    let caught = radiance(&mut sunless);
    sunless.view.ground = Ground::default();
    assert!(caught == radiance(&mut sunless), "without a sun there is no shadow");
}

#[test]
fn orthographic_camera_sees_as_much_near_as_far_and_roll_turns_the_picture() {
    let Some(mut viewer) = viewer(None) else { return };
    viewer.view.background = Background::Color([0.0; 3]);
    let half_height = |camera: OrbitCamera| FRONT.distance * (camera.field_of_view_rad / 2.0).tan();
    let flat = OrbitCamera { is_orthographic: true, ..FRONT };
    let mut lit = |camera: OrbitCamera| {
        viewer.view.camera = Some(camera);
        let picture = radiance(&mut viewer);
        (0..180).filter(|y| texel(&picture, [160, *y]) != [0.0; 3]).count() as f32
    };
    let rows = lit(flat);
    assert!((rows - 180.0 / half_height(flat)).abs() <= 2.0, "{rows}");
    assert!(lit(FRONT) > rows + 1.0, "the near side of a ball looks larger in perspective");
    viewer.view.camera = Some(OrbitCamera { roll_rad: std::f32::consts::FRAC_PI_2, ..FRONT });
    viewer.view.background = Background::Environment;
    let (rolled, straight) = (radiance(&mut viewer), {
        viewer.view.camera = Some(FRONT);
        radiance(&mut viewer)
    });
    // The ball's right side is lit red; and what is right goes down when the picture turns clockwise.
    assert!(texel(&straight, [200, 90])[0] > texel(&straight, [120, 90])[0]);
    assert!(texel(&rolled, [160, 130])[0] > texel(&rolled, [160, 50])[0]);
}
