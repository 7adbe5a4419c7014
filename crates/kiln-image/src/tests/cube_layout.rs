//! Layouts by direction: what a reader of each layout sees towards a direction is what the cube holds there.

use super::{Random, check_within};
use crate::cube_layout::{CubeLayout, Mirror, equirect, mirror, octahedral, sample, texel_direction, unfold};
use crate::{Cancel, Cancelled, Cube, CubePlacement, Layout, octahedral_direction, octahedral_uv};
use kiln_sphere::{cube_direction, cube_face_st, panorama_direction, panorama_uv};
use std::sync::atomic::AtomicI64;

/// A function that differs in every direction, and in each of its mirrors.
fn colour([x, y, z]: [f64; 3]) -> [f64; 3] {
    [2.0 + x + 0.3 * y * z, 2.0 + y + 0.2 * x, 2.0 + z - 0.25 * x * y]
}

fn cube(size: usize, f: impl Fn([f64; 3]) -> [f64; 3]) -> Cube {
    let mut rgb = Vec::new();
    for (face, y, x) in (0..6).flat_map(|f| (0..size).flat_map(move |y| (0..size).map(move |x| (f, y, x)))) {
        rgb.extend(f(texel_direction(size, face, x, y)).map(|value| value as f32));
    }
    Cube { face_size: size, rgb }
}

fn directions() -> Vec<[f64; 3]> {
    let mut random = Random(7);
    let mut directions: Vec<[f64; 3]> = (0..2000)
        .map(|_| {
            panorama_direction(random.unit(), libm::acos(1.0 - 2.0 * random.unit()) / std::f64::consts::PI)
        })
        .collect();
    directions.extend([
        [1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, -1.0],
        [0.577, 0.577, 0.578],
        [-0.7, 0.7, 0.0],
    ]);
    directions
}

fn worst(read: impl Fn([f64; 3]) -> [f64; 3]) -> f64 {
    let difference = |direction: [f64; 3]| {
        let (read, wanted) = (read(direction), colour(direction));
        read.iter().zip(wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    directions().into_iter().map(difference).fold(0.0, f64::max)
}

#[test]
fn crosses_and_strips_hold_each_texel_where_they_say() {
    let cube = cube(4, colour);
    for layout in CubeLayout::ALL {
        let image = unfold(&cube, layout);
        assert_eq!([image.width, image.height], layout.faces().map(|count| count * 4));
        let mut filled = 0;
        for (face, y, x) in (0..6).flat_map(|f| (0..4).flat_map(move |y| (0..4).map(move |x| (f, y, x)))) {
            let [column, row] = layout.placement(4).texel(face, x, y);
            assert_eq!(image.texel(column, row), cube.texel(face, x, y));
            filled += 1;
        }
        let black = image.rgb.chunks(3).filter(|texel| texel == &[0.0; 3]).count();
        assert_eq!(filled + black, image.width * image.height, "no texel twice");
    }
}

/// Largest difference between pixels side by side on the image, both of which belong to faces.
fn largest_step(image: &crate::Image) -> f32 {
    let mut largest = 0.0_f32;
    for (y, x) in (0..image.height - 1).flat_map(|y| (0..image.width - 1).map(move |x| (y, x))) {
        for [nx, ny] in [[x + 1, y], [x, y + 1]] {
            let (a, b) = (image.texel(x, y), image.texel(nx, ny));
            if a != [0.0; 3] && b != [0.0; 3] {
                largest = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(largest, f32::max);
            }
        }
    }
    largest
}

#[test]
fn neighbours_in_a_cross_continue_each_other_and_in_a_strip_do_not() {
    let cube = cube(32, colour);
    for layout in [CubeLayout::HorizontalCross, CubeLayout::VerticalCross] {
        assert!(largest_step(&unfold(&cube, layout)) < 0.1, "{layout:?}");
    }
    for layout in [CubeLayout::HorizontalStrip, CubeLayout::VerticalStrip] {
        assert!(largest_step(&unfold(&cube, layout)) > 0.5, "{layout:?}");
    }
}

#[test]
fn sampling_is_continuous_across_edges_and_right_everywhere() {
    let (coarse, fine) = (cube(16, colour), cube(64, colour));
    assert!(worst(|d| sample(&coarse, d)) < 0.08, "{}", worst(|d| sample(&coarse, d)));
    assert!(worst(|d| sample(&fine, d)) < 0.02, "{}", worst(|d| sample(&fine, d)));
    let constant = cube(3, |_| [0.75; 3]);
    for direction in directions() {
        sample(&constant, direction)
            .into_iter()
            .for_each(|value| check_within("constant", value, 0.75, 1e-12));
    }
    assert!(worst(|[x, y, z]| sample(&fine, [x, y, -z])) > 1.0, "the check itself");
}

/// Nearest texel of an image at (u, v).
fn nearest(image: &crate::Image, [u, v]: [f64; 2]) -> [f64; 3] {
    let index = |uv: f64, count: usize| ((uv * count as f64) as usize).min(count - 1);
    image.texel(index(u, image.width), index(v, image.height)).map(f64::from)
}

#[test]
fn octahedral_map_is_right_by_direction_and_a_turned_one_is_not() {
    for direction in directions() {
        let back = octahedral_uv(direction);
        assert!(back.iter().all(|uv| (0.0..=1.0).contains(uv)));
        let again = octahedral_direction(back[0], back[1]);
        let length = direction.iter().map(|v| v * v).sum::<f64>().sqrt();
        (0..3).for_each(|i| check_within("direction", again[i], direction[i] / length, 1e-12));
    }
    assert_eq!(octahedral_direction(0.5, 0.5), [0.0, 1.0, 0.0]);
    assert_eq!(octahedral_direction(1.0, 0.5), [1.0, 0.0, 0.0]);
    assert_eq!(octahedral_direction(0.5, 1.0), [0.0, 0.0, 1.0]);
    assert_eq!(octahedral_direction(0.0, 0.0), [0.0, -1.0, 0.0]);
    let map = octahedral(&cube(64, colour), 256, Cancel::NEVER).expect("nobody cancels");
    assert!(worst(|d| nearest(&map, octahedral_uv(d))) < 0.06);
    let turned = |d| octahedral_uv(d).map(|uv| 1.0 - uv);
    assert!(worst(|d| nearest(&map, turned(d))) > 1.0, "the check itself");
}

#[test]
fn panorama_is_right_by_direction_and_a_mirrored_one_is_not() {
    let map = equirect(&cube(64, colour), 128, Cancel::NEVER).expect("nobody cancels");
    assert_eq!((map.width, map.height), (256, 128));
    assert!(worst(|d| nearest(&map, panorama_uv(d))) < 0.06);
    let mirrored = |d| {
        let [u, v] = panorama_uv(d);
        [1.0 - u, v]
    };
    assert!(worst(|d| nearest(&map, mirrored(d))) > 1.0, "the check itself");
    assert_eq!(equirect(&cube(2, colour), 8, Cancel::countdown(&AtomicI64::new(3))), Err(Cancelled));
}

/// The texel a GPU takes without filtering.
fn point_sample(cube: &Cube, direction: [f64; 3]) -> [f64; 3] {
    let (face, st) = cube_face_st(direction);
    let index = st.map(|st| (((st + 1.0) * 0.5 * cube.face_size as f64) as usize).min(cube.face_size - 1));
    cube.texel(face, index[0], index[1]).map(f64::from)
}

#[test]
fn mirrors_show_the_mirrored_direction_exactly() {
    let source = cube(5, colour);
    for (which, flip) in [(Mirror::X, [-1.0, 1.0, 1.0]), (Mirror::Z, [1.0, 1.0, -1.0])] {
        let mirrored = mirror(&source, which);
        assert_eq!(mirror(&mirrored, which), source, "twice is nothing");
        for (face, y, x) in (0..6).flat_map(|f| (0..5).flat_map(move |y| (0..5).map(move |x| (f, y, x)))) {
            let direction = texel_direction(5, face, x, y);
            let flipped = [0, 1, 2].map(|i| direction[i] * flip[i]);
            assert_eq!(mirrored.texel(face, x, y).map(f64::from), point_sample(&source, flipped));
        }
    }
    assert_ne!(mirror(&source, Mirror::X), mirror(&source, Mirror::Z));
}

/// OpenEXR's rule (ImfEnvmap.cpp): direction at column and row of a face, in texel cells, both in −1 … 1.
fn openexr_direction(face: usize, column: f64, row: f64) -> [f64; 3] {
    match face {
        0 => [1.0, -row, column],
        1 => [-1.0, -row, -column],
        2 => [column, 1.0, -row],
        3 => [column, -1.0, row],
        4 => [-column, -row, 1.0],
        _ => [column, -row, -1.0],
    }
}

#[test]
fn openexr_faces_follow_the_rule_of_openexr() {
    let source = cube(5, colour);
    let column = CubePlacement::of(Layout::ExrCube, 5, 30).expect("a column").unfold(&source);
    for (face, y, x) in (0..6).flat_map(|f| (0..5).flat_map(move |y| (0..5).map(move |x| (f, y, x)))) {
        let centre = |index: usize| (2 * index + 1) as f64 / 5.0 - 1.0;
        // OpenEXR's +Z is our -Z, its +X our -X.
        let [dx, dy, dz] = openexr_direction(face, centre(x), centre(y));
        assert_eq!(column.texel(x, 5 * face + y).map(f64::from), point_sample(&source, [-dx, dy, -dz]));
    }
    let plain = cube_direction(0, 0.2, 0.4);
    assert_ne!(
        openexr_direction(0, 0.2, 0.4)[2].signum(),
        plain[2].signum(),
        "the check itself: +X is mirrored"
    );
}
