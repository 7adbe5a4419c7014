//! The store's form of a decoded environment: `KILNENV2`, width and height (u32 LE), the form of its texels (u32 LE), then
//! the texels. Twice as wide as high it is a panorama; six times as high as wide the faces of a cube, one below the other in
//! KTX2 order.
//!
//! Texels take the smallest form that loses nothing: what came from an .hdr file fits shared exponents, what came from
//! half floats fits halves. So the largest panoramas stay within memory, and the store within a third of its room.

use half::f16;
use half::slice::HalfFloatSliceExt as _;
use kiln_bake::{Cancel, Cancelled};
use kiln_build::Error;
use kiln_image::{Cube, Environment, Image, Panorama};

use crate::environment::ended;

const MAGIC: &[u8; 8] = b"KILNENV2";
const HEADER_BYTES: usize = 20;

/// How texels are stored, smallest first.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    /// Three mantissas of 8 bits and an exponent e: m · 2^(e − 136), as Radiance has them.
    SharedExponent = 0,
    Half = 1,
    Float = 2,
}

const FORMS: [Form; 3] = [Form::SharedExponent, Form::Half, Form::Float];

impl Form {
    fn texel_bytes(self) -> usize {
        match self {
            Form::SharedExponent => 4,
            Form::Half => 6,
            Form::Float => 12,
        }
    }

    /// Whether every texel comes back as it was.
    fn holds(self, texels: &[[f32; 3]]) -> bool {
        match self {
            Form::SharedExponent => texels.iter().all(|texel| to_shared_exponent(*texel).is_some()),
            Form::Half => texels.as_flattened().iter().all(|value| f16::from_f32(*value).to_f32() == *value),
            Form::Float => true,
        }
    }
}

/// Width and height of the panorama that a stored environment of this length is at most, or becomes: a cube's is four
/// faces wide.
pub(crate) fn environment_size(blob_bytes: usize) -> (usize, usize) {
    let texels = blob_bytes.saturating_sub(HEADER_BYTES) / Form::SharedExponent.texel_bytes();
    // A cube of 6 n² texels becomes a panorama of 8 n².
    let height = (texels.saturating_mul(2) / 3).isqrt() + 1;
    (2 * height, height)
}

/// Texels between two looks at a [`Cancel`]: about a millisecond's work.
const CHUNK_TEXELS: usize = 1 << 16;

pub(crate) fn encode_environment(environment: &Environment, cancel: Cancel) -> Result<Vec<u8>, Cancelled> {
    let (width, height, rgb) = match environment {
        Environment::Panorama(panorama) => (panorama.width(), panorama.height(), panorama.rgb()),
        Environment::Cube(cube) => (cube.face_size, 6 * cube.face_size, cube.rgb.as_slice()),
    };
    let texels = rgb.as_chunks::<3>().0;
    let form = smallest(texels, cancel)?;
    let mut bytes = Vec::with_capacity(HEADER_BYTES + texels.len() * form.texel_bytes());
    bytes.extend_from_slice(MAGIC);
    for number in [width, height, form as usize] {
        bytes.extend_from_slice(&u32::try_from(number).unwrap_or(u32::MAX).to_le_bytes());
    }
    for texels in texels.chunks(CHUNK_TEXELS) {
        cancel.check()?;
        match form {
            Form::SharedExponent => {
                bytes.extend(texels.iter().flat_map(|texel| to_shared_exponent(*texel).unwrap_or_default()));
            }
            Form::Half => {
                let values = texels.as_flattened().iter();
                bytes.extend(values.flat_map(|value| f16::from_f32(*value).to_le_bytes()));
            }
            Form::Float => bytes.extend(texels.as_flattened().iter().flat_map(|value| value.to_le_bytes())),
        }
    }
    Ok(bytes)
}

fn smallest(texels: &[[f32; 3]], cancel: Cancel) -> Result<Form, Cancelled> {
    for form in [Form::SharedExponent, Form::Half] {
        let mut is_held = true;
        for texels in texels.chunks(CHUNK_TEXELS) {
            cancel.check()?;
            is_held = is_held && form.holds(texels);
        }
        if is_held {
            return Ok(form);
        }
    }
    Ok(Form::Float)
}

/// Mantissas and exponent, if they hold the texel exactly.
fn to_shared_exponent(texel: [f32; 3]) -> Option<[u8; 4]> {
    // Bits, so that −0 is told from 0.
    if texel.map(f32::to_bits) == [0; 3] {
        return Some([0; 4]);
    }
    let largest = texel.iter().fold(0.0, |a: f32, b| a.max(*b));
    // 2^exponent ≤ largest < 2^(exponent + 1), for normal numbers.
    let exponent = i32::try_from(largest.to_bits() >> 23).ok()? - 127;
    let byte = u8::try_from(exponent + 129).ok().filter(|byte| (9..=254).contains(byte))?;
    // Exact, being a power of two within the normal numbers.
    let per_unit = f32::powi(2.0, 136 - i32::from(byte));
    let mut bytes = [0, 0, 0, byte];
    for (byte, value) in bytes.iter_mut().zip(texel) {
        let mantissa = value * per_unit;
        if !(0.0..=255.0).contains(&mantissa) || mantissa.is_sign_negative() || mantissa.fract() != 0.0 {
            return None;
        }
        *byte = mantissa as u8;
    }
    Some(bytes)
}

/// 2^(e − 136), a normal number from e = 10 on; at e = 9 it is 2^−127, exact as a subnormal one.
fn shared_unit(exponent: u8) -> f32 {
    f32::powi(2.0, i32::from(exponent) - 136)
}

fn from_shared_exponent([r, g, b, exponent]: [u8; 4]) -> [f32; 3] {
    let unit = if exponent == 0 { 0.0 } else { shared_unit(exponent) };
    [r, g, b].map(|mantissa| f32::from(mantissa) * unit)
}

pub(crate) fn decode_environment(bytes: &[u8], cancel: Cancel) -> Result<Environment, Error> {
    let damaged = || Error::Action {
        action: "read a decoded environment".to_owned(),
        reason: "the store holds something else under its name".to_owned(),
    };
    let (header, texels) = bytes.split_first_chunk::<HEADER_BYTES>().ok_or_else(damaged)?;
    let number = |at: usize| header[at..at + 4].try_into().map(u32::from_le_bytes).map_err(|_| damaged());
    let (width, height) = (number(8)? as usize, number(12)? as usize);
    let form = *FORMS.get(number(16)? as usize).ok_or_else(damaged)?;
    if header[..8] != *MAGIC || !texels.len().is_multiple_of(form.texel_bytes()) {
        return Err(damaged());
    }
    let mut rgb: Vec<f32> = Vec::with_capacity(texels.len() / form.texel_bytes() * 3);
    for chunk in texels.chunks(CHUNK_TEXELS * form.texel_bytes()) {
        cancel.check().map_err(ended)?;
        match form {
            Form::SharedExponent => {
                rgb.extend(chunk.as_chunks::<4>().0.iter().flat_map(|texel| from_shared_exponent(*texel)));
            }
            Form::Half => {
                let halves: Vec<f16> =
                    chunk.as_chunks::<2>().0.iter().map(|value| f16::from_le_bytes(*value)).collect();
                let start = rgb.len();
                rgb.resize(start + halves.len(), 0.0);
                halves.convert_to_f32_slice(&mut rgb[start..]);
            }
            Form::Float => {
                rgb.extend(chunk.as_chunks::<4>().0.iter().map(|value| f32::from_le_bytes(*value)));
            }
        }
    }
    if height == 6 * width {
        return Cube::new(width, rgb).map(Environment::Cube).map_err(|_| damaged());
    }
    let image = Image::new(width, height, rgb).map_err(|_| damaged())?;
    Panorama::new(image).map(Environment::Panorama).map_err(|_| damaged())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panorama(values: impl Iterator<Item = f32>) -> Environment {
        let image = Image::new(4, 2, values.take(24).collect()).unwrap();
        Environment::Panorama(Panorama::new(image).unwrap())
    }

    fn form(bytes: &[u8]) -> u8 {
        bytes[16]
    }

    #[test]
    fn environments_survive_the_store_in_the_smallest_form_and_other_bytes_do_not() {
        let tiny = f32::from_bits(1);
        let cases = [
            (panorama((0..24).map(|i| i as f32 * 8.0)), Form::SharedExponent),
            (panorama([0.0, 1e30_f32.log2().exp2().floor(), 0.0].into_iter().cycle()), Form::Float),
            (panorama([65504.0, 1.0, -0.25].into_iter().cycle()), Form::Half),
            (panorama([-0.0, 0.0, 0.0].into_iter().cycle()), Form::Half),
            (panorama([f32::INFINITY, 1.0, 2.0].into_iter().cycle()), Form::Half),
            (panorama([0.1, 1.0, 2.0].into_iter().cycle()), Form::Float),
            (panorama([tiny, f32::MAX, 0.0].into_iter().cycle()), Form::Float),
            (
                Environment::Cube(Cube::new(2, (0..72u8).map(f32::from).collect()).unwrap()),
                Form::SharedExponent,
            ),
        ];
        for (environment, wanted) in cases {
            let bytes = encode_environment(&environment, Cancel::NEVER).unwrap();
            assert_eq!(form(&bytes), wanted as u8, "{environment:?}");
            let found = decode_environment(&bytes, Cancel::NEVER).unwrap();
            assert_eq!(found, environment);
            let (width, height) = environment_size(bytes.len());
            assert!(width >= 4 && height >= 2, "{width} x {height} is too small an estimate");
            assert!(decode_environment(&bytes[..bytes.len() - 4], Cancel::NEVER).is_err());
            assert!(decode_environment(&[b"X", &bytes[1..]].concat(), Cancel::NEVER).is_err());
        }
    }

    #[test]
    fn every_shared_exponent_comes_back_bit_for_bit() {
        for exponent in 9..=254u8 {
            for mantissas in [[128, 1, 0], [255, 255, 255], [200, 0, 77]] {
                let [r, g, b] = mantissas;
                let texel = from_shared_exponent([r, g, b, exponent]);
                let stored = to_shared_exponent(texel).map(from_shared_exponent);
                assert_eq!(stored.map(|texel| texel.map(f32::to_bits)), Some(texel.map(f32::to_bits)));
            }
        }
        assert_eq!(to_shared_exponent([1.0, 1.0 / 512.0, 0.0]), None, "a ninth bit");
        assert_eq!(to_shared_exponent([f32::NAN, 1.0, 0.0]), None);
    }

    #[test]
    fn nan_survives_as_float() {
        let environment = panorama([f32::NAN, 1.0, 2.0].into_iter().cycle());
        let bytes = encode_environment(&environment, Cancel::NEVER).unwrap();
        assert_eq!(form(&bytes), Form::Float as u8);
        let Environment::Panorama(found) = decode_environment(&bytes, Cancel::NEVER).unwrap() else {
            panic!("a panorama")
        };
        assert!(found.rgb()[0].is_nan());
    }
}
