//! Primitives of the file as primitives of the scene, each once for all draws that show it alike.

use super::Importer;
use crate::geometry::{self, Deformation, Needs, Placing, Read};
use crate::movement::rest_weights;
use crate::{Primitive, SceneError, VariantMaterial, limits, schema, shape, variants};

/// What makes two draws of a file's primitive show the same vertices.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Look {
    /// Mesh, and primitive of it.
    part: (usize, usize),
    /// Morph targets whose weights call for them, while one changes.
    live: Vec<usize>,
    /// Number of joints that it hangs on, if they move.
    joints: Option<usize>,
}

/// A primitive of the scene.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub primitive: usize,
    /// The file's morph targets that became the primitive's.
    pub live: Vec<usize>,
}

/// What a primitive is drawn with.
struct Dress {
    slot: usize,
    needs: Needs,
    /// Of a primitive that is not there yet.
    variants: Vec<VariantMaterial>,
}

impl Importer<'_, '_> {
    /// A primitive as a node shows it; `joints` is the number of those that it hangs on.
    pub(super) fn part(
        &mut self,
        node: usize,
        part: (usize, usize),
        joints: Option<usize>,
    ) -> Result<Option<Part>, SceneError> {
        let live = self.movement.live_targets(node).to_vec();
        if !live.is_empty() {
            let found = self.shared(node, Look { part, live, joints })?;
            // Where only targets that this primitive lacks change, the rest pose is all there is to it.
            if found.as_ref().is_none_or(|it| self.movement.changes_any(node, &it.live)) {
                return Ok(found);
            }
        }
        let look = Look { part, live: Vec::new(), joints };
        if self.data.root.nodes[node].weights.is_some() {
            self.read(node, &look)
        } else {
            self.shared(node, look)
        }
    }

    fn shared(&mut self, node: usize, look: Look) -> Result<Option<Part>, SceneError> {
        if let Some(known) = self.parts.get(&look) {
            return Ok(known.clone());
        }
        let part = self.read(node, &look)?;
        self.parts.insert(look, part.clone());
        Ok(part)
    }

    fn read(&mut self, node: usize, look: &Look) -> Result<Option<Part>, SceneError> {
        let placing = look.joints.map_or(Placing::Instance, Placing::Joints);
        self.read_primitive(node, look.part, &look.live, placing)
    }

    /// A primitive whose vertices are where the rest pose puts them in the world.
    pub(super) fn baked(
        &mut self,
        node: usize,
        part: (usize, usize),
        placing: Placing<'_>,
    ) -> Result<Option<Part>, SceneError> {
        let live = self.movement.live_targets(node).to_vec();
        let found = self.read_primitive(node, part, &live, placing)?;
        match found {
            Some(it) if !live.is_empty() && !self.movement.changes_any(node, &it.live) => {
                self.read_primitive(node, part, &[], placing)
            }
            found => Ok(found),
        }
    }

    /// Whether a primitive is blended with any of its materials.
    pub(super) fn blends(&mut self, (mesh, at): (usize, usize)) -> Result<bool, SceneError> {
        let pointer = format!("/meshes/{mesh}/primitives/{at}");
        let primitive = &self.data.root.meshes[mesh].primitives[at];
        let has_colors = primitive.attributes.contains_key("COLOR_0");
        let Dress { slot, variants, .. } = self.dress(primitive, &pointer)?;
        let mut slots = std::iter::once(slot).chain(variants.into_iter().map(|it| it.material));
        Ok(slots.any(|slot| self.materials.blends(slot, has_colors)))
    }

    fn dress(&mut self, primitive: &schema::Primitive, pointer: &str) -> Result<Dress, SceneError> {
        let slot = self.materials.slot(primitive.material, pointer)?;
        let mut dress = Dress { slot, needs: self.materials.needs(slot), variants: Vec::new() };
        let mappings = variants::mappings(primitive, self.scene.variants.len(), pointer)?;
        for (at, mapping) in mappings.iter().enumerate() {
            let material = self.materials.slot(Some(mapping.material), &variants::place(pointer, at))?;
            dress.needs = dress.needs.or(self.materials.needs(material));
            let variants = mapping.variants.clone();
            dress.variants.push(VariantMaterial { primitive: 0, material, variants });
        }
        Ok(dress)
    }

    fn read_primitive(
        &mut self,
        node: usize,
        (mesh, at): (usize, usize),
        live: &[usize],
        placing: Placing<'_>,
    ) -> Result<Option<Part>, SceneError> {
        let root = self.data.root;
        let primitive = &root.meshes[mesh].primitives[at];
        let pointer = format!("/meshes/{mesh}/primitives/{at}");
        let Dress { slot, needs, variants } = self.dress(primitive, &pointer)?;
        let deformation = Deformation { weights: rest_weights(root, &root.nodes[node]), live, placing };
        let geometry =
            match geometry::read(self.data, primitive, &pointer, needs, deformation, &mut self.budget)? {
                Read::Geometry(geometry) => geometry,
                Read::Nothing(why) => {
                    self.notes.push(format!("{pointer} is not drawn: {why}"));
                    return Ok(None);
                }
            };
        self.note_missing_uvs(primitive, needs, &pointer);
        self.note_restart(primitive, &geometry.indices, &pointer);
        let (geometry, remarks) = shape::finish(geometry, needs);
        remarks.into_iter().for_each(|remark| self.notes.push(format!("{pointer}{remark}")));
        if geometry.indices.is_empty() {
            return Ok(None);
        }
        let (live, targets) = geometry.targets.into_iter().unzip();
        let primitive = Primitive {
            bounds: shape::bounds(&geometry.vertices),
            vertices: geometry.vertices,
            indices: geometry.indices,
            material: slot,
            influences: geometry.influences,
            targets,
        };
        let index = self.push_primitive(primitive, needs, &pointer)?;
        let variants = variants.into_iter().map(|it| VariantMaterial { primitive: index, ..it });
        self.scene.variant_materials.extend(variants);
        Ok(Some(Part { primitive: index, live }))
    }

    pub(super) fn mirrored(&mut self, primitive: usize) -> Result<usize, SceneError> {
        if let Some(&known) = self.mirrored.get(&primitive) {
            return Ok(known);
        }
        let (source, needs) = (&self.scene.primitives[primitive], self.needs[primitive]);
        self.budget.spend_deltas(source.targets.len() * source.vertices.len(), "")?;
        let mirrored = shape::mirrored(source, needs.tangents.is_some());
        let index = self.push_primitive(mirrored, needs, "")?;
        let variants = self.scene.variant_materials.iter().filter(|it| it.primitive == primitive);
        let variants: Vec<_> =
            variants.map(|it| VariantMaterial { primitive: index, ..it.clone() }).collect();
        self.scene.variant_materials.extend(variants);
        self.mirrored.insert(primitive, index);
        Ok(index)
    }

    fn push_primitive(
        &mut self,
        primitive: Primitive,
        needs: Needs,
        pointer: &str,
    ) -> Result<usize, SceneError> {
        self.vertex_count += primitive.vertices.len();
        self.index_count += primitive.indices.len();
        for (what, count, limit) in [
            ("vertices", self.vertex_count, limits::VERTEX_COUNT_MAX),
            ("indices", self.index_count, limits::INDEX_COUNT_MAX),
        ] {
            if count > limit {
                return Err(SceneError::new(
                    pointer,
                    format!("{count} {what} so far exceed the limit of {limit}"),
                ));
            }
        }
        self.needs.push(needs);
        self.scene.primitives.push(primitive);
        Ok(self.scene.primitives.len() - 1)
    }

    fn note_missing_uvs(&mut self, primitive: &schema::Primitive, needs: Needs, pointer: &str) {
        for set in 0..2 {
            let name = format!("TEXCOORD_{set}");
            if needs.uv[set] && !primitive.attributes.contains_key(&name) {
                self.notes.push(format!("{pointer}: its material's textures want {name}, which it lacks"));
            }
        }
    }

    /// The largest value of its type in an index means a new strip to a GPU, which glTF does not have.
    fn note_restart(&mut self, primitive: &schema::Primitive, indices: &[u32], pointer: &str) {
        let accessor = primitive.indices.and_then(|index| self.data.root.accessors.get(index));
        let largest = match accessor.map(|accessor| accessor.component_type) {
            Some(5121) => u32::from(u8::MAX),
            Some(5123) => u32::from(u16::MAX),
            _ => return,
        };
        if indices.contains(&largest) {
            self.notes.push(format!("{pointer}/indices: {largest} is reserved; it was read as a vertex"));
        }
    }
}
