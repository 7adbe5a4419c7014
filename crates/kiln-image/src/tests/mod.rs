//! Tests of the crate, by topic.

mod cancel;
mod colour;
mod compare;
mod containers;
mod corpus;
mod corpus_environment;
mod corpus_orientation;
mod cube_layout;
mod environment;
mod exr_files;
mod hdr;
mod ktx1;
mod ktx2;
mod ktx2_rules;
mod layout;
mod mutation;
mod round_trips;
mod sheet;
mod texel;
mod texels;
mod writers;

use crate::{Cancel, DecodeError, Decoded, Image, Limits, TexelReport, decode};

/// Decodes with default limits.
fn decode_default(bytes: &[u8]) -> Result<Decoded, DecodeError> {
    decode(bytes, &Limits::default(), Cancel::NEVER)
}

fn check_texels(image: &Image) -> TexelReport {
    crate::check_texels(image, Cancel::NEVER).expect("nobody cancels")
}

/// Passes only when `|actual - expected| <= tol`; written with `<=`, so NaN fails.
#[track_caller]
fn check_within(what: &str, actual: f64, expected: f64, tol: f64) {
    let error = (actual - expected).abs();
    assert!(error <= tol, "{what}: got {actual}, want {expected}, error {error} over {tol}");
}

/// The folder of real files, or `None` with a loud line: its tests are then skipped, never passed silently.
#[expect(clippy::print_stderr, reason = "a skipped test has to be seen")]
fn corpus(test: &str) -> Option<std::path::PathBuf> {
    let folder = std::env::var_os("KILN_CORPUS").map(std::path::PathBuf::from);
    if folder.is_none() {
        eprintln!("SKIPPED: {test} needs KILN_CORPUS, the folder of real files");
    }
    folder
}

/// A small generator with a fixed seed (SplitMix64, Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    /// Uniform in 0…1.
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}
