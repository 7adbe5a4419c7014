//! The third of each triple: `invert_x` gives the point of the unit square that `sampling::sample_x` took a direction from.

use std::f64::consts::TAU;

/// Undoes [`sample_cosine`](crate::sampling::sample_cosine). `turn` is 0 along the normal, where any would do.
pub fn invert_cosine([x, y, _]: [f64; 3]) -> [f64; 2] {
    [turn(x, y), x * x + y * y]
}

/// Undoes [`sample_ggx`](crate::sampling::sample_ggx): tan²θ = α² u / (1 − u), solved for u.
pub fn invert_ggx([x, y, z]: [f64; 3], alpha: f64) -> [f64; 2] {
    let sin2 = x * x + y * y;
    [turn(x, y), sin2 / (alpha * alpha * z * z + sin2)]
}

/// Undoes [`sample_ggx_visible`](crate::sampling::sample_ggx_visible): the half vector is unstretched to the hemisphere, and the
/// cap's direction is the view mirrored at it.
pub fn invert_ggx_visible(view: [f64; 3], half: [f64; 3], alpha: f64) -> [f64; 2] {
    let view = unit([alpha * view[0], alpha * view[1], view[2]]);
    let normal = unit([half[0] / alpha, half[1] / alpha, half[2]]);
    let cosine: f64 = view.iter().zip(normal).map(|(v, n)| v * n).sum();
    let cap: [f64; 3] = std::array::from_fn(|i| 2.0 * cosine * normal[i] - view[i]);
    [turn(cap[0], cap[1]), 1.0 - (cap[2] + view[2]) / (1.0 + view[2])]
}

/// Undoes [`sample_charlie`](crate::sampling::sample_charlie): sin θ = u^(α / (2α + 1)), solved for u.
pub fn invert_charlie([x, y, _]: [f64; 3], alpha: f64) -> [f64; 2] {
    [turn(x, y), libm::exp((2.0 * alpha + 1.0) / (2.0 * alpha) * libm::log(x * x + y * y))]
}

/// The azimuth as a share of a turn, in [0, 1).
fn turn(x: f64, y: f64) -> f64 {
    let turn = libm::atan2(y, x) / TAU;
    if turn < 0.0 { turn + 1.0 } else { turn }
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| x / length)
}
