//! Box filter.

/// Averages texels over each pixel's area; where there are fewer texels than pixels, takes the one at the
/// pixel's centre, so that texels stay visible as squares.
pub(super) fn resample(
    (width, height): (usize, usize),
    (width_out, height_out): (usize, usize),
    texel: impl Fn(usize, usize) -> [f32; 3],
) -> Vec<[f32; 3]> {
    let columns: Vec<Vec<(usize, f64)>> = (0..width_out).map(|x| weights(x, width, width_out)).collect();
    let mut out = Vec::with_capacity(width_out * height_out);
    for y in 0..height_out {
        let rows = weights(y, height, height_out);
        for column in &columns {
            let mut sum = [0.0; 3];
            for &(row, row_weight) in &rows {
                for &(x, weight) in column {
                    let rgb = texel(x, row);
                    (0..3).for_each(|i| sum[i] += f64::from(rgb[i]) * (weight * row_weight));
                }
            }
            out.push(sum.map(|value| value as f32));
        }
    }
    out
}

/// Source indices under output index `index` with their shares; the shares sum to 1.
fn weights(index: usize, length: usize, length_out: usize) -> Vec<(usize, f64)> {
    if length <= length_out {
        return vec![((2 * index + 1) * length / (2 * length_out), 1.0)];
    }
    let (start, end) = (index * length, (index + 1) * length);
    let (first, last) = (start / length_out, end.div_ceil(length_out));
    let share = |i: usize| (end.min((i + 1) * length_out) - start.max(i * length_out)) as f64 / length as f64;
    (first..last).map(|i| (i, share(i))).collect()
}
