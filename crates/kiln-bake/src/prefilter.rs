//! Prefiltered cube maps: one multiplication per harmonic, one synthesis, the bright texels on top.

use crate::analysis::Analysis;
use crate::bright::{BrightSet, LANES};
use kiln_image::Cube;
use kiln_sphere::direction::cube_texel_centre;
use kiln_sphere::{
    Bulk, Cancel, Cancelled, CubeSolidAngles, Interpolation, Kernel, Lobe, Profile, ZonalKernel,
    cube_direction, simd, synthesise_cube,
};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::ops::Range;

/// Smallest α that is told apart from 0.
pub const ALPHA_MIN: f64 = 1e-4;

/// A map and how well it is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Prefiltered {
    /// Values at texel centres.
    pub cube: Cube,
    /// Bounds of its error.
    pub accuracy: Accuracy,
}

/// Bounds of a map's error against the exact convolution of the panorama's constant patches, and its clamping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// Bound of the RMS error over the sphere and the channels, relative to the RMS (same sense) of the exact map.
    pub rms_bound: f64,
    /// What truncation is expected to leave, in the same sense: known degrees exactly, and those beyond as if the spectrum went
    /// on as in its last octave. No bound, but near what is measured where the bound is far above it.
    pub rms_expected: f64,
    /// Bound of the error in any direction (Euclidean over the channels), relative to the mean radiance (same norm).
    pub sup_bound: f64,
    /// Flux that clamping to the environment's range added or removed, relative to the map's flux.
    pub clamped_flux: f64,
    /// Highest degree the transform used.
    pub band_limit: usize,
    /// Texels that were convolved directly.
    pub bright_texels: usize,
}

/// The environment convolved with the GGX lobe of N = V = R, for one mip level.
///
/// `alpha` = perceptual roughness², brought into [[`ALPHA_MIN`], 1]; for roughness 0 use [`crate::skybox`].
/// `face_size` ≥ 1. As many degrees are used as the analysis' error asks for at this α.
///
/// # Errors
/// [`Cancelled`] within the work of a block of rings or a row of texels.
pub fn specular_level(
    analysis: &Analysis,
    alpha: f64,
    face_size: usize,
    cancel: Cancel,
) -> Result<Prefiltered, Cancelled> {
    prefilter(analysis, Lobe::Ggx { alpha }, face_size, cancel)
}

/// The environment convolved with the Charlie lobe of N = V = R, for one mip level of a sheen map; `alpha` as in
/// [`specular_level`].
///
/// # Errors
/// [`Cancelled`] within the work of a block of rings or a row of texels.
pub fn sheen_level(
    analysis: &Analysis,
    alpha: f64,
    face_size: usize,
    cancel: Cancel,
) -> Result<Prefiltered, Cancelled> {
    prefilter(analysis, Lobe::Charlie { alpha }, face_size, cancel)
}

/// The environment's irradiance over π, E/π: convolved with max(cos θ, 0)/π, which is GGX of α = 1.
///
/// # Errors
/// [`Cancelled`] within the work of a block of rings or a row of texels.
pub fn irradiance(analysis: &Analysis, face_size: usize, cancel: Cancel) -> Result<Prefiltered, Cancelled> {
    prefilter(analysis, Lobe::Lambert, face_size, cancel)
}

/// The lobe with its α brought into [[`ALPHA_MIN`], 1].
pub(crate) fn usable(lobe: Lobe) -> Lobe {
    let usable = |alpha: f64| if alpha >= ALPHA_MIN { alpha.min(1.0) } else { ALPHA_MIN };
    match lobe {
        Lobe::Lambert => Lobe::Lambert,
        Lobe::Ggx { alpha } => Lobe::Ggx { alpha: usable(alpha) },
        Lobe::Charlie { alpha } => Lobe::Charlie { alpha: usable(alpha) },
    }
}

/// The environment convolved with a lobe.
fn prefilter(
    analysis: &Analysis,
    lobe: Lobe,
    face_size: usize,
    cancel: Cancel,
) -> Result<Prefiltered, Cancelled> {
    let lobe = usable(lobe);
    let kernel = lobe.kernel(analysis.band_limit(), cancel)?;
    let truncation = Truncation::choose(analysis, &kernel, error_share(face_size), cancel)?;
    let kappa = &kernel.kappa[..=truncation.band_limit];
    let interpolation = interpolation(analysis.error);
    let mut values = synthesise_cube(&analysis.dim, kappa, face_size, interpolation, cancel)?;
    match lobe.profile(kernel.ln_norm) {
        Profile::Ggx(kernel) => add_bright(analysis, kernel, face_size, &mut values, cancel)?,
        Profile::Charlie(kernel) => add_bright(analysis, kernel, face_size, &mut values, cancel)?,
    }
    let clamped_flux = clamp(analysis, face_size, &mut values, cancel)?;
    let (mut largest, mut map_energy) = (0.0_f64, 0.0);
    let solid_angles = CubeSolidAngles::new(face_size);
    let mut rgb = Bulk::new(Vec::with_capacity(values.len()));
    for (index, line) in values.chunks_exact(face_size * 3).enumerate() {
        cancel.check()?;
        for (x, texel) in line.chunks_exact(3).enumerate() {
            let norm = norm(texel);
            largest = largest.max(norm);
            map_energy += solid_angles.at(x, index % face_size) * norm * norm;
        }
        rgb.extend(line.iter().map(|&value| value as f32));
    }
    let cube = Cube { face_size, rgb: rgb.into_inner() };
    Ok(Prefiltered {
        cube,
        accuracy: truncation.accuracy(largest, map_energy, clamped_flux, evaluation_error(analysis.error)),
    })
}

/// Adds the bright texels' share, Σ excess ∫_patch K dω.
fn add_bright(
    analysis: &Analysis,
    kernel: impl ZonalKernel,
    face_size: usize,
    rgb: &mut [f64],
    cancel: Cancel,
) -> Result<(), Cancelled> {
    let Analysis { width, height, bright, .. } = analysis;
    if bright.is_empty() {
        return Ok(());
    }
    let bright = BrightSet::new(*width, *height, bright, kernel, rule_error(analysis.error));
    rgb.par_chunks_mut(face_size * 3).enumerate().try_for_each(|(line, texels)| {
        let t = cube_texel_centre(face_size, line % face_size);
        for (block, texels) in texels.chunks_mut(LANES * 3).enumerate() {
            cancel.check()?;
            let axis = |lane: usize| {
                let x = (block * LANES + lane).min(face_size - 1);
                cube_direction(line / face_size, cube_texel_centre(face_size, x), t)
            };
            let axes = std::array::from_fn::<_, LANES, _>(axis);
            let axes = std::array::from_fn(|i| axes.map(|axis| axis[i]));
            let shares = simd::dispatch(
                #[inline(always)]
                || bright.convolve(&axes),
            );
            for (lane, texel) in texels.chunks_exact_mut(3).enumerate() {
                for (value, share) in texel.iter_mut().zip(&shares) {
                    *value += share[lane];
                }
            }
        }
        Ok(())
    })
}

/// Brings values into the environment's range; returns the flux moved relative to all flux.
fn clamp(analysis: &Analysis, face_size: usize, rgb: &mut [f64], cancel: Cancel) -> Result<f64, Cancelled> {
    let (mut moved, mut total) = (0.0, 0.0);
    let solid_angles = CubeSolidAngles::new(face_size);
    for (index, texel) in rgb.chunks_exact_mut(3).enumerate() {
        let (x, y) = (index % face_size, index / face_size % face_size);
        if x == 0 {
            cancel.check()?;
        }
        let (mut texel_moved, mut texel_total) = (0.0, 0.0);
        for (value, [low, high]) in texel.iter_mut().zip(analysis.range) {
            let inside = value.max(low).min(high);
            texel_moved += (inside - *value).abs();
            texel_total += inside.abs();
            *value = inside;
        }
        let solid_angle_sr = solid_angles.at(x, y);
        moved += solid_angle_sr * texel_moved;
        total += solid_angle_sr * texel_total;
    }
    Ok(if total > 0.0 { moved / total } else { 0.0 })
}

/// What the bright texels' rules may leave: little beside the error asked for.
fn rule_error(error: f64) -> f64 {
    (0.05 * error).clamp(1e-9, 1e-4)
}

/// What a map's degrees may leave of the error asked for.
///
/// It is the RMS over the sphere, but the texels of a face of one look straight along the axes, and there what was left
/// out adds up: their horizons are the edges of rows and columns (measured, up to 5 times the RMS).
pub(crate) fn error_share(face_size: usize) -> f64 {
    if face_size == 1 { 0.08 } else { 0.25 }
}

/// The cheapest that is little beside the error asked for.
pub(crate) fn interpolation(error: f64) -> Interpolation {
    if error >= 5e-4 { Interpolation::Coarse } else { Interpolation::Fine }
}

/// Relative error of evaluation apart from truncation: the window of the synthesis and rounding to `f32` (measured, not
/// proved), and the bright texels' rules.
fn evaluation_error(error: f64) -> f64 {
    let interpolated = match interpolation(error) {
        Interpolation::Coarse => 2e-5,
        Interpolation::Fine => 2e-7,
    };
    interpolated + rule_error(error)
}

/// Energy a coefficient of the degrees beyond those known: the last octave's, falling on as it does from the octave before.
fn spectral_density(energies: &[f64]) -> f64 {
    let octave = |degrees: Range<usize>| {
        let coefficients: usize = degrees.clone().map(|degree| 2 * degree + 1).sum();
        energies[degrees].iter().sum::<f64>() / coefficients.max(1) as f64
    };
    let half = energies.len() / 2;
    let (before, last) = (octave(half / 2..half), octave(half..energies.len()));
    let slope = if last > 0.0 { libm::log2(before / last).clamp(0.0, 4.0) } else { 0.0 };
    // From the octave's middle to its end, and on against κ² (2l + 1) ~ l⁻⁴, the tail of a lobe with a horizon.
    last * libm::pow(0.75, slope) * 3.0 / (3.0 + slope)
}

/// How many degrees a map takes and what the others could have added.
struct Truncation {
    band_limit: usize,
    bright_texels: usize,
    /// Bound of ∫ |error|² dω.
    energy: f64,
    /// The same as it is expected.
    expected: f64,
    /// Bound of |error| in any direction.
    sup: f64,
    /// Lower bound of ∫ |map|² dω.
    map_energy: f64,
    /// Euclidean norm of the mean radiance.
    mean: f64,
}

impl Truncation {
    /// The fewest degrees that leave `share` of the error asked for.
    fn choose(analysis: &Analysis, kernel: &Kernel, share: f64, cancel: Cancel) -> Result<Self, Cancelled> {
        let energies = analysis.dim.band_energies(cancel)?;
        let last = energies.len() - 1;
        let map_energy = scaled_energy(&kernel.kappa, &analysis.low.band_energies(cancel)?);
        // By Parseval what the known degrees do not hold is beyond them; rounding leaves 1e-13 of the whole.
        let unknown = (analysis.dim_energy - energies.iter().sum::<f64>()).max(1e-13 * analysis.dim_energy);
        let tail = kernel.energy_beyond(last);
        // κ_l² (2l + 1)/4π ≤ tail for each l beyond.
        let mut energy = unknown * tail * 4.0 * PI / (2 * last + 3) as f64;
        let mut expected = (spectral_density(&energies) * tail * 4.0 * PI).min(energy);
        let mut sup = (unknown * tail).sqrt();
        let allowed = (share * analysis.error).powi(2) * map_energy;
        let mut band_limit = last;
        while band_limit > 0 {
            let (kappa, band) = (kernel.kappa[band_limit], energies[band_limit]);
            let more = energy + kappa * kappa * band;
            if more > allowed || more.is_nan() {
                break;
            }
            energy = more;
            expected += kappa * kappa * band;
            sup += kappa.abs() * ((2 * band_limit + 1) as f64 * band / (4.0 * PI)).sqrt();
            band_limit -= 1;
        }
        let bright_texels = analysis.bright.len();
        Ok(Self {
            band_limit,
            bright_texels,
            energy,
            expected,
            sup,
            map_energy,
            mean: norm(&analysis.mean()),
        })
    }

    /// `largest`: norm of the map's brightest texel, which evaluation errors are relative to; `map_energy`: ∫ |map|² dω by its
    /// texels, which may be far above the lower bound that the other numbers take.
    fn accuracy(&self, largest: f64, map_energy: f64, clamped_flux: f64, evaluation_error: f64) -> Accuracy {
        let relative = |error: f64, size: f64| if size > 0.0 { error / size } else { 0.0 };
        Accuracy {
            rms_bound: relative(self.energy.sqrt(), self.map_energy.sqrt()) + evaluation_error,
            rms_expected: relative(self.expected.sqrt(), map_energy.max(self.map_energy).sqrt()),
            sup_bound: relative(self.sup + evaluation_error * largest, self.mean),
            clamped_flux,
            band_limit: self.band_limit,
            bright_texels: self.bright_texels,
        }
    }
}

fn norm(rgb: &[f64]) -> f64 {
    rgb.iter().map(|value| value * value).sum::<f64>().sqrt()
}

/// Σ_l κ_l² ‖f_l‖².
fn scaled_energy(kappa: &[f64], energies: &[f64]) -> f64 {
    kappa.iter().zip(energies).map(|(k, energy)| k * k * energy).sum()
}
