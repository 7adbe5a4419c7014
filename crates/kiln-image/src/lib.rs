//! Images of radiance: decoded, checked, encoded.
//!
//! Start at [`decode_environment()`]: file bytes in, a [`Panorama`] or a [`Cube`] and what is worth saying about it out;
//! [`decode()`] is the same for flat pictures. [`check_texels`] says what is wrong with an image's numbers and
//! [`TexelPolicy`] what to do about it.
//!
//! Conventions: right-handed, +Y up; a panorama's centre column looks along −Z, its right half towards
//! +X, row 0 is the top (+Y); cube faces in KTX2 order +X −X +Y −Y +Z −Z, each row-major from its top
//! left as KTX2/Vulkan sample it; linear Rec. 709 D65, relative radiance, three channels interleaved.
//!
//! Decoding and checking take a [`Cancel`], since a large file takes a while.
//!
//! Not here: what a map means (`kiln-bake`), directions and transforms (`kiln-sphere`), files (`kiln-project`).

pub mod colour;
pub mod compare;
mod container;
pub mod cube_layout;
mod decode;
mod environment;
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
pub use environment::{
    CubePlacement, DecodedEnvironment, Environment, FACE_NAMES, FacePlacement, Layout, UnknownLayoutName,
    decode_environment, environment_from_faces, octahedral_direction, octahedral_uv,
};
pub use layout::{Cube, Image, LayoutError, Panorama};
pub use texels::{
    Defect, LimitReport, Place, Repair, Shape, TexelError, TexelPolicy, TexelReport, Texels, check_texels,
    limit_radiance, repair_texels,
};
