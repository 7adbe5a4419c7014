//! A product-photography studio: soft boxes over a dark cyclorama.
//!
//! The subject stands at the origin and faces +Z, where the camera is; the panorama's centre (−Z) is the
//! wall behind it. Unit: 1.0 is a white card under the key light, roughly; soft boxes peak at 30.

use crate::panorama::{self, Rgb, add, dot, lerp, scale, smoothstep};
use kiln_image::Panorama;

/// Draws `width × width/2` texels (`width` is rounded down to even, at least 2).
///
/// Everything is smooth at the scale of a degree, so that it looks alike at every resolution: lights have
/// soft edges and a hot spot, wall and floor run into each other without an edge.
pub fn soft_boxes(width: usize) -> Panorama {
    let lights = LIGHTS.map(Light::new);
    panorama::draw(width, |direction| {
        let mut radiance = cyclorama(direction);
        for light in &lights {
            let (coverage, emitted) = light.shade(direction);
            radiance = lerp(radiance, emitted, coverage);
        }
        radiance
    })
}

/// A rectangular soft box that faces the origin, in metres.
struct SoftBox {
    position: [f64; 3],
    /// Half width and half height.
    half: [f64; 2],
    /// Radiance of the hot spot.
    peak: f64,
    tint: Rgb,
    /// Share of the peak left at the corners.
    falloff: f64,
}

const WARM: Rgb = [1.0, 0.95, 0.88];
const NEUTRAL: Rgb = [1.0, 0.985, 0.97];
const COOL: Rgb = [0.90, 0.96, 1.0];

/// Key, fill, overhead, two rim strips; the key is the largest near the camera, as gradients on metal want.
const LIGHTS: [SoftBox; 5] = [
    SoftBox { position: [-1.75, 1.05, 1.25], half: [1.00, 1.15], peak: 30.0, tint: WARM, falloff: 0.18 },
    SoftBox { position: [2.1, 0.70, 1.4], half: [0.95, 1.15], peak: 6.0, tint: NEUTRAL, falloff: 0.22 },
    SoftBox { position: [0.0, 2.2, -0.55], half: [1.00, 0.55], peak: 14.0, tint: NEUTRAL, falloff: 0.20 },
    SoftBox { position: [-1.75, 0.40, -1.55], half: [0.16, 1.35], peak: 20.0, tint: COOL, falloff: 0.30 },
    SoftBox { position: [1.85, 0.40, -1.45], half: [0.20, 1.35], peak: 24.0, tint: COOL, falloff: 0.30 },
];

/// Black fabric around the diffuser, metres.
const FRAME_M: f64 = 0.02;
/// Width over which an edge fades, metres; about a degree from the origin.
const EDGE_M: f64 = 0.035;

/// A soft box with its axes worked out.
struct Light {
    box_: SoftBox,
    forward: [f64; 3],
    right: [f64; 3],
    up: [f64; 3],
    distance: f64,
}

impl Light {
    fn new(box_: SoftBox) -> Light {
        let distance = libm::sqrt(dot(box_.position, box_.position));
        let forward = panorama::normalize(box_.position);
        let (right, up) = panorama::tangents(forward);
        Light { box_, forward, right, up, distance }
    }

    /// How much of the view the box covers, and what it emits there.
    fn shade(&self, direction: [f64; 3]) -> (f64, Rgb) {
        let along = dot(direction, self.forward);
        if along <= 0.0 {
            return (0.0, [0.0; 3]);
        }
        let point = [self.right, self.up].map(|axis| dot(direction, axis) / along * self.distance);
        let outside = rounded_box_distance(point, self.box_.half, 0.06);
        let coverage = 1.0 - smoothstep(FRAME_M, FRAME_M + EDGE_M, outside);
        let lit = 1.0 - smoothstep(-EDGE_M, 0.0, outside);
        let (u, v) = (point[0] / self.box_.half[0], point[1] / self.box_.half[1]);
        // Behind the diffuser the flash head is nearest at the centre.
        let hot_spot = libm::exp(-1.1 * (u * u + v * v));
        let shape = self.box_.falloff + (1.0 - self.box_.falloff) * hot_spot;
        (coverage, scale(self.box_.tint, 0.03 + lit * shape * self.box_.peak))
    }
}

/// Signed distance to a rectangle with rounded corners; negative inside.
fn rounded_box_distance(point: [f64; 2], half: [f64; 2], radius: f64) -> f64 {
    let [x, y] = [0, 1].map(|i| point[i].abs() - half[i] + radius);
    libm::hypot(x.max(0.0), y.max(0.0)) + x.max(y).min(0.0) - radius
}

/// Dark grey paper that sweeps from the floor up the wall; a spot lights the wall behind the subject.
fn cyclorama(direction: [f64; 3]) -> Rgb {
    let [x, y, z] = direction;
    let wall = 0.045 + 0.05 * smoothstep(0.9, -0.2, y);
    let floor = 0.10 + 0.17 * smoothstep(-1.0, -0.15, y);
    let paper = floor + (wall - floor) * smoothstep(-0.22, 0.10, y);
    let behind = [x, y - 0.05, z + 1.0];
    let spot = 0.55 * libm::exp(-dot(behind, behind) * 2.6);
    add(scale([0.97, 0.985, 1.0], paper), scale([1.0, 0.96, 0.90], spot))
}

#[cfg(test)]
#[path = "studio_tests.rs"]
mod tests;
