//! Colour spaces by their chromaticities, the sRGB transfer function, luminance.

use crate::{Cancel, Cancelled, decode::CHECK_TEXELS};

/// CIE xy of the three primaries and of white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chromaticities {
    /// Red primary.
    pub red: [f64; 2],
    /// Green primary.
    pub green: [f64; 2],
    /// Blue primary.
    pub blue: [f64; 2],
    /// White point.
    pub white: [f64; 2],
}

/// A row-major 3 × 3 matrix.
pub type Matrix = [[f64; 3]; 3];

/// ITU-R BT.709-6, table 1, item 1.3 and 1.4 (white is D65).
pub const REC_709: Chromaticities = Chromaticities {
    red: [0.640, 0.330],
    green: [0.300, 0.600],
    blue: [0.150, 0.060],
    white: [0.3127, 0.3290],
};

/// CIE XYZ seen as primaries; equal-energy white.
pub const CIE_XYZ: Chromaticities =
    Chromaticities { red: [1.0, 0.0], green: [0.0, 1.0], blue: [0.0, 0.0], white: [1.0 / 3.0, 1.0 / 3.0] };

/// Two chromaticities closer than this are one: files carry three or four digits.
pub const CHROMATICITY_TOLERANCE: f64 = 2e-4;

/// Luminance weights of linear Rec. 709 (BT.709-6, item 3.2).
pub const LUMINANCE_REC_709: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Bradford cone responses (Lindbloom, "Chromatic Adaptation"; ICC.1:2022, annex E).
const BRADFORD: Matrix = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];

impl Chromaticities {
    /// From `rx ry gx gy bx by wx wy`.
    pub fn from_array(xy: [f64; 8]) -> Chromaticities {
        let pair = |i: usize| [xy[2 * i], xy[2 * i + 1]];
        Chromaticities { red: pair(0), green: pair(1), blue: pair(2), white: pair(3) }
    }

    /// `rx ry gx gy bx by wx wy`.
    pub fn to_array(self) -> [f64; 8] {
        let [r, g, b, w] = [self.red, self.green, self.blue, self.white];
        [r[0], r[1], g[0], g[1], b[0], b[1], w[0], w[1]]
    }

    /// Whether all eight numbers agree within [`CHROMATICITY_TOLERANCE`].
    pub fn is_close_to(self, other: Chromaticities) -> bool {
        let pairs = self.to_array().into_iter().zip(other.to_array());
        pairs.into_iter().all(|(a, b)| (a - b).abs() <= CHROMATICITY_TOLERANCE)
    }
}

/// Relative luminance of a linear Rec. 709 colour.
pub fn luminance(rgb: [f32; 3]) -> f64 {
    let weighted = |channel: usize| f64::from(rgb[channel]) * LUMINANCE_REC_709[channel];
    weighted(0) + weighted(1) + weighted(2)
}

/// The colour space an image was stored in, where it is another than Rec. 709.
///
/// A negative Rec. 709 value of a converted image means one of two things: a colour that Rec. 709 cannot hold, when all
/// stored values were radiance, or a stored value that was negative already, which no light makes (ringing of a
/// resampling filter). The matrix back tells them apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gamut {
    to_rec_709: Matrix,
    from_rec_709: Matrix,
}

/// A stored value above −this times the texel's largest is a zero that went through binary32: its rounding, 6e-8, grows by
/// the condition of the matrices, which stays below 20 for spaces in use.
const STORED_ZERO: f64 = 2e-6;

impl Gamut {
    /// The space that `to_rec_709` converts from; `None` where the matrix has no inverse.
    pub fn new(to_rec_709: Matrix) -> Option<Gamut> {
        // Scaled first: the divisor of XYZE makes a determinant of 1e-7 that is as sound as any.
        let size = to_rec_709.iter().flatten().fold(0.0_f64, |size, value| size.max(value.abs()));
        let inverse = invert(&to_rec_709.map(|row| row.map(|value| value / size)))?;
        finite(inverse.map(|row| row.map(|value| value / size)))
            .map(|from_rec_709| Gamut { to_rec_709, from_rec_709 })
    }

    /// What a Rec. 709 texel was as stored, up to rounding.
    pub fn stored(&self, rgb: [f32; 3]) -> [f64; 3] {
        transform(&self.from_rec_709, rgb.map(f64::from))
    }

    /// The Rec. 709 texel of stored values, before rounding.
    pub fn converted(&self, stored: [f64; 3]) -> [f64; 3] {
        transform(&self.to_rec_709, stored)
    }

    /// Whether stored values, as [`Gamut::stored`] gives them, hold a negative one that is no rounding.
    pub(crate) fn is_negative(stored: [f64; 3]) -> bool {
        let largest = stored.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        stored.iter().any(|&value| value < -STORED_ZERO * largest)
    }
}

/// The matrix from linear RGB of `source` to linear Rec. 709 D65.
///
/// White is adapted with Bradford's cone responses, so (1, 1, 1) stays (1, 1, 1): a file's white is the
/// white its author saw. `None` where the chromaticities span no colour space (collinear, y = 0 of
/// white, not finite).
pub fn to_rec_709(source: Chromaticities) -> Option<Matrix> {
    let to_xyz = rgb_to_xyz(source)?;
    let adapted = multiply(&adaptation(source.white, REC_709.white)?, &to_xyz);
    finite(multiply(&invert(&rgb_to_xyz(REC_709)?)?, &adapted))
}

/// The matrix from CIE XYZ (D65 is white) to linear Rec. 709, without adaptation.
pub fn xyz_to_rec_709() -> Option<Matrix> {
    invert(&rgb_to_xyz(REC_709)?)
}

/// The weights with which `space`'s red, green and blue make up luminance; their sum is 1.
pub fn luminance_weights(space: Chromaticities) -> Option<[f64; 3]> {
    Some(rgb_to_xyz(space)?[1])
}

/// Matrix times column.
pub fn transform(m: &Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Applies a matrix to every texel, in `f64`, rounded once.
///
/// # Errors
/// [`Cancelled`], with some texels changed.
pub fn transform_texels(matrix: &Matrix, rgb: &mut [f32], cancel: Cancel) -> Result<(), Cancelled> {
    change_texels(rgb, |texel| transform(matrix, texel), cancel)
}

/// Replaces every texel by what `change` makes of it.
pub(crate) fn change_texels(
    rgb: &mut [f32],
    change: impl Fn([f64; 3]) -> [f64; 3],
    cancel: Cancel,
) -> Result<(), Cancelled> {
    for texels in rgb.chunks_mut(3 * CHECK_TEXELS) {
        cancel.check()?;
        for texel in texels.chunks_exact_mut(3) {
            let out = change([texel[0].into(), texel[1].into(), texel[2].into()]);
            for (value, new) in texel.iter_mut().zip(out) {
                *value = new as f32;
            }
        }
    }
    Ok(())
}

/// sRGB's electro-optical transfer function, exact piecewise form (IEC 61966-2-1); 0…1 to 0…1.
pub fn srgb_to_linear(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) }
}

/// Inverse of [`srgb_to_linear`].
pub fn linear_to_srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 }
}

/// SMPTE RP 177-1993: primaries scaled so that their sum is white with Y = 1.
fn rgb_to_xyz(space: Chromaticities) -> Option<Matrix> {
    let primaries = [space.red, space.green, space.blue].map(|[x, y]| [x, y, 1.0 - x - y]);
    let columns = transpose(&primaries);
    let scale = transform(&invert(&columns)?, white_xyz(space.white)?);
    finite(columns.map(|row| [row[0] * scale[0], row[1] * scale[1], row[2] * scale[2]]))
}

fn adaptation(from: [f64; 2], to: [f64; 2]) -> Option<Matrix> {
    let cones_from = transform(&BRADFORD, white_xyz(from)?);
    let cones_to = transform(&BRADFORD, white_xyz(to)?);
    let mut scaled = BRADFORD;
    for (row, (a, b)) in scaled.iter_mut().zip(cones_from.into_iter().zip(cones_to)) {
        *row = row.map(|value| value * (b / a));
    }
    finite(multiply(&invert(&BRADFORD)?, &scaled))
}

fn white_xyz([x, y]: [f64; 2]) -> Option<[f64; 3]> {
    (y > 0.0).then(|| [x / y, 1.0, (1.0 - x - y) / y])
}

fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    let columns = transpose(b);
    a.map(|row| columns.map(|column| row[0] * column[0] + row[1] * column[1] + row[2] * column[2]))
}

fn transpose(m: &Matrix) -> Matrix {
    [0, 1, 2].map(|i| [m[0][i], m[1][i], m[2][i]])
}

fn invert(m: &Matrix) -> Option<Matrix> {
    let minor = |r: usize, c: usize| {
        let at = |i: usize, j: usize| m[(r + i) % 3][(c + j) % 3];
        at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)
    };
    let determinant = (0..3).map(|c| m[0][c] * minor(0, c)).sum::<f64>();
    if !determinant.is_finite() || determinant.abs() < 1e-12 {
        return None;
    }
    finite([0, 1, 2].map(|r| [0, 1, 2].map(|c| minor(c, r) / determinant)))
}

fn finite(m: Matrix) -> Option<Matrix> {
    m.iter().flatten().all(|value| value.is_finite()).then_some(m)
}
