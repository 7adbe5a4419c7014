//! An analysis as bytes, so that it can be an artefact of its own.
//!
//! Little-endian: magic `KILNSPH1`; u32 width, height, band limit, low band limit (8), bright count; f64 error,
//! dim energy, range (low, high of red, green, blue); per bright texel u32 index, 3 f64; then the coefficients of
//! low and of dim, six f64 each, in the order of [`Harmonics::coefficients`].

use crate::analysis::{Analysis, BAND_LIMIT_MAX, BRIGHT_MAX, LOW_BAND_LIMIT};
use crate::bright::BrightTexel;
use kiln_sphere::{Bulk, Cancel, Cancelled, Harmonics, coefficient_count};
use thiserror::Error;

const MAGIC: [u8; 8] = *b"KILNSPH1";
const HEADER_BYTES: usize = MAGIC.len() + 5 * 4 + 8 * 8;
/// Panoramas wider than this are no panoramas.
const SIDE_MAX: usize = 1 << 20;

/// Why bytes are no analysis.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum BakeError {
    /// Another kind of file, or another version.
    #[error("not an analysis: the first bytes are not `KILNSPH1`")]
    NotAnAnalysis,
    /// The length does not follow from the header.
    #[error("analysis of {actual} bytes where its header asks for {expected}")]
    Length {
        /// Bytes the header asks for.
        expected: usize,
        /// Bytes given.
        actual: usize,
    },
    /// A field outside its range.
    #[error("{field} of the analysis is {actual}, allowed are {least} to {greatest}")]
    Range {
        /// Which field.
        field: &'static str,
        /// What it holds.
        actual: usize,
        /// Least allowed.
        least: usize,
        /// Greatest allowed.
        greatest: usize,
    },
    /// A number that is NaN or infinite.
    #[error("value {index} of the analysis is not finite")]
    NotFinite {
        /// Which of the file's f64 values, from 0.
        index: usize,
    },
    /// The analysis is not wanted any more; says nothing about the bytes.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Coefficients between two looks at a [`Cancel`]: a fraction of a millisecond's work.
const CHECK_COEFFICIENTS: usize = 1 << 13;

impl Analysis {
    /// The analysis as bytes; equal analyses give equal bytes.
    ///
    /// # Errors
    /// [`Cancelled`] within a millisecond.
    pub fn to_bytes(&self, cancel: Cancel) -> Result<Vec<u8>, Cancelled> {
        let mut result = Bulk::new(Vec::with_capacity(byte_count(self.band_limit(), self.bright.len())));
        let bytes: &mut Vec<u8> = &mut result;
        bytes.extend_from_slice(&MAGIC);
        let counts = [self.width, self.height, self.band_limit(), LOW_BAND_LIMIT, self.bright.len()];
        counts.iter().for_each(|&count| bytes.extend_from_slice(&(count as u32).to_le_bytes()));
        let mut push = |value: f64| bytes.extend_from_slice(&value.to_le_bytes());
        push(self.error);
        push(self.dim_energy);
        self.range.as_flattened().iter().for_each(|&value| push(value));
        for texel in &self.bright {
            bytes.extend_from_slice(&(texel.index as u32).to_le_bytes());
            texel.excess.iter().for_each(|value| bytes.extend_from_slice(&value.to_le_bytes()));
        }
        for harmonics in [&self.low, &self.dim] {
            for coefficients in harmonics.coefficients().chunks(CHECK_COEFFICIENTS) {
                cancel.check()?;
                for value in coefficients.as_flattened() {
                    bytes.extend_from_slice(&value.to_le_bytes());
                }
            }
        }
        Ok(result.into_inner())
    }

    /// Reads what [`Analysis::to_bytes`] wrote. Hostile bytes give an error: sizes are checked against the length
    /// before anything is allocated, and every number must be finite.
    ///
    /// # Errors
    /// [`BakeError`]; [`BakeError::Cancelled`] within a millisecond.
    pub fn from_bytes(bytes: &[u8], cancel: Cancel) -> Result<Analysis, BakeError> {
        let mut reader =
            Reader { rest: bytes.strip_prefix(&MAGIC).ok_or(BakeError::NotAnAnalysis)?, f64_count: 0 };
        if bytes.len() < HEADER_BYTES {
            return Err(BakeError::Length { expected: HEADER_BYTES, actual: bytes.len() });
        }
        let width = reader.count("width", 1, SIDE_MAX)?;
        let height = reader.count("height", 1, SIDE_MAX)?;
        let band_limit = reader.count("band limit", 0, BAND_LIMIT_MAX)?;
        reader.count("low band limit", LOW_BAND_LIMIT, LOW_BAND_LIMIT)?;
        let bright_count = reader.count("bright texel count", 0, BRIGHT_MAX)?;
        let expected = byte_count(band_limit, bright_count);
        if bytes.len() != expected {
            return Err(BakeError::Length { expected, actual: bytes.len() });
        }
        let (error, dim_energy) = (reader.number()?, reader.number()?);
        let mut range = [[0.0; 2]; 3];
        for value in range.as_flattened_mut() {
            *value = reader.number()?;
        }
        let bright = (0..bright_count).map(|_| reader.bright(width * height)).collect::<Result<_, _>>()?;
        let low = reader.harmonics(LOW_BAND_LIMIT, cancel)?;
        let dim = reader.harmonics(band_limit, cancel)?;
        Ok(Analysis { width, height, error, dim, dim_energy, bright, low, range })
    }
}

/// Bytes of an analysis of that many degrees and bright texels.
pub(crate) const fn byte_count(band_limit: usize, bright_count: usize) -> usize {
    let coefficients = coefficient_count(band_limit) + coefficient_count(LOW_BAND_LIMIT);
    HEADER_BYTES + bright_count * 28 + coefficients * 48
}

/// Reads fields off bytes whose length has been checked.
struct Reader<'a> {
    rest: &'a [u8],
    f64_count: usize,
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (head, rest) = self.rest.split_first_chunk().expect("the length was checked");
        self.rest = rest;
        *head
    }

    fn count(&mut self, field: &'static str, least: usize, greatest: usize) -> Result<usize, BakeError> {
        let actual = u32::from_le_bytes(self.take()) as usize;
        let is_allowed = (least..=greatest).contains(&actual);
        if is_allowed { Ok(actual) } else { Err(BakeError::Range { field, actual, least, greatest }) }
    }

    fn number(&mut self) -> Result<f64, BakeError> {
        let value = f64::from_le_bytes(self.take());
        let index = self.f64_count;
        self.f64_count += 1;
        if value.is_finite() { Ok(value) } else { Err(BakeError::NotFinite { index }) }
    }

    fn bright(&mut self, texel_count: usize) -> Result<BrightTexel, BakeError> {
        let index = self.count("bright texel", 0, texel_count - 1)?;
        Ok(BrightTexel { index, excess: [self.number()?, self.number()?, self.number()?] })
    }

    fn harmonics(&mut self, band_limit: usize, cancel: Cancel) -> Result<Harmonics, BakeError> {
        let mut coefficients = Bulk::new(vec![[0.0; 6]; coefficient_count(band_limit)]);
        for coefficients in coefficients.chunks_mut(CHECK_COEFFICIENTS) {
            cancel.check()?;
            for value in coefficients.as_flattened_mut() {
                *value = self.number()?;
            }
        }
        Ok(Harmonics::from_coefficients(band_limit, coefficients.into_inner()).expect("counted above"))
    }
}
