//! GGX by sampling visible normals: twin of `shaders/bake/prefilter_visible.wgsl`.

use kiln_brdf::sampling::{hammersley, pdf_ggx_visible, sample_ggx_visible};

use super::{MIRROR, Tap, Taps, filter_level, mirror, mirrored};

/// The view looks along the normal.
const VIEW: [f64; 3] = [0.0, 0.0, 1.0];

/// As [`super::prefilter::prefilter`], half vectors drawn by spherical caps (Dupuy and Benyoub 2023). Seen along the normal the
/// density is that of all normals, and even the points come out the same: tan θ = α √(u / (1 − u)) either way. Visible normals
/// pay off for slanted views, which prefiltered maps do not have.
pub fn prefilter_visible(face_size: usize, alpha: f64, count: u32, level_bias: f64) -> Taps {
    if alpha <= MIRROR {
        return mirror();
    }
    let tap = |index: u32| {
        let half = sample_ggx_visible(VIEW, hammersley(index, count), alpha);
        let light = mirrored(half);
        let pdf = pdf_ggx_visible(VIEW, half, alpha) / (4.0 * half[2]).max(1e-6);
        Tap { light, level: filter_level(face_size, pdf, count, level_bias), weight: light[2] }
    };
    Taps::normalised((0..count).map(tap).filter(|tap| tap.weight > 0.0).collect())
}
