//! Punctual lights as shaders read them: the uniform `lights` of `docs/shader-interface.md`.
//!
//! A uniform block, not a storage buffer: GLSL ES 3.0 has none of those, and devices may offer none to fragment shaders.

use std::borrow::Cow;

use glam::Vec3;
use kiln_scene::{Light, LightKind, Scene};
use kiln_shader::Member;

/// Bytes of one light: four vectors of 16.
const LIGHT_BYTES: usize = 64;

/// Largest intensity; 64 lights of it seen through the sharpest lobe at the least distance still add up to an `f32`.
const INTENSITY_MAX: f32 = 1e18;

/// Largest 1 / range², that of a range of a micrometre.
const INVERSE_RANGE_SQUARED_MAX: f64 = 1e12;

/// How many lights a block of `size_bytes` has room for.
///
/// # Errors
/// What a shader must declare instead.
pub(crate) fn capacity(size_bytes: u32, members: &[Member]) -> Result<usize, &'static str> {
    let expected =
        "a struct of `count: u32` and `items: array<PunctualLight, N>`, see docs/shader-interface.md";
    let [count, items] = members else { return Err(expected) };
    let count_fits = (count.name.as_str(), count.ty.as_str(), count.offset_bytes) == ("count", "u32", 0);
    let bytes = items.size_bytes as usize;
    let items_fit =
        (items.name.as_str(), items.offset_bytes) == ("items", 16) && 16 + bytes <= size_bytes as usize;
    if count_fits && items_fit && bytes > 0 && bytes.is_multiple_of(LIGHT_BYTES) {
        Ok(bytes / LIGHT_BYTES)
    } else {
        Err(expected)
    }
}

/// The block: how many, then each light. `lights` are at most as many as the block has room for.
pub(crate) fn block(lights: &[Light]) -> Vec<u8> {
    let mut block = vec![0; 16];
    block[..4].copy_from_slice(&(lights.len() as u32).to_le_bytes());
    block.extend(lights.iter().flat_map(|light| record(light).map(f32::to_le_bytes)).flatten());
    block
}

/// The lights that a shader with room for `capacity` draws: the strongest ones at the middle of the scene, in the file's order.
pub(crate) fn strongest<'a>(lights: &'a [Light], scene: &Scene, capacity: usize) -> Cow<'a, [Light]> {
    if lights.len() <= capacity {
        return Cow::Borrowed(lights);
    }
    let middle = scene.bounds.map_or(Vec3::ZERO, |bounds| (bounds.min + bounds.max) / 2.0);
    let mut order: Vec<usize> = (0..lights.len()).collect();
    order.sort_by(|&a, &b| strength(&lights[b], middle).total_cmp(&strength(&lights[a], middle)));
    order.truncate(capacity);
    order.sort_unstable();
    Cow::Owned(order.into_iter().map(|index| lights[index].clone()).collect())
}

/// About the irradiance that a light would give at `middle`, if it shone there.
fn strength(light: &Light, middle: Vec3) -> f32 {
    let intensity = light.intensity.into_iter().fold(0.0, f32::max);
    match light.kind {
        LightKind::Directional => intensity,
        LightKind::Point | LightKind::Spot { .. } => {
            intensity / light.position.distance_squared(middle).max(f32::MIN_POSITIVE)
        }
    }
}

/// `PunctualLight` of `shaders/lib/frame.wgsl`.
fn record(light: &Light) -> [f32; LIGHT_BYTES / 4] {
    let [x, y, z, w] = match light.kind {
        LightKind::Directional => (-light.direction).extend(0.0).to_array(),
        LightKind::Point | LightKind::Spot { .. } => light.position.extend(1.0).to_array(),
    };
    let [red, green, blue] = light.intensity.map(finite_intensity);
    let [along_x, along_y, along_z] = light.direction.to_array();
    let (cone_scale, outer_versine) = cone(light.kind);
    let reach = inverse_range_squared(light);
    [x, y, z, w, red, green, blue, reach, along_x, along_y, along_z, cone_scale, outer_versine, 0.0, 0.0, 0.0]
}

/// A product of colour and power may overflow; WGSL promises nothing about what is not finite.
fn finite_intensity(value: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(0.0, INTENSITY_MAX) }
}

fn inverse_range_squared(light: &Light) -> f32 {
    let range = light.range.filter(|_| light.kind != LightKind::Directional);
    range.map_or(0.0, |range| f64::from(range).powi(-2).min(INVERSE_RANGE_SQUARED_MAX) as f32)
}

/// Scale of the ramp over cosines, and 1 − cosine where it ends: 2 sin²(angle / 2), which keeps its digits for narrow cones.
fn cone(kind: LightKind) -> (f32, f32) {
    let LightKind::Spot { inner_cone_rad, outer_cone_rad } = kind else { return (1.0, 3.0) };
    let versine = |angle: f32| 2.0 * (f64::from(angle) / 2.0).sin().powi(2);
    let outer = versine(outer_cone_rad);
    // An edge of a thousandth of the cone where the two angles are one: a step has no ramp to divide by.
    let ramp = (outer - versine(inner_cone_rad)).max(1e-3 * outer).max(1e-30);
    ((1.0 / ramp) as f32, outer as f32)
}
