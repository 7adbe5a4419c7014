//! Where the faces of a cube stand in a flat image, and how they are turned there.

use super::Layout;
use crate::{Bulk, Cancel, Cube, DecodeError, Image, Limits, decode::check_size};

/// Names of the faces, in KTX2 order.
///
/// Those of six single files stand in [`cube_layout::FACE_STEMS`](crate::cube_layout::FACE_STEMS).
pub const FACE_NAMES: [&str; 6] = ["+X", "-X", "+Y", "-Y", "+Z", "-Z"];

/// One face in a flat image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FacePlacement {
    /// Column and row of its square, counted in squares from the top left.
    pub square: [usize; 2],
    /// Its columns run from the right.
    pub flip_x: bool,
    /// Its rows run from the bottom. With `flip_x`: turned by 180°.
    pub flip_y: bool,
}

/// All six faces in a flat image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CubePlacement {
    /// Texels along a face's edge.
    pub face_size: usize,
    /// Columns and rows of squares.
    pub squares: [usize; 2],
    /// +X −X +Y −Y +Z −Z.
    pub faces: [FacePlacement; 6],
}

const fn upright(x: usize, y: usize) -> FacePlacement {
    FacePlacement { square: [x, y], flip_x: false, flip_y: false }
}

const fn flipped(x: usize, y: usize, flip_x: bool, flip_y: bool) -> FacePlacement {
    FacePlacement { square: [x, y], flip_x, flip_y }
}

const ROW: [FacePlacement; 6] =
    [upright(0, 0), upright(1, 0), upright(2, 0), upright(3, 0), upright(4, 0), upright(5, 0)];
const COLUMN: [FacePlacement; 6] =
    [upright(0, 0), upright(0, 1), upright(0, 2), upright(0, 3), upright(0, 4), upright(0, 5)];
const WIDE_CROSS: [FacePlacement; 6] =
    [upright(2, 1), upright(0, 1), upright(1, 0), upright(1, 2), upright(1, 1), upright(3, 1)];
const TALL_CROSS: [FacePlacement; 6] =
    [upright(2, 1), upright(0, 1), upright(1, 0), upright(1, 2), upright(1, 1), flipped(1, 3, true, true)];

/// OpenEXR (ImfEnvmap.cpp): +X is (1, −t, s), −X (−1, −t, −s), +Y (s, 1, −t), −Y (s, −1, t), +Z (−s, −t, 1), −Z (s, −t, −1).
/// After the half turn about Y, which negates x and z, that is our opposite side face mirrored, or our ±Y face mirrored.
const EXR_COLUMN: [FacePlacement; 6] = [
    flipped(0, 1, true, false),
    flipped(0, 0, true, false),
    flipped(0, 2, true, false),
    flipped(0, 3, true, false),
    flipped(0, 5, true, false),
    flipped(0, 4, true, false),
];

impl CubePlacement {
    /// The faces of an image of this size; `None` where it has not the layout's shape, or the layout is none of faces in
    /// an image.
    pub fn of(layout: Layout, width: usize, height: usize) -> Option<CubePlacement> {
        let candidates: &[([usize; 2], [FacePlacement; 6])] = match layout {
            Layout::CubeStrip => &[([6, 1], ROW), ([1, 6], COLUMN)],
            Layout::CubeCross => &[([4, 3], WIDE_CROSS), ([3, 4], TALL_CROSS)],
            Layout::ExrCube => &[([1, 6], EXR_COLUMN)],
            Layout::Equirect | Layout::Octahedral | Layout::Cube => &[],
        };
        candidates.iter().find_map(|&(squares, faces)| {
            let face_size = width / squares[0];
            let fits = face_size > 0 && squares.map(|count| count * face_size) == [width, height];
            fits.then_some(CubePlacement { face_size, squares, faces })
        })
    }

    /// Column and row in the image of texel (`x`, `y`) of a face.
    pub fn texel(&self, face: usize, x: usize, y: usize) -> [usize; 2] {
        let FacePlacement { square, flip_x, flip_y } = self.faces[face];
        let size = self.face_size;
        let turned = |index: usize, flip: bool| if flip { size - 1 - index } else { index };
        [square[0] * size + turned(x, flip_x), square[1] * size + turned(y, flip_y)]
    }

    /// The image on which a cube's faces stand so; what no face covers is black. Undone by decoding it.
    ///
    /// # Panics
    /// If the cube is of another size.
    pub fn unfold(&self, cube: &Cube) -> Image {
        let size = self.face_size;
        assert_eq!(cube.face_size, size, "faces are placed for their size");
        let [width, height] = self.squares.map(|count| count * size);
        let mut image = Image { width, height, rgb: vec![0.0; width * height * 3] };
        for face in 0..6 {
            for (y, x) in (0..size).flat_map(|y| (0..size).map(move |x| (y, x))) {
                let [column, row] = self.texel(face, x, y);
                image.rgb[(row * width + column) * 3..][..3].copy_from_slice(&cube.texel(face, x, y));
            }
        }
        image
    }

    /// Copies the faces out of the image they stand in.
    pub(super) fn cut(&self, image: &Image, cancel: Cancel) -> Result<Cube, DecodeError> {
        let size = self.face_size;
        let mut rgb = Bulk::new(Vec::with_capacity(6 * size * size * 3));
        for face in 0..6 {
            for y in 0..size {
                cancel.check()?;
                rgb.extend((0..size).flat_map(|x| {
                    let [column, row] = self.texel(face, x, y);
                    image.texel(column, row)
                }));
            }
        }
        Ok(Cube::new(size, rgb.into_inner())?)
    }
}

/// Repeats rows or columns of an image whose texels are not square, where a whole number of times makes them so.
pub(super) fn square_texels(
    image: Bulk<Image>,
    texel_aspect: f64,
    limits: &Limits,
    notes: &mut Vec<String>,
    cancel: Cancel,
) -> Result<Bulk<Image>, DecodeError> {
    if texel_aspect == 1.0 {
        return Ok(image);
    }
    // Headers carry a few digits.
    let whole = |ratio: f64| {
        let rounded = ratio.round();
        ((2.0..=64.0).contains(&rounded) && (ratio - rounded).abs() <= 1e-4 * rounded)
            .then_some(rounded as usize)
    };
    let (columns, rows) = match (whole(texel_aspect), whole(1.0 / texel_aspect)) {
        (Some(rows), _) => (1, rows),
        (None, Some(columns)) => (columns, 1),
        (None, None) => {
            notes.push(format!(
                "texels {texel_aspect} times as high as wide are taken as square: only whole multiples are undone"
            ));
            return Ok(image);
        }
    };
    let (width, height) = (image.width.saturating_mul(columns), image.height.saturating_mul(rows));
    check_size("texel aspect", width, height, limits)?;
    let mut rgb = Bulk::new(Vec::with_capacity(width * height * 3));
    for y in 0..height {
        cancel.check()?;
        let row = image.row(y / rows);
        if columns == 1 {
            rgb.extend_from_slice(row);
        } else {
            rgb.extend(row.chunks_exact(3).flat_map(|texel| std::iter::repeat_n(texel, columns)).flatten());
        }
    }
    let repeated = if rows > 1 { "row" } else { "column" };
    notes.push(format!(
        "the file has texels {texel_aspect} times as high as wide: each {repeated} was repeated {} times",
        rows.max(columns)
    ));
    Ok(Bulk::new(Image::new(width, height, rgb.into_inner())?))
}
