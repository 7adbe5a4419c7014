//! Environments at the edge, their maps, and the truth about them.

use kiln_bake::{AnalysisRequest, BruteForce, Lobe, Prefiltered};
use kiln_image::{Cancel, Cube, Image, Panorama};
use kiln_sphere::panorama_direction;

/// A generator of numbers with a seed: splitmix64 (Steele, Lea and Flood 2014, "Fast Splittable Pseudorandom Number Generators").
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Between two positive values, evenly in their logarithm.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.unit())
    }

    pub fn direction(&mut self) -> [f64; 3] {
        let (z, phi) = (2.0 * self.unit() - 1.0, std::f64::consts::TAU * self.unit());
        let radius = (1.0 - z * z).sqrt();
        [radius * phi.cos(), radius * phi.sin(), z]
    }
}

pub fn panorama(height: usize, light: impl Fn([f64; 3]) -> [f32; 3]) -> Panorama {
    let texel = |index: usize| {
        let (x, y) = (index % (2 * height), index / (2 * height));
        light(panorama_direction((x as f64 + 0.5) / (2 * height) as f64, (y as f64 + 0.5) / height as f64))
    };
    of_texels(height, (0..2 * height * height).flat_map(texel).collect())
}

pub fn of_texels(height: usize, rgb: Vec<f32>) -> Panorama {
    Panorama::new(Image::new(2 * height, height, rgb).unwrap()).unwrap()
}

/// A smooth sky between 0.7 and 2.3.
pub fn sky([x, y, z]: [f64; 3]) -> [f32; 3] {
    [1.5 + 0.4 * x + 0.3 * y, 1.2 + 0.3 * y * z, 1.8 - 0.5 * z].map(|value| value as f32)
}

/// The sky with one texel of this value, a third from the top.
pub fn with_sun(height: usize, value: f32, light: impl Fn([f64; 3]) -> [f32; 3]) -> Panorama {
    let mut panorama = panorama(height, light);
    let at = (height / 3 * 2 * height + height / 2) * 3;
    panorama.rgb_mut()[at..at + 3].fill(value);
    panorama
}

/// A map as baked, nothing rounded or clamped for storage.
pub fn baked(panorama: &Panorama, lobe: Lobe, face_size: usize, error: f64) -> Prefiltered {
    let (alpha_min, sheen_alpha_min) = match lobe {
        Lobe::Ggx { alpha } => (alpha, None),
        Lobe::Charlie { alpha } => (1.0, Some(alpha)),
        Lobe::Lambert => (1.0, None),
    };
    let request = AnalysisRequest { alpha_min, sheen_alpha_min, error };
    let analysis = kiln_bake::analyse(panorama, &request, Cancel::NEVER).unwrap();
    match lobe {
        Lobe::Ggx { alpha } => kiln_bake::specular_level(&analysis, alpha, face_size, Cancel::NEVER),
        Lobe::Charlie { alpha } => kiln_bake::sheen_level(&analysis, alpha, face_size, Cancel::NEVER),
        Lobe::Lambert => kiln_bake::irradiance(&analysis, face_size, Cancel::NEVER),
    }
    .unwrap()
}

/// Relative RMS of a map against brute force over all patches.
pub fn rms(panorama: &Panorama, cube: &Cube, lobe: Lobe) -> f64 {
    let truth = BruteForce::new(panorama, Cancel::NEVER).unwrap();
    truth.measure(cube, lobe, Cancel::NEVER).unwrap().rms
}

/// Bakes and measures; fails where a value is no radiance before anything looks at it.
#[track_caller]
pub fn baked_error(panorama: &Panorama, lobe: Lobe, face_size: usize) -> f64 {
    let map = baked(panorama, lobe, face_size, 1e-3);
    check_radiance(&map.cube);
    // What ended at the environment's range was off by as much before.
    rms(panorama, &map.cube, lobe).max(map.accuracy.clamped_flux)
}

/// No value is NaN, infinite or negative.
#[track_caller]
pub fn check_radiance(cube: &Cube) {
    let report = kiln_image::check_texels(cube, Cancel::NEVER).unwrap();
    assert!(report.is_radiance(), "{report:?}");
}

pub fn flattened(cube: &Cube) -> impl Iterator<Item = f64> + '_ {
    cube.rgb.iter().map(|&value| f64::from(value))
}
