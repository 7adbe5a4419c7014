//! The text in front of the pixels.

use super::FORMAT;
use crate::{DecodeError, colour::Chromaticities};

/// Header bytes looked at before giving up; real headers stay below a kilobyte.
const HEADER_BYTES_MAX: usize = 1 << 20;

/// How texels are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PixelFormat {
    /// Red, green, blue, common exponent.
    Rgbe,
    /// CIE XYZ, common exponent.
    Xyze,
}

/// One axis of the resolution line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Axis {
    /// Texels along it.
    pub length: usize,
    /// Runs leftwards (`-X`) or upwards (`+Y`).
    pub is_reversed: bool,
}

/// The resolution line: `slow` counts scanlines, `fast` texels in one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Orientation {
    pub slow: Axis,
    pub fast: Axis,
    /// Scanlines are columns: X was named first.
    pub is_transposed: bool,
}

/// Everything the header says that matters.
#[derive(Clone, Debug)]
pub(super) struct Header {
    pub pixel_format: PixelFormat,
    /// Product of all EXPOSURE lines.
    pub exposure: f64,
    /// Product of all COLORCORR lines.
    pub colour_correction: [f64; 3],
    pub primaries: Option<Chromaticities>,
    /// Product of all PIXASPECT lines: height of a texel over its width.
    pub texel_aspect: f64,
    pub orientation: Orientation,
    pub notes: Vec<String>,
    /// Byte where the first scanline starts.
    pub pixels_start: usize,
}

/// Parses `#?` line, variables up to an empty line, and the resolution line.
pub(super) fn parse(bytes: &[u8]) -> Result<Header, DecodeError> {
    let mut lines = Lines { bytes, position: 0, number: 0 };
    let mut header = Header {
        pixel_format: PixelFormat::Rgbe,
        exposure: 1.0,
        colour_correction: [1.0; 3],
        primaries: None,
        texel_aspect: 1.0,
        orientation: Orientation {
            slow: Axis { length: 0, is_reversed: false },
            fast: Axis { length: 0, is_reversed: false },
            is_transposed: false,
        },
        notes: Vec::new(),
        pixels_start: 0,
    };
    lines.next("the header")?;
    loop {
        let line = lines.next("the header")?;
        if line.is_empty() {
            break;
        }
        header.read_variable(line, lines.number)?;
    }
    let line = lines.next("the resolution line")?;
    header.orientation =
        parse_resolution(line).ok_or_else(|| invalid(lines.number, resolution_reason(line)))?;
    header.pixels_start = lines.position;
    Ok(header)
}

impl Header {
    /// Reads `NAME=value`; anything else is a comment or a command of the picture's history.
    fn read_variable(&mut self, line: &[u8], number: usize) -> Result<(), DecodeError> {
        let Some((name, value)) = std::str::from_utf8(line).ok().and_then(|text| text.split_once('=')) else {
            return Ok(());
        };
        let value = value.trim();
        match name {
            "FORMAT" => self.pixel_format = parse_format(value, number)?,
            "EXPOSURE" => self.exposure *= parse_positive::<1>(value, "EXPOSURE", number)?[0],
            "COLORCORR" => {
                let correction = parse_positive::<3>(value, "COLORCORR", number)?;
                self.colour_correction.iter_mut().zip(correction).for_each(|(product, c)| *product *= c);
            }
            "PRIMARIES" => {
                let xy = parse_numbers::<8>(value, "PRIMARIES", number)?;
                // Photoshop writes eight zeros where it knows no primaries.
                self.primaries = (xy != [0.0; 8]).then(|| Chromaticities::from_array(xy));
            }
            "PIXASPECT" => self.texel_aspect *= parse_positive::<1>(value, "PIXASPECT", number)?[0],
            "GAMMA" if value.parse() != Ok(1.0) => {
                self.notes.push(format!("GAMMA={value} has no effect: values are taken as linear"));
            }
            _ => {}
        }
        Ok(())
    }
}

fn parse_format(value: &str, number: usize) -> Result<PixelFormat, DecodeError> {
    match value {
        "32-bit_rle_rgbe" => Ok(PixelFormat::Rgbe),
        "32-bit_rle_xyze" => Ok(PixelFormat::Xyze),
        other => Err(invalid(
            number,
            format!("FORMAT is {other:?}, known are 32-bit_rle_rgbe and 32-bit_rle_xyze"),
        )),
    }
}

fn parse_numbers<const N: usize>(value: &str, name: &str, number: usize) -> Result<[f64; N], DecodeError> {
    let parsed: Option<Vec<f64>> = value.split_ascii_whitespace().map(|word| word.parse().ok()).collect();
    parsed
        .and_then(|numbers| <[f64; N]>::try_from(numbers).ok())
        .filter(|numbers| numbers.iter().all(|v| v.is_finite()))
        .ok_or_else(|| invalid(number, format!("{name} wants {N} finite number(s), got {value:?}")))
}

fn parse_positive<const N: usize>(value: &str, name: &str, number: usize) -> Result<[f64; N], DecodeError> {
    let numbers = parse_numbers::<N>(value, name, number)?;
    if numbers.iter().all(|&v| v > 0.0) {
        return Ok(numbers);
    }
    Err(invalid(number, format!("{name} must be above zero, got {value:?}")))
}

/// `-Y 512 +X 1024` and its seven relatives.
fn parse_resolution(line: &[u8]) -> Option<Orientation> {
    let text = std::str::from_utf8(line).ok()?;
    let [first, length, second, length_2] =
        text.split_ascii_whitespace().collect::<Vec<_>>().try_into().ok()?;
    let (slow_is_x, slow) = parse_axis(first, length)?;
    let (fast_is_x, fast) = parse_axis(second, length_2)?;
    (slow_is_x != fast_is_x).then_some(Orientation { slow, fast, is_transposed: slow_is_x })
}

fn parse_axis(name: &str, length: &str) -> Option<(bool, Axis)> {
    let (is_x, is_reversed) = match name {
        "+X" => (true, false),
        "-X" => (true, true),
        "-Y" => (false, false),
        "+Y" => (false, true),
        _ => return None,
    };
    let is_number = length.bytes().all(|byte| byte.is_ascii_digit());
    let length = length.parse().ok().filter(|&length| is_number && length > 0)?;
    Some((is_x, Axis { length, is_reversed }))
}

fn resolution_reason(line: &[u8]) -> String {
    let start: String =
        line.iter().take(60).flat_map(|&b| std::ascii::escape_default(b)).map(char::from).collect();
    format!("the resolution line reads \"{start}\", wanted is one like \"-Y 512 +X 1024\"")
}

fn invalid(line: usize, reason: String) -> DecodeError {
    DecodeError::Invalid { format: FORMAT, place: format!("header line {line}"), reason }
}

struct Lines<'a> {
    bytes: &'a [u8],
    position: usize,
    number: usize,
}

impl<'a> Lines<'a> {
    /// The next line without its end; both `\n` and `\r\n` end one.
    fn next(&mut self, what: &str) -> Result<&'a [u8], DecodeError> {
        self.number += 1;
        let end = self.bytes.len().min(HEADER_BYTES_MAX);
        let rest = self.bytes.get(self.position..end).unwrap_or_default();
        let Some(length) = rest.iter().position(|&byte| byte == b'\n') else {
            return Err(if self.bytes.len() > HEADER_BYTES_MAX {
                invalid(self.number, format!("the header does not end within {HEADER_BYTES_MAX} bytes"))
            } else {
                let what = format!("{what}, line {}", self.number);
                DecodeError::Truncated { format: FORMAT, what, byte: self.bytes.len() }
            });
        };
        self.position += length + 1;
        Ok(rest[..length].strip_suffix(b"\r").unwrap_or(&rest[..length]))
    }
}
