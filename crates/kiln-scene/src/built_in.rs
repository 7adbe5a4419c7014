//! Shapes to look at a shader on where there is no scene: geometry with texture coordinates and one plain material each.
//!
//! Metres, standing on y = 0. They are files like any other and go through [`crate::pack`].

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;
use serde_json::json;

use crate::{Image8, container, images};

/// Names of the shapes.
pub const BUILT_IN: [&str; 4] = ["sphere", "plane", "cloth", "knob"];

/// Steps around an axis, and of a cloth from edge to edge.
const STEPS: usize = 96;
/// Distance of the points that a normal is worked out from, in the surface's parameters.
const DERIVATIVE_STEP: f64 = 1e-5;
/// Two greys of a faint checker, sRGB-encoded: a shader's author sees where texture coordinates are.
const CHECKER: [u8; 2] = [0xc8, 0xbc];
/// Texels of the checker and of its squares.
const CHECKER_SIZE: [u32; 2] = [256, 16];

/// The shape as a .glb file; `None` for a name that is not in [`BUILT_IN`].
pub fn built_in(name: &str) -> Option<Vec<u8>> {
    let (surface, is_double_sided) = match name {
        "sphere" => (lathe(&sphere()), false),
        "plane" => (sheet(1, |u, v| DVec3::new(u - 0.5, 0.0, v - 0.5) * 2.0), true),
        "cloth" => (sheet(3 * STEPS / 2, cloth), true),
        "knob" => (lathe(&knob()), false),
        _ => return None,
    };
    Some(surface.glb(name, is_double_sided))
}

/// A triangle mesh.
#[derive(Default)]
struct Surface {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    coordinates: Vec<[f32; 2]>,
    indices: Vec<u32>,
}

/// A point of a profile in the half plane of radius and height, with its outward direction.
type ProfilePoint = ([f64; 2], [f64; 2]);

/// An arc about `center`, by angles from the radius axis towards +y; it bulges outwards, or inwards where `radius` is negative.
fn arc(
    center: [f64; 2],
    radius: f64,
    from: f64,
    to: f64,
    steps: usize,
) -> impl Iterator<Item = ProfilePoint> {
    (0..=steps).map(move |step| {
        let angle = from + (to - from) * step as f64 / steps as f64;
        let out = [libm::cos(angle), libm::sin(angle)];
        let [across, height] = [0, 1].map(|axis| center[axis] + radius.abs() * out[axis]);
        // On the axis it is exactly there, or a pole would be a tiny hole.
        let at = [if across.abs() < 1e-9 { 0.0 } else { across }, height];
        (at, out.map(|value| value * radius.signum()))
    })
}

/// Of radius 1.
fn sphere() -> Vec<ProfilePoint> {
    arc([0.0, 1.0], 1.0, FRAC_PI_2, -FRAC_PI_2, STEPS / 2).collect()
}

/// A ball that flows into a stem and a foot: convex and hollow parts, wide and tight ones.
fn knob() -> Vec<ProfilePoint> {
    const BALL: f64 = 0.75;
    const NECK: f64 = 0.3;
    const HEIGHT: f64 = 1.15;
    // Where the ball ends, below its middle.
    let end = 50.0 * PI / 180.0;
    let neck = [(BALL + NECK) * libm::cos(end), HEIGHT - (BALL + NECK) * libm::sin(end)];
    let stem = neck[0] - NECK;
    let foot = arc([stem + 0.16, 0.24], -0.16, PI, 1.5 * PI, 12);
    let rim = arc([stem + 0.3, 0.04], 0.04, FRAC_PI_2, 0.0, 8);
    arc([0.0, HEIGHT], BALL, FRAC_PI_2, -end, 48)
        .chain(arc(neck, -NECK, PI - end, PI, 16))
        .chain(foot)
        .chain(rim)
        .chain([([stem + 0.34, 0.0], [1.0, 0.0])])
        .collect()
}

/// Turns a profile, from the top downwards, about the y axis. Texture coordinates run around it and along the profile.
fn lathe(profile: &[ProfilePoint]) -> Surface {
    let steps =
        profile.windows(2).map(|pair| libm::hypot(pair[1].0[0] - pair[0].0[0], pair[1].0[1] - pair[0].0[1]));
    let mut lengths = vec![0.0];
    lengths.extend(steps.scan(0.0, |sum, step| {
        *sum += step;
        Some(*sum)
    }));
    let whole = lengths[lengths.len() - 1];
    let mut surface = Surface::default();
    for ((at, normal), length) in profile.iter().zip(&lengths) {
        for segment in 0..=STEPS {
            // The last column repeats the first exactly, so that no crack opens.
            let (sin, cos) = libm::sincos(TAU * (segment % STEPS) as f64 / STEPS as f64);
            let turned =
                |[radius, height]: [f64; 2]| [(radius * sin) as f32, height as f32, (radius * cos) as f32];
            surface.positions.push(turned(*at));
            surface.normals.push(turned(*normal));
            surface.coordinates.push([(segment as f64 / STEPS as f64) as f32, (length / whole) as f32]);
        }
    }
    surface.join(profile.len() - 1, STEPS);
    surface
}

/// A surface over the unit square: `place` of u, to the right, and v, downwards or towards the eye.
fn sheet(steps: usize, place: impl Fn(f64, f64) -> DVec3) -> Surface {
    let mut surface = Surface::default();
    for (row, column) in (0..=steps).flat_map(|row| (0..=steps).map(move |column| (row, column))) {
        let [u, v] = [column, row].map(|step| step as f64 / steps as f64);
        let along_u = place(u + DERIVATIVE_STEP, v) - place(u - DERIVATIVE_STEP, v);
        let along_v = place(u, v + DERIVATIVE_STEP) - place(u, v - DERIVATIVE_STEP);
        surface.positions.push(place(u, v).as_vec3().to_array());
        surface.normals.push(along_v.cross(along_u).normalize_or(DVec3::Y).as_vec3().to_array());
        surface.coordinates.push([u as f32, v as f32]);
    }
    surface.join(steps, steps);
    surface
}

/// Hangs from a straight edge at 2 m, in folds that grow deeper downwards.
fn cloth(u: f64, v: f64) -> DVec3 {
    let phase = TAU * (3.5 * u + 0.12 * libm::sin(TAU * 1.3 * u)) + 0.7 * v;
    let depth = 0.03 + 0.15 * libm::sqrt(v.max(0.0) + 0.01);
    DVec3::new(2.0 * u - 1.0 + 0.02 * v * libm::sin(2.0 * phase), 2.0 * (1.0 - v), depth * libm::sin(phase))
}

impl Surface {
    /// Triangles between rows of vertices, counter-clockwise where columns run to the right and rows downwards.
    fn join(&mut self, rows: usize, columns: usize) {
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let corner = |down: usize, right: usize| ((row + down) * (columns + 1) + column + right) as u32;
            let [a, b, c, d] = [corner(0, 0), corner(0, 1), corner(1, 0), corner(1, 1)];
            // At a pole a row is one point.
            let at = |corner: u32| self.positions[corner as usize];
            let has_area = |[a, b, c]: &[u32; 3]| at(*a) != at(*b) && at(*b) != at(*c) && at(*c) != at(*a);
            let triangles: Vec<[u32; 3]> = [[a, c, b], [b, c, d]].into_iter().filter(has_area).collect();
            self.indices.extend(triangles.as_flattened());
        }
    }

    fn glb(&self, name: &str, is_double_sided: bool) -> Vec<u8> {
        let checker = checker();
        let columns: [&[u8]; 5] = [
            bytemuck::cast_slice(&self.positions),
            bytemuck::cast_slice(&self.normals),
            bytemuck::cast_slice(&self.coordinates),
            bytemuck::cast_slice(&self.indices),
            &checker,
        ];
        let (mut binary, mut views) = (Vec::new(), Vec::new());
        for bytes in columns {
            views.push(json!({ "buffer": 0, "byteOffset": binary.len(), "byteLength": bytes.len() }));
            binary.extend_from_slice(bytes);
            binary.resize(binary.len().next_multiple_of(4), 0);
        }
        let count = self.positions.len();
        let extreme = |pick: fn(f32, f32) -> f32| {
            let join = |a: [f32; 3], b: &[f32; 3]| [0, 1, 2].map(|axis| pick(a[axis], b[axis]));
            self.positions.iter().fold(self.positions[0], join)
        };
        let attributes = json!({ "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2 });
        let document = json!({
            "asset": { "version": "2.0", "generator": "kiln" }, "scene": 0, "scenes": [{ "nodes": [0] }],
            "nodes": [{ "name": name, "mesh": 0 }],
            "meshes": [{ "name": name, "primitives": [{ "attributes": attributes, "indices": 3, "material": 0 }] }],
            "materials": [{
                "name": name, "doubleSided": is_double_sided,
                "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 }, "metallicFactor": 0.0, "roughnessFactor": 0.4 },
            }],
            "textures": [{ "sampler": 0, "source": 0 }],
            "samplers": [{ "magFilter": 9729, "minFilter": 9987 }],
            "images": [{ "bufferView": 4, "mimeType": "image/png" }],
            "buffers": [{ "byteLength": binary.len() }],
            "bufferViews": views,
            "accessors": [
                { "bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3", "min": extreme(f32::min), "max": extreme(f32::max) },
                { "bufferView": 1, "componentType": 5126, "count": count, "type": "VEC3" },
                { "bufferView": 2, "componentType": 5126, "count": count, "type": "VEC2" },
                { "bufferView": 3, "componentType": 5125, "count": self.indices.len(), "type": "SCALAR" },
            ],
        });
        container::join(document.to_string().into_bytes(), binary)
    }
}

fn checker() -> Vec<u8> {
    let [size, square] = CHECKER_SIZE;
    let grey = |index: u32| CHECKER[((index % size / square + index / size / square) % 2) as usize];
    let rgba = (0..size * size).flat_map(|index| [grey(index), grey(index), grey(index), 255]).collect();
    let picture = images::from_texels(Image8 { width: size, height: size, rgba });
    picture.expect("the size is that of the texels").encoded
}
