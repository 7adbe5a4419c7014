//! GGX by importance sampling, Karis 2013: twin of `shaders/bake/prefilter.wgsl`.

use kiln_brdf::d_ggx;
use kiln_brdf::sampling::{hammersley, sample_ggx};

use super::{MIRROR, Tap, Taps, filter_level, mirror, mirrored, sine2};

/// A bias that reads the largest level whatever the density: plain sampling.
pub const UNFILTERED: f64 = -64.0;

/// Half vectors of `count` points, lights weighted by n·l, read from a source of `face_size` at the level that their density
/// asks for plus `level_bias`: 0 in tutorials, 1 in Křivánek and Colbert 2008, [`UNFILTERED`] for none.
pub fn prefilter(face_size: usize, alpha: f64, count: u32, level_bias: f64) -> Taps {
    if alpha <= MIRROR {
        return mirror();
    }
    let tap = |index: u32| {
        let half = sample_ggx(hammersley(index, count), alpha);
        let light = mirrored(half);
        // D (n·h) / (4 v·h), per steradian of light.
        let pdf = 0.25 * d_ggx(alpha, sine2(half));
        Tap { light, level: filter_level(face_size, pdf, count, level_bias), weight: light[2] }
    };
    Taps::normalised((0..count).map(tap).filter(|tap| tap.weight > 0.0).collect())
}
