//! Writes the newer run-length form.

use super::scanline::{NEW_RLE_WIDTHS, Rgbe};
use crate::Image;

/// Equal bytes from here on become a run; three cost two bytes instead of three plus a split literal.
const RUN_MIN: usize = 4;

/// Encodes as RGBE, `-Y +X`, run-length coded where the width allows (8 to 32767), flat otherwise.
///
/// Mantissas are rounded to nearest, so a texel is off by at most 2⁻⁹ of its brightest channel. The
/// format holds no negative values and no NaN: both become 0; above 2¹²⁷ · (255/128) values saturate.
pub fn encode(image: &Image) -> Vec<u8> {
    let header = format!(
        "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nSOFTWARE=Kiln\n\n-Y {} +X {}\n",
        image.height, image.width
    );
    let mut out = header.into_bytes();
    for y in 0..image.height {
        let line: Vec<Rgbe> =
            image.row(y).chunks_exact(3).map(|rgb| rgbe([rgb[0], rgb[1], rgb[2]])).collect();
        if NEW_RLE_WIDTHS.contains(&line.len()) {
            out.extend_from_slice(&[2, 2, (line.len() >> 8) as u8, (line.len() & 255) as u8]);
            (0..4).for_each(|component| write_component(&mut out, component, &line));
        } else {
            out.extend(line.iter().flatten());
        }
    }
    out
}

/// The nearest RGBE; exponent 0 stands for black.
fn rgbe(rgb: [f32; 3]) -> Rgbe {
    // `max` turns NaN into 0; the minimum keeps ∞ inside the format.
    let rgb = rgb.map(|value| f64::from(value.max(0.0)).min(f64::from(f32::MAX)));
    let max = rgb.into_iter().fold(0.0, f64::max);
    // max = fraction · 2^exponent with fraction in [0.5, 1), so max / 2^(exponent − 8) is in [128, 256).
    let (_, exponent) = libm::frexp(max);
    let mantissa = |value: f64, exponent: i32| libm::round(libm::ldexp(value, 8 - exponent));
    let exponent = if mantissa(max, exponent) > 255.0 { exponent + 1 } else { exponent };
    let biased = exponent + 128;
    if max == 0.0 || biased < 1 {
        return [0; 4];
    }
    let exponent = exponent.min(127);
    let [r, g, b] = rgb.map(|value| mantissa(value, exponent).min(255.0) as u8);
    [r, g, b, (exponent + 128) as u8]
}

fn write_component(out: &mut Vec<u8>, component: usize, line: &[Rgbe]) {
    let run_length = |start: usize| {
        let value = line[start][component];
        line[start..].iter().take(127).take_while(|texel| texel[component] == value).count()
    };
    let mut position = 0;
    while position < line.len() {
        let literal_start = position;
        let mut run = run_length(position);
        while run < RUN_MIN && position - literal_start + run <= 128 && position + run < line.len() {
            position += run;
            run = run_length(position);
        }
        let is_run = run >= RUN_MIN;
        let literal_end = if is_run { position } else { (position + run).min(literal_start + 128) };
        for chunk in line[literal_start..literal_end].chunks(128) {
            out.push(chunk.len() as u8);
            out.extend(chunk.iter().map(|texel| texel[component]));
        }
        position = literal_end;
        if is_run {
            out.extend_from_slice(&[128 + run as u8, line[position][component]]);
            position += run;
        }
    }
}
