//! Error over time as SVG, both axes logarithmic.

use std::fmt::Write as _;

use super::escape;
use crate::curve::Curve;
use crate::estimator::Estimator;
use crate::report::number;

const WIDTH: f64 = 1000.0;
const HEIGHT: f64 = 460.0;
/// Left, top, right, bottom; the right has room for names.
const FRAME: [f64; 4] = [70.0, 20.0, 190.0, 50.0];

/// A logarithmic axis from one power of ten to another.
struct Axis {
    low: i32,
    high: i32,
    from: f64,
    to: f64,
}

impl Axis {
    /// Whole decades around all values that are above 0.
    fn around(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Axis {
        let values = values.filter(|value| *value > 0.0 && value.is_finite()).map(f64::log10);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        if low > high {
            return Axis { low: -1, high: 0, from, to };
        }
        let low = low.floor() as i32;
        Axis { low, high: (high.ceil() as i32).max(low + 1), from, to }
    }

    fn at(&self, value: f64) -> f64 {
        let power = value.max(1e-30).log10();
        let share = (power - f64::from(self.low)) / f64::from(self.high - self.low);
        self.from + share.clamp(0.0, 1.0) * (self.to - self.from)
    }
}

/// Curves of a lobe.
pub(super) fn time_error(curves: &[Curve]) -> String {
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let [left, top, right, bottom] = FRAME;
    let x = Axis::around(points().map(|point| point.seconds), left, WIDTH - right);
    let y = Axis::around(points().map(|point| point.error.rms), HEIGHT - bottom, top);
    let mut out = format!(
        "<svg class=\"plot\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"RMS error over seconds of one core\">\n"
    );
    for power in x.low..=x.high {
        let at = x.at(10_f64.powi(power));
        let _ = writeln!(
            out,
            "<line class=\"grid\" x1=\"{at:.1}\" y1=\"{top}\" x2=\"{at:.1}\" y2=\"{:.1}\"/>\
             <text class=\"tick\" x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
            HEIGHT - bottom,
            HEIGHT - bottom + 18.0,
            seconds(power)
        );
    }
    for power in y.low..=y.high {
        let at = y.at(10_f64.powi(power));
        let _ = writeln!(
            out,
            "<line class=\"grid\" x1=\"{left}\" y1=\"{at:.1}\" x2=\"{:.1}\" y2=\"{at:.1}\"/>\
             <text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">1e{power}</text>",
            WIDTH - right,
            left - 8.0,
            at + 4.0
        );
    }
    let _ = writeln!(
        out,
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">time of one core for the whole chain</text>\
         <text transform=\"translate(16 {:.1}) rotate(-90)\" text-anchor=\"middle\">RMS error</text>",
        0.5 * (left + WIDTH - right),
        HEIGHT - 10.0,
        0.5 * (top + HEIGHT - bottom)
    );
    let ends = curves.iter().map(|curve| curve.points.last().map_or(HEIGHT, |point| y.at(point.error.rms)));
    let labels = apart(&ends.collect::<Vec<_>>());
    for (curve, label) in curves.iter().zip(labels) {
        draw(&mut out, curve, &x, &y, label);
    }
    out.push_str("</svg>\n");
    out
}

fn draw(out: &mut String, curve: &Curve, x: &Axis, y: &Axis, label: f64) {
    let index = Estimator::ALL.iter().position(|known| *known == curve.estimator).unwrap_or(0);
    let color = format!("var(--s{index})");
    let places: Vec<[f64; 2]> =
        curve.points.iter().map(|point| [x.at(point.seconds), y.at(point.error.rms)]).collect();
    let line: Vec<String> = places.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
    let class = if curve.estimator == Estimator::Convolution { "own" } else { "other" };
    let _ = write!(
        out,
        "<g class=\"{class}\"><polyline fill=\"none\" points=\"{}\" style=\"stroke:{color}\"/>",
        line.join(" ")
    );
    for (point, [x, y]) in curve.points.iter().zip(&places) {
        let _ = write!(
            out,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" style=\"fill:{color}\"><title>{} at {}: {:.1e} RMS in {:.3} s</title></circle>",
            escape(curve.estimator.name()),
            number(point.knob),
            point.error.rms,
            point.seconds
        );
    }
    let edge = WIDTH - FRAME[2];
    if let Some([x, y]) = places.last() {
        let _ = write!(
            out,
            "<line x1=\"{x:.1}\" y1=\"{y:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" style=\"stroke:{color};stroke-width:1;stroke-dasharray:2 4\"/>",
            edge + 6.0,
            label - 4.0
        );
    }
    let _ = writeln!(
        out,
        "<text class=\"label\" x=\"{:.1}\" y=\"{label:.1}\" style=\"fill:{color}\">{}</text></g>",
        edge + 10.0,
        escape(curve.estimator.name())
    );
}

/// Heights of labels near those asked for, none on another.
fn apart(wanted: &[f64]) -> Vec<f64> {
    const LINE: f64 = 17.0;
    let mut order: Vec<usize> = (0..wanted.len()).collect();
    order.sort_by(|a, b| wanted[*a].total_cmp(&wanted[*b]));
    let mut found = vec![0.0; wanted.len()];
    let mut next = FRAME[1] + 10.0;
    for index in order.iter().copied() {
        found[index] = (wanted[index] + 4.0).max(next);
        next = found[index] + LINE;
    }
    // What runs out at the bottom moves up again.
    let mut limit = HEIGHT - 20.0;
    for index in order.into_iter().rev() {
        found[index] = found[index].min(limit);
        limit = found[index] - LINE;
    }
    found
}

/// A power of ten of seconds as people say it.
fn seconds(power: i32) -> String {
    match power {
        ..=-4 => format!("{} µs", 10_u32.pow((power + 6).max(0) as u32)),
        -3..=-1 => format!("{} ms", 10_u32.pow((power + 3) as u32)),
        _ => format!("{} s", 10_u32.pow(power.min(9) as u32)),
    }
}

#[cfg(test)]
mod tests {
    use super::{Axis, apart, seconds};

    #[test]
    fn axes_hold_whole_decades_and_labels_stand_apart() {
        let axis = Axis::around([0.02, 3.0, f64::NAN, 0.0].into_iter(), 0.0, 300.0);
        assert_eq!((axis.low, axis.high, axis.at(0.1)), (-2, 1, 100.0));
        let places = apart(&[100.0, 101.0, 99.0, 440.0, 441.0]);
        let mut sorted = places.clone();
        sorted.sort_by(f64::total_cmp);
        assert!(sorted.windows(2).all(|pair| pair[1] - pair[0] >= 16.9), "{places:?}");
        assert_eq!([seconds(-3), seconds(0), seconds(-5)], ["1 ms", "1 s", "10 µs"]);
    }
}
