//! The path tracer beside closed forms and brute force, and the split sum where it is exact.

use super::environments::{panorama, random, sun};
use crate::{Lobe, PathTracer, Surface, Traced, reference_radiance, split_sum_radiance};

const NORMAL: [f64; 3] = [0.48, 0.64, 0.6];
const COUNT: u32 = 1024;
/// The texel of a panorama of 64 by 32 that [`NORMAL`] points at.
const SUN: usize = 8 * 64 + 57;

/// A unit vector so far from [`NORMAL`].
fn view(cosine: f64) -> [f64; 3] {
    let sine = (1.0 - cosine * cosine).sqrt();
    // Normal to NORMAL, of unit length.
    let side = [0.8, -0.6, 0.0];
    std::array::from_fn(|i| cosine * NORMAL[i] + sine * side[i])
}

fn metal(color: f64, roughness: f64) -> Surface {
    Surface { color: [color; 3], metallic: 1.0, roughness }
}

/// Deviations in standard errors, the largest channel.
fn sigmas(traced: Traced, expected: [f64; 3]) -> f64 {
    let of = |i: usize| (traced.radiance[i] - expected[i]).abs() / traced.standard_error[i].max(1e-9);
    (0..3).map(of).fold(0.0, f64::max)
}

#[test]
fn in_a_furnace_paths_and_split_sum_give_the_same_at_any_roughness_and_view() {
    let white = panorama(16, 8, |_| [1.0; 3]);
    let tracer = PathTracer::new(&white);
    for roughness in [0.1, 0.4, 0.7, 1.0] {
        for cosine in [0.15, 0.5, 0.95] {
            for surface in [metal(0.9, roughness), Surface { metallic: 0.0, ..metal(0.6, roughness) }] {
                let split = split_sum_radiance(&white, surface, NORMAL, view(cosine));
                let traced = tracer.radiance(surface, NORMAL, view(cosine), COUNT, 1);
                let off = sigmas(traced, split);
                assert!(off <= 5.0, "{surface:?} at {cosine}: {traced:?}, split {split:?}");
                assert!(traced.standard_error[0] <= 2e-3, "{traced:?}");
                let other = tracer.radiance(metal(0.88, roughness), NORMAL, view(cosine), COUNT, 1);
                assert!(sigmas(other, split) > 5.0, "the check sees another colour");
            }
        }
    }
}

#[test]
fn diffuse_paths_agree_with_brute_force_under_noise_and_under_a_sun() {
    // Two colours have the same specular lobe: what differs is Lambert's.
    let dielectric = |color| Surface { color: [color; 3], metallic: 0.0, roughness: 1.0 };
    let [scale, bias] = kiln_brdf::dfg_ggx(1.0, 1.0);
    let (single, average) = (0.04 * scale + bias, 0.04 + 0.96 / 21.0);
    let lost = 1.0 - scale - bias;
    let left = 1.0 - single - single * average * lost / (1.0 - average * lost);
    for map in [random(24, 12, 3), sun(64, 32, SUN)] {
        let tracer = PathTracer::new(&map);
        let [bright, dark] =
            [0.9, 0.1].map(|color| tracer.radiance(dielectric(color), NORMAL, NORMAL, COUNT, 2));
        let irradiance = reference_radiance(&map, Lobe::Lambert, NORMAL);
        for (i, irradiance) in irradiance.into_iter().enumerate() {
            let ratio = (bright.radiance[i] - dark.radiance[i]) / (0.8 * left * irradiance);
            assert!((ratio - 1.0).abs() <= 0.01, "{ratio}: {bright:?}, {dark:?}");
        }
    }
}

#[test]
fn paths_find_the_reflection_of_a_sun_on_a_smooth_metal() {
    // Seen from the normal's direction the kernel of the lobe and the lobe itself are alike.
    let map = sun(64, 32, SUN);
    let surface = metal(1.0, 0.5);
    let (tracer, axis) = (PathTracer::new(&map), NORMAL);
    let traced = tracer.radiance(surface, axis, axis, 4 * COUNT, 3);
    let split = split_sum_radiance(&map, surface, axis, axis);
    for i in 0..3 {
        let ratio = traced.radiance[i] / split[i];
        assert!((0.5..2.0).contains(&ratio), "{traced:?}, split {split:?}");
    }
    let again = tracer.radiance(surface, axis, axis, 4 * COUNT, 4);
    let spread = (0..3).map(|i| {
        let error = traced.standard_error[i].hypot(again.standard_error[i]);
        (traced.radiance[i] - again.radiance[i]).abs() / error
    });
    assert!(spread.fold(0.0, f64::max) <= 5.0, "{traced:?}, with another seed {again:?}");
}
