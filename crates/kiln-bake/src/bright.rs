//! The brightest texels leave the transform through their own door: each is convolved with the exact kernel.

use crate::patch::{Node, Patch, distance2, is_below_horizon, is_on_horizon, lobe_scale2};
use kiln_sphere::{Cancel, Cancelled, ggx_kernel_at};

/// A texel's excess over what the transform keeps of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BrightTexel {
    /// Row by row.
    pub(crate) index: usize,
    pub(crate) excess: [f64; 3],
}

/// Texels below this many times the mean radiance stay with the transform: nothing there can ring visibly.
const BRIGHTNESS_MIN: f64 = 16.0;

/// Takes the up to `count` brightest texels (by their largest channel) down to the brightest that stays,
/// keeping their hue; `rgb` is left with the rest.
pub(crate) fn take_brightest(
    width: usize,
    rgb: &mut [f32],
    mean: [f64; 3],
    count: usize,
    cancel: Cancel,
) -> Result<Vec<BrightTexel>, Cancelled> {
    let limit = BRIGHTNESS_MIN * mean.iter().fold(0.0, |a: f64, &b| a.max(b));
    let texel_count = rgb.len() / 3;
    let kept = count.min(texel_count - 1);
    let top = brightest(width, rgb, kept + 1, cancel)?;
    let taken = top[..kept].iter().take_while(|(value, _)| f64::from(*value) > limit).count();
    let stays = if texel_count == 1 { 0.0 } else { top[taken].0 };
    let take = |&(value, index): &(f32, usize)| {
        let texel = &mut rgb[3 * index..3 * index + 3];
        let excess = std::array::from_fn(|channel| {
            let whole = texel[channel];
            texel[channel] = whole * (stays / value);
            f64::from(whole) - f64::from(texel[channel])
        });
        BrightTexel { index, excess }
    };
    let mut bright: Vec<BrightTexel> = top[..taken].iter().map(take).collect();
    bright.retain(|texel| texel.excess.iter().any(|&value| value > 0.0));
    Ok(bright)
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

/// Bright texels with their quadrature rules.
pub(crate) struct BrightSet {
    texels: Vec<RuledTexel>,
}

struct RuledTexel {
    patch: Patch,
    centre: [f64; 3],
    size: f64,
    excess: [f64; 3],
    /// Gauss rules of 1² … [`RULES`]² points.
    rules: [Vec<NodeLanes>; RULES],
}

const RULES: usize = 6;
/// Relative error of a patch's integral that a rule may leave.
const RULE_ERROR: f64 = 1e-7;

impl BrightSet {
    pub(crate) fn new(width: usize, height: usize, bright: &[BrightTexel]) -> Self {
        let ruled = |texel: &BrightTexel| {
            let patch = Patch::of_texel(width, height, texel.index);
            let rules = std::array::from_fn(|index| NodeLanes::pack(&patch.nodes(index + 1)));
            let centre = patch.nodes(1)[0].direction;
            RuledTexel { patch, centre, size: patch.size(), excess: texel.excess, rules }
        };
        Self { texels: bright.iter().map(ruled).collect() }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.texels.is_empty()
    }

    /// Σ_texels excess · ∫_patch K dω around `axis`, K the unnormalised GGX kernel.
    pub(crate) fn convolve_ggx(&self, alpha: f64, axis: [f64; 3]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for texel in &self.texels {
            let mass = texel.integrate(alpha, axis);
            for (s, excess) in sum.iter_mut().zip(texel.excess) {
                *s += mass * excess;
            }
        }
        sum
    }
}

/// Four nodes side by side.
struct NodeLanes {
    direction: [[f64; 4]; 3],
    solid_angle_sr: [f64; 4],
}

impl NodeLanes {
    /// Fills up the last four with nodes of no weight.
    fn pack(nodes: &[Node]) -> Vec<Self> {
        let part = |nodes: &[Node], axis: usize| {
            std::array::from_fn(|lane| {
                nodes.get(lane).map_or(nodes[0].direction[axis], |node| node.direction[axis])
            })
        };
        let four = |nodes: &[Node]| Self {
            direction: std::array::from_fn(|axis| part(nodes, axis)),
            solid_angle_sr: std::array::from_fn(|lane| {
                nodes.get(lane).map_or(0.0, |node| node.solid_angle_sr)
            }),
        };
        nodes.chunks(4).map(four).collect()
    }

    #[inline]
    fn integrate(&self, alpha: f64, axis: [f64; 3]) -> f64 {
        let [x, y, z] = &self.direction;
        let terms: [f64; 4] = std::array::from_fn(|lane| {
            let (dx, dy, dz) = (x[lane] - axis[0], y[lane] - axis[1], z[lane] - axis[2]);
            let one_minus_x = 0.5 * (dx * dx + dy * dy + dz * dz);
            self.solid_angle_sr[lane] * ggx_kernel_at(alpha, one_minus_x)
        });
        (terms[0] + terms[1]) + (terms[2] + terms[3])
    }
}

impl RuledTexel {
    fn integrate(&self, alpha: f64, axis: [f64; 3]) -> f64 {
        let distance2 = distance2(self.centre, axis);
        if is_below_horizon(distance2, self.size) {
            return 0.0;
        }
        // Along one side the kernel is seen from as near as half the other side closer.
        let chord = (distance2.sqrt() - 0.5 * self.size).max(0.0);
        let scale2 = lobe_scale2(alpha, chord * chord);
        if is_on_horizon(distance2, self.size) {
            return self.patch.integrate_ggx(alpha, axis, 0.5, RULES);
        }
        for (index, rule) in self.rules.iter().enumerate() {
            if self.size * self.size <= SIZE2_MAX[index] * scale2 {
                return rule.iter().map(|lanes| lanes.integrate(alpha, axis)).sum();
            }
        }
        self.patch.integrate_ggx(alpha, axis, 0.5, RULES)
    }
}

/// Largest (size/scale)² each rule is good for. With the kernel's nearest pole at distance d, n Gauss points leave
/// about 10 (size/4d)^2n; so size/d ≤ 4 (error/10)^(1/2n).
const SIZE2_MAX: [f64; RULES] = [
    16.0 * RULE_ERROR / 10.0,
    16.0 * 1e-4,    // 1e-8^(1/2)
    16.0 * 2.15e-3, // 1e-8^(1/3)
    16.0 * 1e-2,    // 1e-8^(1/4)
    16.0 * 2.51e-2, // 1e-8^(1/5)
    16.0 * 4.64e-2, // 1e-8^(1/6)
];
