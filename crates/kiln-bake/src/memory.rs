//! How much memory a step needs at its peak, so that no more steps run at once than fit.
//!
//! Upper estimates in bytes. Each counts, beside the step's own work, the input as stored and as decoded, and the result as
//! texels and as stored, all held to the end. A panorama and a cube are stored as `f32`, a map's texel in up to 16 bytes.
//! Checked by `tests/memory.rs`: the counted peak of a demanding step lies between a quarter of its estimate and all of it.

use crate::analysis::{BAND_LIMIT_MAX, BRIGHT_MAX};
use crate::bytes::byte_count;
use crate::prefilter::error_share;
use kiln_sphere::{analyse_bytes, synthesise_cube_bytes};

/// Size of the largest analysis ([`crate::Analysis::to_bytes`]), for where it is not made yet.
pub const ANALYSIS_BYTES_MAX: usize = byte_count(BAND_LIMIT_MAX, BRIGHT_MAX);

/// [`kiln_image::decode()`] and the texel policy, from the file's length alone.
///
/// A texel becomes 12 bytes twice, decoded and stored, and stands in a `.hdr` with 3 to 4, in an OpenEXR file with 3 to 12
/// bytes: the estimate holds for both. A JPEG, a PNG and an image of few colours may need several times more, as may the
/// repair of an image that is broken for the most part.
pub fn decode(file_bytes: usize) -> usize {
    with_slack(12 * file_bytes)
}

/// [`kiln_image::decode_environment()`] of a KTX2, KTX1 or DDS file and the texel policy, from the file's length alone.
///
/// BC6H has one byte a texel, and that is what the estimate is for: half floats need a fifth of it. A file compressed as a
/// whole (Zstandard) may need more.
pub fn decode_container(file_bytes: usize) -> usize {
    with_slack((1 + 2 * size_of::<[f32; 3]>()) * file_bytes)
}

/// [`kiln_image::decode_environment()`] of an octahedral map and the texel policy, from the file's length alone; as
/// [`decode`], for 3 bytes a texel.
pub fn decode_octahedral(file_bytes: usize) -> usize {
    // The map; twice as many texels of the panorama, decoded and stored.
    with_slack((1 + 5 * size_of::<[f32; 3]>() / 3) * file_bytes)
}

/// [`crate::panorama_of_cube`], stored. Where the analysis follows in the same step and nothing is freed between, it is
/// this and [`analyse`] of `4 · face_size` × `2 · face_size`.
pub fn panorama_of_cube(face_size: usize) -> usize {
    // Made column by column, put together row by row, and stored while the columns may still wait to be freed.
    with_slack(2 * cube(face_size) + 3 * panorama(4 * face_size, 2 * face_size))
}

/// [`crate::skybox_of_cube`] with all its levels, from a cube of `source_size`.
pub fn skybox_of_cube(source_size: usize, face_size: usize) -> usize {
    let is_halved = source_size.is_multiple_of(face_size) && (source_size / face_size).is_power_of_two();
    let first = if source_size == face_size {
        0
    } else if is_halved {
        // The source again, and its half.
        5 * cube(source_size) / 4
    } else {
        let map = panorama(4 * source_size, 2 * source_size);
        map + map.max(skybox_faces(face_size))
    };
    // An odd size beyond 1 is halved by way of the panorama.
    let odd = face_size >> face_size.trailing_zeros();
    let rest = if is_halved && odd > 1 { 2 * panorama(4 * source_size, 2 * source_size) } else { 0 };
    with_slack(2 * cube(source_size) + first.max(rest) + skybox_levels(face_size))
}

/// [`crate::analyse`], for as many degrees as it may choose.
pub fn analyse(width: usize, height: usize) -> usize {
    // Stored and decoded.
    let panoramas = 2 * panorama(width, height);
    with_slack(panoramas + analyse_bytes(width, height, BAND_LIMIT_MAX) + ANALYSIS_BYTES_MAX)
}

/// [`crate::skybox`] with all its levels.
pub fn skybox(width: usize, height: usize, face_size: usize) -> usize {
    with_slack(2 * panorama(width, height) + skybox_faces(face_size) + skybox_levels(face_size))
}

/// [`crate::specular_level`] from an analysis of `analysis_bytes` (at most [`ANALYSIS_BYTES_MAX`]), made for `error`
/// ([`crate::AnalysisRequest`]).
pub fn specular_level(analysis_bytes: usize, error: f64, alpha: f64, face_size: usize) -> usize {
    let texels = 6 * face_size * face_size;
    let error = error * error_share(face_size);
    let band_limit = band_limit(analysis_bytes).min(band_limit_needed(alpha, error));
    let map = texels * (size_of::<[f32; 3]>() + STORED_TEXEL);
    with_slack(2 * analysis_bytes + synthesise_cube_bytes(band_limit, face_size) + map)
}

/// [`crate::irradiance`], from the same.
pub fn irradiance(analysis_bytes: usize, error: f64, face_size: usize) -> usize {
    specular_level(analysis_bytes, error, 1.0, face_size)
}

/// The larger of the two texel formats.
const STORED_TEXEL: usize = 16;

/// Four faces as means, two as sums with their weight.
fn skybox_faces(face_size: usize) -> usize {
    let texels = 6 * face_size * face_size;
    texels * 2 / 3 * size_of::<[f32; 3]>() + texels / 3 * size_of::<[f64; 4]>()
}

/// As texels and as stored.
fn skybox_levels(face_size: usize) -> usize {
    let texels = 6 * face_size * face_size;
    4 * texels * (size_of::<[f32; 3]>() + STORED_TEXEL) / 3
}

/// A cube's bytes, in memory and as stored.
fn cube(face_size: usize) -> usize {
    6 * face_size * face_size * size_of::<[f32; 3]>()
}

/// A panorama's, likewise.
fn panorama(width: usize, height: usize) -> usize {
    width * height * size_of::<[f32; 3]>()
}

/// Each thread's buffers, tables and headers.
fn with_slack(bytes: usize) -> usize {
    bytes + bytes / 16 + (1 << 20)
}

/// The degrees that an analysis of that length can hold: of L it has more than (L + 1)²/2 coefficients.
fn band_limit(analysis_bytes: usize) -> usize {
    (2 * analysis_bytes / size_of::<[f64; 6]>()).isqrt().min(BAND_LIMIT_MAX)
}

/// Contrast up to which the estimates hold: RMS over mean of what the transform sees, after the brightest texels left.
const CONTRAST_MAX: f64 = 30.0;

/// Degrees a map uses at most, whatever is known.
///
/// The lobe makes |κ_l| ≈ x K_1(x) with x = 2αl, 3e-9 at x = 22. The horizon adds no more than Lambert's 1.6 l^(−5/2). A map
/// takes all degrees L if by them alone its error can exceed `error`: with Σ_{l > L} κ_l² (2l + 1)/4π ≈ 0.14/L³
/// (see `Truncation::choose`) that ends at L = 0.95 √(contrast/error).
fn band_limit_needed(alpha: f64, error: f64) -> usize {
    let lobe = 11.0 / alpha.clamp(crate::ALPHA_MIN, 1.0);
    let horizon = 0.95 * (CONTRAST_MAX / error).sqrt();
    lobe.max(horizon) as usize
}
