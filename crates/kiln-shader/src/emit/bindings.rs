//! Where the resources of a shader are bound, in the terms of each language.

use std::collections::BTreeMap;

use naga::{AddressSpace, ImageClass, Module, StorageAccess, TypeInner};
use serde::{Deserialize, Serialize};

use super::{EmitError, Language};
use crate::Stage;

/// What a program needs to know to bind resources and make pipelines from a file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BindingMap {
    /// Entry points of the file.
    pub entry_points: Vec<EmittedEntryPoint>,
    /// Resources of the file, sorted by group and binding. GLSL has no samplers of their own: see
    /// [`Slot::Uniform`].
    pub resources: Vec<BoundResource>,
    /// MSL: index of the buffer that must hold the size in bytes of each bound buffer that ends with an array
    /// without a size, a `u32` each, in the order of [`BindingMap::resources`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub buffer_sizes: Option<u32>,
}

/// An entry point of a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EmittedEntryPoint {
    /// Its name in WGSL.
    pub name: String,
    /// Its name in the file.
    pub emitted_name: String,
    /// Its stage.
    pub stage: Stage,
}

/// A resource and its place.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BoundResource {
    /// The variable's name in WGSL: what Kiln binds by.
    pub name: String,
    /// `@group`.
    pub group: u32,
    /// `@binding`.
    pub binding: u32,
    /// Where it is.
    pub slot: Slot,
}

/// A place for a resource.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Slot {
    /// WGSL and SPIR-V.
    Descriptor {
        /// Bind group or descriptor set.
        set: u32,
        /// Binding in it.
        binding: u32,
    },
    /// HLSL: `register(t2, space1)`.
    Register {
        /// `b2`, `t2`, `u2` or `s2`.
        register: String,
        /// Register space.
        space: u32,
    },
    /// MSL: `[[buffer(2)]]`.
    Index {
        /// What is counted.
        namespace: MslNamespace,
        /// Its number.
        index: u32,
    },
    /// GLSL. Version 4.50 has `binding = index` in its text. ES 3.00 has not: a program looks the name up and
    /// says `glUniformBlockBinding` or `glUniform1i`, with the index or any other number.
    Uniform {
        /// What is counted.
        namespace: GlslNamespace,
        /// Name of the block, sampler or image in the file; it differs from stage to stage.
        symbol: String,
        /// The block's binding point, the texture unit or the image unit; the same in all stages.
        index: u32,
        /// WGSL name of the sampler that a texture is read with; its state belongs to the texture unit.
        sampler: Option<String>,
    },
}

/// What OpenGL counts separately.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "names say it")]
pub enum GlslNamespace {
    UniformBlock,
    StorageBlock,
    Texture,
    Image,
}

/// What Metal counts separately.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "names say it")]
pub enum MslNamespace {
    Buffer,
    Texture,
    Sampler,
}

/// What a resource is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Uniform,
    Storage { writable: bool, unsized_end: bool },
    Texture,
    StorageTexture,
    Sampler,
}

/// A resource of a module.
#[derive(Clone, Debug)]
pub(super) struct Resource {
    pub name: String,
    pub place: naga::ResourceBinding,
    pub kind: Kind,
}

impl Resource {
    pub fn at(&self, slot: Slot) -> BoundResource {
        let (group, binding) = (self.place.group, self.place.binding);
        BoundResource { name: self.name.clone(), group, binding, slot }
    }
}

/// Resources of `module`, sorted by group and binding.
pub(super) fn resources(module: &Module) -> Result<Vec<Resource>, EmitError> {
    let mut resources = Vec::new();
    for (_, variable) in module.global_variables.iter() {
        let Some(place) = variable.binding else { continue };
        let name = variable.name.clone().unwrap_or_default();
        resources.push(Resource { name, place, kind: kind(module, variable)? });
    }
    resources.sort_by_key(|resource| (resource.place.group, resource.place.binding));
    Ok(resources)
}

fn kind(module: &Module, variable: &naga::GlobalVariable) -> Result<Kind, EmitError> {
    let inner = &module.types[variable.ty].inner;
    Ok(match (variable.space, inner) {
        (AddressSpace::Uniform, _) => Kind::Uniform,
        (AddressSpace::Storage { access }, _) => Kind::Storage {
            writable: access.contains(StorageAccess::STORE),
            unsized_end: inner.is_dynamically_sized(&module.types),
        },
        (_, TypeInner::Image { class: ImageClass::Storage { .. }, .. }) => Kind::StorageTexture,
        (_, TypeInner::Image { .. }) => Kind::Texture,
        (_, TypeInner::Sampler { .. }) => Kind::Sampler,
        _ => return Err(EmitError::Internal(format!("resource of an unknown kind: {inner:?}"))),
    })
}

pub(super) fn in_sets(resources: &[Resource]) -> Vec<BoundResource> {
    let slot = |place: &naga::ResourceBinding| Slot::Descriptor { set: place.group, binding: place.binding };
    resources.iter().map(|resource| resource.at(slot(&resource.place))).collect()
}

/// Indices of resources, counted within each namespace in the order of (group, binding). Variables of
/// different entry points that share a binding share an index.
#[derive(Debug)]
pub(super) struct Indices<N> {
    indices: BTreeMap<(N, u32, u32), u8>,
    counts: BTreeMap<N, u32>,
}

impl<N: Copy + Ord> Indices<N> {
    /// `limit` and `what` are how many resources a namespace has places for, and how to call them.
    pub fn new(
        language: Language,
        resources: &[Resource],
        namespace: impl Fn(Kind) -> Option<N>,
        limit: impl Fn(N) -> (u8, &'static str),
    ) -> Result<Self, EmitError> {
        let mut assigned = Indices { indices: BTreeMap::new(), counts: BTreeMap::new() };
        for resource in resources {
            let Some(namespace) = namespace(resource.kind) else { continue };
            let key = (namespace, resource.place.group, resource.place.binding);
            if assigned.indices.contains_key(&key) {
                continue;
            }
            let count = assigned.counts.entry(namespace).or_default();
            let (limit, what) = limit(namespace);
            let index = u8::try_from(*count).ok().filter(|index| *index < limit);
            let index = index.ok_or(EmitError::TooMany { language, what, limit: limit.into() })?;
            assigned.indices.insert(key, index);
            *count += 1;
        }
        Ok(assigned)
    }

    pub fn get(&self, namespace: N, place: naga::ResourceBinding) -> Option<u8> {
        self.indices.get(&(namespace, place.group, place.binding)).copied()
    }

    pub fn count(&self, namespace: N) -> u32 {
        self.counts.get(&namespace).copied().unwrap_or_default()
    }
}
