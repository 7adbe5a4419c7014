//! Transforms against slow, obvious sums.

use crate::testing::{check_within, random_panorama, uniform};
use crate::{
    Cancel, Harmonics, Interpolation, cube_direction, direction, evaluate, panorama_direction, panorama_uv,
    synthesise_cube,
};
use std::f64::consts::PI;

fn analyse(width: usize, height: usize, rgb: &[f32], band_limit: usize) -> Harmonics {
    crate::analyse(width, height, rgb, band_limit, Cancel::NEVER).expect("nobody cancels")
}

fn unit_direction(random: &mut impl FnMut() -> f64) -> [f64; 3] {
    let (y, lambda) = (2.0 * random() - 1.0, 2.0 * PI * random());
    let r = (1.0 - y * y).sqrt();
    [r * lambda.sin(), y, r * lambda.cos()]
}

#[test]
fn synthesis_matches_the_direct_sum() {
    for (band_limit, face_size) in [(0, 1), (1, 3), (37, 16), (150, 32)] {
        let harmonics = analyse(64, 32, &random_panorama(64, 32, 7), band_limit);
        let kappa = vec![1.0; band_limit + 1];
        for (interpolation, tolerance) in [(Interpolation::Fine, 4e-7), (Interpolation::Coarse, 2e-4)] {
            let cube = synthesise_cube(&harmonics, &kappa, face_size, interpolation, Cancel::NEVER)
                .expect("nobody cancels");
            let mut worst: f64 = 0.0;
            for index in (0..6 * face_size * face_size).step_by(1 + face_size / 3) {
                let (face, rest) = (index / (face_size * face_size), index % (face_size * face_size));
                let centre = |i| direction::cube_texel_centre(face_size, i);
                let d = cube_direction(face, centre(rest % face_size), centre(rest / face_size));
                let exact = evaluate(&harmonics, &kappa, d);
                for channel in 0..3 {
                    worst = worst.max((cube[index * 3 + channel] - exact[channel]).abs());
                }
            }
            check_within("interpolated", worst, 0.0, tolerance);
        }
    }
}

#[test]
fn directions_and_positions_undo_each_other() {
    let mut random = uniform(3);
    for _ in 0..1000 {
        let d = unit_direction(&mut random);
        let [u, v] = panorama_uv(d);
        let (face, [s, t]) = crate::cube_face_st(d);
        let (from_panorama, from_cube) = (panorama_direction(u, v), cube_direction(face, s, t));
        for ((p, c), d) in from_panorama.into_iter().zip(from_cube).zip(d) {
            check_within("panorama", p, d, 1e-14);
            check_within("cube", c, d, 1e-14);
        }
    }
}

/// ∫ f P̄_lm e^{−imλ} dω patch by patch with a 48-point Gauss rule, for one channel.
fn slow_coefficient(width: usize, height: usize, rgb: &[f32], l: usize, m: usize) -> [f64; 2] {
    let rule = crate::quadrature::gauss_legendre(48);
    let mut sum = [0.0; 2];
    for row in 0..height {
        let mut mass = 0.0;
        for &(y, weight) in &rule {
            let theta = PI * (row as f64 + 0.5 + 0.5 * y) / height as f64;
            let block = crate::legendre::RingBlock::new(&[theta]);
            let mut legendre = 0.0;
            crate::legendre::Order::new(m, l).for_each_degree(&block, |k, p| {
                if k == l - m {
                    legendre = p[0];
                }
            });
            mass += weight * 0.5 * PI / height as f64 * theta.sin() * legendre;
        }
        for column in 0..width {
            let value = f64::from(rgb[(row * width + column) * 3]) * mass;
            for &(x, weight) in &rule {
                let lambda = 2.0 * PI * (column as f64 + 0.5 + 0.5 * x) / width as f64;
                let part = value * weight * PI / width as f64;
                sum[0] += part * (m as f64 * lambda).cos();
                sum[1] -= part * (m as f64 * lambda).sin();
            }
        }
    }
    sum
}

#[test]
fn analysis_of_patches_matches_quadrature_for_odd_sizes_and_beyond_half_the_width() {
    for (width, height) in [(10, 5), (2, 1), (8, 4), (7, 3)] {
        let rgb = random_panorama(width, height, 21);
        let harmonics = analyse(width, height, &rgb, 12);
        for (l, m) in [(0, 0), (1, 0), (1, 1), (4, 3), (7, 7), (12, 0), (12, 5), (12, 10)] {
            let [re, im] = slow_coefficient(width, height, &rgb, l, m);
            check_within("re", harmonics.coefficient(l, m)[0], re, 1e-11);
            check_within("im", harmonics.coefficient(l, m)[1], im, 1e-11);
        }
    }
}

#[test]
fn quadrature_check_rejects_the_neighbouring_order() {
    let rgb = random_panorama(10, 5, 21);
    let [re, _] = slow_coefficient(10, 5, &rgb, 4, 2);
    assert!((analyse(10, 5, &rgb, 4).coefficient(4, 3)[0] - re).abs() > 1e-6);
}

#[test]
fn mean_is_kept_to_1e_12() {
    let (width, height) = (64, 32);
    let rgb = random_panorama(width, height, 4);
    let row = |r: usize| (PI * r as f64 / height as f64).cos() - (PI * (r + 1) as f64 / height as f64).cos();
    let exact: f64 =
        (0..width * height).map(|i| f64::from(rgb[3 * i]) * row(i / width)).sum::<f64>() / (2 * width) as f64;
    check_within("mean", analyse(width, height, &rgb, 100).mean()[0] / exact, 1.0, 1e-12);
}

#[test]
fn world_basis_is_orthonormal_and_agrees_with_the_transform() {
    let harmonics = analyse(16, 8, &random_panorama(16, 8, 9), 8);
    let coefficients = crate::world_coefficients(&harmonics, 8);
    let mut random = uniform(8);
    for _ in 0..20 {
        let d = unit_direction(&mut random);
        let basis = crate::real_harmonics(d, 8);
        let sum: f64 = coefficients.iter().zip(&basis).map(|(c, y)| c[1] * y).sum();
        check_within("function", sum, evaluate(&harmonics, &[1.0; 9], d)[1], 1e-11);
        check_within("Y_1-1", basis[1], (3.0 / (4.0 * PI)).sqrt() * d[1], 1e-15);
        check_within("Y_11", basis[3], (3.0 / (4.0 * PI)).sqrt() * d[0], 1e-15);
    }
}

#[test]
fn cube_texels_cover_the_sphere() {
    for face_size in [1, 5, 64] {
        let sum: f64 = (0..face_size * face_size)
            .map(|i| crate::cube_texel_solid_angle_sr(face_size, i % face_size, i / face_size))
            .sum();
        check_within("solid angle", 6.0 * sum, 4.0 * PI, 1e-11);
    }
}

#[test]
fn solid_angles_by_table_are_those_by_formula() {
    for face_size in [1, 2, 5, 64] {
        let table = crate::CubeSolidAngles::new(face_size);
        for (x, y) in (0..face_size).flat_map(|x| (0..face_size).map(move |y| (x, y))) {
            let exact = crate::cube_texel_solid_angle_sr(face_size, x, y);
            check_within("solid angle", table.at(x, y) / exact, 1.0, 1e-11);
        }
    }
}
