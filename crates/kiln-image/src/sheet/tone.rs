//! From radiance to display values.

use crate::{
    Image,
    colour::{linear_to_srgb, luminance},
};

/// Display luminance of the median.
const MIDDLE_GREY: f64 = 0.18;
/// What shows where a value is NaN or infinite.
const NOT_FINITE: [u8; 3] = [255, 0, 255];

/// The factor that puts the median luminance of what is finite and not black at middle grey; 1 where
/// there is nothing.
pub fn exposure(texels: impl Iterator<Item = [f32; 3]>) -> f64 {
    let mut values: Vec<f64> = texels.map(luminance).filter(|y| y.is_finite() && *y > 0.0).collect();
    if values.is_empty() {
        return 1.0;
    }
    let middle = values.len() / 2;
    let (_, median, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    MIDDLE_GREY / *median
}

/// A whole image as sRGB bytes, with its own exposure; what a quick look needs.
pub fn tone_mapped(image: &Image) -> Vec<u8> {
    let texels = || image.rgb.chunks_exact(3).map(|rgb| [rgb[0], rgb[1], rgb[2]]);
    let exposure = exposure(texels());
    texels().flat_map(|rgb| pixel(rgb, exposure)).collect()
}

/// One pixel: exposed, tone mapped, sRGB encoded, rounded.
pub(super) fn pixel(rgb: [f32; 3], exposure: f64) -> [u8; 3] {
    if !rgb.iter().all(|value| value.is_finite()) {
        return NOT_FINITE;
    }
    let mapped = khronos_neutral(rgb.map(|value| (f64::from(value) * exposure).max(0.0)));
    mapped.map(|value| libm::round(linear_to_srgb(value.clamp(0.0, 1.0)) * 255.0) as u8)
}

/// Khronos PBR Neutral: keeps base colours below 0.8, compresses and desaturates highlights.
///
/// Takes and gives linear Rec. 709; values in `0 ≤ v < ∞` map to `0 ≤ v < 1`.
///
/// Source: Khronos, "PBR Neutral Tone Mapper Specification" (2024).
pub fn khronos_neutral(rgb: [f64; 3]) -> [f64; 3] {
    /// Fresnel reflection of a dielectric of index 1.5, which the curve takes off.
    const F90_OFFSET: f64 = 0.04;
    const START: f64 = 0.8 - F90_OFFSET;
    const DESATURATION: f64 = 0.15;

    let min = rgb.into_iter().fold(f64::INFINITY, f64::min);
    let offset = if min < 2.0 * F90_OFFSET { min - min * min / (4.0 * F90_OFFSET) } else { F90_OFFSET };
    let rgb = rgb.map(|value| value - offset);
    let peak = rgb.into_iter().fold(0.0, f64::max);
    if peak < START {
        return rgb;
    }
    let room = 1.0 - START;
    let new_peak = 1.0 - room * room / (peak + room - START);
    let fade = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    rgb.map(|value| {
        let scaled = value * (new_peak / peak);
        scaled + (new_peak - scaled) * fade
    })
}
