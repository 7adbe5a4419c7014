//! Prefiltered maps.

use super::environments::{
    analyse, bytes_of, check_within, irradiance, measured_rms, panorama, random, specular_level, sun,
    texel_direction,
};
use crate::{Analysis, AnalysisRequest, BakeError, Cancel, Lobe, reference_radiance};
use kiln_image::Panorama;
use kiln_sphere::{ggx_kernel_at, kernel_ggx, panorama_direction, panorama_uv};

const ALPHAS: [f64; 5] = [1.0 / 49.0, 1.0 / 16.0, 0.25, 0.5, 1.0];
const REQUEST: AnalysisRequest =
    AnalysisRequest { alpha_min: 1.0 / 49.0, sheen_alpha_min: None, error: 1e-5 };

#[test]
fn constant_map_stays_constant_at_every_alpha() {
    let map = panorama(64, 32, |_| [0.25, 1.0, 7.0]);
    let analysis = analyse(&map, &REQUEST);
    for alpha in ALPHAS {
        let level = specular_level(&analysis, alpha, 5);
        for texel in level.cube.rgb.chunks_exact(3) {
            check_within("red", f64::from(texel[0]), 0.25, 0.25e-6);
            check_within("blue", f64::from(texel[2]), 7.0, 7e-6);
        }
    }
}

#[test]
fn stated_bound_covers_the_measured_error() {
    for (map, name) in [(random(32, 16, 1), "random"), (sun(64, 32, 700), "sun"), (random(10, 5, 2), "odd")] {
        for error in [1e-2, 1e-5] {
            let analysis =
                analyse(&map, &AnalysisRequest { alpha_min: 1.0 / 16.0, sheen_alpha_min: None, error });
            for alpha in [1.0 / 16.0, 0.25, 1.0] {
                let level = specular_level(&analysis, alpha, 5);
                let measured = measured_rms(&map, alpha, &level);
                let bound = level.accuracy.rms_bound;
                // The bound is nearly exact and the texels of a small cube are no exact rule for the sphere.
                assert!(
                    measured <= 1.1 * bound,
                    "{name}, alpha {alpha}, error {error}: {measured} over {bound}"
                );
                assert!(bound <= error, "{name}, alpha {alpha}: bound {bound} over what was asked, {error}");
            }
        }
    }
}

#[test]
fn bound_check_rejects_a_map_of_another_alpha() {
    let map = random(32, 16, 1);
    let level = specular_level(&analyse(&map, &REQUEST), 0.26, 6);
    assert!(measured_rms(&map, 0.25, &level) > 100.0 * level.accuracy.rms_bound);
}

#[test]
fn poles_and_wrap_column_match_brute_force() {
    for map in [random(12, 6, 5), random(2, 1, 6), sun(32, 16, 0), sun(32, 16, 31 + 8 * 32)] {
        let analysis =
            analyse(&map, &AnalysisRequest { alpha_min: 1.0 / 16.0, sheen_alpha_min: None, error: 1e-6 });
        // An odd face has texels at the poles and on the wrap column.
        let level = specular_level(&analysis, 1.0 / 16.0, 3);
        check_within("error", measured_rms(&map, 1.0 / 16.0, &level), 0.0, 3e-6);
    }
}

#[test]
fn single_texel_gives_the_kernel_itself() {
    let (width, height, index) = (256, 128, 40 * 256 + 100);
    let map = panorama(width, height, |i| if i == index { [1000.0; 3] } else { [0.0; 3] });
    let analysis = analyse(&map, &REQUEST);
    let centre = panorama_direction(100.5 / width as f64, 40.5 / height as f64);
    let solid_angle_sr = 4.0 * std::f64::consts::PI * analysis.mean()[0] * 4e-3 / 4.0;
    for alpha in [0.25, 1.0] {
        let level = specular_level(&analysis, alpha, 8);
        let norm = kernel_ggx(alpha, 0, Cancel::NEVER).expect("nobody cancels").ln_norm.exp();
        let peak = ggx_kernel_at(alpha, 0.0) / norm * solid_angle_sr * 1000.0;
        for (i, texel) in level.cube.rgb.chunks_exact(3).enumerate() {
            let direction = texel_direction(8, i);
            let cosine: f64 = (0..3).map(|axis| direction[axis] * centre[axis]).sum();
            let exact = ggx_kernel_at(alpha, 1.0 - cosine) / norm * solid_angle_sr * 1000.0;
            check_within("kernel", f64::from(texel[1]), exact, 2e-3 * peak);
        }
    }
}

#[test]
fn black_environment_stays_black_with_no_error() {
    let analysis = analyse(&panorama(16, 8, |_| [0.0; 3]), &REQUEST);
    for level in [specular_level(&analysis, 0.1, 4), irradiance(&analysis, 4)] {
        assert!(level.cube.rgb.iter().all(|&value| value == 0.0));
        assert!(
            level.accuracy.sup_bound <= 1e-12 && level.accuracy.clamped_flux == 0.0,
            "{:?}",
            level.accuracy
        );
    }
}

#[test]
fn quarter_turn_of_columns_turns_the_map() {
    let map = random(32, 16, 9);
    let turned = panorama(32, 16, |i| map.texel((i + 24) % 32, i / 32));
    let [a, b] = [&map, &turned].map(|map| specular_level(&analyse(map, &REQUEST), 0.1, 8).cube);
    let mut moved: f64 = 0.0;
    for (index, texel) in b.rgb.chunks_exact(3).enumerate() {
        let [u, v] = panorama_uv(texel_direction(8, index));
        let (face, [s, t]) = kiln_sphere::cube_face_st(panorama_direction(u - 0.25, v));
        let place = |s: f64| ((s + 1.0) * 4.0) as usize;
        let there = a.texel(face, place(s), place(t));
        let here = a.rgb[3 * index];
        moved = moved.max(f64::from((texel[0] - here).abs()));
        for channel in 0..3 {
            check_within("turned", f64::from(texel[channel]), f64::from(there[channel]), 1e-4);
        }
    }
    assert!(moved > 0.1, "the map must differ from the one that was not turned");
}

#[test]
fn prefiltering_is_linear() {
    let (f, g) = (random(32, 16, 11), random(32, 16, 12));
    let sum = panorama(32, 16, |i| {
        let (a, b) = (f.texel(i % 32, i / 32), g.texel(i % 32, i / 32));
        std::array::from_fn(|c| 2.0 * a[c] + 0.5 * b[c])
    });
    let [f, g, sum] = [f, g, sum]
        .map(|m| specular_level(&analyse(&m, &AnalysisRequest { error: 1e-6, ..REQUEST }), 0.1, 6).cube.rgb);
    for ((a, b), both) in f.iter().zip(&g).zip(&sum) {
        check_within("sum", f64::from(*both), f64::from(2.0 * a + 0.5 * b), 1e-4);
    }
}

#[test]
fn equal_bytes_for_any_number_of_threads() {
    let map = random(64, 32, 13);
    let bake = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let analysis = analyse(&map, &REQUEST);
            let cube = specular_level(&analysis, 0.05, 16).cube;
            (bytes_of(&analysis), cube.rgb.iter().map(|value| value.to_bits()).collect::<Vec<_>>())
        })
    };
    let one = bake(1);
    assert!(one == bake(2) && one == bake(7), "thread count changed bytes");
    assert!(one.0 != bytes_of(&analyse(&random(64, 32, 14), &REQUEST)), "another map has other bytes");
}

#[test]
fn extreme_alphas_are_finite() {
    let analysis =
        analyse(&sun(32, 16, 100), &AnalysisRequest { alpha_min: 0.1, sheen_alpha_min: None, error: 1e-3 });
    for alpha in [0.0, -1.0, f64::NAN, 1e-9, 2.0, f64::INFINITY] {
        let level = specular_level(&analysis, alpha, 2);
        assert!(level.cube.rgb.iter().all(|value| value.is_finite()), "alpha {alpha}");
    }
}

#[test]
fn impossible_error_is_capped_and_said() {
    let request = AnalysisRequest { alpha_min: 0.0, sheen_alpha_min: None, error: 0.0 };
    let need = crate::analysis::Need::new(&request, [1.0; 3], 20.0, Cancel::NEVER).expect("nobody cancels");
    assert_eq!(need.band_limit(20.0), crate::BAND_LIMIT_MAX);
    let analysis =
        analyse(&random(32, 16, 3), &AnalysisRequest { alpha_min: 0.25, sheen_alpha_min: None, error: 1e-3 });
    let sharper = specular_level(&analysis, 0.001, 2);
    assert!(sharper.accuracy.rms_bound > 0.01, "{:?}", sharper.accuracy);
}

#[test]
fn irradiance_is_alpha_one() {
    let map = random(32, 16, 15);
    let level = irradiance(&analyse(&map, &REQUEST), 4);
    assert!(measured_rms(&map, 1.0, &level) <= 1e-5);
}

#[test]
fn analysis_survives_its_bytes_and_hostile_ones_do_not() {
    let analysis =
        analyse(&sun(16, 8, 3), &AnalysisRequest { alpha_min: 0.5, sheen_alpha_min: None, error: 1e-2 });
    let bytes = bytes_of(&analysis);
    assert_eq!(Analysis::from_bytes(&bytes, Cancel::NEVER), Ok(analysis));
    for length in 0..bytes.len().min(200) {
        assert!(Analysis::from_bytes(&bytes[..length], Cancel::NEVER).is_err(), "{length} bytes");
    }
    assert_eq!(Analysis::from_bytes(b"PNG", Cancel::NEVER), Err(BakeError::NotAnAnalysis));
    let mut huge = bytes.clone();
    huge[16..20].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(matches!(
        Analysis::from_bytes(&huge, Cancel::NEVER),
        Err(BakeError::Range { field: "band limit", .. })
    ));
    let mut nan = bytes.clone();
    nan[28..36].copy_from_slice(&f64::NAN.to_le_bytes());
    assert_eq!(Analysis::from_bytes(&nan, Cancel::NEVER), Err(BakeError::NotFinite { index: 0 }));
}

/// The panorama of a corpus file, unless there is no corpus.
#[expect(clippy::print_stderr, reason = "a skipped test must say so")]
fn corpus(file: &str) -> Option<Panorama> {
    let Some(root) = std::env::var_os("KILN_CORPUS") else {
        eprintln!("SKIPPED: {file}: KILN_CORPUS is not set");
        return None;
    };
    let path = std::path::Path::new(&root).join(file);
    let bytes = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let decoded = kiln_image::decode(&bytes, &kiln_image::Limits::default(), Cancel::NEVER)
        .expect("a readable panorama");
    Some(Panorama::new(decoded.image).expect("2:1"))
}

#[test]
fn real_studio_matches_brute_force() {
    let Some(map) = corpus("hdr/polyhaven-pmndrs/studio.hdr") else { return };
    let analysis = analyse(&map, &REQUEST);
    for alpha in [1.0 / 49.0, 0.25] {
        let level = specular_level(&analysis, alpha, 64);
        let (mut error, mut size) = (0.0, 0.0);
        for index in (0..6 * 64 * 64).step_by(997) {
            let exact = reference_radiance(&map, Lobe::Ggx { alpha }, texel_direction(64, index));
            for (value, exact) in level.cube.rgb[3 * index..].iter().zip(exact) {
                error += (f64::from(*value) - exact).powi(2);
                size += exact * exact;
            }
        }
        check_within("relative RMS", (error / size).sqrt(), 0.0, 5e-5);
    }
}
