//! Profiles of lines and arcs with exact normals, and the surfaces they make when they turn about the y axis.

use std::f64::consts::{PI, TAU};

/// A point of a profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ProfilePoint {
    /// Distance from the axis and height.
    pub at: [f64; 2],
    /// Outward direction in the same plane, unit length.
    pub normal: [f64; 2],
}

/// A piecewise smooth curve in the half plane (radius, height). Points run so that the surface lies to
/// their right when seen from outside: from the top downwards.
#[derive(Clone, Debug, Default)]
pub(crate) struct Profile(Vec<ProfilePoint>);

impl Profile {
    /// An arc about `centre`; angles count from the radius axis towards +y, in radians. A negative `radius`
    /// makes a hollow one: the normal points to the centre.
    pub fn arc(mut self, centre: [f64; 2], radius: f64, from: f64, to: f64, steps: usize) -> Self {
        for step in 0..=steps {
            let angle = from + (to - from) * step as f64 / steps as f64;
            let out = [libm::cos(angle), libm::sin(angle)];
            let at = [centre[0] + radius.abs() * out[0], centre[1] + radius.abs() * out[1]];
            self.push(ProfilePoint { at, normal: out.map(|value| value * radius.signum()) });
        }
        self
    }

    /// A straight line.
    pub fn line(mut self, from: [f64; 2], to: [f64; 2], steps: usize) -> Self {
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = libm::hypot(along[0], along[1]);
        let normal = [-along[1] / length, along[0] / length];
        for step in 0..=steps {
            let t = step as f64 / steps as f64;
            self.push(ProfilePoint { at: [from[0] + t * along[0], from[1] + t * along[1]], normal });
        }
        self
    }

    /// Where two pieces meet smoothly their common point is kept once.
    fn push(&mut self, point: ProfilePoint) {
        let near = |a: [f64; 2], b: [f64; 2]| libm::hypot(a[0] - b[0], a[1] - b[1]) < 1e-9;
        if !self.0.last().is_some_and(|last| near(last.at, point.at) && near(last.normal, point.normal)) {
            self.0.push(point);
        }
    }
}

/// How a surface gets its texture coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Mapping {
    /// None.
    Plain,
    /// Stereographic about the pole above (`up`) or below a centre on the axis, which has no seam and keeps
    /// squares square: the pole is as regular as any other place.
    Stereographic {
        /// Height of the sphere's centre.
        centre: f64,
        /// Whether the pole is the upper one.
        up: bool,
        /// Texture repeats per radius of the sphere at the pole.
        repeats: f64,
    },
}

/// A surface of revolution.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Surface {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    /// Empty for [`Mapping::Plain`].
    pub uvs: Vec<[f32; 2]>,
    pub indices: Vec<u16>,
}

/// Turns a profile about the y axis in `segments` steps; vertices on the axis are not doubled triangles.
pub(crate) fn revolve(profile: &Profile, segments: usize, mapping: Mapping) -> Surface {
    let mut surface = Surface::default();
    for point in &profile.0 {
        for segment in 0..=segments {
            // The last column repeats the first exactly, so that no crack opens.
            let angle = TAU * (segment % segments) as f64 / segments as f64;
            let (sin, cos) = (libm::sin(angle), libm::cos(angle));
            let turn =
                |[radius, height]: [f64; 2]| [(radius * sin) as f32, height as f32, (radius * cos) as f32];
            surface.positions.push(turn(point.at));
            surface.normals.push(turn(point.normal));
            surface.uvs.extend(texture_coordinate(mapping, point.at, sin, cos));
        }
    }
    let row = segments + 1;
    for ring in 0..profile.0.len() - 1 {
        let (above, below) = (profile.0[ring], profile.0[ring + 1]);
        for segment in 0..segments {
            let corner = |row_index: usize, column: usize| (row_index * row + column) as u16;
            let [a, b] = [corner(ring, segment), corner(ring, segment + 1)];
            let [c, d] = [corner(ring + 1, segment), corner(ring + 1, segment + 1)];
            if above.at[0] > 1e-9 {
                surface.indices.extend([a, c, b]);
            }
            if below.at[0] > 1e-9 {
                surface.indices.extend([b, c, d]);
            }
        }
    }
    surface
}

/// Stereographic projection from the far pole: distance 2 tan(θ/2) = 2 r / (1 + h) from the near one.
fn texture_coordinate(mapping: Mapping, [radius, height]: [f64; 2], sin: f64, cos: f64) -> Option<[f32; 2]> {
    let Mapping::Stereographic { centre, up, repeats } = mapping else { return None };
    let above = if up { height - centre } else { centre - height };
    let length = libm::hypot(radius, above);
    let distance = repeats * 2.0 * radius / (length + above);
    // From below the surface is seen mirrored; turning u keeps the texture readable.
    let side = if up { 1.0 } else { -1.0 };
    Some([(0.5 + distance * sin) as f32, (0.5 + side * distance * cos) as f32])
}

/// Degrees to radians.
pub(crate) fn radians(degrees: f64) -> f64 {
    degrees * PI / 180.0
}
