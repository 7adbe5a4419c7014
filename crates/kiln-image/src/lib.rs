//! Images of radiance: decoded, checked, encoded.
//!
//! Start at [`decode()`]: file bytes in, a linear [`Image`] and what is worth saying about it out.
//! [`Panorama`] and [`Cube`] are the two layouts the baker knows; [`check_texels`] says what is wrong
//! with an image's numbers and [`TexelPolicy`] what to do about it.
//!
//! Conventions: right-handed, +Y up; a panorama's centre column looks along −Z, its right half towards
//! +X, row 0 is the top (+Y); cube faces in KTX2 order +X −X +Y −Y +Z −Z, each row-major from its top
//! left as KTX2/Vulkan sample it; linear Rec. 709 D65, relative radiance, three channels interleaved.
//!
//! Decoding and checking take a [`Cancel`], since a large file takes a while.
//!
//! Not here: what a map means (`kiln-bake`), directions and transforms (`kiln-sphere`), files (`kiln-project`).

pub mod colour;
pub mod cube_layout;
mod decode;
pub mod exr_write;
pub mod hdr;
pub mod ktx1;
pub mod ktx2;
mod layout;
mod ldr;
mod openexr;
pub mod png;
pub mod sheet;
pub mod texel;
mod texels;

#[cfg(test)]
mod tests;

pub use kiln_sphere::{Bulk, Cancel, Cancelled};

pub use decode::{DecodeError, Decoded, Limits, decode};
pub use layout::{Cube, Image, LayoutError, Panorama};
pub use texels::{Defect, Place, Repair, TexelError, TexelPolicy, TexelReport, check_texels, repair_texels};
