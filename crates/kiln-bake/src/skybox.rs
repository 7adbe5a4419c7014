//! The environment itself on a cube, with mips.
//!
//! A texel holds the mean radiance over its solid angle, panorama texels being constant patches: seen magnified the
//! sky is as sharp as the panorama, no sharper and no softer, and flux is kept. A side face is integrated along lines
//! of constant s, where longitude does not change; a cap along rays from its centre, which is the pole. Along either
//! the integral is exact, cut where rows and texels end; across them it is Gauss' rule between meridians.

use kiln_image::{Cube, Panorama};
use kiln_sphere::quadrature::gauss_legendre;
use kiln_sphere::{Bulk, Cancel, Cancelled, cube_direction, cube_texel_solid_angle_sr, panorama_uv};
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
    sides.par_iter_mut().enumerate().try_for_each(|(index, column)| {
        let sums = sampler.side_column([0, 1, 4, 5][index / face_size], index % face_size, cancel)?;
        *column = sums.into_iter().map(mean).collect();
        Ok(())
    })?;
    let mut caps = Bulk::new([Vec::new(), Vec::new()]);
    caps.par_iter_mut().enumerate().try_for_each(|(index, sums)| {
        *sums = sampler.cap(2 + index, cancel)?;
        Ok(())
    })?;
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
    let mut rgb = Bulk::new(Vec::with_capacity(6 * size * size * 3));
    for line in 0..6 * size {
        cancel.check()?;
        rgb.extend((0..size).flat_map(|x| half_texel(cube, line / size, line % size, x)));
    }
    Ok(Cube { face_size: size, rgb: rgb.into_inner() })
}

/// The mean of the four texels that a texel of the next level covers.
fn half_texel(cube: &Cube, face: usize, y: usize, x: usize) -> [f32; 3] {
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for (dy, dx) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let (x, y) = (2 * x + dx, 2 * y + dy);
        let weight = cube_texel_solid_angle_sr(cube.face_size, x, y);
        let texel = ((face * cube.face_size + y) * cube.face_size + x) * 3;
        for (sum, &value) in sum.iter_mut().zip(&cube.rgb[texel..]) {
            *sum += weight * f64::from(value);
        }
        total += weight;
    }
    sum.map(|value| (value / total) as f32)
}

/// Lines across a side face's piece between meridians.
const LINES: usize = 3;
/// Rays across a cap's piece between meridians; pieces are so many that a texel at the edge sees at least these.
const RAYS: usize = 8;

struct Sampler<'a> {
    panorama: &'a Panorama,
    face_size: usize,
    /// Texel edges, −1 … 1.
    edges: Vec<f64>,
    /// cot θ of the parallels between rows, north to south.
    parallels_cot: Vec<f64>,
    lines: Vec<(f64, f64)>,
    rays: Vec<(f64, f64)>,
}

impl<'a> Sampler<'a> {
    fn new(panorama: &'a Panorama, face_size: usize) -> Self {
        let height = panorama.height();
        let cot = |row: usize| {
            let (sin, cos) = libm::sincos(PI * row as f64 / height as f64);
            cos / sin
        };
        Self {
            panorama,
            face_size,
            edges: (0..=face_size).map(|i| 2.0 * i as f64 / face_size as f64 - 1.0).collect(),
            parallels_cot: (1..height).map(cot).collect(),
            lines: gauss_legendre(LINES),
            rays: gauss_legendre(RAYS),
        }
    }

    /// ∫ (f, 1) dω over the texels (x, 0), (x, 1) … of a side face.
    fn side_column(&self, face: usize, x: usize, cancel: Cancel) -> Result<Vec<[f64; 4]>, Cancelled> {
        let mut sums = vec![[0.0; 4]; self.face_size];
        for piece in self.between_meridians(face, x).windows(2) {
            cancel.check()?;
            let half = 0.5 * (piece[1] - piece[0]);
            let u = panorama_uv(cube_direction(face, piece[0] + half, 0.0))[0];
            let column = self.column_at(u);
            for &(y, weight) in &self.lines {
                self.add_line(piece[0] + half * (1.0 + y), weight * half, column, &mut sums);
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
        let first = libm::floor(longitude(start)) as i64 + 1;
        let inner = (first..).take_while(|&j| (j as f64) < longitude(end));
        let at = |j: i64| libm::tan(2.0 * PI * (j as f64 / width - u_centre));
        let mut pieces = vec![start];
        pieces.extend(inner.map(at).filter(|s| start < *s && *s < end));
        pieces.push(end);
        pieces
    }

    /// Adds weight · ∫ (f, 1) (1 + s² + t²)^(−3/2) dt along a side face's line of constant s.
    fn add_line(&self, s: f64, weight: f64, column: usize, sums: &mut [[f64; 4]]) {
        let across = 1.0 + s * s;
        // A parallel meets the line at t = −cot θ √(1 + s²).
        let parallels: Vec<f64> = self.parallels_cot.iter().map(|cot| -cot * across.sqrt()).collect();
        let mut cuts = self.edges.clone();
        cuts.extend(parallels.iter().filter(|t| t.abs() < 1.0));
        cuts.sort_unstable_by(f64::total_cmp);
        let integral = |t: f64| t / (across * (across + t * t).sqrt());
        let (mut texel, mut row) = (0, 0);
        for cut in cuts.windows(2) {
            let middle = 0.5 * (cut[0] + cut[1]);
            row += parallels[row..].iter().take_while(|&&t| t < middle).count();
            texel += self.edges[texel + 1..self.face_size].iter().take_while(|&&t| t < middle).count();
            self.add(&mut sums[texel], weight * (integral(cut[1]) - integral(cut[0])), column, row);
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
        let end = 1.0 / a.abs().max(b.abs());
        let height = self.panorama.height();
        let parallels = self.parallels_cot.iter().take_while(|cot| **cot > 0.0).map(|cot| 1.0 / cot);
        let mut cuts = vec![0.0, end];
        cuts.extend(parallels.clone().take_while(|&rho| rho < end));
        for component in [a, b] {
            cuts.extend(
                self.edges.iter().map(|edge| edge / component).filter(|rho| 0.0 < *rho && *rho < end),
            );
        }
        cuts.sort_unstable_by(f64::total_cmp);
        let mut parallels = parallels.peekable();
        let mut row = 0;
        let place =
            |value: f64| ((0.5 * (value + 1.0) * self.face_size as f64) as usize).min(self.face_size - 1);
        let mut cosine = 1.0;
        for cut in cuts.windows(2) {
            let middle = 0.5 * (cut[0] + cut[1]);
            while parallels.next_if(|&rho| rho < middle).is_some() {
                row += 1;
            }
            let next = 1.0 / (1.0 + cut[1] * cut[1]).sqrt();
            let texel = place(b * middle) * self.face_size + place(a * middle);
            let row = if face == 2 { row } else { height - 1 - row };
            self.add(&mut sums[texel], weight * (cosine - next), column, row);
            cosine = next;
        }
    }

    fn add(&self, sum: &mut [f64; 4], solid_angle_sr: f64, column: usize, row: usize) {
        let [r, g, b] = self.panorama.texel(column, row).map(f64::from);
        for (sum, value) in sum.iter_mut().zip([r, g, b, 1.0]) {
            *sum += solid_angle_sr * value;
        }
    }
}
