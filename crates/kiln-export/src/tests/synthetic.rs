//! An environment whose light is known in every direction.

use crate::{BakedEnvironment, DfgTable, ExportFile, Preset, package};
use kiln_image::{Cancel, Cube};
use kiln_sphere::{cube_direction, real_harmonics};

/// Radiance harmonics of degree 2: no coefficient is zero and no two are alike, so every mirror and turn shows.
pub(super) fn coefficients() -> Vec<[f64; 3]> {
    let c = |index: usize, channel: usize| match index {
        0 => 7.0 + channel as f64,
        _ => 0.35 * libm::sin((index * 3 + channel) as f64 * 1.7) + 0.1,
    };
    (0..9).map(|index| [c(index, 0), c(index, 1), c(index, 2)]).collect()
}

fn series(direction: [f64; 3], factors: [f64; 3]) -> [f64; 3] {
    let mut value = [0.0; 3];
    for (index, (c, y)) in coefficients().into_iter().zip(real_harmonics(direction, 2)).enumerate() {
        (0..3).for_each(|channel| value[channel] += factors[index.isqrt()] * c[channel] * y);
    }
    value
}

/// The radiance.
pub(super) fn radiance(direction: [f64; 3]) -> [f64; 3] {
    series(direction, [1.0; 3])
}

/// E/π by Lambert's spectrum.
pub(super) fn irradiance(direction: [f64; 3]) -> [f64; 3] {
    series(direction, [1.0, 2.0 / 3.0, 0.25])
}

/// Stands for the map of one roughness: told apart from the others by its size.
pub(super) fn filtered(direction: [f64; 3], roughness: f64) -> [f64; 3] {
    radiance(direction).map(|value| value * (1.0 + roughness))
}

/// Like [`filtered`], for Charlie.
pub(super) fn sheen(direction: [f64; 3], roughness: f64) -> [f64; 3] {
    radiance(direction).map(|value| value * (3.0 + roughness))
}

fn cube(size: usize, f: impl Fn([f64; 3]) -> [f64; 3]) -> Cube {
    let centre = |index: usize| (2 * index + 1) as f64 / size as f64 - 1.0;
    let mut rgb = Vec::new();
    for (face, y, x) in (0..6).flat_map(|f| (0..size).flat_map(move |y| (0..size).map(move |x| (f, y, x)))) {
        rgb.extend(f(cube_direction(face, centre(x), centre(y))).map(|value| value as f32));
    }
    Cube { face_size: size, rgb }
}

/// Maps of 64 texels as the preset wishes them; everything times `gain`.
pub(super) fn environment(preset: Preset, gain: f64) -> BakedEnvironment {
    let wish = preset.wish(64);
    let times = |value: [f64; 3]| value.map(|value| value * gain);
    let chain = |f: &dyn Fn([f64; 3], f64) -> [f64; 3]| -> Vec<(f64, Cube)> {
        let level = |level: usize| {
            let roughness = wish.law.roughness(level, wish.specular_levels);
            (roughness, cube(wish.specular_face >> level, |d| times(f(d, roughness))))
        };
        (0..wish.specular_levels).map(level).collect()
    };
    BakedEnvironment {
        name: "studio".to_owned(),
        skybox: (0..7).map(|level| cube(64 >> level, |d| times(radiance(d)))).collect(),
        specular: chain(&filtered),
        sheen: wish.sheen.then(|| chain(&sheen)),
        irradiance: wish.irradiance_face.map(|size| cube(size, |d| times(irradiance(d)))),
        radiance_sh: coefficients().into_iter().map(times).collect(),
        dfg: wish
            .dfg_size
            .map(|_| DfgTable { size: 2, entries: vec![[0.9, 0.01], [1.0, 0.0], [0.25, 0.2], [0.5, 0.3]] }),
    }
}

pub(super) fn files(preset: Preset) -> Vec<ExportFile> {
    package(preset, &environment(preset, 1.0), Cancel::NEVER).expect("what the preset wishes")
}

pub(super) fn file<'a>(files: &'a [ExportFile], path: &str) -> &'a [u8] {
    let found = files.iter().find(|file| file.path == path);
    let paths: Vec<&str> = files.iter().map(|file| file.path.as_str()).collect();
    &found.unwrap_or_else(|| panic!("{path} is not in {paths:?}")).bytes
}

/// Directions all over the sphere.
pub(super) fn directions() -> impl Iterator<Item = [f64; 3]> {
    (0..500).map(|i| {
        let (y, phi) = (1.0 - (2 * i + 1) as f64 / 500.0, i as f64 * 2.399_963);
        let r = (1.0 - y * y).sqrt();
        [r * libm::cos(phi), y, r * libm::sin(phi)]
    })
}

/// Largest error of `read` relative to `wanted`, over directions and channels.
pub(super) fn worst(read: impl Fn([f64; 3]) -> [f64; 3], wanted: impl Fn([f64; 3]) -> [f64; 3]) -> f64 {
    let error = |direction: [f64; 3]| {
        let pairs = read(direction).into_iter().zip(wanted(direction));
        pairs
            .map(|(a, b)| ((a - b) / b).abs())
            .fold(0.0, |worst: f64, e| if e.is_nan() { f64::NAN } else { worst.max(e) })
    };
    directions().map(error).fold(0.0, f64::max)
}
