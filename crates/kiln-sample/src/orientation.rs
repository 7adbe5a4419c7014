//! A test environment that shows at a glance which way is which.

use crate::panorama::{self, Rgb, cross, dot, lerp, smoothstep};
use kiln_image::Panorama;

/// Draws `width × width/2` texels (`width` is rounded down to even, at least 2).
///
/// The sphere is cut like a cube; each side has its axis's colour (+X red, −X cyan, +Y green, −Y magenta,
/// +Z blue, −Z yellow) and its name at the centre, readable from inside: looking along the axis, +Y is up;
/// looking up, +Z is up (as after tilting the head back from −Z); looking down, −Z is up.
pub fn six_colours(width: usize) -> Panorama {
    let (texels, _) = panorama::size(width);
    // One texel at the equator, which is the softness of every edge.
    let softness = std::f64::consts::TAU / texels as f64;
    panorama::draw(width, |direction| side_of(direction).shade(direction, softness))
}

/// One side of the cube.
struct Side {
    forward: [f64; 3],
    up: [f64; 3],
    colour: Rgb,
    is_positive: bool,
    letter: Letter,
}

#[derive(Clone, Copy)]
enum Letter {
    X,
    Y,
    Z,
}

const SIDES: [Side; 6] = [
    Side {
        forward: [1., 0., 0.],
        up: [0., 1., 0.],
        colour: [0.75, 0.02, 0.02],
        is_positive: true,
        letter: Letter::X,
    },
    Side {
        forward: [-1., 0., 0.],
        up: [0., 1., 0.],
        colour: [0.02, 0.60, 0.60],
        is_positive: false,
        letter: Letter::X,
    },
    Side {
        forward: [0., 1., 0.],
        up: [0., 0., 1.],
        colour: [0.03, 0.50, 0.03],
        is_positive: true,
        letter: Letter::Y,
    },
    Side {
        forward: [0., -1., 0.],
        up: [0., 0., -1.],
        colour: [0.55, 0.02, 0.55],
        is_positive: false,
        letter: Letter::Y,
    },
    Side {
        forward: [0., 0., 1.],
        up: [0., 1., 0.],
        colour: [0.03, 0.06, 0.80],
        is_positive: true,
        letter: Letter::Z,
    },
    Side {
        forward: [0., 0., -1.],
        up: [0., 1., 0.],
        colour: [0.75, 0.65, 0.02],
        is_positive: false,
        letter: Letter::Z,
    },
];

const INK: Rgb = [1.0, 1.0, 1.0];
const OUTLINE: Rgb = [0.01, 0.01, 0.01];

/// A line in the plane of a side, whose centre is (0, 0) and whose edges are at ±1.
type Stroke = [[f64; 2]; 2];

/// The side whose axis is nearest.
fn side_of(direction: [f64; 3]) -> &'static Side {
    let nearest = |best: &'static Side, side: &'static Side| {
        if dot(direction, side.forward) > dot(direction, best.forward) { side } else { best }
    };
    SIDES.iter().fold(&SIDES[0], nearest)
}

impl Side {
    fn shade(&self, direction: [f64; 3], softness: f64) -> Rgb {
        let along = dot(direction, self.forward);
        let right = cross(self.forward, self.up);
        let point = [dot(direction, right) / along, dot(direction, self.up) / along];
        let edge = 1.0 - point[0].abs().max(point[1].abs());
        let framed = lerp(OUTLINE, self.colour, smoothstep(0.012, 0.012 + 2.0 * softness, edge));
        let distance =
            self.strokes().into_iter().map(|stroke| distance(point, stroke)).fold(f64::INFINITY, f64::min);
        let inside =
            |half_width: f64| 1.0 - smoothstep(half_width - softness, half_width + softness, distance);
        lerp(lerp(framed, OUTLINE, inside(0.085)), INK, inside(0.05))
    }

    /// Sign on the left, letter on the right.
    fn strokes(&self) -> Vec<Stroke> {
        const MINUS: Stroke = [[-0.50, 0.0], [-0.18, 0.0]];
        const PLUS: Stroke = [[-0.34, -0.16], [-0.34, 0.16]];
        let mut strokes = vec![MINUS];
        if self.is_positive {
            strokes.push(PLUS);
        }
        strokes.extend(self.letter.strokes());
        strokes
    }
}

impl Letter {
    fn strokes(self) -> &'static [Stroke] {
        match self {
            Letter::X => &[[[0.10, -0.26], [0.46, 0.26]], [[0.10, 0.26], [0.46, -0.26]]],
            Letter::Y => {
                &[[[0.10, 0.26], [0.28, 0.02]], [[0.46, 0.26], [0.28, 0.02]], [[0.28, 0.02], [0.28, -0.26]]]
            }
            Letter::Z => {
                &[[[0.10, 0.26], [0.46, 0.26]], [[0.46, 0.26], [0.10, -0.26]], [[0.10, -0.26], [0.46, -0.26]]]
            }
        }
    }
}

/// From a point to a line with ends.
fn distance(point: [f64; 2], [from, to]: Stroke) -> f64 {
    let along = [to[0] - from[0], to[1] - from[1]];
    let offset = [point[0] - from[0], point[1] - from[1]];
    let length_2 = along[0] * along[0] + along[1] * along[1];
    let t = ((offset[0] * along[0] + offset[1] * along[1]) / length_2).clamp(0.0, 1.0);
    libm::hypot(offset[0] - t * along[0], offset[1] - t * along[1])
}

#[cfg(test)]
#[path = "orientation_tests.rs"]
mod tests;
