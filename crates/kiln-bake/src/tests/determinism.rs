//! Equal inputs give equal bytes: for any number of threads, with any vector instructions.

use super::environments::{analyse, bytes_of, irradiance, random, skybox, specular_level};
use crate::{AnalysisRequest, BruteForce, Cancel, Lobe};
use kiln_image::{Cube, Panorama};
use kiln_sphere::simd::{self, Instructions};

const WANTED: &str = "nobody cancels";
const REQUEST: AnalysisRequest =
    AnalysisRequest { alpha_min: 1.0 / 49.0, sheen_alpha_min: Some(1.0 / 16.0), error: 1e-5 };

/// Every number that a bake makes of a panorama, as bits.
fn everything(map: &Panorama) -> Vec<u64> {
    let analysis = analyse(map, &REQUEST);
    let mut bits: Vec<u64> = bytes_of(&analysis).into_iter().map(u64::from).collect();
    let mut add = |cube: &Cube| bits.extend(cube.rgb.iter().map(|value| u64::from(value.to_bits())));
    add(&specular_level(&analysis, 0.05, 16).cube);
    // Wider than a vector, and odd.
    add(&specular_level(&analysis, 0.5, 13).cube);
    add(&irradiance(&analysis, 8).cube);
    add(&crate::sheen_level(&analysis, 0.1, 9, Cancel::NEVER).expect(WANTED).cube);
    skybox(map, 16).iter().for_each(&mut add);
    let coarse = analyse(map, &AnalysisRequest { error: 1e-2, ..REQUEST });
    add(&specular_level(&coarse, 0.05, 16).cube);
    let force = BruteForce::new(map, Cancel::NEVER).expect(WANTED);
    for lobe in [Lobe::Lambert, Lobe::Ggx { alpha: 0.05 }, Lobe::Charlie { alpha: 0.25 }] {
        let radiance = force.radiance(lobe, [0.6, 0.0, 0.8], Cancel::NEVER).expect(WANTED);
        bits.extend(radiance.map(f64::to_bits));
    }
    bits
}

/// A square of suns, so that some texels are convolved directly.
fn map(seed: u64) -> Panorama {
    let mut map = random(64, 32, seed);
    for texel in [300, 301, 365, 1023, 2000] {
        map.rgb_mut()[3 * texel..3 * texel + 3].fill(1e5);
    }
    map
}

#[test]
fn every_map_has_equal_bytes_for_1_2_and_7_threads() {
    let map = map(13);
    let bake = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| everything(&map))
    };
    let one = bake(1);
    assert!(one == bake(2) && one == bake(7), "thread count changed bytes");
}

/// The limit of this process goes back to the best when the test ends; other tests meanwhile only run slower.
struct Limited;

impl Drop for Limited {
    fn drop(&mut self) {
        simd::limit_to(Instructions::Best);
    }
}

#[test]
#[expect(clippy::print_stderr, reason = "what was not compared must be said")]
fn every_map_has_equal_bytes_with_any_vector_instructions() {
    let _limited = Limited;
    let map = map(13);
    let mut compared = Vec::new();
    for limit in [Instructions::Baseline, Instructions::Avx2, Instructions::Best] {
        simd::limit_to(limit);
        compared.push((simd::available(), everything(&map)));
    }
    let names: Vec<&str> = compared.iter().map(|(name, _)| *name).collect();
    eprintln!("vector instructions compared: {names:?}");
    if !names.contains(&"AVX-512") {
        eprintln!("NOT COMPARED: this machine has no AVX-512");
    }
    for (name, bits) in &compared[1..] {
        assert!(*bits == compared[0].1, "{name} changed bytes");
    }
    assert_eq!(names[0], "baseline", "the limit must have been in force");
}

#[test]
fn comparison_of_bytes_sees_one_texel_that_moved_by_its_last_bit() {
    let map = map(13);
    let mut moved = map.clone();
    let value = &mut moved.rgb_mut()[777];
    *value = f32::from_bits(value.to_bits() + 1);
    assert!(everything(&map) != everything(&moved));
}
