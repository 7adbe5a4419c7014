//! Sky boxes, harmonics, tables, texel bytes.

use super::environments::{
    analyse, check_within, encode_level, panorama, random, skybox, sun, texel_solid_angle_sr,
};
use crate::{
    AnalysisRequest, Cancel, TexelFormat, dfg_table, irradiance_sh, roughness_of_level, scale_log2, sh,
};
use kiln_image::{Cube, Panorama};
use std::f64::consts::PI;

const REQUEST: AnalysisRequest = AnalysisRequest { alpha_min: 0.5, sheen_alpha_min: None, error: 1e-3 };

/// Mean of the green channel over the sphere.
fn mean_of_cube(cube: &Cube) -> f64 {
    let value =
        |(index, texel): (usize, &[f32])| f64::from(texel[1]) * texel_solid_angle_sr(cube.face_size, index);
    cube.rgb.chunks_exact(3).enumerate().map(value).sum::<f64>() / (4.0 * PI)
}

fn mean_of_panorama(map: &Panorama) -> f64 {
    analyse(map, &REQUEST).mean()[1]
}

const FLUX_ERROR: f64 = 1e-6;

#[test]
fn skybox_keeps_flux_down_to_one_texel() {
    // Suns on a side face, on the wrap column and on both caps.
    for index in [16 * 64 + 20, 14 * 64, 2 * 64 + 9, 31 * 64 + 40] {
        let map = sun(64, 32, index);
        for face_size in [24, 16, 5] {
            let levels = skybox(&map, face_size);
            assert_eq!(levels.last().map(|cube| cube.face_size), Some(1));
            for level in levels {
                check_within(
                    &format!("flux of sun {index} at {face_size}, {}", level.face_size),
                    mean_of_cube(&level) / mean_of_panorama(&map),
                    1.0,
                    FLUX_ERROR,
                );
            }
        }
    }
}

#[test]
fn skybox_flux_check_rejects_one_brighter_texel() {
    let map = sun(64, 32, 16 * 64 + 20);
    let mut cube = skybox(&map, 16).remove(0);
    let brightest = cube.rgb.iter().copied().fold(0.0, f32::max);
    for value in &mut cube.rgb {
        *value *= if *value == brightest { 1.05 } else { 1.0 };
    }
    assert!((mean_of_cube(&cube) / mean_of_panorama(&map) - 1.0).abs() > 2.0 * FLUX_ERROR);
}

#[test]
fn skybox_faces_look_where_ktx2_says() {
    // One colour per quarter of longitude and a top and a bottom cap: u = 0.5 is −Z, u = 0.75 is +X.
    let map = panorama(64, 32, |i| {
        let (column, row) = (i % 64, i / 64);
        let quarter = ((column + 8) / 16 % 4) as f32;
        if row < 4 {
            [9.0; 3]
        } else if row >= 28 {
            [8.0; 3]
        } else {
            [quarter; 3]
        }
    });
    let cube = skybox(&map, 5).remove(0);
    // +X −X +Y −Y +Z −Z
    for (face, expected) in [3.0, 1.0, 9.0, 8.0, 0.0, 2.0].into_iter().enumerate() {
        check_within("face", f64::from(cube.texel(face, 2, 2)[0]), expected, 1e-6);
    }
}

#[test]
fn skybox_of_a_constant_is_constant() {
    for level in skybox(&panorama(10, 5, |_| [3.0; 3]), 7) {
        assert!(level.rgb.iter().all(|&value| (value - 3.0).abs() <= 1e-6));
    }
}

#[test]
fn sh_of_known_functions() {
    let constant = sh(&analyse(&panorama(16, 8, |_| [1.0; 3]), &REQUEST), 8);
    check_within("c_00", constant.coefficients[0][0], (4.0 * PI).sqrt(), 1e-12);
    for c in &constant.coefficients[1..] {
        check_within("others", c[0], 0.0, 1e-12);
    }
    // Brighter above (+Y): only the coefficient at l(l + 1) + m = 1, of y, in band 1.
    let above = sh(&analyse(&panorama(16, 8, |i| [if i < 64 { 1.0 } else { 0.0 }; 3]), &REQUEST), 2);
    check_within("y", above.coefficients[1][2], (3.0 / (4.0 * PI)).sqrt() * PI, 1e-12);
    check_within("z", above.coefficients[2][2], 0.0, 1e-12);
    check_within("x", above.coefficients[3][2], 0.0, 1e-12);
    // Columns 8 … 15 are the half towards +X.
    let right = sh(&analyse(&panorama(16, 8, |i| [if i % 16 < 8 { 0.0 } else { 1.0 }; 3]), &REQUEST), 1);
    check_within("x", right.coefficients[3][0], (3.0 / (4.0 * PI)).sqrt() * PI, 1e-12);
}

#[test]
fn irradiance_sh_of_a_hemisphere_matches_the_closed_form() {
    let analysis = analyse(&panorama(16, 8, |i| [if i < 64 { 1.0 } else { 0.0 }; 3]), &REQUEST);
    // E/π under half a sky is (1 + cos θ)/2, which has bands 0 and 1 only.
    for direction in [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.6, 0.8, 0.0]] {
        let value = irradiance_sh(&analysis).evaluate(direction)[0];
        check_within("E/π", value, 0.5 + 0.5 * direction[1], 1e-12);
    }
}

#[test]
fn roughness_runs_from_0_to_1_and_a_chain_of_one_is_legal() {
    assert_eq!(
        [roughness_of_level(0, 7), roughness_of_level(3, 7), roughness_of_level(6, 7)],
        [0.0, 0.5, 1.0]
    );
    assert_eq!([roughness_of_level(0, 1), roughness_of_level(0, 0)], [0.0, 0.0]);
}

#[test]
fn dfg_table_agrees_with_the_integral() {
    let size = 8;
    let table = dfg_table(size, Cancel::NEVER).expect("nobody cancels");
    assert_eq!(table.len(), 64);
    for (index, entry) in table.iter().enumerate() {
        let centre = |i: usize| (i as f64 + 0.5) / 8.0;
        let exact = kiln_brdf::dfg_ggx(centre(index % size), centre(index / size));
        check_within("scale", f64::from(entry[0]), exact[0], 2e-6);
        check_within("bias", f64::from(entry[1]), exact[1], 2e-6);
    }
    assert!((table[0][0] - table[63][0]).abs() > 0.01, "x and y matter");
}

#[test]
fn half_texels_never_overflow() {
    let cube = Cube { face_size: 1, rgb: vec![999_424.0; 18] };
    assert_eq!(encode_level(&cube, TexelFormat::Rgba16Float, 0).bytes[..2], 65504.0f32.to_half());
    let s = scale_log2(999_424.0);
    assert_eq!(s, 4);
    let scaled = encode_level(&cube, TexelFormat::Rgba16Float, s);
    assert_eq!(scaled.bytes[..2], 62464.0f32.to_half());
    assert_eq!(scaled.bytes.len(), 6 * 8);
    assert_eq!(scaled.bytes[6..8], 1.0f32.to_half());
    assert!(
        scaled.rounding_rms <= 1e-12 && encode_level(&cube, TexelFormat::Rgba16Float, 0).rounding_rms > 0.9
    );
    assert_eq!([scale_log2(1.0), scale_log2(65000.0), scale_log2(f32::NAN)], [0, 0, 0]);
    assert!(f64::from(f32::MAX) / 2f64.powi(scale_log2(f32::MAX)) <= 65504.0);
}

trait ToHalf {
    fn to_half(self) -> [u8; 2];
}

impl ToHalf for f32 {
    fn to_half(self) -> [u8; 2] {
        half::f16::from_f32(self).to_le_bytes()
    }
}

#[test]
fn full_floats_are_exact_and_halves_round_by_2e_4() {
    let map = skybox(&random(16, 8, 4), 4).remove(0);
    assert_eq!(encode_level(&map, TexelFormat::Rgba32Float, 0).rounding_rms, 0.0);
    let rounding = encode_level(&map, TexelFormat::Rgba16Float, 0).rounding_rms;
    assert!((5e-5..3e-4).contains(&rounding), "{rounding}");
}
