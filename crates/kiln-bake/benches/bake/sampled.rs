//! A plain sampled estimator beside the bake: what most tools do, at N = 1024.
//!
//! GGX importance sampling with N = V = R: half vectors from the Hammersley points (i/N, radical inverse of i), each light
//! weighted by n·l, the panorama read bilinearly and not filtered. The lights are worked out once a map, in the tangent
//! frame. Bilinear reads see no constant patches; the difference is far below the estimator's noise.

use crate::accuracy::{FACE_SIZE, LAST_LEVEL, Reference, WANTED, bake, rms, texel_direction};
use crate::clock::{Took, once};
use crate::panoramas::{Named, bilinear, real, studio, suns};
use kiln_bake::{AnalysisRequest, BruteForce, Cancel, Lobe, analyse};
use kiln_image::Panorama;
use kiln_sphere::panorama_uv;
use rayon::prelude::*;
use std::f64::consts::PI;

const SAMPLES: u32 = 1024;
const ERROR: f64 = 1e-3;
/// Of a map with more texels as many are timed, evenly spread, and the time is scaled.
const TIMED: usize = 1536;

/// Lights around +Z of half vectors distributed as GGX, with n·l > 0 as weight.
fn lights(alpha: f64) -> Vec<[f64; 3]> {
    let light = |index: u32| {
        let (u, v) = (f64::from(index) / f64::from(SAMPLES), f64::from(index.reverse_bits()) / 4294967296.0);
        let cos2 = (1.0 - v) / (1.0 + (alpha * alpha - 1.0) * v);
        let (cos, sin) = (cos2.sqrt(), (1.0 - cos2).max(0.0).sqrt());
        let (sin_phi, cos_phi) = libm::sincos(2.0 * PI * u);
        [2.0 * cos * sin * cos_phi, 2.0 * cos * sin * sin_phi, 2.0 * cos2 - 1.0]
    };
    (0..SAMPLES).map(light).filter(|light| light[2] > 0.0).collect()
}

/// Σ L n·l / Σ n·l around an axis.
fn estimate(panorama: &Panorama, lights: &[[f64; 3]], axis: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = axis;
    // Duff et al. 2017, "Building an orthonormal basis, revisited".
    let sign = 1.0_f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    let (first, second) = ([1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y]);
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for &[s, t, weight] in lights {
        let [u, v] = panorama_uv(std::array::from_fn(|i| s * first[i] + t * second[i] + weight * axis[i]));
        for (sum, value) in sum.iter_mut().zip(bilinear(panorama, u, v)) {
            *sum += weight * f64::from(value);
        }
        total += weight;
    }
    sum.map(|sum| sum / total)
}

/// What all texels of a map take, from some of them.
fn time(panorama: &Panorama, lights: &[[f64; 3]], face_size: usize) -> Took {
    let all = 6 * face_size * face_size;
    let texels: Vec<usize> = (0..all).step_by((all / TIMED).max(1)).collect();
    let work = || -> Vec<[f64; 3]> {
        let of = |&texel: &usize| estimate(panorama, lights, texel_direction(face_size, texel));
        texels.par_iter().map(of).collect()
    };
    let (_, took) = once(work);
    let scale = all as f64 / texels.len() as f64;
    Took { cpu_s: took.cpu_s * scale, wall_s: took.wall_s * scale }
}

pub(crate) fn run(only: &str) {
    println!("\n== Beside a plain sampled estimator, {SAMPLES} GGX samples a texel, bilinear, unfiltered");
    println!(
        "RMS error over RMS; its time is of at least {TIMED} texels a map, scaled; ours at error = {ERROR:e}, analysis included"
    );
    let others = real("venice.hdr").into_iter().chain(suns(1024, "sun, 1e5 over 1"));
    for Named { name, panorama } in [studio()].into_iter().chain(others) {
        if !name.contains(only) {
            continue;
        }
        println!("{name}, {}x{}", panorama.width(), panorama.height());
        let force = BruteForce::new(&panorama, Cancel::NEVER).expect(WANTED);
        let request = AnalysisRequest { alpha_min: 1.0 / 64.0, sheen_alpha_min: None, error: ERROR };
        let (analysis, took) = once(|| analyse(&panorama, &request, Cancel::NEVER).expect(WANTED));
        let (mut ours, mut theirs) = (took, Took::default());
        for level in 1..=LAST_LEVEL {
            let (alpha, face_size) = ((level as f64 / LAST_LEVEL as f64).powi(2), FACE_SIZE >> level);
            let lobe = Lobe::Ggx { alpha };
            let (map, took) = once(|| bake(&analysis, lobe, face_size));
            let lights = lights(alpha);
            let sampled = time(&panorama, &lights, face_size);
            for (sum, took) in [(&mut ours, took), (&mut theirs, sampled)] {
                sum.cpu_s += took.cpu_s;
                sum.wall_s += took.wall_s;
            }
            let reference = Reference::new(&force, lobe, face_size);
            let exact = reference.compare_map(&map.cube);
            let estimate = |texel| estimate(&panorama, &lights, texel_direction(face_size, texel));
            let noisy = reference.compare(estimate, rms(&map.cube));
            println!(
                "  mip {level}, {face_size:3}: ours {:.1e} in {:8.1} CPU-ms, sampled {:.1e} in {:8.1} CPU-ms",
                exact.rms,
                took.cpu_s * 1e3,
                noisy.rms,
                sampled.cpu_s * 1e3
            );
        }
        println!(
            "  chain: ours {:.3} CPU-s, sampled {:.2} CPU-s, {:.0} times as much",
            ours.cpu_s,
            theirs.cpu_s,
            theirs.cpu_s / ours.cpu_s
        );
    }
}
