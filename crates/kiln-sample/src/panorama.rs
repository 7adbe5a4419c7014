//! What the generated environments share: texel directions, small vector helpers, the final rounding.

use kiln_image::{Image, Panorama};
use std::f64::consts::PI;

/// Linear Rec. 709, or any triple.
pub(crate) type Rgb = [f64; 3];

/// `width × width/2`, with `width` rounded down to even and at least 2.
pub(crate) fn size(width: usize) -> (usize, usize) {
    let width = width.max(2) / 2 * 2;
    (width, width / 2)
}

/// The azimuth of a column's centre, from −Z towards +X.
pub(crate) struct Column {
    /// Sine of azimuth.
    pub sin: f64,
    /// Cosine of azimuth.
    pub cos: f64,
}

/// All columns from the left.
pub(crate) fn columns(width: usize) -> Vec<Column> {
    let azimuth = |x: usize| ((x as f64 + 0.5) / width as f64 - 0.5) * 2.0 * PI;
    (0..width).map(|x| Column { sin: libm::sin(azimuth(x)), cos: libm::cos(azimuth(x)) }).collect()
}

/// A row's centre.
#[derive(Clone, Copy)]
pub(crate) struct Row {
    /// Radians above the horizon.
    pub elevation: f64,
    /// Its sine, the direction's y.
    pub sin_elevation: f64,
    /// Its cosine.
    pub cos_elevation: f64,
    solid_angle_sr: f64,
}

impl Row {
    pub(crate) fn new(y: usize, height: usize) -> Row {
        let elevation = (0.5 - (y as f64 + 0.5) / height as f64) * PI;
        let polar = |edge: usize| libm::cos(edge as f64 / height as f64 * PI);
        Row {
            elevation,
            sin_elevation: libm::sin(elevation),
            cos_elevation: libm::cos(elevation),
            solid_angle_sr: 2.0 * PI * (polar(y) - polar(y + 1)),
        }
    }

    /// A line without height at elevation 0.
    pub(crate) fn horizon() -> Row {
        Row { elevation: 0.0, sin_elevation: 0.0, cos_elevation: 1.0, solid_angle_sr: 0.0 }
    }

    /// Of one of `width` texels, exact.
    pub(crate) fn texel_solid_angle_sr(&self, width: usize) -> f64 {
        self.solid_angle_sr / width as f64
    }

    /// The unit vector through a texel's centre.
    pub(crate) fn direction(&self, column: &Column) -> [f64; 3] {
        [column.sin * self.cos_elevation, self.sin_elevation, -column.cos * self.cos_elevation]
    }
}

/// Unit vector of azimuth and elevation, radians.
pub(crate) fn direction(azimuth: f64, elevation: f64) -> [f64; 3] {
    let horizontal = libm::cos(elevation);
    [libm::sin(azimuth) * horizontal, libm::sin(elevation), -libm::cos(azimuth) * horizontal]
}

/// The texel that contains a direction.
pub(crate) fn texel_of([x, y, z]: [f64; 3], width: usize, height: usize) -> (usize, usize) {
    let u = libm::atan2(x, -z) / (2.0 * PI) + 0.5;
    let v = libm::acos(y.clamp(-1.0, 1.0)) / PI;
    let index = |value: f64, count: usize| ((value * count as f64) as usize).min(count - 1);
    (index(u, width), index(v, height))
}

/// Right and up of a viewer who looks along `forward`; looking straight up or down, +X is right.
pub(crate) fn tangents(forward: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    let horizontal = libm::hypot(forward[0], forward[2]);
    let right = if horizontal > 1e-9 {
        [-forward[2] / horizontal, 0.0, forward[0] / horizontal]
    } else {
        [1.0, 0.0, 0.0]
    };
    (right, cross(right, forward))
}

/// Evaluates a function of direction at every texel's centre.
pub(crate) fn draw(width: usize, radiance: impl Fn([f64; 3]) -> Rgb) -> Panorama {
    let (width, height) = size(width);
    let columns = columns(width);
    let rows = (0..height).map(|y| Row::new(y, height));
    let rgb =
        rows.flat_map(|row| columns.iter().map(|column| radiance(row.direction(column))).collect::<Vec<_>>());
    finish(width, height, rgb.collect())
}

/// Rounds to `f32`.
pub(crate) fn finish(width: usize, height: usize, rgb: Vec<Rgb>) -> Panorama {
    let values = rgb.into_iter().flatten().map(|value| value as f32).collect();
    let image = Image::new(width, height, values).expect("three values per texel");
    Panorama::new(image).expect("twice as wide as high")
}

pub(crate) fn add(a: Rgb, b: Rgb) -> Rgb {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(crate) fn scale(a: Rgb, factor: f64) -> Rgb {
    a.map(|value| value * factor)
}

pub(crate) fn lerp(a: Rgb, b: Rgb, t: f64) -> Rgb {
    add(scale(a, 1.0 - t), scale(b, t))
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn normalize(a: [f64; 3]) -> [f64; 3] {
    scale(a, 1.0 / libm::sqrt(dot(a, a)))
}

/// 0 below `from`, 1 above `to`, smooth between.
pub(crate) fn smoothstep(from: f64, to: f64, value: f64) -> f64 {
    let t = ((value - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
