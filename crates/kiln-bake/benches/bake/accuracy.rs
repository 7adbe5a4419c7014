//! How exact maps are before they are encoded, by brute force at a subset of their texels.
//!
//! The subset: every n-th texel, so that they lie all over the faces, and with them the texels around the brightest light
//! and the baker's own probes (the light's ring, horizon and opposite, poles, wrap column, an edge, a corner); of small
//! maps all texels. The RMS error over the sphere follows from both: a special texel stands for its own solid angle, the
//! others share the rest. It is relative to the RMS of the whole map, which is the reference's but for that error.

use crate::Verdict;
use crate::panoramas::{Named, real, suns};
use kiln_bake::{
    Analysis, AnalysisRequest, BruteForce, Cancel, Lobe, Prefiltered, analyse, irradiance,
    reference_radiance, sheen_level, specular_level,
};
use kiln_image::Cube;
use kiln_sphere::direction::cube_texel_centre;
use kiln_sphere::{CubeSolidAngles, cube_direction, cube_face_st};
use std::collections::BTreeSet;
use std::f64::consts::PI;

const NEVER: Cancel = Cancel::NEVER;
pub(crate) const WANTED: &str = "nobody cancels";

/// Face size of the chain and its last mip.
pub(crate) const FACE_SIZE: usize = 256;
pub(crate) const LAST_LEVEL: usize = 8;
const IRRADIANCE_SIZE: usize = 64;
const ERROR: f64 = 1e-4;
const SUN_WIDTH: usize = 1024;
/// Texels spread over a map.
const SPREAD: usize = 96;
/// Texels to each side of the brightest.
const AROUND: isize = 3;
const LARGEST_MAX: f64 = 1e-2;

/// One map of the table.
struct Column {
    name: String,
    lobe: Lobe,
    face_size: usize,
    rms_max: f64,
}

fn columns() -> Vec<Column> {
    let roughness = |level: usize| level as f64 / LAST_LEVEL as f64;
    let specular = (1..=LAST_LEVEL).map(|level| {
        let alpha = roughness(level) * roughness(level);
        let rms_max = if alpha >= 1.0 / 32.0 { 1e-4 } else { 1e-3 };
        Column {
            name: format!("ggx {level}"),
            lobe: Lobe::Ggx { alpha },
            face_size: FACE_SIZE >> level,
            rms_max,
        }
    });
    let lambert =
        Column { name: "lambert".into(), lobe: Lobe::Lambert, face_size: IRRADIANCE_SIZE, rms_max: 1e-4 };
    let sheen = [2, 4, 6, 8].into_iter().map(|level| {
        let alpha = roughness(level) * roughness(level);
        let name = format!("char {:.2}", roughness(level));
        Column { name, lobe: Lobe::Charlie { alpha }, face_size: FACE_SIZE >> level, rms_max: 1e-4 }
    });
    specular.chain([lambert]).chain(sheen).collect()
}

/// What one map's comparison found.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Found {
    /// RMS error over RMS, all channels.
    pub(crate) rms: f64,
    /// Largest error over local value + mean/100.
    pub(crate) largest: f64,
    /// Where.
    pub(crate) worst: [f64; 3],
}

/// Texels to compare, and what they should hold.
pub(crate) struct Reference {
    face_size: usize,
    special: Vec<usize>,
    spread: Vec<usize>,
    /// Of the special texels, then of the others.
    exact: Vec<[f64; 3]>,
    mean: [f64; 3],
}

impl Reference {
    pub(crate) fn new(force: &BruteForce, lobe: Lobe, face_size: usize) -> Reference {
        let all = 6 * face_size * face_size;
        let mut special = BTreeSet::new();
        if all <= SPREAD {
            special.extend(0..all);
        } else {
            special.extend(force.probe_texels(lobe, face_size));
            special.extend(around(face_size, force.brightest()));
        }
        // A step that shares no factor with the faces' sizes, from a start of no special place.
        let step = (all / SPREAD).max(1) | 1;
        let spread = (step / 3..all).step_by(step).filter(|texel| !special.contains(texel)).collect();
        let (special, spread): (Vec<_>, Vec<_>) = (special.into_iter().collect(), spread);
        let texels = special.iter().chain(&spread);
        let axes: Vec<_> = texels.map(|&texel| texel_direction(face_size, texel)).collect();
        let exact = force.radiances(lobe, &axes, NEVER).expect(WANTED);
        Reference { face_size, special, spread, exact, mean: force.mean() }
    }

    pub(crate) fn texels(&self) -> impl Iterator<Item = usize> {
        self.special.iter().chain(&self.spread).copied()
    }

    /// `value`: what a map holds at a texel; `rms_size`: RMS of the whole map (Euclidean over its channels).
    pub(crate) fn compare(&self, value: impl Fn(usize) -> [f64; 3], rms_size: f64) -> Found {
        let solid_angles = CubeSolidAngles::new(self.face_size);
        let mut found = Found::default();
        // ∫ |error|² dω and ∫ dω, of special texels and of the others.
        let mut sums = [[0.0; 2]; 2];
        for (index, (texel, exact)) in self.texels().zip(&self.exact).enumerate() {
            let (x, y) = (texel % self.face_size, texel / self.face_size % self.face_size);
            let solid_angle_sr = solid_angles.at(x, y);
            let values = value(texel);
            let sum = &mut sums[usize::from(index >= self.special.len())];
            sum[1] += solid_angle_sr;
            for ((value, exact), mean) in values.iter().zip(exact).zip(self.mean) {
                let error = value - exact;
                sum[0] += solid_angle_sr * error * error;
                let local = exact.abs() + 0.01 * mean.abs();
                let relative = if error == 0.0 { 0.0 } else { error.abs() / local };
                // NaN is worse than anything.
                if relative > found.largest || relative.is_nan() {
                    found.largest = relative;
                    found.worst = texel_direction(self.face_size, texel);
                }
            }
        }
        let [special, spread] = sums;
        let rest =
            if spread[1] > 0.0 { spread[0] / spread[1] * (4.0 * PI - special[1]).max(0.0) } else { 0.0 };
        let error2 = (special[0] + rest) / (4.0 * PI);
        found.rms = if error2 == 0.0 { 0.0 } else { error2.sqrt() / rms_size };
        found
    }

    pub(crate) fn compare_map(&self, cube: &Cube) -> Found {
        self.compare(|texel| std::array::from_fn(|i| f64::from(cube.rgb[3 * texel + i])), rms(cube))
    }
}

/// RMS over the sphere, Euclidean over the channels.
pub(crate) fn rms(cube: &Cube) -> f64 {
    let size = cube.face_size;
    let solid_angles = CubeSolidAngles::new(size);
    let square = |(texel, rgb): (usize, &[f32])| {
        let square: f64 = rgb.iter().map(|&value| f64::from(value) * f64::from(value)).sum();
        solid_angles.at(texel % size, texel / size % size) * square
    };
    (cube.rgb.chunks_exact(3).enumerate().map(square).sum::<f64>() / (4.0 * PI)).sqrt()
}

/// The texels around a direction, on its face.
fn around(face_size: usize, direction: [f64; 3]) -> Vec<usize> {
    let (face, [s, t]) = cube_face_st(direction);
    let place = |s: f64| (0.5 * (s + 1.0) * face_size as f64) as isize;
    let near = |centre: isize| {
        (centre - AROUND..=centre + AROUND)
            .filter(|&x| (0..face_size as isize).contains(&x))
            .map(|x| x as usize)
    };
    near(place(t)).flat_map(|y| near(place(s)).map(move |x| (face * face_size + y) * face_size + x)).collect()
}

pub(crate) fn texel_direction(face_size: usize, texel: usize) -> [f64; 3] {
    let (line, x) = (texel / face_size, texel % face_size);
    let t = cube_texel_centre(face_size, line % face_size);
    cube_direction(line / face_size, cube_texel_centre(face_size, x), t)
}

/// The map of a lobe.
pub(crate) fn bake(analysis: &Analysis, lobe: Lobe, face_size: usize) -> Prefiltered {
    match lobe {
        Lobe::Lambert => irradiance(analysis, face_size, NEVER),
        Lobe::Ggx { alpha } => specular_level(analysis, alpha, face_size, NEVER),
        Lobe::Charlie { alpha } => sheen_level(analysis, alpha, face_size, NEVER),
    }
    .expect(WANTED)
}

/// What the accuracy of a chain with sheen needs.
fn request(error: f64) -> AnalysisRequest {
    AnalysisRequest { alpha_min: 1.0 / 64.0, sheen_alpha_min: Some(1.0 / 16.0), error }
}

/// The worst of a column, and where.
struct Worst {
    rms: (f64, String),
    largest: (f64, String),
}

pub(crate) fn run(only: &str, verdict: &mut Verdict) {
    println!(
        "\n== Accuracy at error = {ERROR:e}: before encoding, chain of {FACE_SIZE}, irradiance {IRRADIANCE_SIZE}"
    );
    println!(
        "rms: error over the map's RMS; max: largest error over (local value + mean/100); in units of 1e-4; ! misses"
    );
    let columns = columns();
    let names: Vec<String> = columns.iter().map(|column| format!("{:>9}", column.name)).collect();
    println!("{:44}{:>5}    {}", "", "L", names.concat());
    let mut worst: Vec<Worst> =
        columns.iter().map(|_| Worst { rms: (0.0, String::new()), largest: (0.0, String::new()) }).collect();
    for Named { name, panorama } in real(only).into_iter().chain(suns(SUN_WIDTH, only)) {
        let analysis = analyse(&panorama, &request(ERROR), NEVER).expect(WANTED);
        let force = BruteForce::new(&panorama, NEVER).expect(WANTED);
        let found: Vec<Found> = columns
            .iter()
            .map(|column| {
                let map = bake(&analysis, column.lobe, column.face_size);
                Reference::new(&force, column.lobe, column.face_size).compare_map(&map.cube)
            })
            .collect();
        let cell = |value: f64, limit: f64| {
            format!("{:>8.3}{}", value * 1e4, if value <= limit { ' ' } else { '!' })
        };
        let rms: Vec<String> =
            found.iter().zip(&columns).map(|(found, column)| cell(found.rms, column.rms_max)).collect();
        let largest: Vec<String> = found.iter().map(|found| cell(found.largest, LARGEST_MAX)).collect();
        println!("{name:44}{:>5} rms{}", analysis.band_limit(), rms.concat());
        println!("{:49} max{}", "", largest.concat());
        for (found, worst) in found.iter().zip(&mut worst) {
            for (value, worst) in [(found.rms, &mut worst.rms), (found.largest, &mut worst.largest)] {
                if value >= worst.0 || value.is_nan() {
                    *worst = (value, format!("{name}, towards {:.2?}", found.worst));
                }
            }
        }
    }
    println!("\nWorst of each map");
    for (column, Worst { rms, largest }) in columns.iter().zip(&worst) {
        let mark = verdict.mark(rms.0 <= column.rms_max);
        println!("{:10} rms {:8.1e}, target {:.0e}{mark}: {}", column.name, rms.0, column.rms_max, rms.1);
        let mark = verdict.mark(largest.0 <= LARGEST_MAX);
        println!("{:10} max {:8.1e}, target {LARGEST_MAX:.0e}{mark}: {}", "", largest.0, largest.1);
    }
    check_brute_force();
}

/// Brute force against the slower reference, which halves patches until a rule leaves 1e-9.
fn check_brute_force() {
    println!("\nBrute force against the slow reference, largest difference over the local value + mean/100");
    for Named { name, panorama } in suns(SUN_WIDTH, "1e5 over 1") {
        let force = BruteForce::new(&panorama, NEVER).expect(WANTED);
        for lobe in [Lobe::Ggx { alpha: 1.0 / 64.0 }, Lobe::Lambert, Lobe::Charlie { alpha: 1.0 / 16.0 }] {
            let axes: Vec<_> =
                force.probe_texels(lobe, 64).iter().map(|&texel| texel_direction(64, texel)).collect();
            let found = force.radiances(lobe, &axes, NEVER).expect(WANTED);
            let difference = |(&axis, found): (&[f64; 3], &[f64; 3])| {
                let exact = reference_radiance(&panorama, lobe, axis)[0];
                (found[0] - exact).abs() / (exact + 0.01 * force.mean()[0])
            };
            let worst = axes.iter().zip(&found).map(difference).fold(0.0, f64::max);
            println!("{name:30} {lobe:?}: {worst:.1e}");
        }
    }
}
