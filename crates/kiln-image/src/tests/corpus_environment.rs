//! Real cubes: EXR cubes against the lat-long maps of the same scenes, containers against what is known of them.

use super::corpus;
use crate::{
    Cancel, Cube, DecodeError, DecodedEnvironment, Environment, Layout, Limits, Panorama, check_texels,
    decode::{Stored, decode_source},
    decode_environment,
};
use kiln_sphere::{cube_direction, cube_texel_solid_angle_sr, panorama_direction, panorama_uv};
use std::{
    f64::consts::PI,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

fn open(path: &Path) -> Result<DecodedEnvironment, DecodeError> {
    let bytes = std::fs::read(path).expect("a file of the corpus");
    decode_environment(&bytes, None, &Limits::default(), Cancel::NEVER)
}

/// ∫ radiance · (1, x, y, z, xy, yz, zx, x² − y², 3z² − 1) dω for each channel, over ∫ radiance dω.
type Moments = [[f64; 3]; 9];

#[derive(Default)]
struct Sum(Moments);

impl Sum {
    fn add(&mut self, [x, y, z]: [f64; 3], weight: f64, texel: [f32; 3]) {
        let basis = [1.0, x, y, z, x * y, y * z, z * x, x * x - y * y, 3.0 * z * z - 1.0];
        for (moment, value) in self.0.iter_mut().zip(basis) {
            moment
                .iter_mut()
                .zip(texel)
                .for_each(|(sum, radiance)| *sum += value * weight * f64::from(radiance));
        }
    }

    fn over_flux(self) -> Moments {
        let flux = self.0[0];
        self.0.map(|moment| [0, 1, 2].map(|c| moment[c] / flux[c]))
    }
}

fn panorama_moments(panorama: &Panorama) -> Moments {
    let (width, height) = (panorama.width(), panorama.height());
    let mut sum = Sum::default();
    for y in 0..height {
        let v = (y as f64 + 0.5) / height as f64;
        let weight = (PI * v).sin() * 2.0 * PI * PI / (width * height) as f64;
        for x in 0..width {
            sum.add(panorama_direction((x as f64 + 0.5) / width as f64, v), weight, panorama.texel(x, y));
        }
    }
    sum.over_flux()
}

fn cube_moments(cube: &Cube) -> Moments {
    let size = cube.face_size;
    let centre = |index: usize| (2 * index + 1) as f64 / size as f64 - 1.0;
    let mut sum = Sum::default();
    for index in 0..6 * size * size {
        let (face, x, y) = (index / (size * size), index % size, index / size % size);
        let weight = cube_texel_solid_angle_sr(size, x, y);
        sum.add(cube_direction(face, centre(x), centre(y)), weight, cube.texel(face, x, y));
    }
    sum.over_flux()
}

fn distance(a: &Moments, b: &Moments) -> f64 {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The cube with one change that a wrong orientation would make.
fn changed(cube: &Cube, texel: impl Fn(usize, usize, usize) -> [usize; 3]) -> Cube {
    let size = cube.face_size;
    let texels = (0..6 * size * size).flat_map(|index| {
        let [face, x, y] = texel(index / (size * size), index % size, index / size % size);
        cube.texel(face, x, y)
    });
    Cube::new(size, texels.collect()).expect("values fit")
}

/// Two renderings of one scene differ by their filters and by where the outermost texels stand: measured are up to 0.003.
const SAME_MOMENTS: f64 = 0.005;

/// The scenes whose light has a direction; measured changes are 0.03 to 0.7.
#[test]
fn exr_cubes_light_from_where_their_panoramas_light() {
    let Some(folder) = corpus("exr_cubes_light_from_where_their_panoramas_light") else { return };
    for scene in ["KernerEnv", "StageEnv"] {
        let (cube, panorama) = pair(&folder, scene);
        let wanted = panorama_moments(&panorama);
        let error = distance(&cube_moments(&cube), &wanted);
        assert!(error <= SAME_MOMENTS, "{scene}: {error}");
        for (what, wrong) in wrong_cubes(&cube) {
            let error = distance(&cube_moments(&wrong), &wanted);
            assert!(error > 4.0 * SAME_MOMENTS, "{scene} {what}: {error}");
        }
    }
}

/// Mean |difference| over mean value, at the cube's texels.
fn picture_difference(cube: &Cube, panorama: &Panorama) -> f64 {
    let size = cube.face_size;
    let centre = |index: usize| (2 * index + 1) as f64 / size as f64 - 1.0;
    let (mut difference, mut total) = (0.0, 0.0);
    for index in 0..6 * size * size {
        let (face, x, y) = (index / (size * size), index % size, index / size % size);
        let [u, v] = panorama_uv(cube_direction(face, centre(x), centre(y)));
        let at = |position: f64, length: usize| ((position * length as f64) as usize).min(length - 1);
        let wanted = panorama.texel(at(u, panorama.width()), at(v, panorama.height()));
        for (a, b) in cube.texel(face, x, y).into_iter().zip(wanted) {
            difference += f64::from((a - b).abs());
            total += f64::from(b);
        }
    }
    difference / total
}

/// The axes' names, written on the sky: mirrored or exchanged they read otherwise.
#[test]
fn exr_cube_shows_the_names_of_the_axes_where_its_panorama_does() {
    let Some(folder) = corpus("exr_cube_shows_the_names_of_the_axes_where_its_panorama_does") else { return };
    let (cube, panorama) = pair(&folder, "Orientation");
    let error = picture_difference(&cube, &panorama);
    for (what, wrong) in wrong_cubes(&cube) {
        let wrong = picture_difference(&wrong, &panorama);
        assert!(wrong > 1.1 * error, "{what}: {wrong} against {error}");
    }
}

fn pair(folder: &Path, scene: &str) -> (Cube, Panorama) {
    let cube = open(&folder.join(format!("cube/openexr-images/{scene}Cube.exr"))).expect("a cube");
    assert_eq!(cube.layout, Layout::ExrCube);
    let panorama = open(&folder.join(format!("exr/openexr-images/MultiResolution/{scene}LatLong.exr")));
    let panorama = panorama.expect("a panorama");
    assert!(panorama.notes[0].contains("as the file says"), "{:?}", panorama.notes);
    match (cube.environment, panorama.environment) {
        (Environment::Cube(cube), Environment::Panorama(panorama)) => (cube, panorama),
        _ => panic!("{scene}"),
    }
}

/// What a wrong orientation would make of a cube.
fn wrong_cubes(cube: &Cube) -> [(&'static str, Cube); 3] {
    let last = cube.face_size - 1;
    let turned = |face, x, y| if face == 2 { [face, last - x, last - y] } else { [face, x, y] };
    [
        ("mirrored", changed(cube, |face, x, y| [face, last - x, y])),
        ("swapped", changed(cube, |face, x, y| [face ^ usize::from(face < 2), x, y])),
        ("turned", changed(cube, turned)),
    ]
}

/// The small cubes have one number a face; the data window is the map, whatever is displayed.
#[test]
fn small_exr_cubes_are_read_whatever_their_windows() {
    let Some(folder) = corpus("small_exr_cubes_are_read_whatever_their_windows") else { return };
    for name in
        ["envmap-cube", "envmap-cube-31", "envmap-cube-custom-windows", "envmap-cube-custom-windows-31"]
    {
        let decoded = open(&folder.join(format!("cube/magnum-exr/{name}.exr"))).expect("a cube");
        let Environment::Cube(cube) = &decoded.environment else { panic!("{name}") };
        let report = check_texels(&decoded, Cancel::NEVER).expect("not cancelled");
        assert_eq!((cube.face_size, report.is_radiance()), (2, true));
        let custom = decoded.notes.iter().any(|note| note.contains("the display window"));
        assert_eq!(custom, name.contains("custom"), "{:?}", decoded.notes);
    }
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).expect("a folder of the corpus") {
        let path = entry.expect("an entry").path();
        if path.is_dir() { found.extend(files(&path)) } else { found.push(path) }
    }
    found.sort();
    found
}

/// The containers that are read, with the size of what they hold; all others are refused.
const READ: [(&str, &str); 49] = [
    ("astc-ktx1/hdr-rgb-r16.ktx", "16 × 16"),
    ("astc-ktx1/hdr-rgb-r32.ktx", "16 × 16"),
    ("astc-ktx1/hdr-rgb-rg16.ktx", "16 × 16"),
    ("astc-ktx1/hdr-rgb-rg32.ktx", "16 × 16"),
    ("astc-ktx1/hdr-rgb-rgb16.ktx", "16 × 16"),
    ("astc-ktx1/hdr-rgb-rgb32.ktx", "16 × 16"),
    ("astc-ktx1/hdr-rgba-rgba16.ktx", "16 × 16"),
    ("astc-ktx1/hdr-rgba-rgba32.ktx", "16 × 16"),
    ("magnum-dds-ktx2/BcDecImageConverter/Test/bc6h.dds", "2 × 3"),
    ("magnum-dds-ktx2/BcDecImageConverter/Test/bc6hs.dds", "2 × 3"),
    ("magnum-dds-ktx2/BcDecImageConverter/Test/rgb16f.ktx2", "2 × 3"),
    ("magnum-dds-ktx2/DdsImporter/Test/bgr8unorm-mips.dds", "3 × 2"),
    ("magnum-dds-ktx2/DdsImporter/Test/bgr8unorm.dds", "3 × 2"),
    ("magnum-dds-ktx2/DdsImporter/Test/bgrx8unorm.dds", "3 × 2"),
    ("magnum-dds-ktx2/DdsImporter/Test/dxt10-r16f-cube.dds", "6 × 2 × 2"),
    ("magnum-dds-ktx2/DdsImporter/Test/dxt10-rg32f.dds", "3 × 2"),
    ("magnum-dds-ktx2/DdsImporter/Test/dxt10-rg8unorm.dds", "3 × 2"),
    ("magnum-dds-ktx2/DdsImporter/Test/dxt10-rgba8srgb.dds", "3 × 2"),
    ("magnum-dds-ktx2/DdsImporter/Test/dxt10-rgba8unorm.dds", "3 × 2"),
    ("magnum-dds-ktx2/DdsImporter/Test/fourcc-114.dds", "3 × 2"),
    ("magnum-dds-ktx2/DdsImporter/Test/rgb8unorm-yup.dds", "3 × 2"),
    ("magnum-dds-ktx2/DdsImporter/Test/rgb8unorm.dds", "3 × 2"),
    ("magnum-dds-ktx2/DdsImporter/Test/rgba8unorm-cube.dds", "6 × 5 × 5"),
    ("magnum-dds-ktx2/DdsImporter/Test/rgbx8unorm.dds", "3 × 2"),
    ("magnum-dds-ktx2/KtxImporter/Test/2d-mipmaps-incomplete.ktx2", "4 × 3"),
    ("magnum-dds-ktx2/KtxImporter/Test/2d-mipmaps.ktx2", "4 × 3"),
    ("magnum-dds-ktx2/KtxImporter/Test/2d-rgb.ktx2", "4 × 3"),
    ("magnum-dds-ktx2/KtxImporter/Test/2d-rgba.ktx2", "4 × 3"),
    ("magnum-dds-ktx2/KtxImporter/Test/2d-rgbf32.ktx2", "4 × 3"),
    ("magnum-dds-ktx2/KtxImporter/Test/bgr-swizzle-bgr.ktx2", "4 × 3"),
    ("magnum-dds-ktx2/KtxImporter/Test/bgr.ktx2", "4 × 3"),
    ("magnum-dds-ktx2/KtxImporter/Test/bgra-swizzle-bgra.ktx2", "4 × 3"),
    ("magnum-dds-ktx2/KtxImporter/Test/bgra.ktx2", "4 × 3"),
    ("magnum-dds-ktx2/KtxImporter/Test/cubemap-mipmaps.ktx2", "6 × 2 × 2"),
    ("magnum-dds-ktx2/KtxImporter/Test/cubemap.ktx2", "6 × 2 × 2"),
    ("magnum-dds-ktx2/KtxImporter/Test/swizzle-bgr.ktx2", "4 × 3"),
    ("magnum-dds-ktx2/KtxImporter/Test/swizzle-bgra.ktx2", "4 × 3"),
    ("magnum-dds-ktx2/KtxImporter/Test/swizzle-identity.ktx2", "4 × 3"),
    ("magnum-dds-ktx2/KtxImporter/Test/swizzle-unsupported.ktx2", "4 × 3"),
    ("magnum-dds-ktx2/KtxImporter/Test/version1.ktx", "4 × 3"),
    ("webgltf-khronos-sampler/goegap/diffuse_256.ktx2", "6 × 256 × 256"),
    ("webgltf-khronos-sampler/goegap/sheen_256.ktx2", "6 × 256 × 256"),
    ("webgltf-khronos-sampler/goegap/specular_256.ktx2", "6 × 256 × 256"),
    ("webgltf-khronos-sampler/lebombo/diffuse_256.ktx2", "6 × 256 × 256"),
    ("webgltf-khronos-sampler/lebombo/sheen_256.ktx2", "6 × 256 × 256"),
    ("webgltf-khronos-sampler/lebombo/specular_256.ktx2", "6 × 256 × 256"),
    ("webgltf-khronos-sampler/royal_esplanade/diffuse_256.ktx2", "6 × 256 × 256"),
    ("webgltf-khronos-sampler/royal_esplanade/sheen_256.ktx2", "6 × 256 × 256"),
    ("webgltf-khronos-sampler/royal_esplanade/specular_256.ktx2", "6 × 256 × 256"),
];

/// Every container of the corpus is read or refused at once.
#[test]
fn containers_are_read_or_refused_at_once() {
    let Some(folder) = corpus("containers_are_read_or_refused_at_once") else { return };
    let folder = folder.join("cube");
    let mut read = Vec::new();
    for path in files(&folder) {
        let is_container =
            ["ktx", "ktx2", "dds"].iter().any(|end| path.extension().is_some_and(|e| e == *end));
        if !is_container {
            continue;
        }
        let bytes = std::fs::read(&path).expect("a file of the corpus");
        let start = Instant::now();
        let source = decode_source(&bytes, &Limits::default(), Cancel::NEVER);
        assert!(start.elapsed() <= Duration::from_secs(1), "{}: {:?}", path.display(), start.elapsed());
        let name = path.strip_prefix(&folder).expect("inside").display().to_string();
        match source.map(|source| source.texels) {
            Ok(Stored::Flat(image)) => read.push((name, format!("{} × {}", image.width, image.height))),
            Ok(Stored::Cube(cube)) => read.push((name, format!("6 × {0} × {0}", cube.face_size))),
            Err(
                DecodeError::Unsupported { .. }
                | DecodeError::Invalid { .. }
                | DecodeError::UnknownFormat { .. },
            ) => {}
            Err(error) => panic!("{name}: {error}"),
        }
    }
    let read: Vec<(&str, &str)> = read.iter().map(|(name, size)| (name.as_str(), size.as_str())).collect();
    assert_eq!(read, READ);
}

fn texels(folder: &Path, name: &str) -> Vec<f32> {
    let bytes = std::fs::read(folder.join("cube").join(name)).expect("a file of the corpus");
    crate::decode(&bytes, &Limits::default(), Cancel::NEVER)
        .unwrap_or_else(|error| panic!("{name}: {error}"))
        .image
        .rgb
}

/// A block-compressed picture, and what it was made from: six texels in one block lose a lot.
#[test]
fn bc6h_shows_what_was_compressed() {
    let Some(folder) = corpus("bc6h_shows_what_was_compressed") else { return };
    let texels = |name: &str| texels(&folder, &format!("magnum-dds-ktx2/BcDecImageConverter/Test/{name}"));
    let (wanted, mut actual) = (texels("rgb16f.ktx2"), texels("bc6hs.dds"));
    let error = |actual: &[f32]| {
        let difference: f32 = actual.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).sum();
        difference / wanted.iter().sum::<f32>()
    };
    assert!(error(&actual) <= 0.2, "{}", error(&actual));
    actual.reverse();
    assert!(error(&actual) > 0.5, "the check itself");
}

/// The Khronos sampler's irradiance of the panorama that three.js calls "apartment". Its panoramas have +X in the centre, so
/// (x, y, z) of ours is (−z, y, x) there; clamped cosines leave 2/3 of a first moment, and it clamps at 1.
#[test]
fn cube_of_irradiance_is_bright_where_its_panorama_is() {
    let Some(folder) = corpus("cube_of_irradiance_is_bright_where_its_panorama_is") else { return };
    let cube = open(&folder.join("cube/webgltf-khronos-sampler/lebombo/diffuse_256.ktx2")).expect("a cube");
    assert!(cube.notes.iter().any(|note| note.contains("8-bit")), "{:?}", cube.notes);
    let panorama = open(&folder.join("hdr/polyhaven-pmndrs/apartment.hdr")).expect("a panorama");
    let (Environment::Cube(cube), Environment::Panorama(panorama)) = (cube.environment, panorama.environment)
    else {
        panic!("one of each")
    };
    let [_, x, y, z, ..] = panorama_moments(&panorama);
    let wanted = [z.map(|z| -z * 2.0 / 3.0), y.map(|y| y * 2.0 / 3.0), x.map(|x| x * 2.0 / 3.0)];
    let error = |cube: &Cube| {
        let moments = cube_moments(cube);
        let pairs = moments[1..4].as_flattened().iter().zip(wanted.as_flattened());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    assert!(error(&cube) <= 0.1, "{}", error(&cube));
    for (what, wrong) in &wrong_cubes(&cube)[..2] {
        assert!(error(wrong) > 0.12, "{what}: {}", error(wrong));
    }
}
