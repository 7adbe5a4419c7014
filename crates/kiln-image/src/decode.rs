//! The entry for pictures: sniffs the content, checks the limits, hands over to a format.

use crate::{
    Cancel, Cancelled, Cube, Image, Layout, LayoutError, colour::Gamut, container, hdr, ldr, openexr,
};
use thiserror::Error;

/// What came out of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoded {
    /// Linear Rec. 709 D65, relative radiance, upright.
    pub image: Image,
    /// `"Radiance HDR"`, `"OpenEXR"`, `"PNG"`, `"JPEG"`, `"KTX2"`, `"KTX1"` or `"DDS"`.
    pub format: &'static str,
    /// What a person should know: conversions made, parts chosen, attributes without effect.
    pub notes: Vec<String>,
}

/// Everything a file says, before anybody asks what its texels show.
#[derive(Clone, Debug)]
pub(crate) struct Source {
    pub format: &'static str,
    pub texels: Stored,
    pub notes: Vec<String>,
    /// The colour space converted from, if any.
    pub gamut: Option<Gamut>,
    /// Height of a texel over its width, as the file states it.
    pub texel_aspect: f64,
    /// The layout the file itself names.
    pub declared: Option<Layout>,
}

/// Texels as a file holds them.
#[derive(Clone, Debug)]
pub(crate) enum Stored {
    Flat(Image),
    Cube(Cube),
}

impl Source {
    /// An image with square texels, of no stated layout and without conversion.
    pub(crate) fn flat(format: &'static str, image: Image, notes: Vec<String>) -> Source {
        Source { format, texels: Stored::Flat(image), notes, gamut: None, texel_aspect: 1.0, declared: None }
    }

    /// The flat image; a cube is refused.
    pub(crate) fn into_decoded(self) -> Result<Decoded, DecodeError> {
        let Source { format, texels, mut notes, texel_aspect, declared, .. } = self;
        let Stored::Flat(image) = texels else {
            let reason = "it is a cube map, and a flat picture is wanted here".to_owned();
            return Err(DecodeError::Unsupported { format, reason });
        };
        if declared == Some(Layout::ExrCube) {
            notes.push("the file says it is a cube map: six faces, stacked".to_owned());
        }
        if texel_aspect != 1.0 {
            notes.push(format!(
                "texels {texel_aspect} times as high as wide are taken as square: the stated aspect has no effect"
            ));
        }
        Ok(Decoded { image, format, notes })
    }
}

/// The largest image that is accepted; checked against headers before anything is allocated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Columns.
    pub width_max: usize,
    /// Rows.
    pub height_max: usize,
    /// Columns times rows.
    pub texels_max: usize,
    /// Channels of one EXR part.
    pub channels_max: usize,
    /// Parts of one EXR file.
    pub parts_max: usize,
}

impl Default for Limits {
    /// 16384 × 8192 texels, 1.5 GiB once decoded.
    fn default() -> Limits {
        Limits { width_max: 32768, height_max: 32768, texels_max: 1 << 27, channels_max: 256, parts_max: 256 }
    }
}

/// Why bytes are no image.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum DecodeError {
    /// No signature that is known.
    #[error("neither Radiance HDR, OpenEXR, PNG, JPEG, KTX nor DDS: the file starts with {start:?}")]
    UnknownFormat {
        /// The first bytes, printable ones as they are.
        start: String,
    },
    /// The bytes end too early.
    #[error("{format}: the file ends in {what}, at byte {byte}")]
    Truncated {
        /// Format name as in [`Decoded::format`].
        format: &'static str,
        /// What is missing, with its row where there is one.
        what: String,
        /// Where the bytes end.
        byte: usize,
    },
    /// The bytes contradict the format.
    #[error("{format}: {place}: {reason}")]
    Invalid {
        /// Format name as in [`Decoded::format`].
        format: &'static str,
        /// Line, row or part.
        place: String,
        /// What is wrong there.
        reason: String,
    },
    /// Well-formed, but nothing this crate reads.
    #[error("{format}: {reason}")]
    Unsupported {
        /// Format name as in [`Decoded::format`].
        format: &'static str,
        /// What it is.
        reason: String,
    },
    /// Over a limit of [`Limits`].
    #[error("{format}: {what} is {actual}, over the limit of {limit}")]
    TooLarge {
        /// Format name as in [`Decoded::format`].
        format: &'static str,
        /// Which quantity.
        what: &'static str,
        /// Its value in the file.
        actual: u64,
        /// The limit.
        limit: u64,
    },
    /// An environment whose layout its shape does not tell.
    #[error(
        "an image of {width} × {height} has the shape of no environment: equirect is 2:1, cube-strip 6:1 or 1:6, \
         cube-cross 4:3 or 3:4, octahedral 1:1 (only with `layout = \"octahedral\"`); convert it, or state its layout"
    )]
    UnknownLayout {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// A layout was asked for, or stated by the file, that the texels do not have.
    #[error("{layout} {wanted}; this is {actual}")]
    WrongLayout {
        /// The layout.
        layout: Layout,
        /// What it must be.
        wanted: &'static str,
        /// What it is.
        actual: String,
    },
    /// One of six files is wrong.
    #[error("face {face}: {source}")]
    Face {
        /// `+X` to `-Z`.
        face: &'static str,
        /// What is wrong with its file.
        source: Box<DecodeError>,
    },
    /// A size that makes no image.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// The image is not wanted any more; says nothing about the bytes.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Texels between two looks at a [`Cancel`]: about a millisecond's work.
pub(crate) const CHECK_TEXELS: usize = 1 << 14;

/// Decodes a flat picture by its content; names and extensions do not matter.
///
/// For what surrounds a scene use [`decode_environment`](crate::decode_environment()): it knows cubes and layouts.
///
/// # Errors
/// [`DecodeError`], for anything but a whole image within `limits`. Nothing panics on hostile bytes and
/// nothing larger than the limits is allocated.
///
/// [`DecodeError::Cancelled`] comes within a row's work or, where another's decoder cannot be interrupted, after it:
/// the whole of a PNG or JPEG (tens of milliseconds for 4096 × 2048 texels), Zstandard data of a KTX2, one chunk of an OpenEXR file (milliseconds, but for
/// DWAB's 256 lines and tiles as large as the image).
pub fn decode(bytes: &[u8], limits: &Limits, cancel: Cancel) -> Result<Decoded, DecodeError> {
    decode_source(bytes, limits, cancel)?.into_decoded()
}

/// [`decode`], with cubes and everything else that the layout of an environment follows from.
pub(crate) fn decode_source(bytes: &[u8], limits: &Limits, cancel: Cancel) -> Result<Source, DecodeError> {
    cancel.check()?;
    match bytes {
        [b'#', b'?', ..] => hdr::decode_source(bytes, limits, cancel),
        [0x76, 0x2f, 0x31, 0x01, ..] => openexr::decode(bytes, limits, cancel),
        [0x89, b'P', b'N', b'G', ..] => ldr::decode(bytes, ldr::Kind::Png, limits, cancel),
        [0xff, 0xd8, 0xff, ..] => ldr::decode(bytes, ldr::Kind::Jpeg, limits, cancel),
        [0xab, b'K', b'T', b'X', b' ', b'2', ..] => container::ktx2::decode(bytes, limits, cancel),
        [0xab, b'K', b'T', b'X', b' ', b'1', ..] => container::ktx1::decode(bytes, limits, cancel),
        [b'D', b'D', b'S', b' ', ..] => container::dds::decode(bytes, limits, cancel),
        _ => Err(DecodeError::UnknownFormat { start: printable_start(bytes) }),
    }
}

/// Refuses sizes of zero or over the limits.
pub(crate) fn check_size(
    format: &'static str,
    width: usize,
    height: usize,
    limits: &Limits,
) -> Result<(), DecodeError> {
    if width == 0 || height == 0 {
        return Err(LayoutError::Empty { width, height }.into());
    }
    let texels = width.saturating_mul(height);
    let sizes = [
        ("the width", width, limits.width_max),
        ("the height", height, limits.height_max),
        ("the number of texels", texels, limits.texels_max),
    ];
    match sizes.into_iter().find(|(_, actual, limit)| actual > limit) {
        Some((what, actual, limit)) => Err(too_large(format, what, actual, limit)),
        None => Ok(()),
    }
}

pub(crate) fn too_large(
    format: &'static str,
    what: &'static str,
    actual: usize,
    limit: usize,
) -> DecodeError {
    DecodeError::TooLarge { format, what, actual: actual as u64, limit: limit as u64 }
}

/// Runs a foreign decoder; its panic becomes an error of this file.
///
/// The decoders behind this are other people's: a panic in one is a bug there, but the bytes that
/// trigger it are a user's file, and a daemon must outlive them. Nothing of `run` survives the unwind.
pub(crate) fn guard<T>(
    format: &'static str,
    run: impl FnOnce() -> Result<T, DecodeError>,
) -> Result<T, DecodeError> {
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(run)).unwrap_or_else(|_| {
        let reason = "the decoder gave up on damaged data".to_owned();
        Err(DecodeError::Invalid { format, place: "file".to_owned(), reason })
    })
}

fn printable_start(bytes: &[u8]) -> String {
    bytes.iter().take(12).flat_map(|&byte| std::ascii::escape_default(byte)).map(char::from).collect()
}
