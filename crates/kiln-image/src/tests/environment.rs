//! Environments in every arrangement, compared by direction.

use super::check_within;
use crate::{
    Cancel, Cube, CubePlacement, DecodeError, DecodedEnvironment, Environment, Image, Layout, Limits,
    decode_environment, environment_from_faces, octahedral_direction, octahedral_uv,
};
use exr::prelude::{Encoding, Layer, LayerAttributes, SpecificChannels, Vec2, WritableImage};
use kiln_sphere::{cube_direction, panorama_direction};

const FACE: usize = 8;

type Vector = [f64; 3];

/// A smooth function that no symmetry of the cube leaves as it is.
fn light([x, y, z]: Vector) -> [f32; 3] {
    [(2.0 + x + 0.3 * y * z) as f32, (2.0 + y + 0.3 * z * x) as f32, (2.0 + z + 0.3 * x * y * y) as f32]
}

fn normalised(v: Vector) -> Vector {
    let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
    v.map(|c| c / length)
}

fn image(width: usize, height: usize, texel: impl Fn(usize, usize) -> [f32; 3]) -> Image {
    let texels = (0..width * height).flat_map(|index| texel(index % width, index / width));
    Image::new(width, height, texels.collect()).expect("values fit")
}

/// An EXR of binary32 texels: nothing is rounded.
pub(super) fn exr(image: &Image) -> Vec<u8> {
    let channels = SpecificChannels::rgb(|at: Vec2<usize>| {
        let [r, g, b] = image.texel(at.0, at.1);
        (r, g, b)
    });
    let size = (image.width, image.height);
    let layer = Layer::new(size, LayerAttributes::named("main"), Encoding::UNCOMPRESSED, channels);
    let mut bytes = std::io::Cursor::new(Vec::new());
    exr::image::Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).expect("to memory");
    bytes.into_inner()
}

fn open(image: &Image, layout: Option<Layout>) -> Result<DecodedEnvironment, DecodeError> {
    decode_environment(&exr(image), layout, &Limits::default(), Cancel::NEVER)
}

fn centre(size: usize, index: usize) -> f64 {
    (2 * index + 1) as f64 / size as f64 - 1.0
}

/// The largest difference between a cube and [`light`] at its texels' centres.
fn cube_error(cube: &Cube) -> f64 {
    let size = cube.face_size;
    let texels = (0..6 * size * size).map(|i| (i / (size * size), i % size, i / size % size));
    let error = texels.map(|(face, x, y)| {
        let wanted = light(cube_direction(face, centre(size, x), centre(size, y)));
        let pairs = cube.texel(face, x, y).into_iter().zip(wanted);
        pairs.map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
    });
    error.fold(0.0, f64::max)
}

fn cube_of(decoded: &DecodedEnvironment) -> &Cube {
    match &decoded.environment {
        Environment::Cube(cube) => cube,
        Environment::Panorama(_) => panic!("{:?} is no cube", decoded.layout),
    }
}

/// What a face of an unfolded cube shows: forwards, to the right, downwards.
#[derive(Clone, Copy)]
struct Frame([Vector; 3]);

const FRONT: Frame = Frame([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]);

impl Frame {
    /// The square beside this one, after turning over their common edge.
    fn step(self, dx: i32, dy: i32) -> Frame {
        let minus = |v: Vector| v.map(|c| -c);
        let Frame([forwards, right, down]) = self;
        Frame(match (dx, dy) {
            (1, 0) => [right, minus(forwards), down],
            (-1, 0) => [minus(right), forwards, down],
            (0, 1) => [down, right, minus(forwards)],
            (0, -1) => [minus(down), right, forwards],
            _ => panic!("one step at a time"),
        })
    }

    fn direction(self, s: f64, t: f64) -> Vector {
        let Frame([forwards, right, down]) = self;
        normalised([0, 1, 2].map(|i| forwards[i] + s * right[i] + t * down[i]))
    }
}

/// A cross painted by unfolding the cube from its front at (1, 1): it knows nothing of faces' orientations.
fn cross(columns: usize, rows: usize) -> Image {
    let (up, down) = (FRONT.step(0, -1), FRONT.step(0, 1));
    let mut squares = vec![
        ([1, 1], FRONT),
        ([0, 1], FRONT.step(-1, 0)),
        ([2, 1], FRONT.step(1, 0)),
        ([1, 0], up),
        ([1, 2], down),
    ];
    squares.push(match columns {
        4 => ([3, 1], FRONT.step(1, 0).step(1, 0)),
        _ => ([1, 3], down.step(0, 1)),
    });
    image(columns * FACE, rows * FACE, |x, y| {
        let frame = squares.iter().find(|(square, _)| *square == [x / FACE, y / FACE]);
        let place = (centre(FACE, x % FACE), centre(FACE, y % FACE));
        frame.map_or([0.0; 3], |(_, frame)| light(frame.direction(place.0, place.1)))
    })
}

fn strip(columns: usize, rows: usize) -> Image {
    image(columns * FACE, rows * FACE, |x, y| {
        let face = x / FACE + y / FACE;
        light(cube_direction(face, centre(FACE, x % FACE), centre(FACE, y % FACE)))
    })
}

fn mirrored(source: &Image) -> Image {
    image(source.width, source.height, |x, y| source.texel(source.width - 1 - x, y))
}

/// One square turned by 180°.
fn with_turned_square(source: &Image, square: [usize; 2]) -> Image {
    image(source.width, source.height, |x, y| {
        if [x / FACE, y / FACE] == square {
            let turned = |index: usize, square: usize| square * FACE + FACE - 1 - index % FACE;
            source.texel(turned(x, square[0]), turned(y, square[1]))
        } else {
            source.texel(x, y)
        }
    })
}

#[test]
fn crosses_unfold_to_the_cube_and_mirrored_or_turned_ones_do_not() {
    for (columns, rows, last) in [(4, 3, [3, 1]), (3, 4, [1, 3])] {
        let cross = cross(columns, rows);
        let decoded = open(&cross, None).expect("a cross");
        assert_eq!(decoded.layout, Layout::CubeCross);
        assert!(decoded.notes[0].contains("cube-cross, told from its shape"), "{:?}", decoded.notes);
        check_within("cross", cube_error(cube_of(&decoded)), 0.0, 1e-6);
        for wrong in [mirrored(&cross), with_turned_square(&cross, last)] {
            assert!(cube_error(cube_of(&open(&wrong, None).expect("a cross"))) > 0.5);
        }
    }
}

#[test]
fn strips_are_faces_in_order_and_exchanged_ones_are_seen() {
    for (columns, rows) in [(6, 1), (1, 6)] {
        let strip = strip(columns, rows);
        let decoded = open(&strip, None).expect("a strip");
        assert_eq!((decoded.layout, cube_of(&decoded).face_size), (Layout::CubeStrip, FACE));
        check_within("strip", cube_error(cube_of(&decoded)), 0.0, 1e-6);
        assert!(
            cube_error(cube_of(&open(&with_turned_square(&strip, [0, 0]), None).expect("a strip"))) > 0.5
        );
    }
}

#[test]
fn exr_cube_is_turned_half_round_and_its_faces_mirrored() {
    // ImfEnvmap's directions, negated in x and z.
    let exr_direction = |face: usize, s: f64, t: f64| {
        let [x, y, z] =
            [[1.0, -t, s], [-1.0, -t, -s], [s, 1.0, -t], [s, -1.0, t], [-s, -t, 1.0], [s, -t, -1.0]][face];
        normalised([-x, y, -z])
    };
    let column =
        image(FACE, 6 * FACE, |x, y| light(exr_direction(y / FACE, centre(FACE, x), centre(FACE, y % FACE))));
    let decoded = open(&column, Some(Layout::ExrCube)).expect("a column");
    check_within("EXR cube", cube_error(cube_of(&decoded)), 0.0, 1e-6);
    assert!(
        cube_error(cube_of(&open(&column, None).expect("a strip"))) > 0.5,
        "KTX2's orientation is another"
    );
}

fn six_files(size: usize) -> [Vec<u8>; 6] {
    std::array::from_fn(|face| {
        exr(&image(size, size, |x, y| light(cube_direction(face, centre(size, x), centre(size, y)))))
    })
}

fn from_files(files: &[Vec<u8>; 6]) -> Result<DecodedEnvironment, DecodeError> {
    environment_from_faces(files.each_ref().map(Vec::as_slice), &Limits::default(), Cancel::NEVER)
}

#[test]
fn six_files_of_any_size_make_a_cube_and_exchanged_ones_another() {
    for size in [1, 5, 8] {
        let mut files = six_files(size);
        let decoded = from_files(&files).expect("six squares");
        assert_eq!(decoded.layout, Layout::Cube);
        check_within("six files", cube_error(cube_of(&decoded)), 0.0, 1e-6);
        files.swap(0, 1);
        assert!(cube_error(cube_of(&from_files(&files).expect("six squares"))) > 0.5);
    }
}

#[test]
fn wrong_face_is_named() {
    let mut files = six_files(4);
    files[3] = exr(&image(4, 5, |_, _| [1.0; 3]));
    let error = from_files(&files).expect_err("a face that is no square").to_string();
    assert!(error.starts_with("face -Y:") && error.contains("4 × 5, where 4 × 4 is due"), "{error}");
    files[3] = b"no picture".to_vec();
    assert!(from_files(&files).expect_err("no picture").to_string().starts_with("face -Y: neither"));
}

#[test]
fn octahedral_corners_edges_and_centre_look_where_they_are_said_to() {
    for (uv, wanted) in [
        ([0.5, 0.5], [0.0, 1.0, 0.0]),
        ([1.0, 0.5], [1.0, 0.0, 0.0]),
        ([0.5, 0.0], [0.0, 0.0, -1.0]),
        ([0.0, 0.0], [0.0, -1.0, 0.0]),
        ([1.0, 1.0], [0.0, -1.0, 0.0]),
    ] {
        let direction = octahedral_direction(uv[0], uv[1]);
        direction.into_iter().zip(wanted).for_each(|(a, b)| check_within("direction", a, b, 1e-12));
    }
    for index in 0..1000 {
        let uv = [(index % 40) as f64 / 40.0 + 0.0125, (index / 40) as f64 / 25.0 + 0.02];
        let back = octahedral_uv(octahedral_direction(uv[0], uv[1]));
        back.into_iter().zip(uv).for_each(|(a, b)| check_within("uv", a, b, 1e-12));
    }
}

fn panorama_error(environment: &Environment) -> f64 {
    let Environment::Panorama(panorama) = environment else { panic!("no panorama") };
    let (width, height) = (panorama.width(), panorama.height());
    let texels = (0..width * height).map(|i| (i % width, i / width));
    let error = texels.map(|(x, y)| {
        let centre = |index: usize, length: usize| (index as f64 + 0.5) / length as f64;
        let wanted = light(panorama_direction(centre(x, width), centre(y, height)));
        let pairs = panorama.texel(x, y).into_iter().zip(wanted);
        pairs.map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
    });
    error.fold(0.0, f64::max)
}

#[test]
fn octahedral_map_becomes_the_panorama_it_shows_and_a_transposed_one_does_not() {
    const SIZE: usize = 64;
    let map = image(SIZE, SIZE, |x, y| {
        light(octahedral_direction((x as f64 + 0.5) / SIZE as f64, (y as f64 + 0.5) / SIZE as f64))
    });
    let decoded = open(&map, Some(Layout::Octahedral)).expect("a square");
    assert!(decoded.notes.iter().any(|note| note.contains("resampled to a panorama of 128 × 64")));
    // A patch's edge is up to 1.5 texels of π/64 from the direction asked for, and the light's slope below 1.4.
    assert!(panorama_error(&decoded.environment) <= 0.06, "{}", panorama_error(&decoded.environment));
    let transposed = image(SIZE, SIZE, |x, y| map.texel(y, x));
    let wrong = open(&transposed, Some(Layout::Octahedral)).expect("a square");
    assert!(panorama_error(&wrong.environment) > 0.5);
}

/// A lamp of one texel keeps its flux: resampling weighs by area.
#[test]
fn octahedral_lamp_keeps_its_flux() {
    const SIZE: usize = 32;
    for (lamp_x, lamp_y) in [(16, 16), (25, 9), (31, 0), (3, 17)] {
        let map = image(SIZE, SIZE, |x, y| if (x, y) == (lamp_x, lamp_y) { [1000.0; 3] } else { [0.0; 3] });
        let decoded = open(&map, Some(Layout::Octahedral)).expect("a square");
        let report =
            crate::limit_radiance(&mut decoded.clone(), f32::MAX, Cancel::NEVER).expect("not cancelled");
        // |d(direction)/d(u, v)| = 4 / |p|³ with p before it is normalised.
        let (mut wanted, steps) = (0.0, 64);
        for index in 0..steps * steps {
            let at =
                |lamp: usize, step: usize| (lamp as f64 + (step as f64 + 0.5) / steps as f64) / SIZE as f64;
            let direction = octahedral_direction(at(lamp_x, index % steps), at(lamp_y, index / steps));
            let norm = 1.0 / direction.iter().map(|c| c.abs()).sum::<f64>();
            wanted += 4.0 / (norm * norm * norm) / ((steps * steps * SIZE * SIZE) as f64);
        }
        let ratio = report.flux_before[0] / (1000.0 * wanted);
        check_within(&format!("flux over that of the lamp at {lamp_x}, {lamp_y}"), ratio, 1.0, 0.01);
    }
}

#[test]
fn constant_octahedral_map_stays_constant() {
    for size in [1, 2, 31] {
        let decoded =
            open(&image(size, size, |_, _| [0.1, 1.0, 65504.0]), Some(Layout::Octahedral)).expect("square");
        let Environment::Panorama(panorama) = decoded.environment else { panic!("no panorama") };
        assert!(panorama.rgb().chunks_exact(3).all(|texel| texel == [0.1, 1.0, 65504.0]), "{size}");
    }
}

#[test]
fn shapes_without_a_layout_are_refused_with_the_choices() {
    let error = open(&image(6, 4, |_, _| [1.0; 3]), None).expect_err("3:2").to_string();
    for name in ["6 × 4", "equirect", "cube-strip", "cube-cross", "octahedral"] {
        assert!(error.contains(name), "{error}");
    }
    assert!(matches!(open(&image(8, 8, |_, _| [1.0; 3]), None), Err(DecodeError::UnknownLayout { .. })));
    assert!(open(&image(8, 8, |_, _| [1.0; 3]), Some(Layout::Octahedral)).is_ok());
    let stretched = open(&image(6, 4, |_, _| [1.0; 3]), Some(Layout::Equirect)).expect_err("3:2").to_string();
    assert!(stretched.contains("twice as wide as high") && stretched.contains("6 × 4"), "{stretched}");
    assert!(
        open(&image(4, 2, |_, _| [1.0; 3]), Some(Layout::Cube)).is_err(),
        "a flat picture is no container"
    );
}

#[test]
fn smallest_and_odd_panoramas_are_panoramas() {
    for height in [1, 3, 125] {
        let decoded = open(&image(2 * height, height, |x, y| [x as f32, y as f32, 1.0]), None).expect("2:1");
        assert_eq!(decoded.layout, Layout::Equirect);
        let Environment::Panorama(panorama) = decoded.environment else { panic!("no panorama") };
        assert_eq!(panorama.texel(1, height - 1), [1.0, (height - 1) as f32, 1.0]);
    }
}

#[test]
fn names_of_layouts_are_read_back_and_others_listed() {
    for layout in Layout::ALL {
        assert_eq!(Layout::parse_choice(layout.name()), Ok(Some(layout)));
    }
    assert_eq!(Layout::parse_choice("auto"), Ok(None));
    let error = Layout::parse_choice("cubes").expect_err("no layout").to_string();
    assert!(error.contains("\"cubes\"") && error.contains("cube-cross, octahedral"), "{error}");
}

#[test]
fn placements_cover_each_square_once() {
    let all = [
        (Layout::CubeStrip, 24, 4),
        (Layout::CubeStrip, 4, 24),
        (Layout::CubeCross, 16, 12),
        (Layout::CubeCross, 12, 16),
        (Layout::ExrCube, 4, 24),
    ];
    for (layout, width, height) in all {
        let placement = CubePlacement::of(layout, width, height).expect("the shape fits");
        let mut is_seen = vec![false; width * height];
        for index in 0..6 * 16 {
            let [x, y] = placement.texel(index / 16, index % 4, index / 4 % 4);
            assert!(!std::mem::replace(&mut is_seen[y * width + x], true), "{layout}");
        }
    }
    assert_eq!(CubePlacement::of(Layout::CubeCross, 16, 11), None);
    assert_eq!(CubePlacement::of(Layout::Equirect, 16, 8), None);
}

#[test]
fn stated_texel_aspect_is_undone_by_repeating_rows() {
    let file = |aspect: &str, width: usize, height: usize| {
        let mut bytes = format!("#?RADIANCE\nPIXASPECT={aspect}\n\n-Y {height} +X {width}\n").into_bytes();
        bytes.extend((0..width * height).flat_map(|index| [128, index as u8, 0, 129]));
        decode_environment(&bytes, None, &Limits::default(), Cancel::NEVER)
    };
    let decoded = file("2", 4, 1).expect("rows twice as high");
    let Environment::Panorama(panorama) = decoded.environment else { panic!("no panorama") };
    assert_eq!((panorama.width(), panorama.height()), (4, 2));
    assert_eq!(panorama.texel(3, 0), panorama.texel(3, 1));
    assert!(
        decoded.notes.iter().any(|note| note.contains("each row was repeated 2 times")),
        "{:?}",
        decoded.notes
    );
    let Environment::Panorama(panorama) = file("0.5", 2, 2).expect("columns twice as wide").environment
    else {
        panic!("no panorama")
    };
    assert_eq!((panorama.width(), panorama.texel(2, 1)), (4, panorama.texel(3, 1)));
    assert!(matches!(file("1.5", 4, 1), Err(DecodeError::UnknownLayout { .. })));
    assert!(file("1e-300", 4, 2).is_ok(), "taken as square");
}

#[test]
fn decoding_ends_when_cancelled() {
    use std::sync::atomic::AtomicI64;
    let files = [(exr(&cross(4, 3)), None), (exr(&image(16, 16, |_, _| [1.0; 3])), Some(Layout::Octahedral))];
    for (bytes, layout) in files {
        let read = |cancel: Cancel| decode_environment(&bytes, layout, &Limits::default(), cancel);
        let left = AtomicI64::new(i64::MAX);
        read(Cancel::countdown(&left)).expect("nobody cancels");
        for at in 0..i64::MAX - left.into_inner() {
            assert!(matches!(read(Cancel::countdown(&AtomicI64::new(at))), Err(DecodeError::Cancelled(_))));
        }
    }
}
