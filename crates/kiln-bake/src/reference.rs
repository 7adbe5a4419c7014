//! The slow, obvious form: every patch against the kernel, for one direction.

use crate::patch::{Node, Patch, direction, distance2, is_below_horizon, is_on_horizon, kernel_at};
use crate::prefilter::usable;
use kiln_image::Panorama;
use kiln_sphere::quadrature::gauss_legendre;
use kiln_sphere::{Cancel, Lobe, ZonalKernel};
use rayon::prelude::*;
use std::f64::consts::PI;

/// What an exact prefiltered map holds in `axis` (a unit vector): Σ_texels f ∫_patch K dω / ∫ K dω.
///
/// `f64` throughout; each patch by product Gauss rules, halved near the lobe until the rule leaves 1e-9 of it.
/// Shares only the kernel's formula with the transform. Costs 4 kernel values a texel and more: for tests and reports.
/// The lobe's α is brought into range as by [`crate::specular_level`].
pub fn reference_radiance(panorama: &Panorama, lobe: Lobe, axis: [f64; 3]) -> [f64; 3] {
    let lobe = usable(lobe);
    let (width, height) = (panorama.width(), panorama.height());
    let kernel = lobe.kernel(0, Cancel::NEVER).expect("nobody cancels");
    let profile = lobe.profile(kernel.ln_norm);
    let columns = Columns::new(width);
    let rows: Vec<[f64; 3]> = (0..height)
        .into_par_iter()
        .map(|row| {
            let texels = &panorama.rgb()[row * width * 3..(row + 1) * width * 3];
            columns.integrate_row(Patch::of_texel(width, height, row * width).theta, texels, &profile, axis)
        })
        .collect();
    let mut sum = [0.0; 3];
    for row in rows {
        for (s, value) in sum.iter_mut().zip(row) {
            *s += value;
        }
    }
    sum
}

/// Patches at most this many lobe scales wide are smooth enough for the rules below.
const SMOOTH_SIZE: f64 = 0.01;

/// Sine and cosine of the longitudes of a two-point rule in each column.
struct Columns {
    width: usize,
    nodes: Vec<[(f64, f64); 2]>,
}

impl Columns {
    fn new(width: usize) -> Self {
        let rule = gauss_legendre(2);
        let lambda = |column: usize, y: f64| 2.0 * PI * (column as f64 + 0.5 + 0.5 * y) / width as f64;
        let nodes = (0..width)
            .map(|column| [libm::sincos(lambda(column, rule[0].0)), libm::sincos(lambda(column, rule[1].0))])
            .collect();
        Self { width, nodes }
    }

    fn integrate_row(
        &self,
        theta: [f64; 2],
        texels: &[f32],
        profile: &impl ZonalKernel,
        axis: [f64; 3],
    ) -> [f64; 3] {
        let half = 0.5 * (theta[1] - theta[0]);
        let rows: Vec<(f64, f64)> =
            gauss_legendre(2).iter().map(|&(y, _)| libm::sincos(theta[0] + half * (1.0 + y))).collect();
        let cell = 2.0 * PI / self.width as f64;
        let area = 0.5 * cell * half;
        let size = Patch { theta, lambda: [0.0, cell] }.size();
        let mut sum = [0.0; 3];
        for (column, (texel, longitudes)) in texels.chunks_exact(3).zip(&self.nodes).enumerate() {
            let (sin_lambda, cos_lambda) = longitudes[0];
            let corner = direction(rows[0].0, rows[0].1, sin_lambda, cos_lambda);
            let distance2 = distance2(corner, axis);
            let near = (distance2.sqrt() - 1.5 * size).max(0.0);
            if is_below_horizon(distance2, 2.0 * size) {
                continue;
            }
            let is_far = !is_on_horizon(distance2, 2.0 * size);
            let mass = if is_far && size * size <= SMOOTH_SIZE * SMOOTH_SIZE * profile.scale2(near * near) {
                four_points(&rows, longitudes, area, profile, axis)
            } else {
                let lambda = [cell * column as f64, cell * (column + 1) as f64];
                Patch { theta, lambda }.integrate(profile, axis, 0.2, 4)
            };
            for (s, &value) in sum.iter_mut().zip(texel) {
                *s += mass * f64::from(value);
            }
        }
        sum
    }
}

fn four_points(
    rows: &[(f64, f64)],
    columns: &[(f64, f64); 2],
    area: f64,
    profile: &impl ZonalKernel,
    axis: [f64; 3],
) -> f64 {
    let mut mass = 0.0;
    for &(sin_theta, cos_theta) in rows {
        for &(sin_lambda, cos_lambda) in columns {
            let direction = direction(sin_theta, cos_theta, sin_lambda, cos_lambda);
            mass += kernel_at(profile, &Node { direction, solid_angle_sr: 1.0 }, axis) * sin_theta;
        }
    }
    mass * area
}
