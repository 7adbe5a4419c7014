//! Curves against values computed by hand.

use crate::{Curve, Interpolation};

fn curve(interpolation: Interpolation, width: usize, times_s: &[f32], values: &[f32]) -> Curve {
    Curve { interpolation, is_rotation: false, times_s: times_s.to_vec(), width, values: values.to_vec() }
}

#[track_caller]
fn check_sample(curve: &Curve, time_s: f64, expected: &[f32]) {
    let mut value = vec![f32::NAN; curve.width];
    curve.sample(time_s, &mut value);
    super::check_within(&format!("at {time_s} s"), &value, expected, 1e-6);
}

#[test]
fn step_holds_the_last_key() {
    let steps = curve(Interpolation::Step, 1, &[1.0, 2.0, 4.0], &[10.0, 20.0, 40.0]);
    for (time_s, expected) in
        [(0.0, 10.0), (1.0, 10.0), (1.999, 10.0), (2.0, 20.0), (3.999, 20.0), (4.0, 40.0), (9.0, 40.0)]
    {
        check_sample(&steps, time_s, &[expected]);
    }
}

#[test]
fn linear_is_straight_between_keys_and_constant_outside() {
    let line = curve(Interpolation::Linear, 2, &[1.0, 3.0, 4.0], &[0.0, 8.0, 4.0, 0.0, 5.0, 5.0]);
    for (time_s, expected) in [(-1.0, [0.0, 8.0]), (1.5, [1.0, 6.0]), (3.0, [4.0, 0.0]), (3.75, [4.75, 3.75])]
    {
        check_sample(&line, time_s, &expected);
    }
    check_sample(&line, f64::INFINITY, &[5.0, 5.0]);
    check_sample(&line, f64::NAN, &[0.0, 8.0]);
    check_sample(&curve(Interpolation::Linear, 1, &[2.0], &[7.0]), 5.0, &[7.0]);
}

#[test]
#[should_panic(expected = "error")]
fn sample_check_rejects_the_value_of_another_time() {
    check_sample(&curve(Interpolation::Linear, 1, &[0.0, 1.0], &[0.0, 1.0]), 0.5, &[0.501]);
}

#[test]
fn rotations_follow_the_shorter_arc_at_constant_speed() {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turn = |to: [f32; 4]| Curve {
        is_rotation: true,
        ..curve(Interpolation::Linear, 4, &[0.0, 1.0], &[[0.0, 0.0, 0.0, 1.0], to].concat())
    };
    // A quarter turn about y: a third of it is 30°, whose half angle is 15°.
    let expected = [0.0, 0.258_819_05, 0.0, 0.965_925_8];
    check_sample(&turn([0.0, half, 0.0, half]), 1.0 / 3.0, &expected);
    check_sample(&turn([0.0, -half, 0.0, -half]), 1.0 / 3.0, &expected);
    check_sample(&turn([0.0, 3.0 * half, 0.0, 3.0 * half]), 1.0, &[0.0, half, 0.0, half]);
    check_sample(&turn([0.0, 0.0, 0.0, 1.0]), 0.5, &[0.0, 0.0, 0.0, 1.0]);
    check_sample(&turn([0.0; 4]), 1.0, &[0.0, 0.0, 0.0, 1.0]);
}

#[test]
fn splines_scale_tangents_by_the_time_between_keys() {
    // In tangent, value, out tangent for each key; two seconds apart.
    let spline = curve(Interpolation::CubicSpline, 1, &[1.0, 3.0], &[9.0, 1.0, 2.0, -1.0, 5.0, 9.0]);
    // At t = 1/2: (1 + 5) / 2 + 2 s · (2 − (−1)) / 8.
    check_sample(&spline, 2.0, &[3.75]);
    // At t = 1/4: 0.84375 · 1 + 2 · 0.140625 · 2 + 0.15625 · 5 + 2 · (−0.046875) · (−1).
    check_sample(&spline, 1.5, &[2.281_25]);
    check_sample(&spline, 1.0, &[1.0]);
    check_sample(&spline, 8.0, &[5.0]);
}

#[test]
fn splines_of_rotations_have_unit_length() {
    let values =
        [[0.0; 4], [0.0, 0.0, 0.0, 1.0], [0.0; 4], [0.0; 4], [1.0, 0.0, 0.0, 0.0], [0.0; 4]].concat();
    let spline = Curve { is_rotation: true, ..curve(Interpolation::CubicSpline, 4, &[0.0, 1.0], &values) };
    let half = std::f32::consts::FRAC_1_SQRT_2;
    check_sample(&spline, 0.5, &[half, 0.0, 0.0, half]);
}

#[track_caller]
fn check_range(curve: &Curve, expected: &[[f32; 2]]) {
    super::check_within("range", curve.range().as_flattened(), expected.as_flattened(), 1e-6);
}

#[test]
fn range_of_a_spline_reaches_where_it_turns() {
    // All keys 0, out tangent 1, in tangent 0: t³ − 2t² + t, largest at t = 1/3: 4/27.
    let over = curve(Interpolation::CubicSpline, 1, &[0.0, 1.0], &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    check_range(&over, &[[0.0, 4.0 / 27.0]]);
    // Tangents 1 and −1 make a parabola t − t²: no cubic term, largest at 1/2.
    let parabola = curve(Interpolation::CubicSpline, 1, &[0.0, 1.0], &[0.0, 0.0, 1.0, -1.0, 0.0, 0.0]);
    check_range(&parabola, &[[0.0, 0.25]]);
    // Tangents 1 and 1: 2t³ − 3t² + t turns on both sides, ±√3/18.
    let wave = curve(Interpolation::CubicSpline, 1, &[0.0, 1.0], &[0.0, 0.0, 1.0, 1.0, 0.0, 0.0]);
    check_range(&wave, &[[-0.096_225_045, 0.096_225_045]]);
    // Flat tangents stay between the keys; a constant stays where it is.
    check_range(
        &curve(Interpolation::CubicSpline, 1, &[0.0, 5.0], &[0.0, 1.0, 0.0, 0.0, 3.0, 0.0]),
        &[[1.0, 3.0]],
    );
    check_range(
        &curve(Interpolation::CubicSpline, 1, &[0.0, 5.0], &[0.0, 1.0, 0.0, 0.0, 1.0, 0.0]),
        &[[1.0, 1.0]],
    );
}

#[test]
fn range_of_lines_and_steps_is_that_of_their_keys() {
    let values = [3.0, 1.0, -2.0, 4.0];
    check_range(&curve(Interpolation::Linear, 2, &[0.0, 1.0], &values), &[[-2.0, 3.0], [1.0, 4.0]]);
    check_range(&curve(Interpolation::Step, 2, &[0.0, 1.0], &values), &[[-2.0, 3.0], [1.0, 4.0]]);
}

/// The exact range against a million samples of splines that nobody chose.
#[test]
fn range_is_what_dense_samples_reach() {
    let mut state = 1u32;
    let mut number = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 8_388_608.0 - 1.0
    };
    for _ in 0..100 {
        let values: Vec<f32> = (0..9).map(|_| 4.0 * number()).collect();
        let spline = curve(Interpolation::CubicSpline, 1, &[0.0, 0.5, 2.0], &values);
        let mut reached = [f32::INFINITY, f32::NEG_INFINITY];
        for at in 0..=10_000 {
            let mut value = [0.0];
            spline.sample(2.0 * f64::from(at) / 10_000.0, &mut value);
            reached = [reached[0].min(value[0]), reached[1].max(value[0])];
        }
        super::check_within("range", &spline.range()[0], &reached, 1e-4);
        assert!(spline.range()[0][0] <= reached[0] && reached[1] <= spline.range()[0][1]);
    }
}
