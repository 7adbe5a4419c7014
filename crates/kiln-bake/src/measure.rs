//! The error of a map as it is, measured at the places where errors hide.
//!
//! The measure is brute force over the panorama's patches, one direction at a time: it shares the lobe's formula with the
//! bake and nothing else, no transform, no band limit, no interpolation.

use crate::patch::{Patch, centroid_offset, is_on_horizon};
use crate::prefilter::usable;
use kiln_image::{Cube, Panorama};
use kiln_sphere::direction::cube_texel_centre;
use kiln_sphere::{
    Cancel, Cancelled, Lobe, Profile, ZonalKernel, cube_direction, cube_face_st, panorama_direction, simd,
};
use rayon::prelude::*;
use std::f64::consts::PI;

/// What brute force found at a map's probes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Texels that were compared.
    pub probes: usize,
    /// RMS error over the probes and channels, relative to the RMS of the exact values.
    pub rms: f64,
    /// Largest error of a channel, relative to its exact value plus a hundredth of the mean radiance.
    pub largest: f64,
    /// Direction of the largest.
    pub worst: [f64; 3],
}

const LANES: usize = 8;
type Lanes = [f64; LANES];

/// Texels brighter than this many times the mean are integrated exactly where the horizon cuts them.
const BRIGHTNESS_MIN: f64 = 16.0;
/// Nearer than this many texel sizes (of the kernel's scale) a patch is integrated adaptively …
const ADAPTIVE: f64 = 8.0;
/// … and nearer than this by four points; farther away its middle stands for it.
const FOUR_POINTS: f64 = 64.0;

/// Red, green, blue and the largest of them, of one row, padded.
type Planes = [Vec<f32>; 4];

/// A panorama made ready for brute force.
pub struct BruteForce<'a> {
    panorama: &'a Panorama,
    width: usize,
    height: usize,
    /// Columns with padding.
    stride: usize,
    /// Largest value of each row.
    row_max: Vec<f32>,
    mean: [f64; 3],
    brightest: [f64; 3],
}

impl<'a> BruteForce<'a> {
    /// Prepares a panorama.
    ///
    /// # Errors
    /// [`Cancelled`] within a row's work.
    pub fn new(panorama: &'a Panorama, cancel: Cancel) -> Result<Self, Cancelled> {
        let (width, height) = (panorama.width(), panorama.height());
        let stride = width.next_multiple_of(LANES);
        let mut row_maxima = Vec::with_capacity(height);
        let (mut sum, mut total, mut brightest) = ([0.0; 3], 0.0, (f32::NEG_INFINITY, 0));
        for (row, texels) in panorama.rgb().chunks_exact(width * 3).enumerate() {
            cancel.check()?;
            let solid_angle_sr = Patch::of_texel(width, height, row * width).solid_angle_sr();
            let mut row_sum = [0.0; 3];
            let mut row_max = f32::NEG_INFINITY;
            for (column, texel) in texels.chunks_exact(3).enumerate() {
                let largest = texel[0].max(texel[1]).max(texel[2]);
                if largest > brightest.0 {
                    brightest = (largest, row * width + column);
                }
                row_max = row_max.max(largest);
                for (sum, &value) in row_sum.iter_mut().zip(texel) {
                    *sum += f64::from(value);
                }
            }
            for (sum, row_sum) in sum.iter_mut().zip(row_sum) {
                *sum += solid_angle_sr * row_sum;
            }
            total += solid_angle_sr * width as f64;
            row_maxima.push(row_max);
        }
        let brightest = Patch::of_texel(width, height, brightest.1).nodes(1)[0].direction;
        let mean = sum.map(|sum| sum / total);
        Ok(Self { panorama, width, height, stride, row_max: row_maxima, mean, brightest })
    }

    /// Where the brightest texel is.
    pub fn brightest(&self) -> [f64; 3] {
        self.brightest
    }

    /// Mean radiance over the sphere.
    pub fn mean(&self) -> [f64; 3] {
        self.mean
    }

    /// What an exact map of the lobe holds in `axis`, to some 1e-6 of it: Σ_texels f ∫_patch K dω, K of unit mass.
    ///
    /// # Errors
    /// [`Cancelled`] within the work of a few rows.
    pub fn radiance(&self, lobe: Lobe, axis: [f64; 3], cancel: Cancel) -> Result<[f64; 3], Cancelled> {
        Ok(self.radiances(lobe, &[axis], cancel)?[0])
    }

    /// [`BruteForce::radiance`] in many directions, for which the panorama is read once.
    ///
    /// # Errors
    /// [`Cancelled`] within the work of a few rows.
    pub fn radiances(
        &self,
        lobe: Lobe,
        axes: &[[f64; 3]],
        cancel: Cancel,
    ) -> Result<Vec<[f64; 3]>, Cancelled> {
        let lobe = usable(lobe);
        let profile = lobe.profile(lobe.kernel(0, cancel)?.ln_norm);
        self.sum(&profile, axes, cancel)
    }

    /// Texels of a cube of `face_size` nearest to where errors of a lobe's map hide: the brightest light, a ring around
    /// it, its horizon and its opposite, the poles, the wrap column, a cube's edge and corner. Ascending, none twice.
    pub fn probe_texels(&self, lobe: Lobe, face_size: usize) -> Vec<usize> {
        probe_texels(self.brightest, lobe, face_size)
    }

    fn sum(&self, profile: &Profile, axes: &[[f64; 3]], cancel: Cancel) -> Result<Vec<[f64; 3]>, Cancelled> {
        match profile {
            Profile::Ggx(kernel) => self.sum_rows(*kernel, axes, cancel),
            Profile::Charlie(kernel) => self.sum_rows(*kernel, axes, cancel),
        }
    }

    /// Row by row for all axes, so that a row's texels are read from memory once.
    fn sum_rows(
        &self,
        kernel: impl ZonalKernel,
        axes: &[[f64; 3]],
        cancel: Cancel,
    ) -> Result<Vec<[f64; 3]>, Cancelled> {
        let views: Vec<_> = axes.iter().map(|&axis| View::new(self, kernel, axis)).collect();
        let row = |planes: &mut Planes, row: usize| -> Result<Vec<[f64; 3]>, Cancelled> {
            cancel.check()?;
            self.fill(planes, row);
            let planes: &Planes = planes;
            let of_view = |view: &View<_>| {
                simd::dispatch(
                    #[inline(always)]
                    || view.row(row, planes),
                )
            };
            Ok(views.iter().map(of_view).collect())
        };
        let rows = (0..self.height).into_par_iter().with_min_len(16);
        let rows: Vec<_> = rows
            .map_init(|| std::array::from_fn(|_| vec![0.0; self.stride]), row)
            .collect::<Result<_, _>>()?;
        let mut sums = vec![[0.0; 3]; axes.len()];
        for row in rows {
            for (sum, row) in sums.iter_mut().zip(row) {
                *sum = std::array::from_fn(|i| sum[i] + row[i]);
            }
        }
        Ok(sums)
    }

    /// The planes of a row. The panorama itself may be too large for another copy.
    fn fill(&self, planes: &mut Planes, row: usize) {
        for (column, texel) in self.panorama.image().row(row).chunks_exact(3).enumerate() {
            let largest = texel[0].max(texel[1]).max(texel[2]);
            for (plane, value) in planes.iter_mut().zip([texel[0], texel[1], texel[2], largest]) {
                plane[column] = value;
            }
        }
    }

    /// Compares a map of `lobe` with brute force at its probes.
    ///
    /// # Errors
    /// [`Cancelled`] within the work of a few rows.
    pub fn measure(&self, cube: &Cube, lobe: Lobe, cancel: Cancel) -> Result<Measured, Cancelled> {
        let lobe = usable(lobe);
        let profile = lobe.profile(lobe.kernel(0, cancel)?.ln_norm);
        self.compare(cube, &profile, &probe_texels(self.brightest, lobe, cube.face_size), cancel)
    }

    fn compare(
        &self,
        cube: &Cube,
        profile: &Profile,
        probes: &[usize],
        cancel: Cancel,
    ) -> Result<Measured, Cancelled> {
        let (mut error2, mut size2) = (0.0, 0.0);
        let mut worst = (0.0_f64, [0.0; 3]);
        let axes: Vec<[f64; 3]> =
            probes.iter().map(|&index| texel_direction(cube.face_size, index)).collect();
        let exact = self.sum(profile, &axes, cancel)?;
        for ((&index, axis), exact) in probes.iter().zip(axes).zip(exact) {
            let values = &cube.rgb[3 * index..3 * index + 3];
            for ((&value, exact), mean) in values.iter().zip(exact).zip(self.mean) {
                let error = f64::from(value) - exact;
                error2 += error * error;
                size2 += exact * exact;
                let local = exact.abs() + 0.01 * mean.abs();
                let relative = if error == 0.0 { 0.0 } else { error.abs() / local };
                // NaN is worse than anything.
                if !worst.0.is_nan() && (relative > worst.0 || relative.is_nan()) {
                    worst = (relative, axis);
                }
            }
        }
        let rms = if error2 == 0.0 { 0.0 } else { (error2 / size2).sqrt() };
        Ok(Measured { probes: probes.len(), rms, largest: worst.0, worst: worst.1 })
    }
}

/// One direction's view of all rows.
struct View<'a, K> {
    source: &'a BruteForce<'a>,
    kernel: K,
    axis: [f64; 3],
    /// cos(λ − λ_axis) · sin θ_axis of the columns' middles and of their two Gauss points.
    across: [Vec<f64>; 3],
    /// A texel's height.
    size: f64,
    bright: f32,
}

/// Gauss' two points in [−1, 1].
const GAUSS: f64 = 0.577_350_269_189_625_8;

impl<'a, K: ZonalKernel> View<'a, K> {
    fn new(source: &'a BruteForce<'a>, kernel: K, axis: [f64; 3]) -> Self {
        let cell = 2.0 * PI / source.width as f64;
        // −sin λ and cos λ are x and z of a direction on the equator.
        let across = [0.0, -GAUSS, GAUSS].map(|y| {
            let at = |column: usize| {
                let (sin, cos) = libm::sincos(cell * (column as f64 + 0.5 + 0.5 * y));
                cos * axis[2] - sin * axis[0]
            };
            (0..source.stride).map(at).collect()
        });
        let mean = source.mean.iter().fold(0.0, |a: f64, &b| a.max(b));
        let bright = (BRIGHTNESS_MIN * mean) as f32;
        Self { source, kernel, axis, across, size: PI / source.height as f64, bright }
    }

    #[inline(always)]
    fn row(&self, row: usize, planes: &Planes) -> [f64; 3] {
        let Self { source, size, .. } = self;
        let middle = size * (row as f64 + 0.5);
        let centroid = middle + centroid_offset(middle, *size);
        let nearest = (middle - libm::acos(self.axis[1].clamp(-1.0, 1.0))).abs();
        if nearest > 0.5 * PI + size {
            return [0.0; 3];
        }
        let chord = (2.0 * libm::sin(0.5 * nearest) - size).max(0.0);
        let scale2 = self.kernel.scale2(chord * chord);
        let has_four = scale2 < (FOUR_POINTS * size) * (FOUR_POINTS * size);
        let patch = Patch::of_texel(source.width, source.height, row * source.width);
        let solid_angle_sr = patch.solid_angle_sr();
        let shift = 0.5 * size * GAUSS;
        let nodes: &[f64] = if has_four { &[middle - shift, middle + shift] } else { &[centroid] };
        let at = |&theta: &f64| {
            let (sin, cos) = libm::sincos(theta);
            [cos * self.axis[1], sin, sin]
        };
        let rows: Vec<[f64; 3]> = nodes.iter().map(at).collect();
        let total: f64 = rows.iter().map(|row| row[2]).sum();
        let has_near = scale2 < (ADAPTIVE * size) * (ADAPTIVE * size);
        let is_mended = has_near || source.row_max[row] > self.bright;
        let columns: &[Vec<f64>] = if has_four { &self.across[1..] } else { &self.across[..1] };
        let mut sum = [[0.0; LANES]; 3];
        for block in self.lit_blocks(centroid) {
            let mut mass = [0.0; LANES];
            for &[along, sin, weight] in &rows {
                let weight = weight / total * solid_angle_sr / columns.len() as f64;
                for column in columns {
                    let across: &Lanes = column[block..block + LANES].try_into().expect("LANES columns");
                    let one_minus_x = across.map(|across| (1.0 - along) - sin * across);
                    for lane in 0..LANES {
                        mass[lane] += weight * self.kernel.at(one_minus_x[lane]);
                    }
                }
            }
            if is_mended {
                self.mend(row, block, libm::sincos(middle), &planes[3], &mut mass);
            }
            for (sum, plane) in sum.iter_mut().zip(planes) {
                let values: &[f32; LANES] = plane[block..block + LANES].try_into().expect("LANES columns");
                for lane in 0..LANES {
                    sum[lane] += mass[lane] * f64::from(values[lane]);
                }
            }
        }
        sum.map(|lanes| lanes.iter().sum())
    }

    /// First columns of the blocks that the horizon leaves of a row, and of a few more.
    #[inline(always)]
    fn lit_blocks(&self, theta: f64) -> impl Iterator<Item = usize> {
        let Self { source, size, axis, .. } = self;
        let (sin, cos) = libm::sincos(theta);
        let reach = (sin * libm::hypot(axis[0], axis[2])).max(f64::MIN_POSITIVE);
        let cosine = (-cos * axis[1] - size) / reach;
        let half = if cosine < 1.0 { libm::acos(cosine.max(-1.0)) } else { 0.0 };
        let blocks = source.stride / LANES;
        let per_radian = source.width as f64 / (2.0 * PI * LANES as f64);
        let middle = libm::atan2(-axis[0], axis[2]) * per_radian;
        // The last block may be padded, so one block more on either side.
        let first = libm::floor(middle - half * per_radian) as isize - 1;
        let count = (2.0 * half * per_radian) as usize + 4;
        let is_all = count >= blocks;
        let (first, count) = if is_all { (0, blocks) } else { (first, count) };
        (0..count as isize).map(move |i| (first + i).rem_euclid(blocks as isize) as usize * LANES)
    }

    /// Integrates adaptively what is too near, or bright and cut by the horizon.
    #[inline(never)]
    fn mend(&self, row: usize, block: usize, (sin, cos): (f64, f64), brightness: &[f32], mass: &mut Lanes) {
        let Self { size, .. } = self;
        let limit = (ADAPTIVE * size) * (ADAPTIVE * size);
        let is_near: [bool; LANES] = std::array::from_fn(|lane| {
            let one_minus_x = (1.0 - cos * self.axis[1]) - sin * self.across[0][block + lane];
            let is_cut = is_on_horizon(2.0 * one_minus_x, *size) && brightness[block + lane] > self.bright;
            let chord2 = (2.0 * one_minus_x).max(0.0);
            let is_near = self.kernel.scale2(chord2) < limit;
            (is_near && !self.kernel.is_negligible((chord2.sqrt() + size) * (chord2.sqrt() + size))) || is_cut
        });
        for lane in (0..LANES).filter(|&lane| is_near[lane] && block + lane < self.source.width) {
            let index = row * self.source.width + block + lane;
            let patch = Patch::of_texel(self.source.width, self.source.height, index);
            mass[lane] = patch.integrate(&self.kernel, self.axis, 0.25, 3);
        }
    }
}

/// The texels nearest to the places where errors hide: the brightest light, a ring around it, its horizon and its
/// opposite, the poles, the wrap column, a cube's edge and corner.
fn probe_texels(brightest: [f64; 3], lobe: Lobe, face_size: usize) -> Vec<usize> {
    let width = match lobe {
        Lobe::Lambert => 1.0,
        Lobe::Ggx { alpha } => 2.0 * alpha,
        Lobe::Charlie { .. } => 0.5 * PI,
    };
    let towards = |[x, y, z]: [f64; 3]| {
        let length = (x * x + y * y + z * z).sqrt();
        [x / length, y / length, z / length]
    };
    // Two directions square to the light.
    let [x, y, z] = brightest;
    let first = towards(if y.abs() < 0.9 { [z, 0.0, -x] } else { [0.0, -z, y] });
    let second = [y * first[2] - z * first[1], z * first[0] - x * first[2], x * first[1] - y * first[0]];
    let around = |angle: f64, side: [f64; 3]| {
        let (sin, cos) = libm::sincos(angle);
        towards(std::array::from_fn(|i| cos * brightest[i] + sin * side[i]))
    };
    let directions = [
        brightest,
        around(width, first),
        around(0.5 * PI, second),
        around(PI, first),
        [0.0, 1.0, 0.0],
        [0.0, -1.0, 0.0],
        panorama_direction(0.0, 0.45),
        towards([1.0, 1.0, 0.0]),
        towards([-1.0, -1.0, 1.0]),
    ];
    let mut texels: Vec<usize> = directions.iter().map(|&d| nearest_texel(face_size, d)).collect();
    texels.sort_unstable();
    texels.dedup();
    texels
}

fn nearest_texel(face_size: usize, direction: [f64; 3]) -> usize {
    let (face, [s, t]) = cube_face_st(direction);
    let place = |s: f64| ((0.5 * (s + 1.0) * face_size as f64) as usize).min(face_size - 1);
    (face * face_size + place(t)) * face_size + place(s)
}

fn texel_direction(face_size: usize, index: usize) -> [f64; 3] {
    let (line, x) = (index / face_size, index % face_size);
    let t = cube_texel_centre(face_size, line % face_size);
    cube_direction(line / face_size, cube_texel_centre(face_size, x), t)
}
