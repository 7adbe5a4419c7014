//! The ladder of errors: from what a user can buy to what no time buys.
//!
//! Each rung is measured alone, the others being exact: estimator (the map's texels), encoding (their bits), reconstruction
//! (lookups between texels and mips), texel model (what lies between a panorama's texels), split sum (two lookups and a table
//! instead of the integral).

use kiln_bake::{
    BruteForce, PathTracer, RoughnessLaw, Surface, TexelFormat, encode_level, scale_log2, skybox,
    split_sum_radiance,
};
use kiln_brdf::sampling::{hammersley, orthonormal_basis};
use kiln_image::{Cancel, Cancelled, Cube, Image, Panorama};
use kiln_sphere::cube_texel_solid_angle_sr;
use serde::{Deserialize, Serialize};

use crate::chain::{Level, LobeKind};
use crate::estimator::convolve;
use crate::norms::ErrorNorms;
use crate::source::Source;
use crate::truth::Truth;

/// What a rung's error can be bought off with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Price {
    /// Time of the bake.
    Time,
    /// Bytes.
    Bytes,
    /// A finer source.
    Source,
    /// Nothing but another renderer.
    Nothing,
}

/// One kind of error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rung {
    /// Its name.
    pub name: String,
    /// RMS, relative to the exact values' RMS.
    pub rms: f64,
    /// What it is paid with.
    pub price: Price,
    /// What was measured.
    pub what: String,
}

/// A texel format for the same chain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Encoding {
    /// Its name as on the command line.
    pub format: String,
    /// RMS over the chain, relative.
    pub rms: f64,
    /// Bytes of the chain.
    pub bytes: u64,
}

/// All rungs, from the bake to the renderer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ladder {
    /// In order.
    pub rungs: Vec<Rung>,
    /// What each format would cost.
    pub encodings: Vec<Encoding>,
    /// Name of the largest rung.
    pub dominant: String,
}

/// How a ladder is measured.
pub struct LadderRequest<'a> {
    /// The environment.
    pub panorama: &'a Panorama,
    /// Of it.
    pub force: &'a BruteForce<'a>,
    /// The GGX chain, rough levels.
    pub levels: &'a [Level],
    /// Edge of the chain's first mip.
    pub face_size: usize,
    /// Its law.
    pub law: &'a RoughnessLaw,
    /// Error that was asked for and what the chain then had.
    pub estimator: (f64, ErrorNorms),
    /// Format that is baked.
    pub format: TexelFormat,
    /// Probes for each roughness between levels.
    pub probes: usize,
}

/// Formats by the names of the command line.
pub const FORMATS: [(&str, TexelFormat); 5] = [
    ("rgba32f", TexelFormat::Rgba32Float),
    ("rgba16f", TexelFormat::Rgba16Float),
    ("rgb9e5", TexelFormat::Rgb9e5Ufloat),
    ("r11g11b10f", TexelFormat::R11g11b10Ufloat),
    ("bc6h", TexelFormat::Bc6hUfloat),
];

/// Error of the chains that stand for the exact one.
const EXACT: f64 = 1e-6;

/// Measures all rungs.
///
/// # Errors
/// [`Cancelled`] soon after it is asked for.
pub fn ladder(request: &LadderRequest, cancel: Cancel) -> Result<Ladder, Cancelled> {
    let (maps, _) = convolve(request.panorama, request.levels, EXACT, cancel)?;
    let maps: Vec<Cube> = maps.into_iter().map(|map| map.cube).collect();
    let encodings = encodings(&maps, cancel)?;
    let format =
        FORMATS.iter().find(|(_, format)| *format == request.format).map_or("rgba16f", |(name, _)| name);
    let encoding =
        encodings.iter().find(|encoding| encoding.format == format).map_or(0.0, |encoding| encoding.rms);
    let reconstruction = reconstruction(request, maps.clone(), cancel)?;
    let texel_model = texel_model(request, &maps, cancel)?;
    let (split, noise) = split_sum(request.panorama, cancel)?;
    let rung =
        |name: &str, rms: f64, price: Price, what: String| Rung { name: name.to_owned(), rms, price, what };
    let (asked, estimator) = request.estimator;
    let rungs = vec![
        rung("estimator", estimator.rms, Price::Time, format!("texels before encoding, {asked:.0e} asked for")),
        rung("encoding", encoding, Price::Bytes, format!("texels as {format}")),
        rung(
            "reconstruction",
            reconstruction,
            Price::Bytes,
            "seamless bilinear lookups, linear between mips, beside the convolution at that direction and roughness".to_owned(),
        ),
        rung(
            "texel model",
            texel_model,
            Price::Source,
            "the source's texels as constant patches beside a bilinear sky through their centres".to_owned(),
        ),
        rung(
            "split sum",
            split,
            Price::Nothing,
            format!("exact lookups and table beside a path tracer (its noise {noise:.0e}), roughness 0.25 to 1, three views"),
        ),
    ];
    let dominant = rungs
        .iter()
        .max_by(|a, b| a.rms.total_cmp(&b.rms))
        .map_or_else(String::new, |rung| rung.name.clone());
    Ok(Ladder { rungs, encodings, dominant })
}

/// Root of the mean square of relative errors.
fn mean_root(errors: &[f64]) -> f64 {
    (errors.iter().map(|error| error * error).sum::<f64>() / errors.len().max(1) as f64).sqrt()
}

fn encodings(maps: &[Cube], cancel: Cancel) -> Result<Vec<Encoding>, Cancelled> {
    let brightest = maps.iter().flat_map(|map| &map.rgb).copied().fold(0.0, f32::max);
    let encoding = |(name, format): (&str, TexelFormat)| {
        // 32-bit floats need no scale.
        let scale = if format == TexelFormat::Rgba32Float { 0 } else { scale_log2(brightest) };
        let (mut errors, mut bytes) = (Vec::new(), 0);
        for map in maps {
            let encoded = encode_level(map, format, scale, cancel)?;
            errors.push(encoded.rounding_rms);
            bytes += encoded.bytes.len() as u64;
        }
        Ok(Encoding { format: name.to_owned(), rms: mean_root(&errors), bytes })
    };
    FORMATS.into_iter().map(encoding).collect()
}

/// Lookups as a renderer's, halfway between mips, in directions between texels.
fn reconstruction(request: &LadderRequest, maps: Vec<Cube>, cancel: Cancel) -> Result<f64, Cancelled> {
    /// A grid whose centres are no chain's.
    const BETWEEN: usize = 181;
    let first = skybox(request.panorama, request.face_size, cancel)?.swap_remove(0);
    let mip_count = request.levels.first().map_or(1, |level| level.mip_count);
    let chain: Vec<Cube> = std::iter::once(first).chain(maps).collect();
    let source = Source::of_levels(&chain, cancel)?;
    let mut errors = Vec::new();
    for pair in request.levels.windows(2) {
        let roughness = 0.5 * (pair[0].roughness + pair[1].roughness);
        let lobe = LobeKind::Ggx.of_roughness(roughness);
        let level = Level { roughness, lobe, face_size: BETWEEN, ..pair[0] };
        let truth = Truth::new(request.force, level, request.probes, cancel)?;
        let mip = request.law.level(roughness, mip_count);
        let values: Vec<_> = truth.probes.iter().map(|probe| source.sample(probe.direction, mip)).collect();
        errors.push(truth.compare(&values).rms);
    }
    Ok(mean_root(&errors))
}

/// The chain of a bilinear sky through the texels' centres, in quarters of texels, whose means are its values in their middles.
fn texel_model(request: &LadderRequest, maps: &[Cube], cancel: Cancel) -> Result<f64, Cancelled> {
    let (smooth, _) = convolve(&refined(request.panorama), request.levels, EXACT, cancel)?;
    let errors = maps.iter().zip(&smooth).map(|(exact, smooth)| difference(&smooth.cube, exact));
    Ok(mean_root(&errors.collect::<Vec<_>>()))
}

/// RMS over the sphere of how far a map is from another, relative to the other's.
pub fn difference(map: &Cube, exact: &Cube) -> f64 {
    let size = exact.face_size;
    let (mut off, mut total) = (0.0, 0.0);
    for (index, (a, b)) in map.rgb.iter().zip(&exact.rgb).enumerate() {
        let texel = index / 3;
        let weight = cube_texel_solid_angle_sr(size, texel % size, texel / size % size);
        off += weight * f64::from(a - b).powi(2);
        total += weight * f64::from(*b).powi(2);
    }
    if off == 0.0 { 0.0 } else { (off / total).sqrt() }
}

/// Twice the size, bilinear; columns wrap around, rows end at the poles.
fn refined(panorama: &Panorama) -> Panorama {
    let (width, height) = (panorama.width(), panorama.height());
    let mut rgb = Vec::with_capacity(12 * width * height);
    for y in 0..2 * height {
        // The nearer of the two rows has three quarters.
        let rows = [y / 2, if y % 2 == 0 { (y / 2).saturating_sub(1) } else { (y / 2 + 1).min(height - 1) }];
        for x in 0..2 * width {
            let other = if x % 2 == 0 { x / 2 + width - 1 } else { x / 2 + 1 } % width;
            let columns = [x / 2, other];
            for channel in 0..3 {
                let mut sum = 0.0;
                for (row, by_row) in rows.into_iter().zip([0.75, 0.25]) {
                    for (column, by_column) in columns.into_iter().zip([0.75, 0.25]) {
                        sum += by_row * by_column * panorama.texel(column, row)[channel];
                    }
                }
                rgb.push(sum);
            }
        }
    }
    let image = Image::new(2 * width, 2 * height, rgb).expect("as many values as texels ask for");
    Panorama::new(image).expect("twice as wide as high")
}

/// Means of whole texels until the panorama is at most `width_max` wide.
fn reduced(panorama: &Panorama, width_max: usize) -> Panorama {
    let mut small = panorama.clone();
    while small.width() > width_max && small.height().is_multiple_of(2) {
        let (width, height) = (small.width() / 2, small.height() / 2);
        let texel = |index: usize| {
            let (x, y) = (2 * (index % width), 2 * (index / width));
            let four = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| small.texel(x, y));
            [0, 1, 2].map(|channel| four.iter().map(|texel| 0.25 * texel[channel]).sum::<f32>())
        };
        let rgb: Vec<f32> = (0..width * height).flat_map(texel).collect();
        let image = Image::new(width, height, rgb).expect("as many values as texels ask for");
        small = Panorama::new(image).expect("twice as wide as high");
    }
    small
}

/// RMS of the split sum beside the integral, and of the integral's noise; both relative. On a panorama of at most 256 columns:
/// the model's error does not see finer ones.
fn split_sum(panorama: &Panorama, cancel: Cancel) -> Result<(f64, f64), Cancelled> {
    const NORMALS: u32 = 5;
    let small = reduced(panorama, 256);
    let tracer = PathTracer::new(&small);
    let surfaces = [0.25, 0.5, 0.75, 1.0].into_iter().flat_map(|roughness| {
        // A white metal, and a dielectric without diffuse light.
        [(1.0, 1.0), (0.0, 0.0)].map(|(color, metallic)| Surface { color: [color; 3], metallic, roughness })
    });
    let (mut off, mut noise, mut total) = (0.0, 0.0, 0.0);
    for (seed, surface) in surfaces.enumerate() {
        for index in 0..NORMALS {
            cancel.check()?;
            let [turn, along] = hammersley(index, NORMALS);
            let cos = 1.0 - 2.0 * (along + 0.5 / f64::from(NORMALS)).fract();
            let (sin_phi, cos_phi) = libm::sincos(2.0 * std::f64::consts::PI * turn);
            let sine = (1.0 - cos * cos).max(0.0).sqrt();
            let normal = [sine * cos_phi, cos, sine * sin_phi];
            let [tangent, _] = orthonormal_basis(normal);
            let n_dot_v: f64 = [0.2, 0.6, 1.0][index as usize % 3];
            let across = (1.0 - n_dot_v * n_dot_v).sqrt();
            let view = std::array::from_fn(|i| n_dot_v * normal[i] + across * tangent[i]);
            let split = split_sum_radiance(&small, surface, normal, view);
            let traced = tracer.radiance(surface, normal, view, 256, (seed as u64) << 8 | u64::from(index));
            for ((split, exact), error) in split.iter().zip(traced.radiance).zip(traced.standard_error) {
                off += (split - exact).powi(2);
                noise += error * error;
                total += exact * exact;
            }
        }
    }
    let relative = |squares: f64| if squares == 0.0 { 0.0 } else { (squares / total).sqrt() };
    Ok((relative(off), relative(noise)))
}

#[cfg(test)]
mod tests {
    use super::{difference, reduced, refined};
    use kiln_image::{Cube, Image, Panorama};

    #[test]
    fn refining_keeps_a_constant_and_reducing_keeps_the_mean() {
        let constant = Panorama::new(Image::new(8, 4, vec![0.5; 96]).unwrap()).unwrap();
        assert!(refined(&constant).rgb().iter().all(|value| *value == 0.5));
        let rgb: Vec<f32> = (0..96).map(|i| i as f32).collect();
        let ramp = Panorama::new(Image::new(8, 4, rgb).unwrap()).unwrap();
        let mean = |p: &Panorama| p.rgb().iter().sum::<f32>() / p.rgb().len() as f32;
        assert_eq!((mean(&reduced(&ramp, 2)), reduced(&ramp, 2).width()), (mean(&ramp), 2));
        assert!(refined(&ramp).rgb() != reduced(&refined(&ramp), 8).rgb());
        let cube = |value: f32| Cube { face_size: 1, rgb: vec![value; 18] };
        assert!((difference(&cube(1.1), &cube(1.0)) - 0.1).abs() < 1e-6);
    }
}
