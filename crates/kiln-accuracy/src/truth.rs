//! What maps are compared with: brute force in `f64` at probes.
//!
//! Half of a level's probes are spread evenly over the sphere, half gather around the brightest light as its lobe does, since
//! that is where a map with a sun has its energy. Each stands for the solid angle that it would be one of so many over (the
//! balance heuristic, Veach and Guibas 1995), so the RMS is that of the whole sphere. The places where errors hide — the
//! light's centre and a ring, its 90° circle and antipode, poles, wrap column, a cube's edge and corner — count for the
//! largest error alone.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use kiln_bake::{BruteForce, Lobe};
use kiln_brdf::sampling::{hammersley, orthonormal_basis};
use kiln_image::cube_layout::texel_direction;
use kiln_image::{Cancel, Cancelled, Cube};
use kiln_sphere::{cube_face_st, cube_texel_solid_angle_sr};
use rayon::prelude::*;

use crate::chain::Level;
use crate::norms::{ErrorNorms, Weighted};
use crate::passes::Taps;
use crate::source::{Rgb, Source};

/// One direction with the exact value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// Texel of the map, faces in KTX2 order.
    pub texel: usize,
    /// Where its centre looks.
    pub direction: [f64; 3],
    /// Solid angle that it stands for; 0: the largest error alone.
    pub weight: f64,
    /// By brute force.
    pub exact: Rgb,
}

/// A level's probes.
#[derive(Clone, Debug)]
pub struct Truth {
    /// The level.
    pub level: Level,
    /// Where it is compared.
    pub probes: Vec<Probe>,
    /// Mean square over the sphere and the channels.
    size2: f64,
    /// Mean radiance.
    mean: Rgb,
}

impl Truth {
    /// Exact values of a level at some `count` probes, at all its texels if there are no more.
    ///
    /// # Errors
    /// [`Cancelled`] within the work of a few rows.
    pub fn new(force: &BruteForce, level: Level, count: usize, cancel: Cancel) -> Result<Truth, Cancelled> {
        let weights = weights(force.brightest(), &level, count);
        let mut probes = weights;
        for texel in force.probe_texels(level.lobe, level.face_size) {
            probes.entry(texel).or_insert(0.0);
        }
        let direction = |texel: usize| texel_centre(level.face_size, texel);
        let axes: Vec<[f64; 3]> = probes.keys().map(|&texel| direction(texel)).collect();
        let exact = force.radiances(level.lobe, &axes, cancel)?;
        let probes: Vec<Probe> = probes
            .into_iter()
            .zip(axes)
            .zip(exact)
            .map(|(((texel, weight), direction), exact)| Probe { texel, direction, weight, exact })
            .collect();
        let (mut squares, mut total) = (0.0, 0.0);
        for probe in &probes {
            squares += probe.weight * mean_square(probe.exact);
            total += probe.weight;
        }
        Ok(Truth { level, probes, size2: squares / total, mean: force.mean() })
    }

    /// The error of values at the probes.
    pub fn compare(&self, values: &[Rgb]) -> ErrorNorms {
        let errors = self.probes.iter().zip(values).map(|(probe, value)| {
            let off: Rgb = std::array::from_fn(|i| value[i] - probe.exact[i]);
            let local = (0..3).map(|i| {
                let size = probe.exact[i].abs() + 0.01 * self.mean[i].abs();
                if off[i] == 0.0 { 0.0 } else { off[i].abs() / size }
            });
            let worst = local.fold(
                0.0,
                |worst: f64, e| if e.is_nan() || worst.is_nan() { f64::NAN } else { worst.max(e) },
            );
            Weighted { weight: probe.weight, square: mean_square(off), local: worst }
        });
        ErrorNorms::of(errors, self.size2)
    }

    /// The error of a map.
    pub fn compare_map(&self, map: &Cube) -> ErrorNorms {
        let value = |probe: &Probe| [0, 1, 2].map(|i| f64::from(map.rgb[3 * probe.texel + i]));
        self.compare(&self.probes.iter().map(value).collect::<Vec<_>>())
    }

    /// What a sampled estimator makes of the probes' texels.
    ///
    /// # Errors
    /// [`Cancelled`] within a texel.
    pub fn sample(
        &self,
        taps: &Taps,
        source: &Source,
        jitter: impl Fn([f64; 3]) -> f64 + Sync,
        cancel: Cancel,
    ) -> Result<Vec<Rgb>, Cancelled> {
        let texel = |probe: &Probe| {
            cancel.check()?;
            // As a map of `f32` holds it.
            let radiance = taps.radiance(source, probe.direction, jitter(probe.direction));
            Ok(radiance.map(|value| f64::from(value as f32)))
        };
        self.probes.par_iter().map(texel).collect()
    }
}

/// Where a texel's centre looks.
pub fn texel_centre(face_size: usize, texel: usize) -> [f64; 3] {
    let (line, x) = (texel / face_size, texel % face_size);
    texel_direction(face_size, line / face_size, x, line % face_size)
}

fn mean_square(rgb: Rgb) -> f64 {
    rgb.iter().map(|value| value * value).sum::<f64>() / 3.0
}

/// Texels with the solid angles they stand for.
fn weights(brightest: [f64; 3], level: &Level, count: usize) -> BTreeMap<usize, f64> {
    let size = level.face_size;
    if level.texels() <= count {
        let weight = |texel: usize| cube_texel_solid_angle_sr(size, texel % size, texel / size % size);
        return (0..level.texels()).map(|texel| (texel, weight(texel))).collect();
    }
    let gathered = Gathered::new(level);
    let [tangent, bitangent] = orthonormal_basis(brightest);
    let mut found = BTreeMap::new();
    let half = (count / 2).max(1) as u32;
    for index in 0..2 * half {
        let [along, turn] = hammersley(index % half, half);
        // Half a point from the end, so that neither pole is one.
        let along = along + 0.5 / f64::from(half);
        let one_minus_x = if index < half { 2.0 * along } else { gathered.one_minus_x(along) };
        let (sin, cos) = libm::sincos(2.0 * PI * turn);
        let sine = (one_minus_x * (2.0 - one_minus_x)).max(0.0).sqrt();
        let direction = std::array::from_fn(|i| {
            sine * (cos * tangent[i] + sin * bitangent[i]) + (1.0 - one_minus_x) * brightest[i]
        });
        let texel = nearest_texel(size, direction);
        // The texel's centre is what is looked at, so its density is what counts.
        let centre = texel_centre(size, texel);
        let distance2: f64 = (0..3).map(|i| (centre[i] - brightest[i]).powi(2)).sum();
        let density = 0.5 * (0.25 / PI + gathered.density(0.5 * distance2));
        *found.entry(texel).or_insert(0.0) += 1.0 / (density * f64::from(2 * half));
    }
    found
}

/// A density over directions that falls as 1 / (1 − x + s)² from the brightest light.
struct Gathered {
    scale: f64,
    norm: f64,
}

impl Gathered {
    fn new(level: &Level) -> Gathered {
        let width = match level.lobe {
            Lobe::Lambert => 1.0,
            Lobe::Ggx { alpha } => 2.0 * alpha,
            Lobe::Charlie { .. } => 0.5 * PI,
        };
        let texel = 2.0 / level.face_size as f64;
        let scale = 0.5 * (width * width).max(texel * texel).min(1.0);
        Gathered { scale, norm: 1.0 / scale - 1.0 / (2.0 + scale) }
    }

    fn one_minus_x(&self, u: f64) -> f64 {
        1.0 / (1.0 / self.scale - u * self.norm) - self.scale
    }

    fn density(&self, one_minus_x: f64) -> f64 {
        let distance = one_minus_x + self.scale;
        1.0 / (2.0 * PI * self.norm * distance * distance)
    }
}

fn nearest_texel(face_size: usize, direction: [f64; 3]) -> usize {
    let (face, [s, t]) = cube_face_st(direction);
    let place = |s: f64| ((0.5 * (s + 1.0) * face_size as f64) as usize).min(face_size - 1);
    (face * face_size + place(t)) * face_size + place(s)
}
