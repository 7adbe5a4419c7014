//! ꟻLIP: what the eye makes of the difference between two pictures shown one after the other.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild 2020, "ꟻLIP: A Difference Evaluator for Alternating
//! Images", PACM CGIT 3(2). Constants are the paper's. Filters are sums of Gaussians, so they run along rows, then columns;
//! borders repeat.

use std::f64::consts::PI;

use rayon::prelude::*;

use super::{Picture, linear};

/// Of an observer 0.7 m before a screen of 0.7 m and 3840 pixels.
pub const PIXELS_PER_DEGREE: f64 = 67.020_643_276_582_25;

/// Exponents of colour and feature differences.
const COLOR_EXPONENT: f64 = 0.7;
const FEATURE_EXPONENT: f64 = 0.5;
/// The share of the largest colour difference that is mapped to the second number.
const KNEE: (f64, f64) = (0.4, 0.95);
/// Width of the eye's edge and point detectors in degrees.
const FEATURE_WIDTH_DEGREES: f64 = 0.082;

/// Contrast sensitivity of a channel: a₁ √(π/b₁) exp(−π²x²/b₁) + a₂ √(π/b₂) exp(−π²x²/b₂), x in degrees.
struct Sensitivity {
    a: [f64; 2],
    b: [f64; 2],
}

/// Achromatic, red-green, blue-yellow.
const SENSITIVITIES: [Sensitivity; 3] = [
    Sensitivity { a: [1.0, 0.0], b: [0.0047, 1e-5] },
    Sensitivity { a: [1.0, 0.0], b: [0.0053, 1e-5] },
    Sensitivity { a: [34.1, 13.5], b: [0.04, 0.025] },
];

/// White of sRGB, D65, as CIE XYZ.
const WHITE: [f64; 3] = [0.950_428_545, 1.0, 1.088_900_371];

/// The error of each pixel, 0 to 1, for an observer to whom a degree is as many pixels. Both pictures have one size.
pub fn flip(reference: Picture<'_>, test: Picture<'_>, pixels_per_degree: f64) -> Vec<f32> {
    let size = [reference.width, reference.height];
    let [reference, test] = [reference, test].map(|picture| Seen::new(picture, pixels_per_degree));
    let color_max = hyab(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0])).powf(COLOR_EXPONENT);
    (0..size[0] * size[1])
        .into_par_iter()
        .map(|at| {
            let color = hyab(reference.colors[at], test.colors[at]).powf(COLOR_EXPONENT);
            let color = redistribute(color, color_max);
            let features = [(&reference.edges, &test.edges), (&reference.points, &test.points)];
            let feature = features.map(|(a, b)| (a[at] - b[at]).abs()).into_iter().fold(0.0, f64::max);
            let feature = (feature / 2f64.sqrt()).powf(FEATURE_EXPONENT).min(1.0);
            color.powf(1.0 - feature) as f32
        })
        .collect()
}

/// A picture as the eye takes it in.
struct Seen {
    /// Filtered, as L*a*b* with Hunt's adjustment.
    colors: Vec<[f64; 3]>,
    edges: Vec<f64>,
    points: Vec<f64>,
}

impl Seen {
    fn new(picture: Picture<'_>, pixels_per_degree: f64) -> Seen {
        let size = [picture.width, picture.height];
        let opponent: Vec<[f64; 3]> = linear(picture).into_iter().map(opponent_of_linear).collect();
        let channel = |index: usize| opponent.iter().map(|color| color[index]).collect::<Vec<f64>>();
        let filtered = [0, 1, 2].map(|index| {
            filter_by_sensitivity(&channel(index), size, &SENSITIVITIES[index], pixels_per_degree)
        });
        let color = |at: usize| {
            let linear = linear_of_opponent([filtered[0][at], filtered[1][at], filtered[2][at]]);
            hunt_lab(linear.map(|value| value.clamp(0.0, 1.0)))
        };
        let lightness: Vec<f64> = opponent.iter().map(|color| (color[0] + 16.0) / 116.0).collect();
        let detectors = Detectors::new(pixels_per_degree);
        Seen {
            colors: (0..opponent.len()).into_par_iter().map(color).collect(),
            edges: detectors.magnitude(&lightness, size, &detectors.edge),
            points: detectors.magnitude(&lightness, size, &detectors.point),
        }
    }
}

fn filter_by_sensitivity(
    values: &[f64],
    size: [usize; 2],
    sensitivity: &Sensitivity,
    pixels_per_degree: f64,
) -> Vec<f64> {
    // The widest of all channels' Gaussians, to three deviations.
    let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as i64;
    let mut sum = vec![0.0; values.len()];
    let mut total = 0.0;
    for (a, b) in sensitivity.a.into_iter().zip(sensitivity.b).filter(|(a, _)| *a > 0.0) {
        let taps: Vec<f64> = (-radius..=radius)
            .map(|x| (-PI * PI * (x as f64 / pixels_per_degree).powi(2) / b).exp())
            .collect();
        let weight = a * (PI / b).sqrt();
        let blurred = convolve(values, size, &taps, &taps);
        sum.iter_mut().zip(blurred).for_each(|(sum, value)| *sum += weight * value);
        total += weight * taps.iter().sum::<f64>().powi(2);
    }
    sum.iter_mut().for_each(|value| *value /= total);
    sum
}

/// What responds to edges and points along one axis, times a Gaussian across it.
struct Detectors {
    across: Vec<f64>,
    edge: Vec<f64>,
    point: Vec<f64>,
}

impl Detectors {
    fn new(pixels_per_degree: f64) -> Detectors {
        let deviation = 0.5 * FEATURE_WIDTH_DEGREES * pixels_per_degree;
        let radius = (3.0 * deviation).ceil() as i64;
        let of = |shape: &dyn Fn(f64) -> f64| -> Vec<f64> {
            (-radius..=radius).map(|x| shape(x as f64)).collect()
        };
        let gaussian = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
        let across = of(&gaussian);
        let sum: f64 = across.iter().sum();
        Detectors {
            edge: balanced(of(&|x| -x * gaussian(x))),
            point: balanced(of(&|x| (x * x / (deviation * deviation) - 1.0) * gaussian(x))),
            across: across.iter().map(|value| value / sum).collect(),
        }
    }

    /// Length of the responses along x and y.
    fn magnitude(&self, values: &[f64], size: [usize; 2], along: &[f64]) -> Vec<f64> {
        let along_x = convolve(values, size, along, &self.across);
        let along_y = convolve(values, size, &self.across, along);
        along_x.into_iter().zip(along_y).map(|(x, y)| x.hypot(y)).collect()
    }
}

/// Positive weights sum up to 1, negative ones to −1.
fn balanced(taps: Vec<f64>) -> Vec<f64> {
    let positive: f64 = taps.iter().filter(|tap| **tap > 0.0).sum();
    let negative: f64 = -taps.iter().filter(|tap| **tap < 0.0).sum::<f64>();
    taps.into_iter().map(|tap| if tap > 0.0 { tap / positive } else { tap / negative }).collect()
}

/// Correlates rows with `along_x`, then columns with `along_y`; borders repeat.
fn convolve(values: &[f64], [width, height]: [usize; 2], along_x: &[f64], along_y: &[f64]) -> Vec<f64> {
    let within = |at: usize, offset: usize, radius: usize, count: usize| {
        (at + offset).saturating_sub(radius).min(count - 1)
    };
    if values.is_empty() {
        return Vec::new();
    }
    let mut rows = vec![0.0; values.len()];
    rows.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
        let source = &values[y * width..(y + 1) * width];
        for (x, value) in row.iter_mut().enumerate() {
            let taps = along_x.iter().enumerate();
            *value = taps.map(|(at, tap)| tap * source[within(x, at, along_x.len() / 2, width)]).sum();
        }
    });
    let mut out = vec![0.0; values.len()];
    out.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
        for (at, tap) in along_y.iter().enumerate() {
            let source = within(y, at, along_y.len() / 2, height) * width;
            row.iter_mut().zip(&rows[source..source + width]).for_each(|(sum, value)| *sum += tap * value);
        }
    });
    out
}

/// Linear Rec. 709 to CIE XYZ, IEC 61966-2-1.
fn xyz_of_linear([r, g, b]: [f64; 3]) -> [f64; 3] {
    [
        10_135_552.0 / 24_577_794.0 * r + 8_788_810.0 / 24_577_794.0 * g + 4_435_075.0 / 24_577_794.0 * b,
        2_613_072.0 / 12_288_897.0 * r + 8_788_810.0 / 12_288_897.0 * g + 887_015.0 / 12_288_897.0 * b,
        1_425_312.0 / 73_733_382.0 * r + 8_788_810.0 / 73_733_382.0 * g + 70_074_185.0 / 73_733_382.0 * b,
    ]
}

fn linear_of_xyz([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.241_003_275 * x - 1.537_398_934 * y - 0.498_615_861 * z,
        -0.969_224_334 * x + 1.875_930_071 * y + 0.041_554_224 * z,
        0.055_639_423 * x - 0.204_011_202 * y + 1.057_148_933 * z,
    ]
}

/// YyCxCz: lightness and two opponent colours, linear in XYZ.
fn opponent_of_linear(linear: [f64; 3]) -> [f64; 3] {
    let xyz = xyz_of_linear(linear);
    let [x, y, z] = [0, 1, 2].map(|at| xyz[at] / WHITE[at]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn linear_of_opponent([yy, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (yy + 16.0) / 116.0;
    linear_of_xyz([(y + cx / 500.0) * WHITE[0], y * WHITE[1], (y - cz / 200.0) * WHITE[2]])
}

/// CIE L*a*b*, its colours weaker where it is dark (Hunt).
fn hunt_lab(linear: [f64; 3]) -> [f64; 3] {
    const DELTA: f64 = 6.0 / 29.0;
    let xyz = xyz_of_linear(linear);
    let [x, y, z] = [0, 1, 2].map(|at| {
        let t = xyz[at] / WHITE[at];
        if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    });
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// City blocks along lightness, straight across colours.
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// Small differences get most of the range.
fn redistribute(error: f64, error_max: f64) -> f64 {
    let (share, value) = KNEE;
    let knee = share * error_max;
    if error < knee {
        return error * value / knee;
    }
    (value + (error - knee) / (error_max - knee) * (1.0 - value)).min(1.0)
}
