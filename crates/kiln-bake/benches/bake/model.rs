//! What the split sum costs: the shading model with exact lookups beside a path tracer of the same lobes.
//!
//! The error that no map takes away, and so the least that a renderer with prefiltered maps has: a sphere seen from afar,
//! whole and over its rim, where the lobe is stretched and the lookup's is not (Karis 2013 assumes N = V = R).

use crate::panoramas::{Named, real, studio, suns};
use kiln_bake::{PathTracer, Surface, split_sum_radiance};
use kiln_image::{Image, Panorama};
use rayon::prelude::*;

/// Points of the sphere's picture along each axis.
const GRID: usize = 12;
/// Directions of each kind in each of 16 runs.
const COUNT: u32 = 1024;
/// Columns of the panorama: every texel is looked at for every point.
const WIDTH: usize = 256;
/// Beyond this the rim begins.
const RIM_N_DOT_V: f64 = 0.5;

const SURFACES: [(&str, [f64; 3], f64); 2] =
    [("metal", [0.9, 0.6, 0.3], 1.0), ("dielectric", [0.9, 0.6, 0.3], 0.0)];

struct Point {
    n_dot_v: f64,
    split: [f64; 3],
    traced: [f64; 3],
    standard_error: [f64; 3],
}

pub(crate) fn run(only: &str) {
    println!(
        "\n== Model: the split sum with exact lookups beside path tracing, a sphere from afar, panoramas averaged to {WIDTH} columns"
    );
    println!(
        "RMS difference over RMS radiance; whole sphere, where n·v < {RIM_N_DOT_V}, and the path tracer's standard error"
    );
    let named = ["venice.hdr", "sunset.hdr"].into_iter().flat_map(real);
    for Named { name, panorama } in [studio()].into_iter().chain(named).chain(suns(256, "sun, 1e5 over 1")) {
        if !name.contains(only) {
            continue;
        }
        let panorama = averaged(panorama);
        println!("{name}, {}x{}", panorama.width(), panorama.height());
        for (what, color, metallic) in SURFACES {
            for roughness in [0.1, 0.25, 0.5, 0.75, 1.0] {
                let points = sphere(&panorama, Surface { color, metallic, roughness });
                let rim: Vec<&Point> = points.iter().filter(|point| point.n_dot_v < RIM_N_DOT_V).collect();
                let all: Vec<&Point> = points.iter().collect();
                let difference = |point: &Point, i: usize| point.split[i] - point.traced[i];
                println!(
                    "  {what:<11} roughness {roughness:<4}  {:>7.2} %   rim {:>7.2} %   +- {:.2} %",
                    100.0 * relative_rms(&all, difference),
                    100.0 * relative_rms(&rim, difference),
                    100.0 * relative_rms(&all, |point, i| point.standard_error[i]),
                );
            }
        }
    }
}

fn sphere(panorama: &Panorama, surface: Surface) -> Vec<Point> {
    let tracer = PathTracer::new(panorama);
    let at = |step: usize| (step as f64 + 0.5) / GRID as f64 * 2.0 - 1.0;
    let normals = (0..GRID * GRID).filter_map(|index| {
        let (x, y) = (at(index % GRID), at(index / GRID));
        let z2 = 1.0 - x * x - y * y;
        (z2 > 0.0).then(|| [x, y, z2.sqrt()])
    });
    let normals: Vec<[f64; 3]> = normals.collect();
    let view = [0.0, 0.0, 1.0];
    let points = normals.par_iter().enumerate().map(|(seed, &normal)| {
        let traced = tracer.radiance(surface, normal, view, COUNT, seed as u64);
        Point {
            n_dot_v: normal[2],
            split: split_sum_radiance(panorama, surface, normal, view),
            traced: traced.radiance,
            standard_error: traced.standard_error,
        }
    });
    points.collect()
}

fn relative_rms(points: &[&Point], value: impl Fn(&Point, usize) -> f64) -> f64 {
    let sum = |of: &dyn Fn(&Point, usize) -> f64| -> f64 {
        points.iter().flat_map(|point| (0..3).map(|i| of(point, i).powi(2))).sum()
    };
    (sum(&value) / sum(&|point, i| point.traced[i])).sqrt()
}

/// Whole blocks averaged down to [`WIDTH`] columns; as it is where that does not work out.
fn averaged(panorama: Panorama) -> Panorama {
    let block = panorama.width() / WIDTH;
    if block < 2 || block * WIDTH != panorama.width() || block * (WIDTH / 2) != panorama.height() {
        return panorama;
    }
    let mean = |x: usize, y: usize| {
        let inside = |at: usize| panorama.texel(x * block + at % block, y * block + at / block);
        let sum = (0..block * block)
            .map(inside)
            .fold([0.0_f64; 3], |sum, texel| std::array::from_fn(|i| sum[i] + f64::from(texel[i])));
        sum.map(|value| (value / (block * block) as f64) as f32)
    };
    let rgb = (0..WIDTH / 2).flat_map(|y| (0..WIDTH).flat_map(move |x| mean(x, y))).collect();
    let image = Image::new(WIDTH, WIDTH / 2, rgb);
    image.ok().and_then(|image| Panorama::new(image).ok()).unwrap_or(panorama)
}
