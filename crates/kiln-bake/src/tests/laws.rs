//! Laws any convolution on the sphere obeys: closed forms, energy, seams, symmetry, one answer from two methods.

use super::environments::{
    analyse, check_within, irradiance, panorama, random, skybox, specular_level, sun, texel_direction,
    texel_solid_angle_sr,
};
use crate::{Analysis, AnalysisRequest, Cancel, Lobe, Prefiltered};
use kiln_image::{Cube, Panorama};
use kiln_sphere::{ZonalKernel as _, cube_direction, cube_face_st, panorama_direction};
use std::f64::consts::PI;

const WANTED: &str = "nobody cancels";
const REQUEST: AnalysisRequest =
    AnalysisRequest { alpha_min: 1.0 / 16.0, sheen_alpha_min: Some(1.0 / 16.0), error: 1e-5 };
const LOBES: [Lobe; 6] = [
    Lobe::Lambert,
    Lobe::Ggx { alpha: 1.0 / 16.0 },
    Lobe::Ggx { alpha: 0.25 },
    Lobe::Ggx { alpha: 1.0 },
    Lobe::Charlie { alpha: 1.0 / 16.0 },
    Lobe::Charlie { alpha: 1.0 },
];

fn bake(analysis: &Analysis, lobe: Lobe, face_size: usize) -> Prefiltered {
    match lobe {
        Lobe::Lambert => irradiance(analysis, face_size),
        Lobe::Ggx { alpha } => specular_level(analysis, alpha, face_size),
        Lobe::Charlie { alpha } => {
            crate::sheen_level(analysis, alpha, face_size, Cancel::NEVER).expect(WANTED)
        }
    }
}

/// A panorama of a function's values at texel centres.
fn sampled(width: usize, f: impl Fn([f64; 3]) -> f64) -> Panorama {
    let centre = |i: usize| [(i % width) as f64 + 0.5, (i / width) as f64 + 0.5];
    panorama(width, width / 2, |i| {
        let [x, y] = centre(i);
        [f(panorama_direction(x / width as f64, 2.0 * y / width as f64)) as f32; 3]
    })
}

/// Largest difference of a map's green from a function, over all texels.
fn worst_difference(cube: &Cube, f: impl Fn([f64; 3]) -> f64) -> f64 {
    let texels = cube.rgb.chunks_exact(3).enumerate();
    let difference =
        |(i, rgb): (usize, &[f32])| (f64::from(rgb[1]) - f(texel_direction(cube.face_size, i))).abs();
    texels.map(difference).fold(0.0, f64::max)
}

/// Texels that leave a constant by more than 1e-6 of it.
fn inconstant(cube: &Cube, rgb: [f64; 3]) -> usize {
    let is_off = |(i, value): (usize, &f32)| (f64::from(*value) - rgb[i % 3]).abs() > 1e-6 * rgb[i % 3];
    cube.rgb.iter().enumerate().filter(|&value| is_off(value)).count()
}

#[test]
fn constant_map_is_constant_to_1e_6_in_every_mip_of_every_chain() {
    let rgb = [0.3, 1.0, 1e4];
    for width in [256, 10] {
        let map = panorama(width, width / 2, |_| rgb.map(|value| value as f32));
        let rgb = rgb.map(|value: f64| f64::from(value as f32));
        for error in [1e-3, 1e-5] {
            let analysis = analyse(&map, &AnalysisRequest { alpha_min: 1.0 / 64.0, error, ..REQUEST });
            for level in 1..=6 {
                let alpha = (f64::from(level) / 6.0).powi(2);
                for lobe in [Lobe::Ggx { alpha }, Lobe::Charlie { alpha }, Lobe::Lambert] {
                    let cube = bake(&analysis, lobe, 64 >> level).cube;
                    assert_eq!(inconstant(&cube, rgb), 0, "{lobe:?}, width {width}, error {error}");
                }
            }
        }
        for level in skybox(&map, 64) {
            assert_eq!(inconstant(&level, rgb), 0, "skybox of {}, width {width}", level.face_size);
        }
    }
}

#[test]
fn constancy_check_rejects_one_value_off_by_2e_6() {
    let mut cube = Cube { face_size: 2, rgb: vec![1.0; 72] };
    cube.rgb[40] += 2e-6;
    assert_eq!(inconstant(&cube, [1.0; 3]), 1);
}

/// ∫ f dω / 4π of the panorama's patches, green.
fn mean_of_patches(map: &Panorama) -> f64 {
    let (width, height) = (map.width(), map.height());
    let row = |row: usize| {
        let edge = |row: usize| libm::cos(PI * row as f64 / height as f64);
        let sum: f64 = (0..width).map(|column| f64::from(map.texel(column, row)[1])).sum();
        sum * (edge(row) - edge(row + 1)) / (2.0 * width as f64)
    };
    (0..height).map(row).sum()
}

#[test]
fn degree_zero_is_kept_to_1e_12_with_bright_texels_and_without() {
    for map in [random(128, 64, 3), sun(512, 256, 70 * 512 + 9), random(10, 5, 4)] {
        let analysis = analyse(&map, &REQUEST);
        check_within("mean", analysis.mean()[1] / mean_of_patches(&map), 1.0, 1e-12);
    }
    for lobe in LOBES {
        check_within("κ_0", lobe.kernel(8, Cancel::NEVER).expect(WANTED).kappa[0], 1.0, 1e-12);
    }
}

#[test]
fn mean_check_sees_a_texel_that_moved_by_a_millionth() {
    let map = random(128, 64, 3);
    let moved = panorama(128, 64, |i| {
        map.texel(i % 128, i / 128).map(|value| if i == 4000 { value * 1.000_001 } else { value })
    });
    assert!((mean_of_patches(&moved) / mean_of_patches(&map) - 1.0).abs() > 1e-12);
}

/// 1 + 0.4 · a harmonic of degree 3 and order 2, scaled by `kappa`.
fn third_degree([x, y, z]: [f64; 3], kappa: f64) -> f64 {
    1.0 + 0.4 * kappa * 2.6 * y * (x * x - z * z)
}

/// Largest error of a map of one harmonic against κ_degree times it.
fn single_band_error(lobe: Lobe, degree: usize) -> f64 {
    let analysis = analyse(&sampled(512, |direction| third_degree(direction, 1.0)), &REQUEST);
    let kappa = lobe.kernel(8, Cancel::NEVER).expect(WANTED).kappa[degree];
    worst_difference(&bake(&analysis, lobe, 7).cube, |direction| third_degree(direction, kappa))
}

#[test]
fn single_band_is_scaled_by_its_kappa() {
    for lobe in LOBES {
        // Patches of 512 columns shrink degree 3 by 1e-4.
        check_within(&format!("{lobe:?}"), single_band_error(lobe, 3), 0.0, 1e-4);
    }
}

#[test]
fn single_band_check_rejects_the_next_kappa() {
    assert!(single_band_error(Lobe::Ggx { alpha: 0.25 }, 4) > 1e-2);
}

/// Largest error of a map of one texel against its lobe's kernel, relative to its peak.
fn delta_error(baked: Lobe, lobe: Lobe) -> f64 {
    const WIDTH: usize = 1024;
    let (column, row) = (300, 200);
    let map = panorama(WIDTH, WIDTH / 2, |i| if i == row * WIDTH + column { [1e4; 3] } else { [0.0; 3] });
    let centre =
        panorama_direction((column as f64 + 0.5) / WIDTH as f64, 2.0 * (row as f64 + 0.5) / WIDTH as f64);
    let flux = 4.0 * PI * mean_of_patches(&map);
    let profile = lobe.profile(lobe.kernel(0, Cancel::NEVER).expect(WANTED).ln_norm);
    let cube = bake(&analyse(&map, &REQUEST), baked, 32).cube;
    let (mut peak, mut worst) = (0.0_f64, 0.0_f64);
    for (i, rgb) in cube.rgb.chunks_exact(3).enumerate() {
        let direction = texel_direction(32, i);
        let one_minus_x = 0.5 * (0..3).map(|i| (direction[i] - centre[i]).powi(2)).sum::<f64>();
        let exact = flux * profile.at(one_minus_x);
        peak = peak.max(exact);
        // A texel is no point: where the horizon cuts it, the kernel's kink is rounded.
        if (1.0 - one_minus_x).abs() > 0.01 {
            worst = worst.max((f64::from(rgb[1]) - exact).abs());
        }
    }
    worst / peak
}

#[test]
fn one_texel_gives_the_kernel_of_every_lobe() {
    for lobe in LOBES {
        check_within(&format!("{lobe:?}"), delta_error(lobe, lobe), 0.0, 1e-3);
    }
}

#[test]
fn kernel_check_rejects_another_alpha() {
    assert!(delta_error(Lobe::Ggx { alpha: 0.25 }, Lobe::Ggx { alpha: 0.26 }) > 1e-2);
}

/// ∫ map dω / 4π, green, by the texels' solid angles.
fn mean_of_map(cube: &Cube) -> f64 {
    let texel = |(i, rgb): (usize, &[f32])| f64::from(rgb[1]) * texel_solid_angle_sr(cube.face_size, i);
    cube.rgb.chunks_exact(3).enumerate().map(texel).sum::<f64>() / (4.0 * PI)
}

#[test]
fn no_lobe_makes_or_loses_energy() {
    for map in [random(64, 32, 21), sun(256, 128, 40 * 256 + 200)] {
        let analysis = analyse(&map, &REQUEST);
        for lobe in LOBES {
            let cube = bake(&analysis, lobe, 64).cube;
            // Texel centres are no exact rule for the sphere.
            check_within(&format!("{lobe:?}"), mean_of_map(&cube) / mean_of_patches(&map), 1.0, 1e-3);
        }
    }
}

#[test]
fn energy_check_rejects_a_lost_face() {
    let map = random(64, 32, 21);
    let mut cube = bake(&analyse(&map, &REQUEST), Lobe::Lambert, 64).cube;
    cube.rgb[..3 * 64 * 64].fill(0.0);
    assert!((mean_of_map(&cube) / mean_of_patches(&map) - 1.0).abs() > 1e-1);
}

/// Steepest change a radian between neighbours (green), within the faces and across their edges.
fn slopes(cube: &Cube) -> [f64; 2] {
    let size = cube.face_size;
    let mut steepest = [0.0_f64; 2];
    for texel in 0..6 * size * size {
        let (face, y, x) = (texel / (size * size), texel / size % size, texel % size);
        let here = texel_direction(size, texel);
        for (dx, dy) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
            let place = |index: usize, step: f64| (2.0 * (index as f64 + step) + 1.0) / size as f64 - 1.0;
            let beyond = cube_direction(face, place(x, dx), place(y, dy));
            let (other_face, [s, t]) = cube_face_st(beyond);
            let index = |s: f64| ((0.5 * (s + 1.0) * size as f64) as usize).min(size - 1);
            let other = (other_face * size + index(t)) * size + index(s);
            let there = texel_direction(size, other);
            let distance = (0..3).map(|i| (here[i] - there[i]).powi(2)).sum::<f64>().sqrt();
            let change = f64::from((cube.rgb[3 * texel + 1] - cube.rgb[3 * other + 1]).abs());
            let kind = usize::from(other_face != face);
            steepest[kind] = steepest[kind].max(change / distance);
        }
    }
    steepest
}

#[test]
fn neighbours_across_an_edge_agree_as_those_within_a_face_do() {
    for lobe in LOBES {
        // A lamp off the edges: nothing else is as steep as its flanks.
        let map =
            sampled(256, |[x, y, z]| 1.0 + 5.0 * libm::exp(20.0 * (0.6 * x + 0.48 * y + 0.64 * z - 1.0)));
        let [within, across] = slopes(&bake(&analyse(&map, &REQUEST), lobe, 32).cube);
        assert!(across <= 1.02 * within, "{lobe:?}: {across} across edges, {within} within faces");
    }
}

#[test]
fn seam_check_rejects_two_faces_that_changed_places() {
    let map = sampled(256, |[x, y, z]| 1.0 + 5.0 * libm::exp(20.0 * (0.6 * x + 0.48 * y + 0.64 * z - 1.0)));
    let mut cube = bake(&analyse(&map, &REQUEST), Lobe::Ggx { alpha: 0.25 }, 32).cube;
    let (first, rest) = cube.rgb.split_at_mut(3 * 32 * 32);
    first.swap_with_slice(&mut rest[..3 * 32 * 32]);
    let [within, across] = slopes(&cube);
    assert!(across > 2.0 * within);
}

/// Three soft lights.
fn lights([x, y, z]: [f64; 3]) -> f64 {
    let light = |c: [f64; 3], k: f64| libm::exp(k * (x * c[0] + y * c[1] + z * c[2] - 1.0));
    0.2 + light([0.0, 1.0, 0.0], 6.0) + 2.0 * light([0.6, 0.0, 0.8], 12.0) + light([-0.48, -0.6, 0.64], 9.0)
}

/// A quarter turn about x: the zenith becomes a place on the horizon.
fn turned([x, y, z]: [f64; 3]) -> [f64; 3] {
    [x, -z, y]
}

#[test]
fn turning_the_poles_to_the_horizon_turns_the_map() {
    let [still, moved] = [sampled(512, lights), sampled(512, |d| lights(turned(d)))];
    for lobe in LOBES {
        let [still, moved] = [&still, &moved].map(|map| bake(&analyse(map, &REQUEST), lobe, 16).cube);
        let value = |direction: [f64; 3]| {
            let (face, [s, t]) = cube_face_st(direction);
            let place = |s: f64| (0.5 * (s + 1.0) * 16.0) as usize;
            f64::from(still.texel(face, place(s), place(t))[1])
        };
        // Patches follow the lights to 2e-4 only.
        check_within(&format!("{lobe:?}"), worst_difference(&moved, |d| value(turned(d))), 0.0, 5e-4);
        assert!(worst_difference(&moved, value) > 2e-2, "{lobe:?}: the check itself");
    }
}

/// The analysis with every texel in the transform.
fn without_bright(map: &Panorama, analysis: &Analysis, band_limit: usize) -> Analysis {
    let (width, height) = (map.width(), map.height());
    let dim = kiln_sphere::analyse(width, height, map.rgb(), band_limit, Cancel::NEVER).expect(WANTED);
    let square =
        |i: usize| map.texel(i % width, i / width).iter().map(|&v| f64::from(v).powi(2)).sum::<f64>();
    let patch = |i: usize| crate::patch::Patch::of_texel(width, height, i).solid_angle_sr();
    let dim_energy = (0..width * height).map(|i| square(i) * patch(i)).sum();
    Analysis { dim, dim_energy, bright: Vec::new(), ..analysis.clone() }
}

#[test]
fn bright_texels_convolved_directly_are_as_by_the_transform() {
    let map = sun(128, 64, 20 * 128 + 127);
    let analysis = analyse(&map, &REQUEST);
    assert!(!analysis.bright.is_empty(), "a sun must go through the other door");
    // The horizon's tail of a sun ends slowly.
    let transformed = without_bright(&map, &analysis, 600);
    for lobe in LOBES {
        let [direct, all] = [&analysis, &transformed].map(|analysis| bake(analysis, lobe, 6).cube);
        let peak = direct.rgb.iter().fold(0.0, |a: f32, &b| a.max(b));
        let difference = direct.rgb.iter().zip(&all.rgb).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        check_within(&format!("{lobe:?}"), f64::from(difference / peak), 0.0, 5e-5);
    }
}

#[test]
fn comparison_of_methods_rejects_an_analysis_that_forgot_its_bright_texels() {
    let map = sun(128, 64, 20 * 128 + 127);
    let analysis = analyse(&map, &REQUEST);
    let forgetful = Analysis { bright: Vec::new(), ..analysis.clone() };
    let [whole, less] =
        [&analysis, &forgetful].map(|analysis| mean_of_map(&bake(analysis, Lobe::Lambert, 6).cube));
    assert!(less < 0.9 * whole, "{less} of {whole}");
}

#[test]
fn clamping_moves_less_flux_than_the_error_asked_for() {
    for map in [random(64, 32, 5), sun(256, 128, 300), sampled(256, lights)] {
        for error in [1e-1, 1e-2, 1e-3, 1e-4] {
            let analysis = analyse(&map, &AnalysisRequest { error, ..REQUEST });
            for lobe in LOBES {
                let moved = bake(&analysis, lobe, 16).accuracy.clamped_flux;
                assert!(moved <= error, "{lobe:?} at error {error}: {moved}");
            }
        }
    }
}

#[test]
fn clamping_law_rejects_an_analysis_with_too_narrow_a_range() {
    let analysis = analyse(&random(64, 32, 5), &AnalysisRequest { error: 1e-1, ..REQUEST });
    let narrow = Analysis { range: analysis.mean().map(|mean| [0.0, 0.5 * mean]), ..analysis };
    let moved = bake(&narrow, Lobe::Lambert, 16).accuracy.clamped_flux;
    assert!(moved > 1e-1, "half of the light is cut, {moved} is stated");
}

/// Whether each step of (analysis, maps) work is more than the one before.
fn climbs(ladder: &[(usize, usize)]) -> bool {
    ladder.windows(2).all(|steps| steps[0].0 < steps[1].0 && steps[0].1 < steps[1].1)
}

#[test]
fn an_error_ten_times_looser_takes_fewer_degrees() {
    let map = random(256, 128, 8);
    let work = |error: f64| {
        let analysis = analyse(&map, &AnalysisRequest { error, ..REQUEST });
        let of_lobe = |&lobe: &Lobe| (bake(&analysis, lobe, 4).accuracy.band_limit + 1).pow(2);
        (analysis.band_limit(), LOBES.iter().map(of_lobe).sum::<usize>())
    };
    let ladder = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5].map(work);
    assert!(climbs(&ladder), "{ladder:?}");
    // A baker that does not listen does the same work each time.
    assert!(!climbs(&[ladder[0]; 2]), "{ladder:?}");
}
