//! One scanline in each of the three encodings.

use super::FORMAT;
use crate::DecodeError;

/// Widths the newer run-length form can hold.
pub(super) const NEW_RLE_WIDTHS: std::ops::RangeInclusive<usize> = 8..=32767;

/// A texel as stored: three mantissas, one exponent.
pub(super) type Rgbe = [u8; 4];

/// Fewest bytes of a line in the newer run-length form: two for each run of up to 127 texels, of four components.
pub(super) fn line_bytes_min(length: usize) -> usize {
    4 + 4 * 2 * length.div_ceil(127)
}

/// Walks through the pixel bytes.
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
    position: usize,
    row: usize,
}

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8], position: usize) -> Reader<'a> {
        Reader { bytes, position, row: 0 }
    }

    /// Fills `line`, whatever its encoding: files may mix them.
    pub(super) fn read_line(&mut self, row: usize, line: &mut [Rgbe]) -> Result<(), DecodeError> {
        self.row = row;
        match *self.rest() {
            [2, 2, high, low, ..] if high < 128 && NEW_RLE_WIDTHS.contains(&line.len()) => {
                let length = usize::from(high) << 8 | usize::from(low);
                if length != line.len() {
                    return Err(self.invalid(format!("it states {length} texels, the header {}", line.len())));
                }
                self.position += 4;
                (0..4).try_for_each(|component| self.read_component(component, line))
            }
            _ => self.read_flat_or_old(line),
        }
    }

    /// Newer run-length form: one component after the other.
    fn read_component(&mut self, component: usize, line: &mut [Rgbe]) -> Result<(), DecodeError> {
        let mut filled = 0;
        while filled < line.len() {
            let code = self.byte()?;
            let count = usize::from(if code > 128 { code - 128 } else { code });
            let Some(target) = line.get_mut(filled..filled + count) else {
                return Err(self.invalid(format!("a run of {count} passes the end at texel {filled}")));
            };
            if code > 128 {
                let value = self.byte()?;
                target.iter_mut().for_each(|texel| texel[component] = value);
            } else {
                let values = self.take(count)?;
                target.iter_mut().zip(values).for_each(|(texel, &value)| texel[component] = value);
            }
            filled += count;
        }
        Ok(())
    }

    /// Flat texels, and the older run-length form: (1, 1, 1, n) repeats the last texel n times;
    /// directly following repeats count 256 times as much each.
    fn read_flat_or_old(&mut self, line: &mut [Rgbe]) -> Result<(), DecodeError> {
        let (mut filled, mut shift) = (0, 0_u32);
        while filled < line.len() {
            let [r, g, b, e] = *self.take_array()?;
            if [r, g, b] != [1, 1, 1] {
                line[filled] = [r, g, b, e];
                filled += 1;
                shift = 0;
                continue;
            }
            let Some(last) = filled.checked_sub(1).map(|index| line[index]) else {
                return Err(self.invalid("it starts with a repetition of nothing".to_owned()));
            };
            let count = usize::from(e).checked_shl(shift).filter(|_| shift < 32).unwrap_or(usize::MAX);
            let Some(target) = filled.checked_add(count).and_then(|end| line.get_mut(filled..end)) else {
                return Err(self.invalid(format!("a run of {count} passes the end at texel {filled}")));
            };
            target.fill(last);
            filled += count;
            shift += 8;
        }
        Ok(())
    }

    fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.position..).unwrap_or_default()
    }

    fn byte(&mut self) -> Result<u8, DecodeError> {
        let [byte] = *self.take_array()?;
        Ok(byte)
    }

    fn take_array<const N: usize>(&mut self) -> Result<&'a [u8; N], DecodeError> {
        let taken = self.rest().first_chunk().ok_or_else(|| self.truncated())?;
        self.position += N;
        Ok(taken)
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], DecodeError> {
        let taken = self.rest().get(..count).ok_or_else(|| self.truncated())?;
        self.position += count;
        Ok(taken)
    }

    fn truncated(&self) -> DecodeError {
        let what = format!("scanline {}", self.row);
        DecodeError::Truncated { format: FORMAT, what, byte: self.bytes.len() }
    }

    fn invalid(&self, reason: String) -> DecodeError {
        let place = format!("scanline {}, byte {}", self.row, self.position);
        DecodeError::Invalid { format: FORMAT, place, reason }
    }
}
