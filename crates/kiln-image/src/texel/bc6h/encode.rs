//! The BC6H encoder.
//!
//! A block's texels are points in the space where its lines are straight: half-float bit patterns, that is roughly
//! logarithms, so errors are relative ones. One region is fitted first: principal axis, ends at the extreme points,
//! then least squares for the ends given the indices, a few times. Where that leaves more than rounding, the shapes
//! whose two lines would leave the least are fitted too. The mode is the most precise one that can hold the ends.
//!
//! Plain `f32` arithmetic in a fixed order: equal texels give equal bytes on every machine.

use super::layout::{
    Block, MODES, Mode, PARTITION_COUNT, WEIGHTS_3, WEIGHTS_4, is_anchor, region_of, unquantise,
};
use super::{BLOCK_BYTES, MAX, Texels, mix};
use half::f16;

/// A texel's colour or a line's end where lines are straight, in 0 … 65535 as the decoder interpolates.
type Point = [f32; 3];
type Line = [Point; 2];

/// Modes in the order in which they are tried: most precise first, and the last of each list can hold any ends.
const ONE_REGION: [usize; 4] = [13, 12, 11, 10];
const TWO_REGIONS: [usize; 10] = [2, 3, 4, 0, 5, 6, 7, 8, 1, 9];
/// Rounds of least squares after the first fit.
const REFINEMENTS: usize = 3;
/// Shapes of two regions that are fitted in full.
const PARTITIONS_TRIED: usize = 4;
/// Squared error of a block at which every channel is off by about half a step of its half float: good enough.
const ERROR_NEGLIGIBLE: f32 = 48.0;

/// Encodes sixteen texels. Negative values and NaN become 0, values above [`MAX`] saturate.
pub fn encode_block(texels: &Texels) -> [u8; BLOCK_BYTES] {
    let points = texels.map(|texel| texel.map(point));
    let mut best = fit(&points, 0, 1);
    if best.error > ERROR_NEGLIGIBLE {
        for partition in promising_partitions(&points, best.error) {
            let candidate = fit(&points, partition, 2);
            if candidate.error < best.error {
                best = candidate;
            }
        }
    }
    best.block.to_bytes()
}

/// The middle of what the decoder turns into the half float nearest to a value.
fn point(value: f32) -> f32 {
    let half = f16::from_f32(if value > 0.0 { value.min(MAX) } else { 0.0 });
    (f32::from(half.to_bits()) + 0.5) * (64.0 / 31.0)
}

#[derive(Clone, Copy)]
struct Candidate {
    block: Block,
    error: f32,
}

/// The best block found for one shape.
fn fit(points: &[Point; 16], partition: usize, regions: usize) -> Candidate {
    let mut lines = [[[0.0; 3]; 2]; 2];
    for (region, line) in lines.iter_mut().enumerate().take(regions) {
        *line = principal_line(points, partition, regions, region);
    }
    let mut best = quantise(points, partition, regions, lines);
    let mut last = best;
    for _ in 0..REFINEMENTS {
        if best.error <= ERROR_NEGLIGIBLE {
            break;
        }
        for (region, line) in lines.iter_mut().enumerate().take(regions) {
            *line = least_squares(points, &last.block, regions, region).unwrap_or(*line);
        }
        last = quantise(points, partition, regions, lines);
        if last.error >= best.error {
            break;
        }
        best = last;
    }
    best
}

/// Sum, count and second moments of some texels, relative to a centre near them.
#[derive(Clone, Copy, Default)]
struct Moments {
    count: f32,
    sum: Point,
    /// xx, yy, zz, xy, xz, yz.
    products: [f32; 6],
}

impl Moments {
    fn add(&mut self, [x, y, z]: Point) {
        self.count += 1.0;
        self.sum = [self.sum[0] + x, self.sum[1] + y, self.sum[2] + z];
        for (sum, product) in self.products.iter_mut().zip([x * x, y * y, z * z, x * y, x * z, y * z]) {
            *sum += product;
        }
    }

    fn without(&self, other: &Moments) -> Moments {
        Moments {
            count: self.count - other.count,
            sum: std::array::from_fn(|c| self.sum[c] - other.sum[c]),
            products: std::array::from_fn(|c| self.products[c] - other.products[c]),
        }
    }

    /// Mean and, times the count, covariance.
    fn centred(&self) -> (Point, [f32; 6]) {
        let mean = self.sum.map(|sum| sum / self.count);
        let [x, y, z] = mean;
        let correction = [x * x, y * y, z * z, x * y, x * z, y * z];
        (mean, std::array::from_fn(|index| self.products[index] - self.count * correction[index]))
    }

    /// Squared distance to the best line through the texels.
    fn residual(&self) -> f32 {
        if self.count < 2.5 {
            return 0.0;
        }
        let (_, covariance) = self.centred();
        let (axis, length2) = principal_axis(&covariance);
        let along = dot(axis, apply(&covariance, axis)) / length2.max(f32::MIN_POSITIVE);
        (covariance[0] + covariance[1] + covariance[2] - along).max(0.0)
    }
}

fn dot(a: Point, b: Point) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn apply(&[xx, yy, zz, xy, xz, yz]: &[f32; 6], [x, y, z]: Point) -> Point {
    [xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z]
}

/// Direction of greatest variance by power iteration from the channel that varies most, and its squared length;
/// zero where nothing varies.
fn principal_axis(covariance: &[f32; 6]) -> (Point, f32) {
    let [xx, yy, zz, xy, xz, yz] = *covariance;
    let rows = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let start = if xx >= yy && xx >= zz {
        0
    } else if yy >= zz {
        1
    } else {
        2
    };
    let mut axis = rows[start];
    for _ in 0..4 {
        let largest = axis.iter().fold(0.0_f32, |largest, value| largest.max(value.abs()));
        if largest <= f32::MIN_POSITIVE {
            return ([0.0; 3], 0.0);
        }
        axis = apply(covariance, axis.map(|value| value / largest));
    }
    let largest = axis.iter().fold(f32::MIN_POSITIVE, |largest, value| largest.max(value.abs()));
    let axis = axis.map(|value| value / largest);
    (axis, dot(axis, axis))
}

fn mean(points: &[Point; 16]) -> Point {
    let mut sum = [0.0; 3];
    for point in points {
        sum = [sum[0] + point[0], sum[1] + point[1], sum[2] + point[2]];
    }
    sum.map(|value| value / 16.0)
}

/// The line along a region's principal axis, between its extreme points.
fn principal_line(points: &[Point; 16], partition: usize, regions: usize, region: usize) -> Line {
    let centre = mean(points);
    let members = || (0..16).filter(|&texel| region_of(partition, texel, regions) == region);
    let relative = |texel: usize| std::array::from_fn(|channel| points[texel][channel] - centre[channel]);
    let mut moments = Moments::default();
    members().for_each(|texel| moments.add(relative(texel)));
    let (mean, covariance) = moments.centred();
    let (axis, length2) = principal_axis(&covariance);
    let offset: Point = std::array::from_fn(|channel| centre[channel] + mean[channel]);
    if length2 == 0.0 {
        return [offset; 2];
    }
    let (mut low, mut high) = (0.0_f32, 0.0_f32);
    for texel in members() {
        let from_mean = std::array::from_fn(|channel| points[texel][channel] - offset[channel]);
        let position = dot(from_mean, axis) / length2;
        (low, high) = (low.min(position), high.max(position));
    }
    [low, high].map(|position| std::array::from_fn(|channel| offset[channel] + position * axis[channel]))
}

/// The shapes whose lines leave the least, best first; only those that leave less than `limit`.
fn promising_partitions(points: &[Point; 16], limit: f32) -> impl Iterator<Item = usize> {
    let centre = mean(points);
    let relative = points.map(|point| std::array::from_fn(|channel| point[channel] - centre[channel]));
    let mut whole = Moments::default();
    relative.iter().for_each(|&point| whole.add(point));
    let mut best = [(f32::INFINITY, 0); PARTITIONS_TRIED];
    for partition in 0..PARTITION_COUNT {
        let mut second = Moments::default();
        for (texel, &point) in relative.iter().enumerate() {
            if region_of(partition, texel, 2) == 1 {
                second.add(point);
            }
        }
        let residual = second.residual() + whole.without(&second).residual();
        if residual < best[PARTITIONS_TRIED - 1].0 {
            best[PARTITIONS_TRIED - 1] = (residual, partition);
            best.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
    }
    best.into_iter().filter(move |entry| entry.0 < limit).map(|entry| entry.1)
}

/// The ends that suit the block's indices best; `None` where all indices are equal.
fn least_squares(points: &[Point; 16], block: &Block, regions: usize, region: usize) -> Option<Line> {
    let (mut aa, mut ab, mut bb) = (0.0, 0.0, 0.0);
    let (mut a, mut b) = ([0.0; 3], [0.0; 3]);
    for texel in (0..16).filter(|&texel| region_of(block.partition, texel, regions) == region) {
        let t = weight(regions, usize::from(block.indices[texel])) as f32 / 64.0;
        let s = 1.0 - t;
        (aa, ab, bb) = (aa + s * s, ab + s * t, bb + t * t);
        for channel in 0..3 {
            a[channel] += s * points[texel][channel];
            b[channel] += t * points[texel][channel];
        }
    }
    let determinant = aa * bb - ab * ab;
    if determinant < 1e-4 {
        return None;
    }
    Some([
        std::array::from_fn(|channel| (bb * a[channel] - ab * b[channel]) / determinant),
        std::array::from_fn(|channel| (aa * b[channel] - ab * a[channel]) / determinant),
    ])
}

fn weight(regions: usize, index: usize) -> i32 {
    if regions == 1 { WEIGHTS_4[index] } else { WEIGHTS_3[index] }
}

/// Rounds lines to the most precise mode that holds them and gives each texel its nearest colour.
fn quantise(points: &[Point; 16], partition: usize, regions: usize, mut lines: [Line; 2]) -> Candidate {
    // The anchor's index has no top bit: it must lie in the first half of its line.
    for (texel, point) in points.iter().enumerate().filter(|&(texel, _)| is_anchor(partition, texel, regions))
    {
        let line = &mut lines[region_of(partition, texel, regions)];
        let along: Point = std::array::from_fn(|channel| line[1][channel] - line[0][channel]);
        let from_start = std::array::from_fn(|channel| point[channel] - line[0][channel]);
        if dot(from_start, along) * 2.0 > dot(along, along) {
            line.swap(0, 1);
        }
    }
    let (mode, ends) = round_ends(regions, &lines);
    let palette_size = if regions == 1 { 16 } else { 8 };
    let mut palettes = [[[0.0; 16]; 3]; 2];
    for (region, palette) in palettes.iter_mut().enumerate().take(regions) {
        let line = [ends[2 * region], ends[2 * region + 1]];
        let line = line.map(|end| end.map(|value| unquantise(value, MODES[mode].bits)));
        for (channel, values) in palette.iter_mut().enumerate() {
            for (index, value) in values.iter_mut().enumerate().take(palette_size) {
                *value = mix(line[0][channel], line[1][channel], weight(regions, index)) as f32;
            }
        }
    }
    let (mut indices, mut error) = ([0; 16], 0.0);
    for (texel, point) in points.iter().enumerate() {
        let palette = &palettes[region_of(partition, texel, regions)];
        let is_short = is_anchor(partition, texel, regions);
        let allowed = if is_short { palette_size / 2 } else { palette_size };
        let (index, distance) = nearest(palette, point, allowed);
        indices[texel] = index;
        error += distance;
    }
    Candidate { block: Block { mode, partition, ends, indices }, error }
}

/// The first of the `allowed` colours that is nearest to a point, and its squared distance.
fn nearest(palette: &[[f32; 16]; 3], point: &Point, allowed: usize) -> (u8, f32) {
    let distances: [f32; 16] = std::array::from_fn(|index| {
        let [r, g, b] = [0, 1, 2].map(|channel| palette[channel][index] - point[channel]);
        r * r + g * g + b * b
    });
    let mut best = (0, distances[0]);
    for (index, &distance) in distances.iter().enumerate().take(allowed).skip(1) {
        if distance < best.1 {
            best = (index as u8, distance);
        }
    }
    best
}

/// Mode and quantised ends.
fn round_ends(regions: usize, lines: &[Line; 2]) -> (usize, [[i32; 3]; 4]) {
    let modes: &[usize] = if regions == 1 { &ONE_REGION } else { &TWO_REGIONS };
    let round = |mode: &Mode| -> [[i32; 3]; 4] {
        std::array::from_fn(|end| match end < mode.end_count() {
            true => lines[end / 2][end % 2].map(|value| round_end(value, mode.bits)),
            false => [0; 3],
        })
    };
    let fitting = modes.iter().map(|&index| (index, round(&MODES[index]))).find(|(index, ends)| {
        let mode = &MODES[*index];
        !mode.is_transformed()
            || ends[1..mode.end_count()].iter().all(|end| {
                (0..3).all(|channel| {
                    let half = 1 << (mode.delta_bits[channel] - 1);
                    (-half..half).contains(&(end[channel] - ends[0][channel]))
                })
            })
    });
    fitting.expect("the last mode stores its ends in full")
}

/// The quantised end whose value is nearest.
fn round_end(value: f32, bits: u32) -> i32 {
    let largest = ((1_u32 << bits) - 1) as f32;
    // Below 15 bits an end stands for the middle of its interval.
    let steps = if bits >= 15 { value + 0.5 } else { value / (1_u32 << (16 - bits)) as f32 };
    steps.clamp(0.0, largest) as i32
}
