//! Reads glTF 2.0 into a scene that a renderer can draw, and finds the effects it calls for.
//!
//! Start at [`pack`]: a .gltf or .glb with what it refers to in, one normalised GLB and the scene's
//! [`Effect`]s out. [`load`] turns that GLB (or any self-contained one) into a [`Scene`]. Both run the same
//! import, so what a pack says about a scene is what a renderer gets. [`Scene::pose`] plays its animations.
//!
//! Conventions: right-handed, +Y up, metres; matrices are column-major and act on column vectors; colours
//! linear Rec. 709 (8-bit images keep their encoding, [`ColorSpace`] says which); UV origin top left. Places
//! in a file are JSON pointers (RFC 6901). Every world matrix has a positive determinant at rest: mirrored instances
//! get their own mirrored geometry, so a renderer never flips its winding.
//!
//! Why no glTF crate: hostile files must end in a message with a place, values that this version does not
//! draw must be seen too, and the same types write the pack; the schema of what is drawn fits one file.
//!
//! Not here: files (a caller resolves URIs), GPU resources (`kiln-preview`), which lobes to bake (`kiln-project`).

pub use animation::{Animation, Channel, Curve, Interpolation, Target};
pub use built_in::{BUILT_IN, built_in};
pub use deform::{Deformed, Influence, MorphDelta, MorphTarget, skinned_vertex};
pub use effect::{EffectOverrides, variant_name};
pub use error::SceneError;
pub use images::decode_image;

pub use pack::{LightReads, MaterialEffects, PackOptions, Packed, SceneSummary, load, pack, pack_with};
pub use play::{Posed, PosedDraw, Sources};
pub use property::{CameraProperty, LightProperty, MaterialProperty, TextureSlot};
pub use scene::*;
pub use specular_glossiness::SpecularGlossinessAs;
pub use uri::{Uri, UriKind, external_uris};

mod accessor;
mod animate;
mod animation;
mod built_in;
mod conform;
mod container;
mod deform;
mod document;
mod effect;
mod error;
mod extensions;
mod geometry;
mod hierarchy;
mod images;
mod import;
mod json;
pub mod limits;
mod locate;
mod material_table;
mod materials;
mod movement;
mod pack;
mod play;
mod pose;
mod property;
mod prune;
mod rig;
mod scene;
mod schema;
mod shape;
mod specular_glossiness;
mod tangents;
mod textures;
mod topology;
mod uri;
mod variants;
mod write;
mod write_geometry;
mod write_motion;

#[cfg(test)]
mod tests;
