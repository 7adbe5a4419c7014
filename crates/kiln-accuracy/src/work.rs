//! Work that is counted and not timed: equal on every machine, so that CI can hold on to it.

use kiln_bake::Prefiltered;
use serde::{Deserialize, Serialize};

/// What an estimator does for a chain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Work {
    /// Lookups by direction.
    pub samples: u64,
    /// Texels read for them, and of the panorama.
    pub texel_reads: u64,
    /// Floating-point operations, by a model: what each step takes to leading order, lookups included.
    pub flops: u64,
}

impl Work {
    /// Both.
    pub fn plus(self, other: Work) -> Work {
        Work {
            samples: self.samples + other.samples,
            texel_reads: self.texel_reads + other.texel_reads,
            flops: self.flops + other.flops,
        }
    }

    /// Of `texels` texels, each with `samples` lookups that read `texel_reads` texels.
    pub fn of_samples(texels: usize, samples: usize, texel_reads: u64) -> Work {
        /// Turning a direction into the texel's frame, choosing the face, the weights of the four texels.
        const PER_SAMPLE: u64 = 40;
        /// Three channels, multiplied and added; the share between levels.
        const PER_TEXEL: u64 = 8;
        let texels = texels as u64;
        Work {
            samples: texels * samples as u64,
            texel_reads: texels * texel_reads,
            flops: texels * (samples as u64 * PER_SAMPLE + texel_reads * PER_TEXEL),
        }
    }

    /// Of analysing a panorama up to degree `band_limit`: a real FFT of each row, three channels, and for each pair of rows
    /// each Legendre function once.
    pub fn of_analysis(width: usize, height: usize, band_limit: usize) -> Work {
        let (width, height) = (width as f64, height as f64);
        let rows = 3.0 * 2.5 * width * width.log2() * height;
        let flops = rows + functions(band_limit) * height / 2.0;
        Work { samples: 0, texel_reads: (width * height) as u64, flops: flops as u64 }
    }

    /// Of one map: the harmonics on rings that resolve its degrees, a window of 6 × 6 ring values a texel, and the bright
    /// texels directly.
    pub fn of_synthesis(map: &Prefiltered) -> Work {
        /// Points of a ring for each degree, and rings: the window needs half as many again as the degrees do.
        const OVERSAMPLING: f64 = 1.5;
        /// Distance, kernel, three channels.
        const PER_BRIGHT_TEXEL: f64 = 16.0;
        let accuracy = map.accuracy;
        let rings = OVERSAMPLING * (accuracy.band_limit + 1) as f64;
        let points = 2.0 * rings;
        let texels = (map.cube.rgb.len() / 3) as f64;
        let flops = functions(accuracy.band_limit) * rings / 2.0
            + 3.0 * 2.5 * points * points.log2() * rings
            + texels * (36.0 * 6.0 + accuracy.bright_texels as f64 * PER_BRIGHT_TEXEL);
        Work { samples: 0, texel_reads: 0, flops: flops as u64 }
    }
}

/// Of all Legendre functions up to a degree at one latitude: three operations of the recursion, and even and odd sums of three
/// complex channels.
fn functions(band_limit: usize) -> f64 {
    let degrees = (band_limit + 1) as f64;
    0.5 * degrees * (degrees + 1.0) * (3.0 + 12.0)
}
