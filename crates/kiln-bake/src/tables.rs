//! Tables that do not depend on an environment: what BRDFs reflect of uniform light.

use kiln_brdf::{
    ErrorNorms, Masking, Precision, SheenVisibility, albedo_average, dfg, dfg_multiscatter, sheen_albedo,
};
use kiln_sphere::{Cancel, Cancelled};
use rayon::prelude::*;

/// Rows of a table unless somebody wants another size.
///
/// What lookups are then off by ([`table_error`], least roughness in brackets):
///
/// | table                  | graded, worst          | uniform, RMS (worst)                   |
/// |------------------------|------------------------|----------------------------------------|
/// | GGX scale and bias     | 6.4e-5 (0.089)         | 4.2e-5 (4.7e-3) (0.089), 1.6e-4 (0)    |
/// | GGX multiple scattering| 9.3e-5 (0.089)         | 6.4e-5 (6.8e-3) (0.089), 1.9e-4 (0)    |
/// | tutorials' GGX         | 8.8e-5 (0.089)         | 8.2e-5 (7.9e-3) (0.12), 3.0e-4 (0)     |
/// | average albedo of GGX  | 1.1e-5 (0)             | 2.2e-6 (4.3e-6) (0)                    |
/// | clamped sheen          | 8.4e-5 (0.12)          | 9.3e-6 (1.6e-4) (0.12), 3.2e-4 (0)     |
/// | unclamped sheen        | 7.4e-5 (0.25)          | 5.4e-5 (2.3e-3) (0.25), 3.1e-3 (0)     |
pub const TABLE_SIZE: usize = 256;

/// What a table holds. Entries are those of [`Precision::Table`], rounded to `f32`; the average albedo is good to 1e-5.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Table {
    /// GGX, two channels (scale, bias): reflectance = F0 · scale + bias. [`Masking::SchlickIbl`] is the tutorials' table.
    GgxScaleBias(Masking),
    /// GGX for multiple scattering, two channels (bias, E), E = scale + bias the directional albedo for F0 = 1.
    GgxMultiscatter(Masking),
    /// GGX, one channel and one column: the average albedo 2 ∫ E μ dμ for each roughness.
    GgxAlbedoAverage(Masking),
    /// Charlie's directional albedo, one channel.
    SheenAlbedo(SheenVisibility),
}

impl Table {
    /// Values an entry.
    pub fn channels(self) -> usize {
        match self {
            Self::GgxScaleBias(_) | Self::GgxMultiscatter(_) => 2,
            Self::GgxAlbedoAverage(_) | Self::SheenAlbedo(_) => 1,
        }
    }

    /// Columns of a table with `size` rows.
    pub fn width(self, size: usize) -> usize {
        if matches!(self, Self::GgxAlbedoAverage(_)) { 1 } else { size }
    }

    /// The entry for one n·v and perceptual roughness; the second value is 0 where there is one channel.
    fn entry(self, [n_dot_v, roughness]: [f64; 2], precision: Precision) -> [f64; 2] {
        match self {
            Self::GgxScaleBias(masking) => dfg(masking, n_dot_v, roughness, precision),
            Self::GgxMultiscatter(masking) => dfg_multiscatter(masking, n_dot_v, roughness, precision),
            Self::GgxAlbedoAverage(masking) => [albedo_average(masking, roughness, precision), 0.0],
            Self::SheenAlbedo(visibility) => [sheen_albedo(visibility, n_dot_v, roughness, precision), 0.0],
        }
    }
}

/// Where a table's texel centres (x + ½)/size, (y + ½)/size stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableAxes {
    /// n·v = x, roughness = y: what engines read.
    ///
    /// Near (0, 0) all tables are functions of n·v/α. No equal spacing resolves those: the largest error of a lookup
    /// there does not shrink with the size ([`table_error`] measures it).
    Uniform,
    /// n·v = x³, roughness = y²; so a lookup reads at (∛(n·v), √roughness).
    Graded,
}

impl TableAxes {
    /// [n·v, perceptual roughness] at a position in the table.
    pub fn at(self, [x, y]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Uniform => [x, y],
            Self::Graded => [x * x * x, y * y],
        }
    }
}

/// Integrates a table of `size` rows and [`Table::width`] columns, [`Table::channels`] values an entry, row 0 (least
/// roughness) first.
///
/// # Errors
/// [`Cancelled`] within an entry's work.
pub fn table(kind: Table, axes: TableAxes, size: usize, cancel: Cancel) -> Result<Vec<f32>, Cancelled> {
    let width = kind.width(size);
    let channels = kind.channels();
    let mut values = vec![0.0; width * size * channels];
    values.par_chunks_exact_mut(channels).enumerate().try_for_each(|(index, texel)| {
        cancel.check()?;
        let at = axes.at([centre(index % width, width), centre(index / width, size)]);
        for (value, exact) in texel.iter_mut().zip(kind.entry(at, Precision::Table)) {
            *value = exact as f32;
        }
        Ok(())
    })?;
    Ok(values)
}

/// Position of a texel's centre along a side of `count` texels.
fn centre(index: usize, count: usize) -> f64 {
    (index as f64 + 0.5) / count as f64
}

/// What bilinear lookups in a table of `size` rows are off by, between its outermost texel centres and from perceptual
/// roughness `roughness_min` on: the largest error of any channel at the middles of cells and of their edges, where
/// linear interpolation is farthest off. (Lookups beyond the outermost centres see the edge's value.)
///
/// # Errors
/// [`Cancelled`] within an entry's work.
///
/// # Panics
/// If `values` is not a table of this kind and size.
pub fn table_error(
    kind: Table,
    axes: TableAxes,
    size: usize,
    values: &[f32],
    roughness_min: f64,
    cancel: Cancel,
) -> Result<ErrorNorms, Cancelled> {
    let (width, channels) = (kind.width(size), kind.channels());
    assert_eq!(values.len(), width * size * channels, "a table of {size} rows");
    let columns = if width <= 1 { width } else { width - 1 };
    let value = |x: usize, y: usize, channel: usize| {
        f64::from(values[(y.min(size - 1) * width + x.min(width - 1)) * channels + channel])
    };
    let rows: Result<Vec<Vec<_>>, Cancelled> = (0..size.saturating_sub(1))
        .into_par_iter()
        .map(|y| {
            let mut errors = Vec::with_capacity(columns * PROBES.len());
            for (x, probe) in (0..columns).flat_map(|x| PROBES.map(|probe| (x, probe))) {
                cancel.check()?;
                let corners =
                    [[x, y], [x + 1, y + 1]].map(|[x, y]| axes.at([centre(x, width), centre(y, size)]));
                let at = axes.at([
                    centre(x, width) + probe[0] / width as f64,
                    centre(y, size) + probe[1] / size as f64,
                ]);
                if at[1] < roughness_min {
                    continue;
                }
                let exact = kind.entry(at, Precision::Table);
                let error = (0..channels).fold(0.0, |worst: f64, channel| {
                    let row = |y: usize| lerp(value(x, y, channel), value(x + 1, y, channel), probe[0]);
                    worst.max((lerp(row(y), row(y + 1), probe[1]) - exact[channel]).abs())
                });
                let area = (corners[1][0] - corners[0][0]) * (corners[1][1] - corners[0][1]);
                errors.push((at, error, area));
            }
            Ok(errors)
        })
        .collect();
    Ok(ErrorNorms::of(rows?.into_iter().flatten()))
}

/// Places in a cell at which interpolation is probed.
const PROBES: [[f64; 2]; 3] = [[0.5, 0.5], [0.5, 0.0], [0.0, 0.5]];

fn lerp(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// [`Table::GgxScaleBias`] with height-correlated Smith masking on [`TableAxes::Uniform`], in pairs.
///
/// # Errors
/// [`Cancelled`] within an entry's work.
pub fn dfg_table(size: usize, cancel: Cancel) -> Result<Vec<[f32; 2]>, Cancelled> {
    let values = table(Table::GgxScaleBias(Masking::SmithCorrelated), TableAxes::Uniform, size, cancel)?;
    Ok(values.as_chunks().0.to_vec())
}
