//! Numbers, without a device.

use glam::{Mat4, Vec3};
use kiln_scene::{Bounds, Image8};
use kiln_shader::Member;

use crate::OrbitCamera;
use crate::mip::{Average, smaller_levels};
use crate::uniform::{Value, draw_member, fill_block, long_type_name, material_member};

fn image(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> Image8 {
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    Image8 { width, height, rgba: texels.flat_map(|(x, y)| texel(x, y)).collect() }
}

#[test]
fn mips_of_a_checkerboard_have_half_the_light_not_half_the_code() {
    let board = image(4, 4, |x, y| [255 * ((x + y) % 2) as u8; 4]);
    let srgb = smaller_levels(&board, Average::Srgb);
    // 0.5 of the light is code 188; alpha is linear.
    assert_eq!(srgb[0].rgba[..4], [188, 188, 188, 128]);
    let linear = smaller_levels(&board, Average::Linear);
    assert_eq!(linear[0].rgba[..4], [128; 4]);
    assert_eq!((srgb.len(), srgb[1].width, srgb[1].height), (2, 1, 1));
}

#[test]
fn mips_keep_every_code_of_a_constant_image() {
    for code in 0..=255 {
        let constant = image(7, 3, |_, _| [code; 4]);
        for average in [Average::Srgb, Average::Linear] {
            for level in smaller_levels(&constant, average) {
                assert!(
                    level.rgba.iter().all(|&byte| byte == code),
                    "{average:?} {code} {:?}",
                    &level.rgba[..4]
                );
            }
        }
    }
}

#[test]
fn mips_of_odd_sizes_weigh_every_texel_equally() {
    // One bright texel of 3 × 1 carries a third wherever it is; dropping the last column would lose it.
    for bright in 0..3 {
        let row = image(3, 1, |x, _| [if x == bright { 255 } else { 0 }; 4]);
        assert_eq!(smaller_levels(&row, Average::Linear)[0].rgba, [85; 4]);
    }
    let levels = smaller_levels(&image(5, 7, |_, _| [9; 4]), Average::Linear);
    assert_eq!(levels.iter().map(|level| (level.width, level.height)).collect::<Vec<_>>(), [(2, 3), (1, 1)]);
}

#[test]
fn uniform_members_land_at_their_offsets_in_any_order() {
    let member = |name: &str, ty: &str, offset_bytes, size_bytes| Member {
        name: name.into(),
        ty: ty.into(),
        offset_bytes,
        size_bytes,
    };
    let members = [member("ior", "f32", 12, 4), member("emissive_factor", "vec3<f32>", 0, 12)];
    let material = kiln_scene::Material { emissive_factor: [1.0, 2.0, 3.0], ..crate::neutral::material() };
    let block = fill_block(32, &members, |name| material_member(&material, name));
    let floats: Vec<f32> = bytemuck::pod_collect_to_vec(&block);
    assert_eq!(floats, [1.0, 2.0, 3.0, 1.5, 0.0, 0.0, 0.0, 0.0]);
}

#[test]
fn uniform_member_past_the_block_is_left_out() {
    let member = Member { name: "ior".into(), ty: "f32".into(), offset_bytes: 30, size_bytes: 4 };
    let block = fill_block(32, &[member], |_| Some(Value::F32(1.0)));
    assert_eq!(block, [0; 32]);
}

#[test]
fn short_type_names_are_spelled_out() {
    let cases =
        [("vec3f", "vec3<f32>"), ("mat4x4f", "mat4x4<f32>"), ("vec4<f32>", "vec4<f32>"), ("f32", "f32")];
    for (short, long) in cases {
        assert_eq!(long_type_name(short), long);
    }
}

fn normal_of(world: Mat4, normal: Vec3) -> Vec3 {
    match draw_member(world, "world_from_object_normal") {
        Some(Value::Mat4(matrix)) => {
            Mat4::from_cols_array(&matrix).transform_vector3(normal).normalize_or_zero()
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn normal_matrix_is_the_inverse_transpose_and_keeps_sides_when_mirrored() {
    let world = Mat4::from_scale(Vec3::new(-2.0, 1.0, 0.5)) * Mat4::from_rotation_x(0.3);
    for normal in [Vec3::X, Vec3::new(1.0, 2.0, -3.0).normalize()] {
        let expected = world.inverse().transpose().transform_vector3(normal).normalize();
        let error = (normal_of(world, normal) - expected).length();
        assert!(error <= 1e-5, "{error}");
    }
}

#[test]
fn normal_matrix_of_a_flattened_object_is_finite_and_points_out_of_the_plane() {
    let flat = Mat4::from_scale(Vec3::new(1.0, 0.0, 1.0));
    assert_eq!(normal_of(flat, Vec3::Y), Vec3::Y);
    assert_eq!(normal_of(Mat4::ZERO, Vec3::Y), Vec3::Y);
}

/// Whether every corner of the box is inside the picture and between near and far.
fn sees_all(camera: OrbitCamera, bounds: Bounds, aspect: f32) -> bool {
    let clip = camera.clip_from_world(Some(bounds), aspect);
    (0..8).all(|corner| {
        let pick = |bit: u32, min: f32, max: f32| if corner & bit == 0 { min } else { max };
        let (min, max) = (bounds.min, bounds.max);
        let corner = Vec3::new(pick(1, min.x, max.x), pick(2, min.y, max.y), pick(4, min.z, max.z));
        let [x, y, z, w] = (clip * corner.extend(1.0)).to_array();
        w > 0.0 && x.abs() <= w && y.abs() <= w && z >= 0.0 && z <= w
    })
}

#[test]
fn framing_shows_every_corner_in_wide_and_tall_pictures_of_any_scale() {
    for scale in [1e-3, 1.0, 1e4] {
        for aspect in [0.3, 1.0, 16.0 / 9.0, 5.0] {
            let bounds =
                Bounds { min: Vec3::new(-1.0, 0.0, -3.0) * scale, max: Vec3::new(2.0, 0.5, 1.0) * scale };
            let camera = OrbitCamera::framing(bounds, aspect);
            assert!(sees_all(camera, bounds, aspect), "scale {scale}, aspect {aspect}: {camera:?}");
            let closer = OrbitCamera { distance: camera.distance * 0.6, ..camera };
            assert!(!sees_all(closer, bounds, aspect), "the check sees corners outside");
        }
    }
}

#[test]
fn empty_and_degenerate_scenes_have_a_finite_camera() {
    for bounds in [None, Some(Bounds { min: Vec3::ONE, max: Vec3::ONE })] {
        let camera = OrbitCamera::for_scene(bounds, &[], 0, 1.5);
        assert!(camera.clip_from_world(bounds, 1.5).is_finite(), "{camera:?}");
        assert!(camera.clip_from_world(bounds, 1.5).inverse().is_finite(), "{camera:?}");
    }
}

#[test]
fn camera_of_the_file_is_where_the_file_puts_it() {
    let world = Mat4::from_translation(Vec3::new(1.0, 2.0, 6.0))
        * Mat4::from_rotation_y(0.3)
        * Mat4::from_rotation_x(-0.2);
    let camera = kiln_scene::Camera {
        name: String::new(),
        world,
        yfov_rad: Some(0.7),
        znear: 0.1,
        zfar: None,
        ymag: None,
    };
    let bounds = Some(Bounds { min: -Vec3::ONE, max: Vec3::ONE });
    let orbit = OrbitCamera::for_scene(bounds, &[camera], 0, 1.0);
    let forward = (orbit.target - orbit.position()).normalize();
    assert!((orbit.position() - Vec3::new(1.0, 2.0, 6.0)).length() <= 1e-4, "{orbit:?}");
    assert!((forward + world.z_axis.truncate()).length() <= 1e-4, "{orbit:?}");
}

#[test]
fn camera_of_the_file_keeps_its_roll_its_size_and_the_way_straight_down() {
    let bounds = Some(Bounds { min: -Vec3::ONE, max: Vec3::ONE });
    let down = Mat4::from_rotation_x(-std::f32::consts::FRAC_PI_2);
    for (turn, roll) in [(Mat4::from_rotation_y(0.3), 0.4), (down, 0.0), (down, 1.1), (Mat4::IDENTITY, -2.0)]
    {
        let world = turn * Mat4::from_rotation_z(roll) * Mat4::from_translation(Vec3::new(0.0, 0.0, 7.0));
        for (yfov_rad, ymag) in [(Some(0.7), None), (None, Some(1.5))] {
            let camera =
                kiln_scene::Camera { name: String::new(), world, yfov_rad, znear: 0.1, zfar: None, ymag };
            let orbit = OrbitCamera::for_scene(bounds, &[camera], 0, 1.0);
            let clip = orbit.clip_from_world(bounds, 1.0);
            // Half way up the picture at the target, seen from the file's camera.
            let half = ymag.unwrap_or_else(|| 7.0 * 0.35_f32.tan());
            let up = clip.project_point3(world.y_axis.truncate() * half * 0.5);
            assert!((up.x.abs() <= 1e-4) && (up.y - 0.5).abs() <= 1e-4, "{up} with {orbit:?}");
            assert_eq!(orbit.is_orthographic, ymag.is_some());
        }
    }
}

#[test]
fn orbiting_over_the_pole_stops_short_of_it() {
    let mut camera = OrbitCamera::BACKGROUND_ONLY;
    camera.orbit(0.0, 100.0);
    assert!(camera.clip_from_world(None, 1.0).is_finite());
    camera.dolly(0.0);
    assert!(camera.distance > 0.0);
}
