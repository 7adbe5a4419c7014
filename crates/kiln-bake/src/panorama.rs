//! A cube as a panorama, for the steps that read nothing else.
//!
//! A texel holds the mean radiance over its solid angle, the cube's texels being constant patches: what is constant stays
//! so, and flux is kept. The panorama is about as fine as the cube at the faces' centres and finer elsewhere.

use crate::overlap::Overlaps;
use crate::skybox::{Sums, add, mean};
use kiln_image::{Cube, Image, Panorama};
use kiln_sphere::{Bulk, Cancel, Cancelled};
use rayon::prelude::*;

/// The cube as a panorama of `4 · face_size` columns and `2 · face_size` rows.
///
/// # Errors
/// [`Cancelled`] within the work of a column and a row of texels of the cube.
///
/// # Panics
/// Where the cube's values do not fill its size, or that is 0.
pub fn panorama_of_cube(cube: &Cube, cancel: Cancel) -> Result<Panorama, Cancelled> {
    let (width, height) = (4 * cube.face_size, 2 * cube.face_size);
    let overlaps = Overlaps::new(height, cube.face_size);
    // A column of a cap's quadrant and its mirror images are made together: every column, once.
    let mut columns = Bulk::new(vec![Default::default(); overlaps.quadrant_columns()]);
    columns.par_iter_mut().enumerate().try_for_each(|(column, four)| {
        *four = mirrored_columns(cube, &overlaps, column, cancel)?;
        Ok(())
    })?;
    let quarter = columns.len();
    let texel = |row: usize, column: usize| match column / quarter {
        0 => columns[column][0][row],
        1 => columns[2 * quarter - 1 - column][2][row],
        2 => columns[column - 2 * quarter][3][row],
        _ => columns[width - 1 - column][1][row],
    };
    let mut rgb = Bulk::new(Vec::with_capacity(width * height * 3));
    for row in 0..height {
        cancel.check()?;
        rgb.extend((0..width).flat_map(|column| texel(row, column)));
    }
    let image = Image::new(width, height, rgb.into_inner()).expect("every texel was made");
    Ok(Panorama::new(image).expect("4 : 2"))
}

/// In the order of [`Overlaps::cap_images`].
fn mirrored_columns(
    cube: &Cube,
    overlaps: &Overlaps,
    column: usize,
    cancel: Cancel,
) -> Result<[Vec<[f32; 3]>; 4], Cancelled> {
    let size = cube.face_size;
    let index = |face: usize, y: usize, x: usize| (face * size + y) * size + x;
    let mut columns = [(); 4].map(|()| vec![[0.0; 4]; 2 * size]);
    let mut at_edges = vec![0.0; size + 1];
    for (image, sums) in overlaps.cap_images(0, 0, column).iter().zip(&mut columns) {
        for piece in overlaps.pieces_of_column(image.column) {
            cancel.check()?;
            overlaps.side(&piece, &mut at_edges, |y, row, solid_angle_sr| {
                add(&mut sums[row], solid_angle_sr, &cube.rgb, index(piece.face, y, piece.x));
            });
        }
    }
    for y in 0..overlaps.quadrant_size() {
        cancel.check()?;
        for x in overlaps.texels_of_column(column, y) {
            let images = overlaps.cap_images(x, y, column);
            overlaps.cap(x, y, column, |row, solid_angle_sr| {
                for (image, sums) in images.iter().zip(&mut columns) {
                    add(&mut sums[row], solid_angle_sr, &cube.rgb, index(2, image.y, image.x));
                    let sum = &mut sums[overlaps.mirrored_row(row)];
                    add(sum, solid_angle_sr, &cube.rgb, index(3, size - 1 - image.y, image.x));
                }
            });
        }
    }
    Ok(columns.map(|sums: Vec<Sums>| sums.into_iter().map(mean).collect()))
}
