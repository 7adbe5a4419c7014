//! Whether an image continues where it must: across a panorama's wrap, at its poles, across a cube's edges.
//!
//! A difference of neighbours is measured as a contrast, |a − b| / (a + b) of their luminances, so that a seam in the shade
//! counts as much as one in the light. What lies beside a seam says how much of it is the picture.

use kiln_image::colour::luminance;
use kiln_image::{Cube, FACE_NAMES, Panorama};
use kiln_sphere::{cube_direction, cube_face_st};

/// Mean contrast across a seam and between the neighbours beside it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seam {
    /// Of the two sides.
    pub across: f64,
    /// Of neighbours further inwards: the largest of such means near the seam.
    pub beside: f64,
    /// Of what the image was made of, between the same directions; 0 where that is not known.
    pub expected: f64,
}

/// Least mean contrast that is a seam: a fiftieth is what an eye sees in a smooth gradient.
const VISIBLE: f64 = 0.02;
/// A picture's own detail is this much below a seam.
const EXCESS: f64 = 4.0;

impl Seam {
    /// Whether it stands out of what is beside it.
    pub fn is_visible(&self) -> bool {
        self.across > VISIBLE && self.across > EXCESS * self.beside && self.across > 2.0 * self.expected
    }
}

/// 0 where either is no light: that is another check's.
fn contrast(a: [f32; 3], b: [f32; 3]) -> f64 {
    let (a, b) = (luminance(a), luminance(b));
    let is_light = a.is_finite() && b.is_finite() && a >= 0.0 && b >= 0.0 && a + b > 0.0;
    if is_light { (a - b).abs() / (a + b) } else { 0.0 }
}

/// The seam of a panorama's last and first column; `None` for one too small to have an inside.
pub fn wrap_column(panorama: &Panorama) -> Option<Seam> {
    let (width, height) = (panorama.width(), panorama.height());
    if width < 8 {
        return None;
    }
    let mut seam = Seam::default();
    for y in 0..height {
        let texel = |x: usize| panorama.texel(x, y);
        seam.across += contrast(texel(width - 1), texel(0));
        seam.beside += 0.5 * (contrast(texel(width - 2), texel(width - 1)) + contrast(texel(0), texel(1)));
    }
    Some(Seam { across: seam.across / height as f64, beside: seam.beside / height as f64, expected: 0.0 })
}

/// Mean contrast of a row's texels with the row's mean, for the first row (`false`) or the last (`true`), as
/// [`Seam::across`]; and that of the row eight further, which is that much further from the pole, as [`Seam::beside`].
pub fn pole_spread(panorama: &Panorama, is_last: bool) -> Option<Seam> {
    const FURTHER: usize = 8;
    let (width, height) = (panorama.width(), panorama.height());
    if height <= 2 * FURTHER {
        return None;
    }
    let spread = |from_pole: usize| {
        let y = if is_last { height - 1 - from_pole } else { from_pole };
        let mean = |channel: usize| {
            let sum: f64 = (0..width).map(|x| f64::from(panorama.texel(x, y)[channel])).sum();
            (sum / width as f64) as f32
        };
        let mean = [mean(0), mean(1), mean(2)];
        (0..width).map(|x| contrast(panorama.texel(x, y), mean)).sum::<f64>() / width as f64
    };
    Some(Seam { across: spread(0), beside: spread(FURTHER), expected: 0.0 })
}

/// Steps inwards from an edge that are compared: an object's own edge is seldom sharper than that.
const INWARDS: usize = 3;

/// Radiance by direction.
pub type Lookup<'a> = &'a (dyn Fn([f64; 3]) -> [f32; 3] + Sync);

/// Sums at one edge of a cube.
#[derive(Default)]
struct Edge {
    faces: (usize, usize),
    across: f64,
    expected: f64,
    /// By side and step.
    beside: [[f64; INWARDS]; 2],
    count: f64,
}

/// The seams of a cube's twelve edges, by the names of the faces that meet there; none for faces under eight texels. `source`
/// is what the cube shows.
pub fn cube_edges(cube: &Cube, source: Option<Lookup>) -> Vec<(String, Seam)> {
    let size = cube.face_size;
    if size < 8 {
        return Vec::new();
    }
    let mut edges: Vec<Edge> = Vec::new();
    for face in 0..6 {
        for side in 0..4 {
            for along in 0..size {
                add_texel(&mut edges, cube, source, [face, side, along]);
            }
        }
    }
    let seam = |edge: &Edge| {
        // Each side has its own texels.
        let beside = edge.beside.as_flattened().iter().fold(0.0, |most: f64, sum| most.max(*sum));
        let (a, b) = edge.faces;
        let name = format!("{} and {}", FACE_NAMES[a], FACE_NAMES[b]);
        let [across, expected] = [edge.across, edge.expected].map(|sum| sum / edge.count);
        (name, Seam { across, beside: 2.0 * beside / edge.count, expected })
    };
    edges.iter().map(seam).collect()
}

/// Adds the contrasts at texel `along` of a face's side to those of its edge.
fn add_texel(edges: &mut Vec<Edge>, cube: &Cube, source: Option<Lookup>, [face, side, along]: [usize; 3]) {
    let (size, along) = (cube.face_size as isize, along as isize);
    let place = |inwards: isize| match side {
        0 => (inwards, along),
        1 => (size - 1 - inwards, along),
        2 => (along, inwards),
        _ => (along, size - 1 - inwards),
    };
    let texel = |(x, y): (isize, isize)| cube.texel(face, x as usize, y as usize);
    let step = 2.0 / size as f64;
    let direction = |(x, y): (isize, isize)| {
        let [s, t] = [x, y].map(|index| (index as f64 + 0.5) * step - 1.0);
        cube_direction(face, s, t)
    };
    let (other, [s, t]) = cube_face_st(direction(place(-1)));
    let index = |position: f64| (((position + 1.0) / step).max(0.0) as usize).min(cube.face_size - 1);
    let beyond = cube.texel(other, index(s), index(t));
    let faces = (face.min(other), face.max(other));
    let at = edges.iter().position(|edge| edge.faces == faces).unwrap_or_else(|| {
        edges.push(Edge { faces, ..Edge::default() });
        edges.len() - 1
    });
    let edge = &mut edges[at];
    edge.across += contrast(texel(place(0)), beyond);
    if let Some(source) = source {
        edge.expected += contrast(source(direction(place(0))), source(direction(place(-1))));
    }
    for (inwards, sum) in edge.beside[usize::from(face == faces.1)].iter_mut().enumerate() {
        let inwards = inwards as isize;
        *sum += contrast(texel(place(inwards)), texel(place(inwards + 1)));
    }
    edge.count += 1.0;
}
