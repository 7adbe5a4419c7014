//! Eevee's light probes of Blender before version 4: twin of `shaders/bake/prefilter_eevee.wgsl`.

use std::f64::consts::PI;

use kiln_brdf::d_ggx;
use kiln_brdf::sampling::{radical_inverse, sample_ggx};

use super::{MIRROR, Tap, Taps, mirror, mirrored, sine2};

/// Entries of the table of Hammersley's points.
pub const TABLE_SIZE: u32 = 8192;

/// Samples of a mip.
pub fn sample_count(mip: usize) -> u32 {
    [1, 16, 32, 64].get(mip).copied().unwrap_or(128)
}

/// Added to the level that is read.
pub fn level_bias(mip: usize) -> f64 {
    if mip == 0 { -1.0 } else { 1.0 }
}

/// Half vectors of `count` points: the angle from the normal follows i / count, the azimuth a table of 8192 radical inverses.
/// The density lacks the quarter that turns half vectors into lights, and a texel is taken for 4π/6 of a face: one level of
/// `level_bias` makes up for both.
pub fn prefilter_eevee(face_size: usize, alpha: f64, count: u32, level_bias: f64) -> Taps {
    if alpha <= MIRROR {
        return mirror();
    }
    let level_factor = level_bias + 0.5 * libm::log2((face_size as f64).powi(2) / f64::from(count));
    let tap = |index: u32| {
        let along = f64::from(index) / f64::from(count);
        let half = sample_ggx([radical_inverse(index % TABLE_SIZE), along], alpha);
        let light = mirrored(half);
        let pdf = d_ggx(alpha, sine2(half)) * half[2];
        let distortion = 4.0 * PI / 6.0;
        let level = (level_factor - 0.5 * libm::log2((pdf * distortion).max(1e-12))).max(0.0);
        Tap { light, level, weight: light[2] }
    };
    Taps::normalised((0..count).map(tap).filter(|tap| tap.weight > 0.0).collect())
}
