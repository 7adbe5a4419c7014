//! Every file written here is read here: the same cube, texel by texel, or by direction where it was resampled.

use super::check_within;
use crate::cube_layout::{self, CubeLayout, Mirror, texel_direction};
use crate::{
    Cancel, Cube, DecodedEnvironment, Environment, Image, Layout, Limits, Panorama, decode_environment,
    environment_from_faces, exr_write, hdr, ktx1, ktx2,
};
use kiln_sphere::panorama_direction;

const WANTED: &str = "nobody cancels";

/// A smooth light that no symmetry of the cube leaves as it is, in steps that every format holds exactly.
fn light([x, y, z]: [f64; 3]) -> [f64; 3] {
    [2.0 + x + 0.3 * y * z, 2.0 + y + 0.3 * z * x, 2.0 + z + 0.3 * x * y * y]
}

fn in_steps(value: f64, step: f64) -> f32 {
    (libm::rint(value / step) * step) as f32
}

fn cube(face_size: usize, step: f64) -> Cube {
    let texels = (0..6 * face_size * face_size).flat_map(|index| {
        let (face, y, x) =
            (index / (face_size * face_size), index / face_size % face_size, index % face_size);
        light(texel_direction(face_size, face, x, y)).map(|value| in_steps(value, step))
    });
    Cube { face_size, rgb: texels.collect() }
}

/// One face mirrored left to right, the others as they are.
fn with_mirrored_face(source: &Cube, mirrored: usize) -> Cube {
    let size = source.face_size;
    let texels = (0..6 * size * size).flat_map(|index| {
        let (face, y, x) = (index / (size * size), index / size % size, index % size);
        source.texel(face, if face == mirrored { size - 1 - x } else { x }, y)
    });
    Cube { face_size: size, rgb: texels.collect() }
}

fn read(bytes: &[u8], layout: Option<Layout>) -> DecodedEnvironment {
    decode_environment(bytes, layout, &Limits::default(), Cancel::NEVER).expect("written here")
}

fn cube_in(decoded: DecodedEnvironment) -> Cube {
    match decoded.environment {
        Environment::Cube(cube) => cube,
        Environment::Panorama(_) => panic!("{} is no cube", decoded.layout),
    }
}

fn exr(image: &Image) -> Vec<u8> {
    exr_write::encode_image(image, Cancel::NEVER).expect(WANTED)
}

/// A step that every format holds for values below 4, the coarsest being 5 bits of mantissa.
const STEP: f64 = 1.0 / 16.0;

/// Every way to write a cube, as what is read back from it.
fn written_and_read(cube: &Cube) -> Vec<(String, Cube)> {
    let mut all = Vec::new();
    for layout in CubeLayout::ALL {
        let image = cube_layout::unfold(cube, layout);
        for (kind, bytes) in [("EXR", exr(&image)), ("HDR", hdr::encode(&image))] {
            all.push((format!("{layout:?} as {kind}"), cube_in(read(&bytes, None))));
        }
    }
    let files: [Vec<u8>; 6] = std::array::from_fn(|face| hdr::encode(&cube_layout::face_image(cube, face)));
    let files = files.each_ref().map(Vec::as_slice);
    let six = environment_from_faces(files, &Limits::default(), Cancel::NEVER).expect("written here");
    all.push(("six files".to_owned(), cube_in(six)));
    let bytes = exr_write::encode_cube(cube, Cancel::NEVER).expect(WANTED);
    let decoded = read(&bytes, None);
    assert_eq!(decoded.layout, Layout::ExrCube, "the file says so");
    all.push(("EXR cube".to_owned(), cube_in(decoded)));
    let size = cube.face_size;
    let texels = |channels: usize| {
        cube.rgb
            .as_chunks::<3>()
            .0
            .iter()
            .flat_map(move |&[r, g, b]| [r, g, b, 1.0].into_iter().take(channels))
    };
    for format in ktx2::Format::ALL {
        let Some(level) = ktx2_level(format, cube) else { continue };
        let texture = ktx2::Texture {
            format,
            width: size,
            height: size,
            faces: 6,
            levels: vec![&level],
            key_values: Vec::new(),
        };
        all.push((format!("{format:?}"), cube_in(read(&ktx2::write(&texture), None))));
        let compressed = ktx2::write_zstd(&texture, 3, Cancel::NEVER).expect(WANTED);
        all.push((format!("{format:?}, Zstandard"), cube_in(read(&compressed, None))));
    }
    use ktx1::Format::{R11fG11fB10f, R11fG11fB10fFilament, Rgb16f, Rgba16f, Rgba32f};
    for format in [R11fG11fB10f, R11fG11fB10fFilament, Rgb16f, Rgba16f, Rgba32f] {
        let channels = format.texels().channels();
        let values: Vec<f32> = texels(channels).collect();
        let level = format.texels().encode(&values, channels);
        let texture = ktx1::Cube { format, face_size: size, levels: vec![&level], key_values: Vec::new() };
        all.push((format!("KTX1 {format:?}"), cube_in(read(&ktx1::write_cube(&texture), None))));
    }
    all
}

/// Level 0; `None` for formats with fewer than three channels, or that hold nothing above 1.
fn ktx2_level(format: ktx2::Format, cube: &Cube) -> Option<Vec<u8>> {
    use crate::texel::bc6h;
    use ktx2::Format::{BC6H_UFLOAT_BLOCK, R8G8B8A8_UNORM, R16G16_SFLOAT, R32G32_SFLOAT};
    match format {
        R8G8B8A8_UNORM | R16G16_SFLOAT | R32G32_SFLOAT => None,
        BC6H_UFLOAT_BLOCK => {
            let size = cube.face_size;
            let face = |face| bc6h::encode(size, size, cube.face(face), Cancel::NEVER).expect(WANTED);
            Some((0..6).flat_map(face).collect())
        }
        _ => Some(format.encode(&cube.rgb, 3)),
    }
}

fn largest_difference(a: &Cube, b: &Cube) -> f64 {
    assert_eq!(a.face_size, b.face_size);
    a.rgb.iter().zip(&b.rgb).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
}

#[test]
fn cube_comes_back_from_every_file_that_can_hold_one() {
    for face_size in [1, 5, 8] {
        let cube = cube(face_size, STEP);
        let all = written_and_read(&cube);
        assert_eq!(all.len(), 8 + 1 + 1 + 2 * 7 + 5);
        for (what, back) in all {
            // A block's texels lie on two lines of eight colours: those of a coarse cube do so roughly.
            let tolerance = if what.starts_with("BC6H") { 0.35 } else { 0.0 };
            check_within(&format!("{what} of {face_size}"), largest_difference(&back, &cube), 0.0, tolerance);
        }
    }
}

#[test]
fn one_mirrored_face_is_seen_in_every_file() {
    let cube = cube(8, STEP);
    for mirrored in 0..6 {
        for (what, back) in written_and_read(&with_mirrored_face(&cube, mirrored)) {
            assert!(largest_difference(&back, &cube) > 0.5, "{what}, face {mirrored}");
        }
    }
}

/// The largest difference between a panorama and [`light`], at texels' centres.
fn panorama_error(decoded: &DecodedEnvironment) -> f64 {
    let Environment::Panorama(map) = &decoded.environment else {
        panic!("{} is no panorama", decoded.layout)
    };
    let mut worst = 0.0_f64;
    for (row, column) in (0..map.height()).flat_map(|y| (0..map.width()).map(move |x| (y, x))) {
        let at = |index: usize, count: usize| (index as f64 + 0.5) / count as f64;
        let wanted = light(panorama_direction(at(column, map.width()), at(row, map.height())));
        let pairs = map.texel(column, row).into_iter().zip(wanted);
        worst = pairs.map(|(a, b)| (f64::from(a) - b).abs()).fold(worst, f64::max);
    }
    worst
}

#[test]
fn resampled_cubes_come_back_by_direction_and_one_mirrored_face_is_seen() {
    const FACE: usize = 32;
    let files = |cube: &Cube| {
        let octahedral = cube_layout::octahedral(cube, 2 * FACE, Cancel::NEVER).expect(WANTED);
        let equirect = cube_layout::equirect(cube, 2 * FACE, Cancel::NEVER).expect(WANTED);
        let panorama = Panorama::new(equirect.clone()).expect("twice as wide as high");
        let named = exr_write::encode_panorama(&panorama, Cancel::NEVER).expect(WANTED);
        [
            read(&exr(&octahedral), Some(Layout::Octahedral)),
            read(&hdr::encode(&octahedral), Some(Layout::Octahedral)),
            read(&exr(&equirect), None),
            read(&named, None),
        ]
    };
    let cube = cube(FACE, 1.0 / 1024.0);
    for (decoded, tolerance) in files(&cube).iter().zip([0.07, 0.08, 0.02, 0.02]) {
        let what = format!("{} from {}", decoded.layout, decoded.format);
        check_within(&what, panorama_error(decoded), 0.0, tolerance);
    }
    for mirrored in 0..6 {
        let wrong = files(&with_mirrored_face(&cube, mirrored));
        assert!(wrong.iter().all(|decoded| panorama_error(decoded) > 0.5), "face {mirrored}");
    }
    let wrong = files(&cube_layout::mirror(&cube, Mirror::X));
    assert!(wrong.iter().all(|decoded| panorama_error(decoded) > 0.5));
}
