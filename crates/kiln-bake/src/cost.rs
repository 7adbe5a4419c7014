//! What a bake will cost, before it is made: its work counted from sizes and a [`Forecast`], in steps whose relative prices
//! are known.
//!
//! Counting is deterministic. How fast a machine is, is one number ([`Work::reference_ms`] beside a clock), which the caller
//! finds by timing [`SpeedTest`].

use kiln_image::{Image, Panorama};
use kiln_sphere::{Cancel, Cancelled, Interpolation, Lobe};
use std::f64::consts::PI;

use crate::analysis::{AnalysisRequest, Forecast, analyse};
use crate::prefilter::{error_share, interpolation, irradiance, specular_level, usable};

/// A map that is to be made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WantedMap {
    /// What it is convolved with.
    pub lobe: Lobe,
    /// Edge of its faces.
    pub face_size: usize,
}

/// Counted work, in units of each step's own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work {
    /// Texels of the source: read, checked, stored and summed up.
    pub source_texels: f64,
    /// Operations of transforms, forth and back.
    pub transform: f64,
    /// Squares of degrees of kernels' spectra.
    pub kernel: f64,
    /// Texels of maps: evaluated, encoded and stored; half as many again where little error is allowed.
    pub map_texels: f64,
    /// Texels of the skybox and of the chain's mirror level: averaged, encoded and stored.
    pub skybox_texels: f64,
    /// Bright texels looked at from texels of maps.
    pub direct: f64,
    /// The same for Charlie's lobe, which takes logarithms.
    pub direct_charlie: f64,
    /// Texels of the source looked at by brute force for each map, which measures it.
    pub measured: f64,
    /// Steps.
    pub steps: f64,
}

impl Work {
    /// Of an environment's maps. `skybox_texels` counts those of all its levels. The spectrum of what is transformed is taken to
    /// fall as 1/(l + 1), as that of lit scenes about does.
    ///
    /// # Errors
    /// [`Cancelled`] within a spectrum's work.
    pub fn of_maps(
        (width, height): (usize, usize),
        forecast: &Forecast,
        error: f64,
        maps: &[WantedMap],
        skybox_texels: usize,
        cancel: Cancel,
    ) -> Result<Work, Cancelled> {
        let source_texels = (width * height) as f64;
        let rows = 3.0 * 2.5 * source_texels * (width as f64).log2();
        let mut work = Work {
            source_texels,
            transform: rows + legendre(forecast.band_limit) * height as f64 / 2.0,
            skybox_texels: skybox_texels as f64,
            steps: 4.0 + 2.0 * maps.len() as f64,
            ..Work::default()
        };
        let is_fine = interpolation(error) == Interpolation::Fine;
        for map in maps {
            let texels = 6.0 * (map.face_size * map.face_size) as f64;
            let degrees = degrees(map, forecast, error, cancel)?;
            let rings = 1.5 * (degrees + 1) as f64;
            work.transform += legendre(degrees) * rings / 2.0 + 3.0 * 5.0 * rings * rings * rings.log2();
            work.kernel += (forecast.band_limit * forecast.band_limit) as f64;
            work.map_texels += if is_fine { 1.5 * texels } else { texels };
            let direct = texels * forecast.bright_texels as f64;
            match map.lobe {
                Lobe::Charlie { .. } => work.direct_charlie += direct,
                _ => work.direct += direct,
            }
            work.measured += source_texels;
        }
        Ok(work)
    }

    /// Both.
    pub fn plus(self, other: Work) -> Work {
        Work {
            source_texels: self.source_texels + other.source_texels,
            transform: self.transform + other.transform,
            kernel: self.kernel + other.kernel,
            map_texels: self.map_texels + other.map_texels,
            skybox_texels: self.skybox_texels + other.skybox_texels,
            direct: self.direct + other.direct,
            direct_charlie: self.direct_charlie + other.direct_charlie,
            measured: self.measured + other.measured,
            steps: self.steps + other.steps,
        }
    }

    /// Milliseconds on one core of the machine that the prices were found on (x86-64 with AVX-512, 2026).
    pub fn reference_ms(&self) -> f64 {
        let Work { source_texels, transform, kernel, map_texels, skybox_texels, direct, .. } = self;
        let Work { direct_charlie, measured, steps, .. } = self;
        1e-6 * (NS_SOURCE_TEXEL * source_texels
            + NS_TRANSFORM * transform
            + NS_KERNEL * kernel
            + NS_MAP_TEXEL * map_texels
            + NS_SKYBOX_TEXEL * skybox_texels
            + NS_DIRECT * direct
            + NS_DIRECT_CHARLIE * direct_charlie
            + NS_MEASURED * measured
            + NS_STEP * steps)
    }
}

// Nanoseconds of each on one core, from the times of steps of panoramas of 256 to 2048 columns (`kiln bake --timings --jobs 1`).
const NS_SOURCE_TEXEL: f64 = 225.0;
const NS_TRANSFORM: f64 = 0.05;
const NS_KERNEL: f64 = 2.0;
const NS_MAP_TEXEL: f64 = 215.0;
const NS_SKYBOX_TEXEL: f64 = 230.0;
const NS_DIRECT: f64 = 3.0;
const NS_DIRECT_CHARLIE: f64 = 300.0;
const NS_MEASURED: f64 = 28.0;
const NS_STEP: f64 = 4e5;

/// Operations for all Legendre functions up to a degree at one latitude: the recursion, and sums of three complex channels.
fn legendre(band_limit: usize) -> f64 {
    let degrees = (band_limit + 1) as f64;
    7.5 * degrees * (degrees + 1.0)
}

/// The degrees that a map will take.
fn degrees(map: &WantedMap, forecast: &Forecast, error: f64, cancel: Cancel) -> Result<usize, Cancelled> {
    let last = forecast.band_limit;
    let kappa = usable(map.lobe).kernel(last, cancel)?.kappa;
    let harmonic: f64 = (1..=last).map(|l| 1.0 / (l + 1) as f64).sum();
    // Relative to a mean of 1, whose map has the energy 4π at least.
    let band = |l: usize| 4.0 * PI * forecast.contrast.powi(2) / harmonic / (l + 1) as f64;
    let allowed = (error_share(map.face_size) * error).powi(2) * 4.0 * PI;
    let (mut degrees, mut energy) = (last, 0.0);
    while degrees > 0 {
        energy += kappa[degrees].powi(2) * band(degrees);
        if energy > allowed || energy.is_nan() {
            break;
        }
        degrees -= 1;
    }
    Ok(degrees)
}

/// A small bake whose work is known, to be timed.
#[derive(Clone, Debug)]
pub struct SpeedTest {
    panorama: Panorama,
    request: AnalysisRequest,
}

impl Default for SpeedTest {
    fn default() -> Self {
        Self::new()
    }
}

impl SpeedTest {
    /// What it takes on one core of the machine that [`Work::reference_ms`] speaks of.
    pub const REFERENCE_MS: f64 = 14.0;
    const SIZE: (usize, usize) = (512, 256);
    const FACE_SIZE: usize = 64;
    const ALPHA: f64 = 0.05;

    /// Its panorama: waves of all lengths.
    pub fn new() -> SpeedTest {
        let (width, height) = Self::SIZE;
        let texel = |index: usize| {
            let (x, y) = ((index % width) as f32 / width as f32, (index / width) as f32 / height as f32);
            let waves = (1..8).map(|k| ((x * k as f32 * 6.0).sin() * (y * k as f32 * 3.0).cos()) / k as f32);
            [1.0, 0.9, 0.8].map(|tint| tint * (1.5 + 0.5 * waves.clone().sum::<f32>()).max(0.0))
        };
        let rgb = (0..width * height).flat_map(texel).collect();
        let image = Image::new(width, height, rgb).expect("as many texels as its size says");
        let panorama = Panorama::new(image).expect("it is twice as wide as high");
        let request = AnalysisRequest { alpha_min: Self::ALPHA, sheen_alpha_min: None, error: 1e-4 };
        SpeedTest { panorama, request }
    }

    /// Does it.
    ///
    /// # Errors
    /// [`Cancelled`] soon after it is asked for.
    pub fn run(&self, cancel: Cancel) -> Result<(), Cancelled> {
        let analysis = analyse(&self.panorama, &self.request, cancel)?;
        specular_level(&analysis, Self::ALPHA, Self::FACE_SIZE, cancel)?;
        irradiance(&analysis, Self::FACE_SIZE, cancel).map(drop)
    }
}
