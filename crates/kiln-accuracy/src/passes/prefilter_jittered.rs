//! GGX as the common Vulkan samples do it: twin of `shaders/bake/prefilter_jittered.wgsl`.

use kiln_brdf::d_ggx;
use kiln_brdf::sampling::{hammersley, sample_ggx};

use super::{MIRROR, Tap, Taps, level_of_share, mirror, mirrored, sine2};

/// Share of a turn that the azimuth of a texel's samples is moved by at most, 0.1 rad.
pub const JITTER: f64 = 0.1 / (2.0 * std::f64::consts::PI);
/// Added to densities, so that nothing is divided by 0.
const PDF_OFFSET: f64 = 1e-4;

/// Hammersley's points, one level above what their density asks for, turned about each texel's normal by up to a tenth of a
/// radian. 32 samples there.
pub fn prefilter_jittered(face_size: usize, alpha: f64, count: u32) -> Taps {
    if alpha <= MIRROR {
        return mirror();
    }
    let tap = |index: u32| {
        let half = sample_ggx(hammersley(index, count), alpha);
        let light = mirrored(half);
        let pdf = 0.25 * d_ggx(alpha, sine2(half)) + PDF_OFFSET;
        let level = level_of_share(face_size, 1.0 / (f64::from(count) * pdf), 1.0);
        Tap { light, level, weight: light[2] }
    };
    let taps = Taps::normalised((0..count).map(tap).filter(|tap| tap.weight > 0.0).collect());
    Taps { basis: z_up_basis, jitter: JITTER, ..taps }
}

/// Tangent and bitangent around +Z, and around +X where the normal is close to ±Z.
pub fn z_up_basis([x, y, z]: [f64; 3]) -> [[f64; 3]; 2] {
    let tangent = if z.abs() < 0.999 {
        let length = libm::hypot(x, y);
        [-y / length, x / length, 0.0]
    } else {
        let length = libm::hypot(y, z);
        [0.0, -z / length, y / length]
    };
    let [a, b, c] = tangent;
    [tangent, [y * c - z * b, z * a - x * c, x * b - y * a]]
}

/// A texel's number in [0, 1). The samples hash with a sine, which no two machines compute alike in `f32`; here in `f64`, and
/// given to the pass as data.
#[expect(clippy::approx_constant, reason = "the hash types three digits of π")]
pub fn jitter([x, _, z]: [f64; 3]) -> f64 {
    let turn = (12.9898 * x + 78.233 * z).rem_euclid(3.14);
    (libm::sin(turn) * 43758.5453).rem_euclid(1.0)
}
