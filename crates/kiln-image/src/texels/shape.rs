//! Texels wherever they stand: picture, panorama or cube. Where one is, what it weighs, what is beside it.

use crate::{Cube, Image, Panorama, colour::Gamut};
use kiln_sphere::{cube_direction, cube_face_st, cube_texel_solid_angle_sr};
use std::f64::consts::PI;

/// How texels are arranged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A picture; all texels weigh alike.
    Flat {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// An equirectangular image, `width = 2 · height`.
    Panorama {
        /// Rows.
        height: usize,
    },
    /// Six faces.
    Cube {
        /// Texels along a face's edge.
        face_size: usize,
    },
}

/// Three-channel texels that can be checked and repaired.
pub trait Texels {
    /// How they are arranged. The number of texels must be that of [`Texels::rgb`].
    fn shape(&self) -> Shape;
    /// Interleaved values.
    fn rgb(&self) -> &[f32];
    /// The same, to be changed.
    fn rgb_mut(&mut self) -> &mut [f32];
    /// The colour space they were converted from; `None` where nothing was converted.
    fn gamut(&self) -> Option<&Gamut> {
        None
    }
}

impl Texels for Image {
    /// A picture twice as wide as high counts as a panorama.
    fn shape(&self) -> Shape {
        if self.width == 2 * self.height {
            Shape::Panorama { height: self.height }
        } else {
            Shape::Flat { width: self.width, height: self.height }
        }
    }

    fn rgb(&self) -> &[f32] {
        &self.rgb
    }

    fn rgb_mut(&mut self) -> &mut [f32] {
        &mut self.rgb
    }
}

impl Texels for Panorama {
    fn shape(&self) -> Shape {
        Shape::Panorama { height: self.height() }
    }

    fn rgb(&self) -> &[f32] {
        Panorama::rgb(self)
    }

    fn rgb_mut(&mut self) -> &mut [f32] {
        Panorama::rgb_mut(self)
    }
}

impl Texels for Cube {
    fn shape(&self) -> Shape {
        Shape::Cube { face_size: self.face_size }
    }

    fn rgb(&self) -> &[f32] {
        &self.rgb
    }

    fn rgb_mut(&mut self) -> &mut [f32] {
        &mut self.rgb
    }
}

impl Shape {
    /// Face (of a cube), column and row of texel `index`.
    pub(super) fn position(self, index: usize) -> (Option<usize>, usize, usize) {
        match self {
            Shape::Flat { width, .. } => (None, index % width, index / width),
            Shape::Panorama { height } => (None, index % (2 * height), index / (2 * height)),
            Shape::Cube { face_size } => {
                let (face, rest) = (index / (face_size * face_size), index % (face_size * face_size));
                (Some(face), rest % face_size, rest / face_size)
            }
        }
    }

    /// Up to nine texels around and at texel `index`. A panorama's columns wrap, a cube's neighbours stand on the next face.
    pub(super) fn neighbours(self, index: usize) -> impl Iterator<Item = usize> {
        let steps = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
        steps.filter_map(move |step| self.neighbour(index, step))
    }

    fn neighbour(self, index: usize, (dx, dy): (isize, isize)) -> Option<usize> {
        let (face, x, y) = self.position(index);
        let moved = |from: usize, step: isize, length: usize| {
            from.checked_add_signed(step).filter(|&position| position < length)
        };
        match self {
            Shape::Flat { width, height } => Some(moved(y, dy, height)? * width + moved(x, dx, width)?),
            Shape::Panorama { height } => {
                let width = 2 * height;
                let column = (x + width).wrapping_add_signed(dx) % width;
                Some(moved(y, dy, height)? * width + column)
            }
            Shape::Cube { face_size } => {
                let face = face.unwrap_or(0);
                if let (Some(x), Some(y)) = (moved(x, dx, face_size), moved(y, dy, face_size)) {
                    return Some((face * face_size + y) * face_size + x);
                }
                // A step of a texel's width in the plane of this face, as the next face sees it.
                let step = 2.0 / face_size as f64;
                let beside = |index: usize, by: isize| (index as f64 + 0.5 + by as f64) * step - 1.0;
                let (s, t) = (beside(x, dx), beside(y, dy));
                let (face, [s, t]) = cube_face_st(cube_direction(face, s, t));
                let index = |position: f64| {
                    (((position + 1.0) * 0.5 * face_size as f64).max(0.0) as usize).min(face_size - 1)
                };
                Some((face * face_size + index(t)) * face_size + index(s))
            }
        }
    }
}

/// What each texel weighs: its solid angle in steradians; for a picture, equal parts of 4π.
pub(super) struct Weights {
    shape: Shape,
    /// One for all, one a row, or a quarter of a face.
    table: Vec<f64>,
}

impl Weights {
    pub(super) fn new(shape: Shape) -> Weights {
        let table = match shape {
            Shape::Flat { width, height } => vec![4.0 * PI / (width as f64 * height as f64)],
            Shape::Panorama { height } => {
                // cos a − cos b = 2 sin((a + b)/2) sin((b − a)/2), without cancellation.
                let half_row = PI / (2.0 * height as f64);
                let middle = |row: usize| (2 * row + 1) as f64 * half_row;
                let area = |row: usize| 2.0 * libm::sin(middle(row)) * libm::sin(half_row);
                (0..height).map(|row| area(row) * PI / height as f64).collect()
            }
            Shape::Cube { face_size } => {
                let half = face_size.div_ceil(2);
                let texels = (0..half).flat_map(|y| (0..half).map(move |x| (x, y)));
                texels.map(|(x, y)| cube_texel_solid_angle_sr(face_size, x, y)).collect()
            }
        };
        Weights { shape, table }
    }

    /// Of texel `index`.
    pub(super) fn of(&self, index: usize) -> f64 {
        match self.shape {
            Shape::Flat { .. } => self.table[0],
            Shape::Panorama { height } => self.table[index / (2 * height)],
            Shape::Cube { face_size } => {
                let (_, x, y) = self.shape.position(index);
                let half = face_size.div_ceil(2);
                self.table[y.min(face_size - 1 - y) * half + x.min(face_size - 1 - x)]
            }
        }
    }
}
