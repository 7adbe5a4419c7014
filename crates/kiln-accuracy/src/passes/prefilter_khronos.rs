//! Khronos' sampler for glTF: twin of `shaders/bake/prefilter_khronos.wgsl`.

use kiln_brdf::sampling::{hammersley, pdf_cosine, sample_charlie, sample_cosine, sample_ggx};
use kiln_brdf::{d_charlie, d_ggx};

use super::{MIRROR, Tap, Taps, mirror, mirrored, sine2};

/// Their level of a sample: ½ log2(6 size² / (count · pdf)), which lacks the sphere's 4π and so reads 1.8 levels above what a
/// sample stands for. Finite where the density is 0, as it is of Charlie's first sample.
fn level(face_size: usize, pdf: f64, count: u32) -> f64 {
    let texels = 6.0 * (face_size as f64).powi(2);
    (0.5 * libm::log2(texels / (f64::from(count) * pdf).max(1e-12))).max(0.0)
}

/// Lambert: the mean along directions distributed as cos θ / π.
pub fn lambert(face_size: usize, count: u32) -> Taps {
    let tap = |index: u32| {
        let light = sample_cosine(hammersley(index, count));
        Tap { light, level: level(face_size, pdf_cosine(light[2]), count), weight: 1.0 }
    };
    Taps::new((0..count).map(tap).collect(), f64::from(count))
}

/// GGX: half vectors, lights weighted by n·l.
pub fn ggx(face_size: usize, alpha: f64, count: u32) -> Taps {
    reflected(face_size, alpha, count, sample_ggx, |half| 0.25 * d_ggx(alpha, sine2(half)))
}

/// Charlie: the same with its own half vectors.
pub fn charlie(face_size: usize, alpha: f64, count: u32) -> Taps {
    reflected(face_size, alpha, count, sample_charlie, |half| 0.25 * d_charlie(alpha, sine2(half).sqrt()))
}

fn reflected(
    face_size: usize,
    alpha: f64,
    count: u32,
    sample: fn([f64; 2], f64) -> [f64; 3],
    pdf: impl Fn([f64; 3]) -> f64,
) -> Taps {
    if alpha <= MIRROR {
        return mirror();
    }
    let tap = |index: u32| {
        let half = sample(hammersley(index, count), alpha);
        let light = mirrored(half);
        Tap { light, level: level(face_size, pdf(half), count), weight: light[2] }
    };
    Taps::normalised((0..count).map(tap).filter(|tap| tap.weight > 0.0).collect())
}
