//! Helpers of this crate's tests.

/// Passes only when `|actual - expected| <= tol`; written with `<=`, so NaN fails.
#[track_caller]
pub(crate) fn check_within(what: &str, actual: f64, expected: f64, tol: f64) {
    let error = (actual - expected).abs();
    assert!(error <= tol, "{what}: got {actual}, want {expected}, error {error} over {tol}");
}

/// Deterministic values in [0, 1) (SplitMix64; Steele, Lea, Flood 2014).
pub(crate) fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A panorama of random texels.
pub(crate) fn random_panorama(width: usize, height: usize, seed: u64) -> Vec<f32> {
    let mut random = uniform(seed);
    (0..width * height * 3).map(|_| (random() * 4.0) as f32).collect()
}
