//! The convolution on the sphere where it is hardest: high degrees, suns, horizons, changes of method.

use kiln_bake::{AnalysisRequest, BruteForce, Lobe, irradiance_sh};
use kiln_image::Cancel;
use kiln_sphere::{evaluate, kernel_charlie, kernel_ggx, kernel_lambert, real_harmonics};

use crate::maps::{Random, baked, baked_error, check_radiance, flattened, panorama, sky, with_sun};
use crate::record::{hold, relative, worst};

#[test]
fn constant_map_stays_constant_by_every_method() {
    let one = panorama(48, |_| [1.0; 3]);
    let error = |lobe: Lobe, size: usize| {
        let map = baked(&one, lobe, size, 1e-4);
        // Maps end at their environment's range: what that took away is the error before.
        worst(flattened(&map.cube).map(|value| relative(value, 1.0, 1.0)).chain([map.accuracy.clamped_flux]))
    };
    let mut errors = [0.003, 0.02, 0.3, 1.0].map(|alpha| error(Lobe::Ggx { alpha }, 8)).to_vec();
    errors.extend([
        error(Lobe::Lambert, 8),
        error(Lobe::Charlie { alpha: 0.05 }, 8),
        error(Lobe::Charlie { alpha: 1.0 }, 8),
    ]);
    let skybox = kiln_bake::skybox(&one, 16, Cancel::NEVER).unwrap();
    errors.extend(skybox.iter().map(|level| worst(flattened(level).map(|value| relative(value, 1.0, 1.0)))));
    hold("constant_map_stays_constant_by_every_method", "f64", worst(errors));
}

#[test]
fn legendre_functions_that_underflow_near_the_poles_come_back() {
    // P̄_mm at θ = half a row is below 1e-300 from m of some 100 on; Σ |Y_lm|² = (2l + 1)/4π holds for all of them together.
    let mut random = Random(12);
    let mut errors = Vec::new();
    for tilt in [0.0, 1e-12, 1e-3, 0.01, random.between(1e-6, 0.1)] {
        let direction = [tilt, (1.0 - tilt * tilt).sqrt(), 0.0];
        let basis = real_harmonics(direction, 60);
        for l in [0, 5, 40, 60] {
            let sum: f64 = basis[l * l..(l + 1) * (l + 1)].iter().map(|y| y * y).sum();
            errors.push(relative(sum, (2 * l + 1) as f64 / (4.0 * std::f64::consts::PI), 0.0));
        }
    }
    // The product's own recursion, through an analysis of a lamp at the pole and its evaluation there.
    let lamp = panorama(128, |[_, y, _]| if y > 0.9995 { [100.0; 3] } else { [1.0; 3] });
    let harmonics = kiln_sphere::analyse(256, 128, lamp.rgb(), 500, Cancel::NEVER).unwrap();
    assert!(harmonics.coefficients().iter().flatten().all(|c| c.is_finite()));
    let kernel = kernel_ggx(0.02, 500, Cancel::NEVER).unwrap();
    let truth = BruteForce::new(&lamp, Cancel::NEVER).unwrap();
    for direction in [[0.0, 1.0, 0.0], [0.02, 0.9998, 0.0], [0.0, -1.0, 0.0]] {
        let direction = crate::support::unit(direction);
        let expected = truth.radiance(Lobe::Ggx { alpha: 0.02 }, direction, Cancel::NEVER).unwrap()[0];
        errors.push(relative(evaluate(&harmonics, &kernel.kappa, direction)[0], expected, 1.0));
    }
    hold("legendre_functions_that_underflow_near_the_poles_come_back", "f64", worst(errors));
}

#[test]
fn content_beyond_nyquist_is_convolved_as_patches() {
    // Every other texel is black: patches have all degrees, also those beyond half the width.
    let mut chequers = panorama(24, |_| [1.0; 3]);
    for (index, texel) in chequers.rgb_mut().chunks_exact_mut(3).enumerate() {
        texel.fill(if (index % 48 + index / 48).is_multiple_of(2) { 2.0 } else { 0.0 });
    }
    let errors = [0.01, 0.05, 0.3].map(|alpha| baked_error(&chequers, Lobe::Ggx { alpha }, 16));
    hold("content_beyond_nyquist_is_convolved_as_patches", "f64", worst(errors));
}

#[test]
fn nothing_rings_beside_a_sun() {
    let sun = with_sun(64, 1e6, |_| [1.0; 3]);
    for alpha in [0.005, 0.03, 0.2, 1.0] {
        let map = baked(&sun, Lobe::Ggx { alpha }, 32, 1e-3);
        let least = flattened(&map.cube).fold(f64::INFINITY, f64::min);
        // Means of light of at least 1 are at least 1, before anything is clamped.
        assert!(least >= 1.0 - 1e-3, "α {alpha}: down to {least}");
        assert!(map.accuracy.clamped_flux <= 1e-6, "α {alpha}: {:e} was clamped", map.accuracy.clamped_flux);
    }
}

#[test]
fn horizon_of_a_sun_of_1e7_has_its_kink_and_no_tail() {
    let sun = with_sun(32, 1e7, |_| [0.0; 3]);
    let truth = BruteForce::new(&sun, Cancel::NEVER).unwrap();
    let towards = truth.brightest();
    for lobe in [Lobe::Lambert, Lobe::Ggx { alpha: 0.5 }, Lobe::Ggx { alpha: 1.0 }] {
        let map = baked(&sun, lobe, 32, 1e-3);
        check_radiance(&map.cube);
        let peak = flattened(&map.cube).fold(0.0, f64::max);
        for (index, texel) in map.cube.rgb.chunks_exact(3).enumerate() {
            let (face, rest) = (index / 1024, index % 1024);
            let st = |index: usize| (2 * index + 1) as f64 / 32.0 - 1.0;
            let direction = kiln_sphere::cube_direction(face, st(rest % 32), st(rest / 32));
            let cosine: f64 = direction.iter().zip(towards).map(|(a, b)| a * b).sum();
            // Beyond the sun's own texel and a margin behind the horizon nothing arrives.
            if cosine < -0.2 {
                assert!(f64::from(texel[0]) <= 1e-6 * peak, "{lobe:?}: {} behind the horizon", texel[0]);
            }
        }
    }
    let errors = [Lobe::Lambert, Lobe::Ggx { alpha: 1.0 }].map(|lobe| baked_error(&sun, lobe, 32));
    hold("horizon_of_a_sun_of_1e7_has_its_kink_and_no_tail", "f64", worst(errors));
}

#[test]
fn charlies_spectrum_is_whole_where_its_kernel_underflows() {
    // sin^(1/α) is no f64 for α = 1e-3 over most of the sphere.
    assert_eq!(0.1f64.powf(1e3), 0.0);
    let mut errors = Vec::new();
    for alpha in [1e-3, 0.01, 0.1, 1.0] {
        let kernel = kernel_charlie(alpha, 64, Cancel::NEVER).unwrap();
        assert!(
            kernel.kappa.iter().all(|k| k.is_finite()) && kernel.ln_norm.is_finite() && kernel.energy > 0.0,
            "{alpha}"
        );
        errors.push(relative(kernel.kappa[0], 1.0, 1.0));
    }
    errors.push(baked_error(&panorama(32, sky), Lobe::Charlie { alpha: 0.01 }, 8));
    hold("charlies_spectrum_is_whole_where_its_kernel_underflows", "f64", worst(errors));
}

#[test]
fn methods_agree_where_one_takes_over_from_the_other() {
    // Two neighbouring roughnesses differ by little, whatever method each is made by.
    let lamp = with_sun(64, 50.0, sky);
    let mut steps = Vec::new();
    for alpha in [0.003, 0.004, 0.006, 0.01, 0.02] {
        let [a, b] = [alpha, 1.001 * alpha].map(|alpha| baked(&lamp, Lobe::Ggx { alpha }, 16, 1e-4).cube);
        let brightest = flattened(&a).fold(0.0, f64::max);
        steps.push(worst(flattened(&a).zip(flattened(&b)).map(|(a, b)| (a - b).abs() / brightest)));
    }
    hold("methods_agree_where_one_takes_over_from_the_other", "f64", worst(steps));
    let errors = [0.003, 0.004, 0.006].map(|alpha| baked_error(&lamp, Lobe::Ggx { alpha }, 16));
    // Of probes at the worst places; over the sphere it is what was asked for.
    assert!(worst(errors) <= 3e-3, "{errors:?}");
}

#[test]
fn rotations_by_tiny_angles_and_by_half_a_turn_keep_the_light() {
    // A half turn about the vertical exchanges columns exactly; the maps are each other's mirror images.
    let height = 32;
    let original = with_sun(height, 1e4, sky);
    let mut turned = original.clone();
    turned.rgb_mut().chunks_exact_mut(2 * height * 3).for_each(|row| row.rotate_left(height * 3));
    let direction = [0.3, 0.5, -0.8];
    let of = |panorama: &kiln_image::Panorama, direction: [f64; 3]| {
        let request = AnalysisRequest { alpha_min: 0.3, sheen_alpha_min: None, error: 1e-4 };
        let analysis = kiln_bake::analyse(panorama, &request, Cancel::NEVER).unwrap();
        irradiance_sh(&analysis).evaluate(crate::support::unit(direction))[0]
    };
    let half =
        relative(of(&turned, [-direction[0], direction[1], -direction[2]]), of(&original, direction), 0.0);
    // A tiny angle changes a smooth function in proportion, down to the rounding of the angle.
    let mut errors = vec![half];
    for angle in [1e-15, 1e-9, 1e-6] {
        let [x, y, z] = direction;
        let (s, c) = f64::sin_cos(angle);
        let moved = of(&original, [c * x + s * z, y, c * z - s * x]);
        let change = relative(moved, of(&original, direction), 0.0);
        assert!(change <= 10.0 * angle + 1e-14, "{angle}: {change}");
        errors.push(if angle < 1e-12 { change } else { 0.0 });
    }
    hold("rotations_by_tiny_angles_and_by_half_a_turn_keep_the_light", "f64", worst(errors));
}

#[test]
fn long_sums_keep_their_digits() {
    // Two million texels of 0.1, which no binary fraction is: the mean is theirs.
    let height = 1024;
    let even = crate::maps::of_texels(height, vec![0.1; 6 * height * height]);
    let facts = kiln_check::mean_radiance(&even, Cancel::NEVER).unwrap();
    let truth = BruteForce::new(&even, Cancel::NEVER).unwrap();
    let expected = f64::from(0.1f32);
    let errors = [relative(facts.mean[0], expected, 0.0), relative(truth.mean()[0], expected, 0.0)];
    let naive: f32 = even.rgb().iter().step_by(3).sum::<f32>() / (2 * height * height) as f32;
    assert!(relative(f64::from(naive), expected, 0.0) > 1e-4, "f32 loses them: {naive}");
    hold("long_sums_keep_their_digits", "f64", worst(errors));
    let kappa = kernel_lambert(8).kappa;
    assert!(
        (kappa[0] - 1.0).abs() <= 1e-15 && (kappa[1] - 2.0 / 3.0).abs() <= 1e-15 && kappa[3].abs() <= 1e-15
    );
}
