//! The brightest texels leave the transform through their own door: each is convolved with the exact kernel.

use crate::analysis::{BRIGHT_MAX, Need, Sums};
use crate::patch::{Cell, Node, Patch, is_below_horizon, is_on_horizon};
use kiln_sphere::{Cancel, Cancelled, ZonalKernel};

/// A texel's excess over what the transform keeps of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BrightTexel {
    /// Row by row.
    pub(crate) index: usize,
    pub(crate) excess: [f64; 3],
}

/// Texels below this many times the mean radiance stay with the transform: nothing there can ring visibly.
const BRIGHTNESS_MIN: f64 = 16.0;

/// The excess of the brightest texels (by their largest channel) over the brightest that stays; what is left of each has
/// its hue ([`without`]).
///
/// As many, up to [`BRIGHT_MAX`], as save more degrees than they cost: a sun goes, a lit window stays.
pub(crate) fn take_brightest(
    width: usize,
    height: usize,
    rgb: &[f32],
    whole: &Sums,
    need: &Need,
    cancel: Cancel,
) -> Result<Vec<BrightTexel>, Cancelled> {
    let limit = BRIGHTNESS_MIN * whole.mean().iter().fold(0.0, |a: f64, &b| a.max(b));
    let texel_count = rgb.len() / 3;
    let most = BRIGHT_MAX.min(texel_count - 1);
    let top = brightest(width, rgb, most + 1, cancel)?;
    let stays = |taken: usize| if texel_count == 1 { 0.0 } else { top[taken].0 };
    let most = top[..most].iter().take_while(|(value, _)| f64::from(*value) > limit).count();
    let variance_without = |taken: usize| {
        let take = |rest: Sums, &(value, index): &(f32, usize)| {
            let texel = [0, 1, 2].map(|channel| f64::from(rgb[3 * index + channel]));
            let excess = texel.map(|whole| whole * (1.0 - f64::from(stays(taken) / value)));
            rest.without(texel, excess, Patch::of_texel(width, height, index).solid_angle_sr())
        };
        top[..taken].iter().fold(whole.clone(), take).variance()
    };
    let cost = |&taken: &usize| {
        let degrees = need.band_limit(variance_without(taken)) as f64;
        degrees * degrees + need.texel_cost * taken as f64
    };
    let doubling = std::iter::successors(Some(1), |count| Some(2 * count)).take_while(|&count| count < most);
    let counts = [0, most].into_iter().chain(doubling);
    let taken = counts.min_by(|a, b| cost(a).total_cmp(&cost(b)).then(a.cmp(b))).unwrap_or(0);
    let stays = stays(taken);
    let take = |&(value, index): &(f32, usize)| {
        let excess = std::array::from_fn(|channel| {
            let whole = rgb[3 * index + channel];
            f64::from(whole - whole * (stays / value))
        });
        BrightTexel { index, excess }
    };
    let mut bright: Vec<BrightTexel> = top[..taken].iter().map(take).collect();
    bright.retain(|texel| texel.excess.iter().any(|&value| value > 0.0));
    Ok(bright)
}

/// What is left of a texel; it and the excess add up to the texel exactly.
pub(crate) fn without(texel: &mut [f32], excess: [f64; 3]) {
    for (value, excess) in texel.iter_mut().zip(excess) {
        // The excess came from `f32`, and both differences are exact: either part is at most twice the other (Sterbenz).
        *value -= excess as f32;
    }
}

/// The `count` brightest texels (value, index), brightest first, of equal ones the first.
fn brightest(
    width: usize,
    rgb: &[f32],
    count: usize,
    cancel: Cancel,
) -> Result<Vec<(f32, usize)>, Cancelled> {
    let descending = |a: &(f32, usize), b: &(f32, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
    let mut top: Vec<(f32, usize)> = Vec::new();
    // Row by row, since one selection from all texels could not be interrupted.
    for (row, texels) in rgb.chunks(width * 3).enumerate() {
        cancel.check()?;
        let brightness = |texel: &[f32]| texel.iter().fold(0.0, |a: f32, &b| a.max(b));
        let values = texels.chunks_exact(3).map(brightness).enumerate();
        let values = values.map(|(column, value)| (value, row * width + column));
        let least = top.get(count - 1).copied();
        top.extend(values.filter(|value| least.is_none_or(|least| descending(value, &least).is_lt())));
        if top.len() >= count {
            top.select_nth_unstable_by(count - 1, descending);
            top.truncate(count);
        }
    }
    top.sort_unstable_by(descending);
    Ok(top)
}

/// Axes handled side by side.
pub(crate) const LANES: usize = 8;
type Lanes = [f64; LANES];

/// Bright texels with their quadrature rules.
pub(crate) struct BrightSet<K> {
    kernel: K,
    texels: Vec<RuledTexel>,
    /// Largest (size/scale)² each rule is good for.
    size2_max: [f64; RULES],
}

struct RuledTexel {
    patch: Patch,
    centre: [f64; 3],
    size: f64,
    excess: [f64; 3],
    /// Gauss rules of 1² … [`RULES`]² points.
    rules: [Vec<Node>; RULES],
    /// For axes whose horizon cuts the texel.
    cells: Vec<Cell>,
}

const RULES: usize = 4;
/// Cells along a side of a texel on the horizon: with them the kernel's slope there is followed to 1e-6.
const CELLS: usize = 4;
/// Texels larger than this (radians) are no parallelograms; their horizon is integrated exactly, and slowly.
const FLAT_MAX: f64 = 0.03;

impl<K: ZonalKernel> BrightSet<K> {
    /// `error`: relative error of a patch's integral that a rule may leave.
    pub(crate) fn new(width: usize, height: usize, bright: &[BrightTexel], kernel: K, error: f64) -> Self {
        let ruled = |texel: &BrightTexel| {
            let patch = Patch::of_texel(width, height, texel.index);
            let rules: [Vec<Node>; RULES] = std::array::from_fn(|index| match index {
                0 => vec![patch.centroid()],
                _ => patch.nodes(index + 1),
            });
            let centre = rules[0][0].direction;
            let cells = patch.cells(CELLS);
            RuledTexel { patch, centre, size: patch.size(), excess: texel.excess, rules, cells }
        };
        // With the kernel's nearest pole at distance d, n Gauss points leave about 10 (size/4d)^2n; so
        // size/d ≤ 4 (error/10)^(1/2n).
        let size2_max = std::array::from_fn(|index| 16.0 * libm::pow(0.1 * error, 1.0 / (index + 1) as f64));
        Self { kernel, texels: bright.iter().map(ruled).collect(), size2_max }
    }

    /// Σ_texels excess · ∫_patch K dω around each of the axes (x, y, z of all), per channel.
    #[inline(always)]
    pub(crate) fn convolve(&self, axes: &[Lanes; 3]) -> [Lanes; 3] {
        let mut sum = [[0.0; LANES]; 3];
        for texel in &self.texels {
            let Some(mass) = self.integrate(texel, axes) else { continue };
            for (sum, excess) in sum.iter_mut().zip(texel.excess) {
                for lane in 0..LANES {
                    sum[lane] += mass[lane] * excess;
                }
            }
        }
        sum
    }

    /// `None` where the texel lies below all horizons, or where the kernel is nothing.
    #[inline(always)]
    fn integrate(&self, texel: &RuledTexel, axes: &[Lanes; 3]) -> Option<Lanes> {
        let one_minus_x = one_minus_cosines(texel.centre, axes);
        let nearest = one_minus_x.iter().fold(f64::INFINITY, |a: f64, &b| a.min(b));
        if is_below_horizon(2.0 * nearest, texel.size) {
            return None;
        }
        let farthest = one_minus_x.iter().fold(0.0, |a: f64, &b| a.max(b));
        let far = (2.0 * farthest).sqrt() + texel.size;
        if self.kernel.is_negligible(far * far) {
            return None;
        }
        // Along one side the kernel is seen from as near as half the other side closer.
        let chord = ((2.0 * nearest).sqrt() - 0.5 * texel.size).max(0.0);
        let scale2 = self.kernel.scale2(chord * chord);
        let size2 = texel.size * texel.size;
        let is_cut = one_minus_x.iter().any(|&u| is_on_horizon(2.0 * u, texel.size));
        if is_cut && texel.size <= FLAT_MAX {
            let mut mass = [0.0; LANES];
            for cell in &texel.cells {
                self.add_cell(cell, axes, &mut mass);
            }
            return Some(mass);
        }
        if !is_cut && let Some(rule) = (0..RULES).find(|&rule| size2 <= self.size2_max[rule] * scale2) {
            let mut mass = [0.0; LANES];
            for node in &texel.rules[rule] {
                let one_minus_x = one_minus_cosines(node.direction, axes);
                for lane in 0..LANES {
                    mass[lane] += node.solid_angle_sr * self.kernel.at(one_minus_x[lane]);
                }
            }
            return Some(mass);
        }
        Some(self.integrate_slowly(texel, axes))
    }

    /// Axis by axis, halving the texel.
    #[inline(never)]
    fn integrate_slowly(&self, texel: &RuledTexel, axes: &[Lanes; 3]) -> Lanes {
        std::array::from_fn(|lane| {
            let axis = [axes[0][lane], axes[1][lane], axes[2][lane]];
            texel.patch.integrate(&self.kernel, axis, 0.5, RULES + 2)
        })
    }

    /// Adds D · ∫ max(cos θ, 0) over a cell that the horizon may cut.
    #[inline(always)]
    fn add_cell(&self, cell: &Cell, axes: &[Lanes; 3], mass: &mut Lanes) {
        let one_minus_x = one_minus_cosines(cell.node.direction, axes);
        let (down, right) = (dot(cell.down, axes), dot(cell.right, axes));
        for lane in 0..LANES {
            let cosine = ramp(1.0 - one_minus_x[lane], down[lane].abs(), right[lane].abs());
            mass[lane] += cell.node.solid_angle_sr * cosine * self.kernel.distribution_at(one_minus_x[lane]);
        }
    }
}

/// Mean of max(c, 0) over a parallelogram on which c changes linearly, by `a` along one side and by `b` along the other,
/// from its value in the middle.
#[inline(always)]
fn ramp(middle: f64, a: f64, b: f64) -> f64 {
    let (long, short) = (a.max(b), a.min(b));
    let positive = |c: f64| c.max(0.0);
    if middle.abs() >= 0.5 * (long + short) {
        return positive(middle);
    }
    let square = |c: f64| positive(c) * positive(c);
    if short < 1e-3 * long {
        return 0.5 * (square(middle + 0.5 * long) - square(middle - 0.5 * long)) / long;
    }
    let cube = |c: f64| square(c) * positive(c);
    let (sum, difference) = (0.5 * (long + short), 0.5 * (long - short));
    let corners =
        cube(middle + sum) - cube(middle + difference) - cube(middle - difference) + cube(middle - sum);
    corners / (6.0 * long * short)
}

/// 1 − cos θ between a direction and each axis, exact where they meet.
#[inline(always)]
fn one_minus_cosines(direction: [f64; 3], axes: &[Lanes; 3]) -> Lanes {
    std::array::from_fn(|lane| {
        let [x, y, z] = [0, 1, 2].map(|i| direction[i] - axes[i][lane]);
        0.5 * (x * x + y * y + z * z)
    })
}

#[inline(always)]
fn dot(vector: [f64; 3], axes: &[Lanes; 3]) -> Lanes {
    std::array::from_fn(|lane| {
        vector[0] * axes[0][lane] + vector[1] * axes[1][lane] + vector[2] * axes[2][lane]
    })
}

#[cfg(test)]
mod tests {
    use super::{BrightSet, BrightTexel, LANES, ramp};
    use crate::patch::Patch;
    use kiln_sphere::{Cancel, Lobe};

    #[test]
    fn ramp_is_the_mean_over_the_cell() {
        for (middle, a, b) in
            [(0.1, 0.5, 0.3), (-0.2, 0.5, 0.3), (0.0, 0.5, 1e-6), (0.3, 0.1, 0.1), (-0.3, 0.1, 0.1)]
        {
            let n = 400;
            let at = |i: usize| (i as f64 + 0.5) / f64::from(n) - 0.5;
            let sum: f64 = (0..n as usize)
                .flat_map(|i| (0..n as usize).map(move |j| (i, j)))
                .map(|(i, j)| (middle + a * at(i) + b * at(j)).max(0.0))
                .sum();
            let error = ramp(middle, a, b) - sum / f64::from(n * n);
            assert!(error.abs() <= 1e-5, "{middle} {a} {b}: {error}");
        }
    }

    const STEPS: usize = 80;

    /// Largest error of one texel's integral over all directions, relative to its largest value.
    fn worst(lobe: Lobe, width: usize, index: usize, error: f64) -> f64 {
        let kernel = lobe.kernel(0, Cancel::NEVER).expect("nobody cancels");
        let profile = lobe.profile(kernel.ln_norm);
        let bright = [BrightTexel { index, excess: [1.0; 3] }];
        let set = BrightSet::new(width, width / 2, &bright, profile, error);
        let patch = Patch::of_texel(width, width / 2, index);
        let (mut largest, mut worst): (f64, f64) = (0.0, 0.0);
        for step in 0..STEPS {
            let axis = |lane: usize| {
                let v = (step * LANES + lane) as f64 / (STEPS * LANES) as f64;
                kiln_sphere::panorama_direction((v * 37.0).fract(), v)
            };
            let axes: [[f64; LANES]; 3] = std::array::from_fn(|i| std::array::from_fn(|lane| axis(lane)[i]));
            let found = set.convolve(&axes);
            for (lane, found) in found[1].iter().enumerate() {
                // Eight points on a tenth of the kernel's scale leave nothing.
                let exact = patch.integrate(&profile, axis(lane), 0.1, 8);
                largest = largest.max(exact);
                worst = worst.max((found - exact).abs());
            }
        }
        worst / largest
    }

    #[test]
    fn bright_texel_is_integrated_to_the_error_asked_for() {
        let lobes = [
            Lobe::Lambert,
            Lobe::Ggx { alpha: 1.0 / 64.0 },
            Lobe::Ggx { alpha: 0.25 },
            Lobe::Charlie { alpha: 0.0625 },
            Lobe::Charlie { alpha: 0.5 },
        ];
        for lobe in lobes {
            for (width, index) in [(1024, 1024 * 130 + 7), (1024, 3), (8, 17)] {
                let found = worst(lobe, width, index, 1e-5);
                assert!(found <= 6e-5, "{lobe:?}, texel {index} of width {width}: {found}");
            }
        }
    }

    #[test]
    fn rule_check_rejects_a_loose_rule() {
        assert!(worst(Lobe::Ggx { alpha: 1.0 / 64.0 }, 1024, 1024 * 130 + 7, 0.5) > 1e-4);
    }
}
