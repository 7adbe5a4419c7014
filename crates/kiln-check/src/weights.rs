//! Solid angles of texels, for means over the sphere.

use std::f64::consts::PI;

use kiln_image::Shape;
use kiln_sphere::CubeSolidAngles;

/// What each texel weighs, in steradians; equal parts of 4π in a flat picture.
pub(crate) struct Weights {
    shape: Shape,
    rows: Vec<f64>,
    cube: Option<CubeSolidAngles>,
}

impl Weights {
    pub(crate) fn new(shape: Shape) -> Weights {
        let (rows, cube) = match shape {
            Shape::Flat { width, height } => (vec![4.0 * PI / (width * height) as f64; height], None),
            Shape::Panorama { height } => {
                // cos a − cos b = 2 sin((a + b)/2) sin((b − a)/2), without cancellation.
                let half_row = PI / (2 * height) as f64;
                let row = |y: usize| {
                    2.0 * libm::sin((2 * y + 1) as f64 * half_row) * libm::sin(half_row) * PI / height as f64
                };
                ((0..height).map(row).collect(), None)
            }
            Shape::Cube { face_size } => (Vec::new(), Some(CubeSolidAngles::new(face_size))),
        };
        Weights { shape, rows, cube }
    }

    /// Of texel `index`.
    pub(crate) fn of(&self, index: usize) -> f64 {
        match (self.shape, &self.cube) {
            (Shape::Cube { face_size }, Some(angles)) => {
                angles.at(index % face_size, index / face_size % face_size)
            }
            (Shape::Panorama { height }, _) => self.rows[index / (2 * height)],
            _ => self.rows.first().copied().unwrap_or(0.0),
        }
    }
}

/// Texels in a row of this shape.
pub(crate) fn row_texels(shape: Shape) -> usize {
    match shape {
        Shape::Flat { width, .. } => width,
        Shape::Panorama { height } => 2 * height,
        Shape::Cube { face_size } => face_size,
    }
}
