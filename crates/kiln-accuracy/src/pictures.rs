//! What maps look like, and where they are off.

use kiln_image::colour::linear_to_srgb;
use kiln_image::compare::heat_map;
use kiln_image::cube_layout::{CubeLayout, unfold};
use kiln_image::png::encode_rgb8;
use kiln_image::sheet::khronos_neutral;
use kiln_image::{Cube, Image};

use crate::chain::LobeKind;

/// Errors that heat maps tell apart, as powers of ten: black to pale yellow.
pub const HEAT: [f64; 2] = [-6.0, 0.0];

/// A map and its error.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Which lobe.
    pub lobe: LobeKind,
    /// Whose map, at which setting.
    pub title: String,
    /// Its six faces in a row, +X −X +Y −Y +Z −Z, as PNG.
    pub faces: Vec<u8>,
    /// How far its texels are from the exact ones, as PNG; `None` for the exact map.
    pub heat: Option<Vec<u8>>,
}

/// All pictures of a report.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pictures(pub Vec<Picture>);

impl Pictures {
    /// Adds maps of one level, the exact one first; all are shown with the exposure of that one.
    pub fn add(&mut self, lobe: LobeKind, maps: &[(String, Cube)]) {
        let Some((_, exact)) = maps.first() else { return };
        let exposure = exposure(exact);
        for (index, (title, map)) in maps.iter().enumerate() {
            let heat = (index > 0).then(|| heat(map, exact));
            self.0.push(Picture { lobe, title: title.clone(), faces: faces(map, exposure), heat });
        }
    }
}

/// Brings the mean to a middle grey.
fn exposure(map: &Cube) -> f64 {
    let mean = map.rgb.iter().map(|value| f64::from(*value)).sum::<f64>() / map.rgb.len().max(1) as f64;
    if mean > 0.0 { 0.35 / mean } else { 1.0 }
}

fn strip(cube: &Cube) -> Image {
    unfold(cube, CubeLayout::HorizontalStrip)
}

fn faces(map: &Cube, exposure: f64) -> Vec<u8> {
    let image = strip(map);
    let pixel = |rgb: &[f32]| {
        let linear = [0, 1, 2].map(|i| (f64::from(rgb[i]) * exposure).max(0.0));
        khronos_neutral(linear).map(|value| (linear_to_srgb(value.clamp(0.0, 1.0)) * 255.0).round() as u8)
    };
    let bytes: Vec<u8> = image.rgb.chunks_exact(3).flat_map(pixel).collect();
    encode_rgb8(image.width, image.height, &bytes)
}

/// The worst channel's error relative to the exact value plus a hundredth of the mean, on the scale of [`HEAT`].
fn heat(map: &Cube, exact: &Cube) -> Vec<u8> {
    let mean = exact.rgb.iter().map(|value| value.abs()).sum::<f32>() / exact.rgb.len().max(1) as f32;
    let off = |(a, b): (&f32, &f32)| {
        let relative = f64::from((a - b).abs() / (b.abs() + 0.01 * mean).max(f32::MIN_POSITIVE));
        let [low, high] = HEAT;
        // What is not a number is as wrong as can be.
        let share = (libm::log10(relative.max(1e-30)) - low) / (high - low);
        if share.is_nan() { 1.0 } else { share as f32 }
    };
    let values: Vec<f32> = map.rgb.iter().zip(&exact.rgb).map(off).collect();
    let worst = values.chunks_exact(3).flat_map(|texel| [texel[0].max(texel[1]).max(texel[2]); 3]).collect();
    let image = strip(&Cube { face_size: exact.face_size, rgb: worst });
    let red: Vec<f32> = image.rgb.chunks_exact(3).map(|texel| texel[0]).collect();
    encode_rgb8(image.width, image.height, &heat_map(&red))
}
