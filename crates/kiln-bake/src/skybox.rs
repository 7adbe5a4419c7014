//! The environment itself on a cube, with mips.
//!
//! A texel holds the mean radiance over its solid angle, panorama texels being constant patches: seen magnified the
//! sky is as sharp as the panorama, no sharper and no softer, and flux is kept. A side face is integrated along lines
//! of constant s, where longitude does not change; a cap along rays from its centre, which is the pole. Along either
//! the integral is exact, cut where rows and texels end; across them it is Gauss' rule between meridians.

use kiln_image::{Cube, Panorama};
use kiln_sphere::quadrature::gauss_legendre;
use kiln_sphere::{Bulk, Cancel, Cancelled, CubeSolidAngles, cube_direction, panorama_uv};
use rayon::prelude::*;
use std::f64::consts::PI;

/// The panorama on cubes of `face_size` ≥ 1, half of it (rounded down), …, 1 texel along an edge.
///
/// Each mip is the solid-angle weighted mean of the one before; after an odd size it is made from the panorama anew.
///
/// # Errors
/// [`Cancelled`] within the work of a row, or of a column of a side face.
pub fn skybox(panorama: &Panorama, face_size: usize, cancel: Cancel) -> Result<Vec<Cube>, Cancelled> {
    let mut levels = Bulk::new(vec![resample(panorama, face_size, cancel)?]);
    while let Some(last) = levels.last().filter(|level| level.face_size > 1) {
        let size = last.face_size / 2;
        let is_even = last.face_size.is_multiple_of(2);
        let next = if is_even { halve(last, cancel)? } else { resample(panorama, size, cancel)? };
        levels.push(next);
    }
    Ok(levels.into_inner())
}

fn resample(panorama: &Panorama, face_size: usize, cancel: Cancel) -> Result<Cube, Cancelled> {
    let sampler = Sampler::new(panorama, face_size);
    // Side faces column by column, caps whole and still as sums.
    let mut sides = Bulk::new(vec![Vec::new(); 4 * face_size]);
    let mut caps = Bulk::new([Vec::new(), Vec::new()]);
    let resample_sides = || {
        sides.par_iter_mut().enumerate().try_for_each(|(index, column)| {
            let sums = sampler.side_column([0, 1, 4, 5][index / face_size], index % face_size, cancel)?;
            *column = sums.into_iter().map(mean).collect();
            Ok(())
        })
    };
    let resample_caps = || {
        caps.par_iter_mut().enumerate().try_for_each(|(index, sums)| {
            *sums = sampler.cap(2 + index, cancel)?;
            Ok(())
        })
    };
    let (of_caps, of_sides) = rayon::join(resample_caps, resample_sides);
    of_caps.and(of_sides)?;
    let texel = |face: usize, y: usize, x: usize| match face {
        2 | 3 => mean(caps[face - 2][y * face_size + x]),
        0 | 1 => sides[face * face_size + x][y],
        _ => sides[(face - 2) * face_size + x][y],
    };
    let mut rgb = Bulk::new(Vec::with_capacity(6 * face_size * face_size * 3));
    for line in 0..6 * face_size {
        cancel.check()?;
        let (face, y) = (line / face_size, line % face_size);
        rgb.extend((0..face_size).flat_map(|x| texel(face, y, x)));
    }
    Ok(Cube { face_size, rgb: rgb.into_inner() })
}

/// Of the sums of (red, green, blue, 1) dω.
fn mean([r, g, b, total]: [f64; 4]) -> [f32; 3] {
    [r, g, b].map(|sum| (sum / total) as f32)
}

fn halve(cube: &Cube, cancel: Cancel) -> Result<Cube, Cancelled> {
    let size = cube.face_size / 2;
    let solid_angles = CubeSolidAngles::new(cube.face_size);
    let mut rgb = Bulk::new(Vec::with_capacity(6 * size * size * 3));
    for line in 0..6 * size {
        cancel.check()?;
        rgb.extend((0..size).flat_map(|x| half_texel(cube, &solid_angles, line / size, line % size, x)));
    }
    Ok(Cube { face_size: size, rgb: rgb.into_inner() })
}

/// The mean of the four texels that a texel of the next level covers.
fn half_texel(cube: &Cube, solid_angles: &CubeSolidAngles, face: usize, y: usize, x: usize) -> [f32; 3] {
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for (dy, dx) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let (x, y) = (2 * x + dx, 2 * y + dy);
        let weight = solid_angles.at(x, y);
        let texel = ((face * cube.face_size + y) * cube.face_size + x) * 3;
        for (sum, &value) in sum.iter_mut().zip(&cube.rgb[texel..]) {
            *sum += weight * f64::from(value);
        }
        total += weight;
    }
    sum.map(|value| (value / total) as f32)
}

/// Lines across a side face's piece between meridians.
const LINES: usize = 2;
/// Rays across a cap's piece between meridians; pieces are so many that a texel at the edge sees at least these.
const RAYS: usize = 3;

struct Sampler<'a> {
    panorama: &'a Panorama,
    face_size: usize,
    /// Texel edges, −1 … 1.
    edges: Vec<f64>,
    /// (cot θ, cos θ) of the parallels between rows, north to south.
    parallels: Vec<[f64; 2]>,
    lines: Vec<(f64, f64)>,
    rays: Vec<(f64, f64)>,
}

impl<'a> Sampler<'a> {
    fn new(panorama: &'a Panorama, face_size: usize) -> Self {
        let height = panorama.height();
        let parallel = |row: usize| {
            let (sin, cos) = libm::sincos(PI * row as f64 / height as f64);
            [cos / sin, cos]
        };
        Self {
            panorama,
            face_size,
            edges: (0..=face_size).map(|i| 2.0 * i as f64 / face_size as f64 - 1.0).collect(),
            parallels: (1..height).map(parallel).collect(),
            lines: gauss_legendre(LINES),
            rays: gauss_legendre(RAYS),
        }
    }

    /// ∫ (f, 1) dω over the texels (x, 0), (x, 1) … of a side face.
    fn side_column(&self, face: usize, x: usize, cancel: Cancel) -> Result<Vec<[f64; 4]>, Cancelled> {
        let mut sums = vec![[0.0; 4]; self.face_size];
        let mut at_edges = vec![0.0; self.face_size + 1];
        for piece in self.between_meridians(face, x).windows(2) {
            cancel.check()?;
            let half = 0.5 * (piece[1] - piece[0]);
            let u = panorama_uv(cube_direction(face, piece[0] + half, 0.0))[0];
            let column = self.column_at(u);
            for &(y, weight) in &self.lines {
                self.add_line(piece[0] + half * (1.0 + y), weight * half, column, &mut at_edges, &mut sums);
            }
        }
        Ok(sums)
    }

    fn column_at(&self, u: f64) -> usize {
        ((u * self.panorama.width() as f64) as usize).min(self.panorama.width() - 1)
    }

    /// The edges of column x of a side face and the meridians between them: there longitude depends on s alone.
    fn between_meridians(&self, face: usize, x: usize) -> Vec<f64> {
        let (start, end) = (self.edges[x], self.edges[x + 1]);
        let width = self.panorama.width() as f64;
        let u_centre = panorama_uv(cube_direction(face, 0.0, 0.0))[0];
        let longitude = |s: f64| (u_centre + libm::atan(s) / (2.0 * PI)) * width;
        let (first, last) = (libm::floor(longitude(start)) as i64 + 1, longitude(end));
        let inner = (first..).take_while(|&j| (j as f64) < last);
        let at = |j: i64| libm::tan(2.0 * PI * (j as f64 / width - u_centre));
        let mut pieces = vec![start];
        pieces.extend(inner.map(at).filter(|s| start < *s && *s < end));
        pieces.push(end);
        pieces
    }

    /// Adds weight · ∫ (f, 1) (1 + s² + t²)^(−3/2) dt along a side face's line of constant s.
    ///
    /// The integral up to t is t / (a √(a + t²)), a = 1 + s². A parallel meets the line at t = −cot θ √a, where that is
    /// −cos θ / a. `at_edges` is room for it at the texels' edges.
    fn add_line(&self, s: f64, weight: f64, column: usize, at_edges: &mut [f64], sums: &mut [[f64; 4]]) {
        let across = 1.0 + s * s;
        let root = across.sqrt();
        for (value, t) in at_edges.iter_mut().zip(&self.edges) {
            *value = t / (across * (across + t * t).sqrt());
        }
        let t_of = |row: usize| self.parallels.get(row).map_or(f64::INFINITY, |[cot, _]| -cot * root);
        let mut row = self.parallels.partition_point(|[cot, _]| -cot * root <= -1.0);
        let mut next_row = t_of(row);
        let mut before = at_edges[0];
        for (texel, sum) in sums.iter_mut().enumerate() {
            let edge = self.edges[texel + 1];
            while next_row < edge {
                let here = -self.parallels[row][1] / across;
                self.add(sum, weight * (here - before), column, row);
                before = here;
                row += 1;
                next_row = t_of(row);
            }
            self.add(sum, weight * (at_edges[texel + 1] - before), column, row);
            before = at_edges[texel + 1];
        }
    }

    /// ∫ (f, 1) dω over the texels of the top (2) or bottom (3) face, row by row.
    fn cap(&self, face: usize, cancel: Cancel) -> Result<Vec<[f64; 4]>, Cancelled> {
        let mut sums = Bulk::new(vec![[0.0; 4]; self.face_size * self.face_size]);
        let width = self.panorama.width();
        let pieces = libm::ceil(PI * self.face_size as f64 / width as f64) as usize;
        let piece = 2.0 * PI / (width * pieces) as f64;
        for index in 0..width * pieces {
            cancel.check()?;
            for &(y, weight) in &self.rays {
                let lambda = piece * (index as f64 + 0.5 + 0.5 * y);
                self.add_ray(face, lambda, 0.5 * piece * weight, index / pieces, &mut sums);
            }
        }
        Ok(sums.into_inner())
    }

    /// Adds weight · ∫ (f, 1) sin θ dθ along a meridian of a cap: a ray (s, t) = ρ (a, b), ρ = tan θ from the pole.
    fn add_ray(&self, face: usize, lambda: f64, weight: f64, column: usize, sums: &mut [[f64; 4]]) {
        let (sin, cos) = libm::sincos(lambda);
        // x = s on both caps, z = t on top and −t on the bottom.
        let (a, b) = (-sin, if face == 2 { cos } else { -cos });
        let last_row = self.panorama.height() - 1;
        let (mut x, mut y) = (Crossings::new(&self.edges, a), Crossings::new(&self.edges, b));
        let rho_of = |row: usize| match self.parallels.get(row) {
            Some([cot, _]) if *cot > 0.0 => 1.0 / cot,
            _ => f64::INFINITY,
        };
        let (mut row, mut next_row) = (0, rho_of(0));
        let mut before = 1.0;
        loop {
            let texel = y.texel * self.face_size + x.texel;
            let panorama_row = if face == 2 { row } else { last_row - row };
            let rho = x.next.min(y.next);
            if next_row < rho {
                let here = self.parallels[row][1];
                self.add(&mut sums[texel], weight * (before - here), column, panorama_row);
                before = here;
                row += 1;
                next_row = rho_of(row);
                continue;
            }
            let here = 1.0 / (1.0 + rho * rho).sqrt();
            self.add(&mut sums[texel], weight * (before - here), column, panorama_row);
            before = here;
            let is_inside = if x.next <= y.next { x.advance() } else { y.advance() };
            if !is_inside {
                return;
            }
        }
    }

    #[inline(always)]
    fn add(&self, sum: &mut [f64; 4], solid_angle_sr: f64, column: usize, row: usize) {
        let start = (row * self.panorama.width() + column) * 3;
        let rgb = &self.panorama.rgb()[start..start + 3];
        for (sum, &value) in sum.iter_mut().zip(rgb) {
            *sum += solid_angle_sr * f64::from(value);
        }
        sum[3] += solid_angle_sr;
    }
}

/// Where a ray from a face's centre goes from texel to texel, along one axis.
struct Crossings<'a> {
    /// Edges from the centre outwards, as the ray meets them.
    edges: &'a [f64],
    inverse_slope: f64,
    is_rising: bool,
    texel: usize,
    /// ρ of the next edge; infinite if there is none.
    next: f64,
}

impl<'a> Crossings<'a> {
    fn new(edges: &'a [f64], slope: f64) -> Self {
        let face_size = edges.len() - 1;
        let is_rising = slope >= 0.0;
        let texel = if is_rising { face_size / 2 } else { (face_size - 1) / 2 };
        let mut crossings = Self { edges, inverse_slope: 1.0 / slope, is_rising, texel, next: 0.0 };
        crossings.next = crossings.rho();
        crossings
    }

    /// ρ where the ray leaves the texel it is in.
    fn rho(&self) -> f64 {
        let edge = self.edges[if self.is_rising { self.texel + 1 } else { self.texel }];
        let rho = edge * self.inverse_slope;
        if rho.is_nan() { f64::INFINITY } else { rho }
    }

    /// On to the next texel; `false` at the face's border.
    fn advance(&mut self) -> bool {
        let border = if self.is_rising { self.edges.len() - 2 } else { 0 };
        if self.texel == border {
            return false;
        }
        self.texel = if self.is_rising { self.texel + 1 } else { self.texel - 1 };
        self.next = self.rho();
        true
    }
}
