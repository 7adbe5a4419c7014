//! A texel as a patch of the sphere, and the integral of a lobe over it.

use kiln_sphere::ZonalKernel;
use kiln_sphere::quadrature::gauss_legendre;
use std::f64::consts::PI;
use std::sync::OnceLock;

/// Part of the sphere between two parallels and two meridians; angles in radians.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patch {
    pub(crate) theta: [f64; 2],
    pub(crate) lambda: [f64; 2],
}

/// A direction and the solid angle it stands for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    pub(crate) direction: [f64; 3],
    pub(crate) solid_angle_sr: f64,
}

/// A small part of a patch, as a parallelogram: its centre and its edges' vectors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell {
    pub(crate) node: Node,
    pub(crate) down: [f64; 3],
    pub(crate) right: [f64; 3],
}

impl Patch {
    /// Texel `index` (row by row) of a panorama.
    pub(crate) fn of_texel(width: usize, height: usize, index: usize) -> Self {
        let (row, column) = (index / width, index % width);
        let theta = |row: usize| PI * row as f64 / height as f64;
        let lambda = |column: usize| 2.0 * PI * column as f64 / width as f64;
        Self { theta: [theta(row), theta(row + 1)], lambda: [lambda(column), lambda(column + 1)] }
    }

    /// Height and greatest width.
    fn extent(&self) -> [f64; 2] {
        let [top, bottom] = self.theta;
        let widest =
            if top <= 0.5 * PI && bottom >= 0.5 * PI { 1.0 } else { libm::sin(top).max(libm::sin(bottom)) };
        [bottom - top, (self.lambda[1] - self.lambda[0]) * widest]
    }

    /// The longer side.
    pub(crate) fn size(&self) -> f64 {
        let [height, width] = self.extent();
        height.max(width)
    }

    /// Solid angle in steradians: Δλ (cos θ_0 − cos θ_1), as a product.
    pub(crate) fn solid_angle_sr(&self) -> f64 {
        let [top, bottom] = self.theta;
        let (mid, half) = (0.5 * (top + bottom), 0.5 * (bottom - top));
        (self.lambda[1] - self.lambda[0]) * 2.0 * libm::sin(mid) * libm::sin(half)
    }

    /// The one point that stands for the patch to second order.
    pub(crate) fn centroid(&self) -> Node {
        let (middle, height) = (0.5 * (self.theta[0] + self.theta[1]), self.theta[1] - self.theta[0]);
        let (sin_theta, cos_theta) = libm::sincos(middle + centroid_offset(middle, height));
        let (sin_lambda, cos_lambda) = libm::sincos(0.5 * (self.lambda[0] + self.lambda[1]));
        Node {
            direction: direction(sin_theta, cos_theta, sin_lambda, cos_lambda),
            solid_angle_sr: self.solid_angle_sr(),
        }
    }

    /// Product Gauss rule with `count` points a side.
    pub(crate) fn nodes(&self, count: usize) -> Vec<Node> {
        let rule = gauss(count);
        let at = |[a, b]: [f64; 2], y: f64| a + 0.5 * (b - a) * (1.0 + y);
        let area = 0.25 * (self.theta[1] - self.theta[0]) * (self.lambda[1] - self.lambda[0]);
        let mut nodes = Vec::with_capacity(count * count);
        for &(y, row_weight) in rule {
            let (sin_theta, cos_theta) = libm::sincos(at(self.theta, y));
            for &(x, weight) in rule {
                let (sin_lambda, cos_lambda) = libm::sincos(at(self.lambda, x));
                nodes.push(Node {
                    direction: direction(sin_theta, cos_theta, sin_lambda, cos_lambda),
                    solid_angle_sr: area * row_weight * weight * sin_theta,
                });
            }
        }
        nodes
    }

    /// Halves, cut across the longer side.
    fn split(&self) -> [Self; 2] {
        let middle = |[a, b]: [f64; 2]| 0.5 * (a + b);
        let [height, width] = self.extent();
        if height >= width {
            let cut = middle(self.theta);
            [Self { theta: [self.theta[0], cut], ..*self }, Self { theta: [cut, self.theta[1]], ..*self }]
        } else {
            let cut = middle(self.lambda);
            [Self { lambda: [self.lambda[0], cut], ..*self }, Self { lambda: [cut, self.lambda[1]], ..*self }]
        }
    }

    /// ∫_patch K dω around `axis`; halves the patch until `size_max` times the kernel's local scale, then takes a Gauss
    /// rule of `count`² points.
    pub(crate) fn integrate(
        &self,
        profile: &impl ZonalKernel,
        axis: [f64; 3],
        size_max: f64,
        count: usize,
    ) -> f64 {
        let size = self.size();
        let centre = self.nodes(1)[0].direction;
        let distance2 = distance2(centre, axis);
        if is_below_horizon(distance2, size) {
            return 0.0;
        }
        // The nearest point of the patch is where the kernel varies fastest.
        let chord = (distance2.sqrt() - 0.75 * size).max(0.0);
        let is_smooth = size * size <= size_max * size_max * profile.scale2(chord * chord)
            || profile.is_negligible((distance2.sqrt() + size) * (distance2.sqrt() + size));
        if !is_smooth && size >= 1e-9 {
            return self.split().iter().map(|half| half.integrate(profile, axis, size_max, count)).sum();
        }
        if is_on_horizon(distance2, size) {
            return self.integrate_lit(profile, axis, count.max(6));
        }
        self.nodes(count).iter().map(|node| node.solid_angle_sr * kernel_at(profile, node, axis)).sum()
    }

    /// ∫ K dω over the part of the patch above the horizon of `axis`, by Gauss rules between all kinks.
    ///
    /// With the axis at (θ_a, λ_a) a point is lit where |λ − λ_a| < acos c, c = −cos θ_a cos θ / (sin θ_a sin θ).
    fn integrate_lit(&self, profile: &impl ZonalKernel, axis: [f64; 3], count: usize) -> f64 {
        let (along, across) = (axis[1], libm::hypot(axis[0], axis[2]));
        let lambda_axis = libm::atan2(-axis[0], axis[2]);
        let mut sum = 0.0;
        for piece in self.horizon_cuts(along, across, lambda_axis).windows(2) {
            let half = 0.5 * (piece[1] - piece[0]);
            for &(y, weight) in gauss(count) {
                let (sin_theta, cos_theta) = libm::sincos(piece[0] + half * (1.0 + y));
                let c = (-along * cos_theta / (across * sin_theta).max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0);
                let width = libm::acos(c);
                for turn in [-2.0 * PI, 0.0, 2.0 * PI] {
                    let start = self.lambda[0].max(lambda_axis + turn - width);
                    let end = self.lambda[1].min(lambda_axis + turn + width);
                    if start < end {
                        let arc =
                            arc_integral(sin_theta, cos_theta, [start, end], profile, axis, gauss(count));
                        sum += weight * half * sin_theta * arc;
                    }
                }
            }
        }
        sum
    }

    /// `count`² cells of equal angles, each with its edges.
    pub(crate) fn cells(&self, count: usize) -> Vec<Cell> {
        let part = |[a, b]: [f64; 2], index: usize| {
            let at = |index: usize| a + (b - a) * index as f64 / count as f64;
            [at(index), at(index + 1)]
        };
        let cell = |index: usize| {
            let theta = part(self.theta, index / count);
            let lambda = part(self.lambda, index % count);
            let node = Patch { theta, lambda }.centroid();
            let [x, y, z] = node.direction;
            let sin_theta = libm::hypot(x, z);
            let (height, width) = (theta[1] - theta[0], lambda[1] - lambda[0]);
            let turn = height * y / sin_theta.max(f64::MIN_POSITIVE);
            Cell {
                node,
                down: [x * turn, -sin_theta * height, z * turn],
                right: [-z * width, 0.0, x * width],
            }
        };
        (0..count * count).map(cell).collect()
    }

    /// The patch's θ range, cut where the horizon meets a meridian of its edge or turns back:
    /// cot θ = −tan θ_a cos(λ − λ_a).
    fn horizon_cuts(&self, along: f64, across: f64, lambda_axis: f64) -> Vec<f64> {
        let edges = self.lambda.map(|lambda| libm::cos(lambda - lambda_axis));
        let mut cuts = self.theta.to_vec();
        for cosine in [edges[0], edges[1], 1.0, -1.0] {
            let theta = libm::atan2(along, -across * cosine);
            let theta = if theta < 0.0 { theta + PI } else { theta };
            if self.theta[0] < theta && theta < self.theta[1] {
                cuts.push(theta);
            }
        }
        cuts.sort_unstable_by(f64::total_cmp);
        cuts
    }
}

/// ∫ K dλ along a parallel.
fn arc_integral(
    sin_theta: f64,
    cos_theta: f64,
    [start, end]: [f64; 2],
    profile: &impl ZonalKernel,
    axis: [f64; 3],
    rule: &[(f64, f64)],
) -> f64 {
    let half = 0.5 * (end - start);
    let term = |&(x, weight): &(f64, f64)| {
        let (sin_lambda, cos_lambda) = libm::sincos(start + half * (1.0 + x));
        let node =
            Node { direction: direction(sin_theta, cos_theta, sin_lambda, cos_lambda), solid_angle_sr: 1.0 };
        weight * half * kernel_at(profile, &node, axis)
    };
    rule.iter().map(term).sum()
}

/// Whether a patch of `size`, its centre at a squared chord from the axis, lies wholly where cos θ ≤ 0.
#[inline]
pub(crate) fn is_below_horizon(distance2: f64, size: f64) -> bool {
    1.0 - 0.5 * distance2 < -size
}

/// Whether such a patch may be cut by the horizon cos θ = 0.
#[inline]
pub(crate) fn is_on_horizon(distance2: f64, size: f64) -> bool {
    (1.0 - 0.5 * distance2).abs() <= size
}

/// Gauss rules of up to [`GAUSS_MAX`] points, made once.
fn gauss(count: usize) -> &'static [(f64, f64)] {
    static RULES: OnceLock<Vec<Vec<(f64, f64)>>> = OnceLock::new();
    &RULES.get_or_init(|| (0..=GAUSS_MAX).map(gauss_legendre).collect())[count]
}

const GAUSS_MAX: usize = 8;

/// Unit direction at (θ, λ): θ from +Y, λ = 2πu of the panorama.
pub(crate) fn direction(sin_theta: f64, cos_theta: f64, sin_lambda: f64, cos_lambda: f64) -> [f64; 3] {
    [-sin_theta * sin_lambda, cos_theta, sin_theta * cos_lambda]
}

/// |a − b|² = 2 (1 − a·b) for unit vectors, exact where they meet.
#[inline]
pub(crate) fn distance2(a: [f64; 3], b: [f64; 3]) -> f64 {
    let (x, y, z) = (a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    x * x + y * y + z * z
}

/// From the middle of a patch's θ range to the centroid of its sin θ.
#[inline]
pub(crate) fn centroid_offset(middle: f64, height: f64) -> f64 {
    height * height / 12.0 * libm::cos(middle) / libm::sin(middle)
}

/// The kernel at a node.
#[inline]
pub(crate) fn kernel_at(profile: &impl ZonalKernel, node: &Node, axis: [f64; 3]) -> f64 {
    profile.at(0.5 * distance2(node.direction, axis))
}
