//! The three layouts of texels, each checked once, when it is made.

use thiserror::Error;

/// Three-channel linear image, interleaved, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width · height · 3` values.
    pub rgb: Vec<f32>,
}

/// An equirectangular image: [`Image`] with `width = 2 · height`.
#[derive(Clone, Debug, PartialEq)]
pub struct Panorama(Image);

/// One level of a cube map: six square faces in KTX2 order.
#[derive(Clone, Debug, PartialEq)]
pub struct Cube {
    /// Texels along a face's edge.
    pub face_size: usize,
    /// `6 · face_size² · 3` values.
    pub rgb: Vec<f32>,
}

/// Sizes that make no image.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum LayoutError {
    /// A side is zero.
    #[error("an image of {width} × {height} texels is empty")]
    Empty {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// The values do not fill the stated size.
    #[error("{width} × {height} texels need {expected} values, {actual} were given")]
    Length {
        /// Columns.
        width: usize,
        /// Rows (of all faces).
        height: usize,
        /// Values the size asks for; `usize::MAX` where the product overflows.
        expected: usize,
        /// Values given.
        actual: usize,
    },
    /// Not twice as wide as high.
    #[error("a panorama is twice as wide as high, this image is {width} × {height}")]
    Aspect {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
}

impl Image {
    /// Wraps `width · height · 3` interleaved values.
    ///
    /// # Errors
    /// [`LayoutError::Empty`] for a zero side, [`LayoutError::Length`] where the values do not fit.
    pub fn new(width: usize, height: usize, rgb: Vec<f32>) -> Result<Image, LayoutError> {
        check_length(width, height, rgb.len())?;
        Ok(Image { width, height, rgb })
    }

    /// The three channels of one texel.
    ///
    /// # Panics
    /// Outside the image.
    #[inline]
    pub fn texel(&self, x: usize, y: usize) -> [f32; 3] {
        assert!(x < self.width && y < self.height, "texel ({x}, {y}) of {} × {}", self.width, self.height);
        triple(&self.rgb, y * self.width + x)
    }

    /// The values of row `y`, `width · 3` of them.
    pub fn row(&self, y: usize) -> &[f32] {
        let stride = self.width * 3;
        &self.rgb[y * stride..(y + 1) * stride]
    }
}

impl Panorama {
    /// Takes an image that is twice as wide as high; 2 × 1 is the smallest.
    ///
    /// # Errors
    /// [`LayoutError::Aspect`] for any other shape, [`LayoutError::Length`] where the public fields of
    /// `image` disagree.
    pub fn new(image: Image) -> Result<Panorama, LayoutError> {
        let Image { width, height, .. } = image;
        if height == 0 || height.checked_mul(2) != Some(width) {
            return Err(LayoutError::Aspect { width, height });
        }
        check_length(width, height, image.rgb.len())?;
        Ok(Panorama(image))
    }

    /// Columns.
    #[inline]
    pub fn width(&self) -> usize {
        self.0.width
    }

    /// Rows.
    #[inline]
    pub fn height(&self) -> usize {
        self.0.height
    }

    /// `width · height · 3` values, row 0 at the top.
    #[inline]
    pub fn rgb(&self) -> &[f32] {
        &self.0.rgb
    }

    /// The three channels of one texel.
    ///
    /// # Panics
    /// Outside the image.
    #[inline]
    pub fn texel(&self, x: usize, y: usize) -> [f32; 3] {
        self.0.texel(x, y)
    }

    /// The largest value of any channel; NaN counts as nothing, an all-NaN panorama gives −∞.
    pub fn max_value(&self) -> f32 {
        self.0.rgb.iter().copied().fold(f32::NEG_INFINITY, f32::max)
    }

    /// The same values, to be changed.
    pub fn rgb_mut(&mut self) -> &mut [f32] {
        &mut self.0.rgb
    }

    /// The same texels as a plain image.
    pub fn image(&self) -> &Image {
        &self.0
    }

    /// Gives the image back.
    pub fn into_image(self) -> Image {
        self.0
    }
}

impl Cube {
    /// Wraps `6 · face_size² · 3` interleaved values.
    ///
    /// # Errors
    /// [`LayoutError::Empty`] for face size 0, [`LayoutError::Length`] where the values do not fit.
    pub fn new(face_size: usize, rgb: Vec<f32>) -> Result<Cube, LayoutError> {
        check_length(face_size, face_size.saturating_mul(6), rgb.len())?;
        Ok(Cube { face_size, rgb })
    }

    /// The three channels of one texel; faces count +X −X +Y −Y +Z −Z from 0.
    ///
    /// # Panics
    /// Outside the cube.
    pub fn texel(&self, face: usize, x: usize, y: usize) -> [f32; 3] {
        let size = self.face_size;
        assert!(face < 6 && x < size && y < size, "texel ({x}, {y}) on face {face} of size {size}");
        triple(&self.rgb, (face * size + y) * size + x)
    }

    /// The values of one face, `face_size² · 3` of them.
    pub fn face(&self, face: usize) -> &[f32] {
        let stride = self.face_size * self.face_size * 3;
        &self.rgb[face * stride..(face + 1) * stride]
    }
}

fn triple(rgb: &[f32], index: usize) -> [f32; 3] {
    [rgb[3 * index], rgb[3 * index + 1], rgb[3 * index + 2]]
}

fn check_length(width: usize, height: usize, actual: usize) -> Result<(), LayoutError> {
    if width == 0 || height == 0 {
        return Err(LayoutError::Empty { width, height });
    }
    let expected = width.checked_mul(height).and_then(|count| count.checked_mul(3)).unwrap_or(usize::MAX);
    if expected == actual { Ok(()) } else { Err(LayoutError::Length { width, height, expected, actual }) }
}
