//! The environment itself on a cube, with mips.
//!
//! A texel holds the mean radiance over its solid angle, texels of the source being constant patches: seen magnified the
//! sky is as sharp as the panorama, no sharper and no softer, and flux is kept. `overlap.rs` knows which texels share what.

use crate::overlap::{Overlaps, SIDES};
use crate::panorama_of_cube;
use kiln_image::{Cube, Panorama};
use kiln_sphere::{Bulk, Cancel, Cancelled, CubeSolidAngles};
use rayon::prelude::*;

/// The panorama on cubes of `face_size` ≥ 1, half of it (rounded down), …, 1 texel along an edge.
///
/// Each mip is the solid-angle weighted mean of the one before; after an odd size it is made from the panorama anew.
///
/// # Errors
/// [`Cancelled`] within the work of a row, or of a column of a side face.
pub fn skybox(panorama: &Panorama, face_size: usize, cancel: Cancel) -> Result<Vec<Cube>, Cancelled> {
    let resample = |size: usize| resample(panorama, size, cancel);
    with_mips(resample(face_size)?, resample, cancel)
}

/// A cube as the source of its sky box: cubes of `face_size` ≥ 1, half of it (rounded down), …, 1 texel along an edge.
///
/// At the source's own size the texels are the source's; where that is `face_size` times a power of two, they are halved in
/// steps, as mips are. Every other size goes through [`panorama_of_cube`].
///
/// # Errors
/// As [`skybox`].
pub fn skybox_of_cube(cube: &Cube, face_size: usize, cancel: Cancel) -> Result<Vec<Cube>, Cancelled> {
    let mut panorama: Option<Bulk<Panorama>> = None;
    let mut resample = |size: usize| {
        if panorama.is_none() {
            panorama = Some(Bulk::new(panorama_of_cube(cube, cancel)?));
        }
        let panorama = panorama.as_ref().expect("it was made above");
        resample(panorama, size, cancel)
    };
    let ratio = cube.face_size / face_size;
    let first = if ratio.is_power_of_two() && ratio * face_size == cube.face_size {
        let mut level = Bulk::new(cube.clone());
        while level.face_size > face_size {
            level = Bulk::new(halve(&level, cancel)?);
        }
        level.into_inner()
    } else {
        resample(face_size)?
    };
    with_mips(first, resample, cancel)
}

/// A level and all smaller ones; `resample` makes those that no halving reaches.
fn with_mips(
    first: Cube,
    mut resample: impl FnMut(usize) -> Result<Cube, Cancelled>,
    cancel: Cancel,
) -> Result<Vec<Cube>, Cancelled> {
    let mut levels = Bulk::new(vec![first]);
    while let Some(last) = levels.last().filter(|level| level.face_size > 1) {
        let is_even = last.face_size.is_multiple_of(2);
        let next = if is_even { halve(last, cancel)? } else { resample(last.face_size / 2)? };
        levels.push(next);
    }
    Ok(levels.into_inner())
}

/// Sums of (red, green, blue, 1) dω.
pub(crate) type Sums = [f64; 4];

fn resample(panorama: &Panorama, face_size: usize, cancel: Cancel) -> Result<Cube, Cancelled> {
    let overlaps = Overlaps::new(panorama.height(), face_size);
    // Side faces column by column; caps by rows of a quadrant, still as sums, as that in the middle is two half rows.
    let mut sides = Bulk::new(vec![Vec::new(); 4 * face_size]);
    let mut caps: Bulk<Vec<CapRows>> = Bulk::new(vec![Default::default(); overlaps.quadrant_size()]);
    let resample_sides = || {
        sides.par_iter_mut().enumerate().try_for_each(|(index, column)| {
            let (face, x) = (SIDES[index / face_size], index % face_size);
            *column = side_column(panorama, &overlaps, face, x, face_size, cancel)?;
            Ok(())
        })
    };
    let resample_caps = || {
        caps.par_iter_mut().enumerate().try_for_each(|(y, rows)| {
            *rows = cap_rows(panorama, &overlaps, y, face_size, cancel)?;
            Ok(())
        })
    };
    let (of_caps, of_sides) = rayon::join(resample_caps, resample_sides);
    of_caps.and(of_sides)?;
    let texel = |face: usize, y: usize, x: usize| match face {
        2 | 3 => {
            let is_lower = y >= face_size / 2;
            let from_centre = if is_lower { y } else { face_size - 1 - y } - face_size / 2;
            mean(caps[from_centre][face - 2][usize::from(is_lower)][x])
        }
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

fn side_column(
    panorama: &Panorama,
    overlaps: &Overlaps,
    face: usize,
    x: usize,
    face_size: usize,
    cancel: Cancel,
) -> Result<Vec<[f32; 3]>, Cancelled> {
    let mut sums = vec![[0.0; 4]; face_size];
    let mut at_edges = vec![0.0; face_size + 1];
    let (rgb, width) = (panorama.rgb(), panorama.width());
    for piece in overlaps.pieces_of_texels(face, x) {
        cancel.check()?;
        overlaps.side(&piece, &mut at_edges, |y, row, solid_angle_sr| {
            add(&mut sums[y], solid_angle_sr, rgb, row * width + piece.column);
        });
    }
    Ok(sums.into_iter().map(mean).collect())
}

/// Of the top and of the bottom, a row above the middle and one from the middle on.
type CapRows = [[Vec<Sums>; 2]; 2];

/// The rows that row `y` of a quadrant is mirrored to.
fn cap_rows(
    panorama: &Panorama,
    overlaps: &Overlaps,
    y: usize,
    face_size: usize,
    cancel: Cancel,
) -> Result<CapRows, Cancelled> {
    let mut rows: CapRows = [(); 2].map(|()| [(); 2].map(|()| vec![[0.0; 4]; face_size]));
    let (rgb, width) = (panorama.rgb(), panorama.width());
    for x in 0..overlaps.quadrant_size() {
        for column in overlaps.columns_of_texel(x, y) {
            cancel.check()?;
            let images = overlaps.cap_images(x, y, column);
            overlaps.cap(x, y, column, |row, solid_angle_sr| {
                for image in images {
                    let is_lower = usize::from(image.y >= face_size / 2);
                    let top = &mut rows[0][is_lower][image.x];
                    add(top, solid_angle_sr, rgb, row * width + image.column);
                    let is_lower = usize::from(face_size - 1 - image.y >= face_size / 2);
                    let bottom = &mut rows[1][is_lower][image.x];
                    add(bottom, solid_angle_sr, rgb, overlaps.mirrored_row(row) * width + image.column);
                }
            });
        }
    }
    Ok(rows)
}

#[inline(always)]
pub(crate) fn add(sums: &mut Sums, solid_angle_sr: f64, rgb: &[f32], texel: usize) {
    for (sum, &value) in sums.iter_mut().zip(&rgb[3 * texel..3 * texel + 3]) {
        *sum += solid_angle_sr * f64::from(value);
    }
    sums[3] += solid_angle_sr;
}

pub(crate) fn mean([r, g, b, total]: Sums) -> [f32; 3] {
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
