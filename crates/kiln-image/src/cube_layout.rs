//! A cube on one image: crosses and strips without loss, octahedron and panorama by resampling.
//!
//! Crosses and strips hold the six KTX2 faces as they are (mirrored, as a GPU samples them), so that neighbours in the
//! cross continue each other:
//!
//! ```text
//! horizontal cross        vertical cross       strips
//!      +Y                    +Y                +X −X +Y −Y +Z −Z
//!  −X  +Z  +X  −Z        −X  +Z  +X            from the left or from the top
//!      −Y                    −Y
//!                            −Z, turned by 180°
//! ```

use crate::{Cancel, Cancelled, Cube, CubePlacement, Image, Layout, octahedral_direction};
use kiln_sphere::direction::cube_texel_centre;
use kiln_sphere::{cube_direction, cube_face_st, panorama_direction};

/// Where the six faces lie on an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CubeLayout {
    /// 4 × 3 faces.
    HorizontalCross,
    /// 3 × 4 faces, −Z at the bottom turned by 180°.
    VerticalCross,
    /// 6 × 1 faces in KTX2 order.
    HorizontalStrip,
    /// 1 × 6 faces in KTX2 order.
    VerticalStrip,
}

/// File name stems of six single faces, in KTX2 order.
pub const FACE_STEMS: [&str; 6] = ["px", "nx", "py", "ny", "pz", "nz"];

impl CubeLayout {
    /// All of them.
    pub const ALL: [CubeLayout; 4] = [
        CubeLayout::HorizontalCross,
        CubeLayout::VerticalCross,
        CubeLayout::HorizontalStrip,
        CubeLayout::VerticalStrip,
    ];

    /// Columns and rows, in faces.
    pub fn faces(self) -> [usize; 2] {
        match self {
            CubeLayout::HorizontalCross => [4, 3],
            CubeLayout::VerticalCross => [3, 4],
            CubeLayout::HorizontalStrip => [6, 1],
            CubeLayout::VerticalStrip => [1, 6],
        }
    }

    /// Where the faces stand, as decoding finds them.
    ///
    /// # Panics
    /// If `face_size` is 0.
    pub fn placement(self, face_size: usize) -> CubePlacement {
        let layout = match self {
            CubeLayout::HorizontalCross | CubeLayout::VerticalCross => Layout::CubeCross,
            CubeLayout::HorizontalStrip | CubeLayout::VerticalStrip => Layout::CubeStrip,
        };
        let [width, height] = self.faces().map(|count| count * face_size);
        CubePlacement::of(layout, width, height).expect("the shape is the layout's")
    }
}

/// The six faces on one image; what no face covers is black.
pub fn unfold(cube: &Cube, layout: CubeLayout) -> Image {
    layout.placement(cube.face_size).unfold(cube)
}

/// One face as an image.
///
/// # Panics
/// If `face` is not below 6.
pub fn face_image(cube: &Cube, face: usize) -> Image {
    Image { width: cube.face_size, height: cube.face_size, rgb: cube.face(face).to_vec() }
}

/// Mirrors of a cube that engines ask for; each only moves texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Mirror {
    /// x ↔ −x.
    X,
    /// z ↔ −z.
    Z,
}

/// The cube that holds, in direction d, what `cube` holds in the mirrored direction.
pub fn mirror(cube: &Cube, mirror: Mirror) -> Cube {
    let size = cube.face_size;
    let mut rgb = Vec::with_capacity(cube.rgb.len());
    for face in 0..6 {
        for (y, x) in (0..size).flat_map(|y| (0..size).map(move |x| (y, x))) {
            let flip = |index: usize| size - 1 - index;
            let is_cap = face == 2 || face == 3;
            let (from, x, y) = match mirror {
                Mirror::X if face < 2 => (1 - face, flip(x), y),
                Mirror::X => (face, flip(x), y),
                Mirror::Z if face > 3 => (9 - face, flip(x), y),
                Mirror::Z if is_cap => (face, x, flip(y)),
                Mirror::Z => (face, flip(x), y),
            };
            rgb.extend_from_slice(&cube.texel(from, x, y));
        }
    }
    Cube { face_size: size, rgb }
}

/// The cube in a direction of any length but zero: bilinear between texel centres, across edges too (the neighbour
/// face's nearest texel), as a GPU filters seamlessly.
pub fn sample(cube: &Cube, direction: [f64; 3]) -> [f64; 3] {
    let size = cube.face_size;
    let (face, [s, t]) = cube_face_st(direction);
    let position = |st: f64| (st + 1.0) * 0.5 * size as f64 - 0.5;
    let (px, py) = (position(s), position(t));
    let (x, y) = (libm::floor(px), libm::floor(py));
    let mut value = [0.0; 3];
    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        let weight = (1.0 - (px - x - dx).abs()) * (1.0 - (py - y - dy).abs());
        let texel = texel_beyond(cube, face, x + dx, y + dy);
        for (value, texel) in value.iter_mut().zip(texel) {
            *value += weight * f64::from(texel);
        }
    }
    value
}

/// A texel of the plane of `face`, taken from a neighbour where it lies outside.
fn texel_beyond(cube: &Cube, face: usize, x: f64, y: f64) -> [f32; 3] {
    let size = cube.face_size as f64;
    if (0.0..size).contains(&x) && (0.0..size).contains(&y) {
        return cube.texel(face, x as usize, y as usize);
    }
    let centre = |index: f64| (2.0 * index + 1.0) / size - 1.0;
    let (face, [s, t]) = cube_face_st(cube_direction(face, centre(x), centre(y)));
    let index = |st: f64| (((st + 1.0) * 0.5 * size).max(0.0) as usize).min(cube.face_size - 1);
    cube.texel(face, index(s), index(t))
}

/// The cube on a square octahedral map: each texel is [`sample`] at its centre, so make `size` about twice the face
/// size to keep what the cube holds.
///
/// # Errors
/// [`Cancelled`] within a row.
pub fn octahedral(cube: &Cube, size: usize, cancel: Cancel) -> Result<Image, Cancelled> {
    resample(cube, size, size, octahedral_direction, cancel)
}

/// The cube as a panorama `2 · height` wide, in this crate's orientation (centre column −Z): each texel is [`sample`]
/// at its centre, so `height` twice the face size keeps what the cube holds.
///
/// # Errors
/// [`Cancelled`] within a row.
pub fn equirect(cube: &Cube, height: usize, cancel: Cancel) -> Result<Image, Cancelled> {
    resample(cube, 2 * height, height, panorama_direction, cancel)
}

/// An image whose texel at (u, v) shows the cube in `direction(u, v)`, by [`sample`] at texel centres.
///
/// # Errors
/// [`Cancelled`] within a row.
pub fn resample(
    cube: &Cube,
    width: usize,
    height: usize,
    direction: impl Fn(f64, f64) -> [f64; 3],
    cancel: Cancel,
) -> Result<Image, Cancelled> {
    let mut rgb = Vec::with_capacity(width * height * 3);
    for y in 0..height {
        cancel.check()?;
        let v = (y as f64 + 0.5) / height as f64;
        for x in 0..width {
            let u = (x as f64 + 0.5) / width as f64;
            rgb.extend(sample(cube, direction(u, v)).map(|value| value as f32));
        }
    }
    Ok(Image { width, height, rgb })
}

/// Direction of the centre of a cube's texel.
pub fn texel_direction(face_size: usize, face: usize, x: usize, y: usize) -> [f64; 3] {
    cube_direction(face, cube_texel_centre(face_size, x), cube_texel_centre(face_size, y))
}
