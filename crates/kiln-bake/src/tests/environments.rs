//! Panoramas and checks the tests share.

use crate::{
    Analysis, AnalysisRequest, Cancel, EncodedLevel, Lobe, Prefiltered, TexelFormat, reference_radiance,
};
use kiln_image::{Cube, Image, Panorama};
use kiln_sphere::direction::cube_texel_centre;
use kiln_sphere::{cube_direction, cube_texel_solid_angle_sr};

/// Passes only when `|actual - expected| <= tol`; written with `<=`, so NaN fails.
#[track_caller]
pub(super) fn check_within(what: &str, actual: f64, expected: f64, tol: f64) {
    let error = (actual - expected).abs();
    assert!(error <= tol, "{what}: got {actual}, want {expected}, error {error} over {tol}");
}

const WANTED: &str = "nobody cancels";

pub(super) fn analyse(panorama: &Panorama, request: &AnalysisRequest) -> Analysis {
    crate::analyse(panorama, request, Cancel::NEVER).expect(WANTED)
}

pub(super) fn bytes_of(analysis: &Analysis) -> Vec<u8> {
    analysis.to_bytes(Cancel::NEVER).expect(WANTED)
}

pub(super) fn specular_level(analysis: &Analysis, alpha: f64, face_size: usize) -> Prefiltered {
    crate::specular_level(analysis, alpha, face_size, Cancel::NEVER).expect(WANTED)
}

pub(super) fn irradiance(analysis: &Analysis, face_size: usize) -> Prefiltered {
    crate::irradiance(analysis, face_size, Cancel::NEVER).expect(WANTED)
}

pub(super) fn skybox(panorama: &Panorama, face_size: usize) -> Vec<Cube> {
    crate::skybox(panorama, face_size, Cancel::NEVER).expect(WANTED)
}

pub(super) fn encode_level(cube: &Cube, format: TexelFormat, scale_log2: i32) -> EncodedLevel {
    crate::encode_level(cube, format, scale_log2, Cancel::NEVER).expect(WANTED)
}

pub(super) fn panorama(width: usize, height: usize, texel: impl FnMut(usize) -> [f32; 3]) -> Panorama {
    let rgb = (0..width * height).flat_map(texel).collect();
    Panorama::new(Image::new(width, height, rgb).expect("sizes fit")).expect("2:1")
}

/// Random texels (SplitMix64), some a hundred times brighter.
pub(super) fn random(width: usize, height: usize, seed: u64) -> Panorama {
    let mut state = seed;
    let mut uniform = move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u32 << 24) as f32
    };
    panorama(width, height, |_| {
        let gain = if uniform() > 0.97 { 100.0 } else { 1.0 };
        [gain * uniform(), gain * uniform(), gain * uniform()]
    })
}

/// 1 everywhere but for one texel of 10⁵.
pub(super) fn sun(width: usize, height: usize, index: usize) -> Panorama {
    panorama(width, height, |i| if i == index { [1e5; 3] } else { [1.0; 3] })
}

/// Direction of a cube texel.
pub(super) fn texel_direction(face_size: usize, index: usize) -> [f64; 3] {
    let (face, y, x) = (index / (face_size * face_size), index / face_size % face_size, index % face_size);
    cube_direction(face, cube_texel_centre(face_size, x), cube_texel_centre(face_size, y))
}

/// Solid angle of a cube texel.
pub(super) fn texel_solid_angle_sr(face_size: usize, index: usize) -> f64 {
    cube_texel_solid_angle_sr(face_size, index % face_size, index / face_size % face_size)
}

/// RMS error of a map against brute force over its texels, relative to the reference's RMS.
pub(super) fn measured_rms(panorama: &Panorama, alpha: f64, map: &Prefiltered) -> f64 {
    let (mut error, mut size) = (0.0, 0.0);
    for (index, texel) in map.cube.rgb.chunks_exact(3).enumerate() {
        let weight = texel_solid_angle_sr(map.cube.face_size, index);
        let exact =
            reference_radiance(panorama, Lobe::Ggx { alpha }, texel_direction(map.cube.face_size, index));
        for (value, exact) in texel.iter().zip(exact) {
            error += weight * (f64::from(*value) - exact).powi(2);
            size += weight * exact * exact;
        }
    }
    (error / size).sqrt()
}
