//! The geometry of a pack: interleaved floats and only the attributes that something reads, joints and weights, morph
//! targets, skins, instances.

use std::collections::BTreeMap;

use crate::deform::MorphDelta;
use crate::geometry::NEUTRAL;
use crate::schema::{self, Accessor, Instancing, Mesh, Node, Primitive};
use crate::write::{FLOAT, Writer, node};
use crate::{Bounds, Draw, Effect, Material, Scene, Skin, Vertex};

const UNSIGNED_BYTE: u32 = 5121;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

impl Writer {
    pub fn mesh(&mut self, primitive: &crate::Primitive, materials: &[&Material]) {
        let columns = columns(&primitive.vertices, materials);
        let mut attributes = self.interleaved(&primitive.vertices, &columns, primitive.bounds);
        if !primitive.influences.is_empty() {
            let (joints, weights) = self.influences(primitive);
            attributes.insert("JOINTS_0".into(), joints);
            attributes.insert("WEIGHTS_0".into(), weights);
        }
        let targets = primitive.targets.iter().map(|target| self.target(&target.deltas)).collect();
        let indices = Some(self.indices(&primitive.indices, primitive.vertices.len()));
        let material = Some(primitive.material);
        let primitive = Primitive { attributes, indices, material, targets, ..Primitive::default() };
        self.root.meshes.push(Mesh { primitives: vec![primitive], weights: Vec::new() });
    }

    /// Writes columns of floats side by side; returns the accessor of each by its name.
    fn interleaved<T>(
        &mut self,
        rows: &[T],
        columns: &[Column<T>],
        positions: Bounds,
    ) -> BTreeMap<String, usize> {
        let width: usize = columns.iter().map(|column| column.width).sum();
        let view = self.view_of(Some(4 * width as u64), Some(ARRAY_BUFFER), |bin| {
            for row in rows {
                for column in columns {
                    bin.extend_from_slice(bytemuck::cast_slice(&(column.read)(row)[..column.width]));
                }
            }
        });
        let mut attributes = BTreeMap::new();
        let mut byte_offset = 0;
        for column in columns {
            let bounds = (column.name == "POSITION").then_some(positions);
            let accessor = Accessor {
                byte_offset,
                min: bounds.map(|bounds| bounds.min.to_array().to_vec()),
                max: bounds.map(|bounds| bounds.max.to_array().to_vec()),
                ..whole(view, FLOAT, rows.len(), &format!("VEC{}", column.width))
            };
            byte_offset += 4 * column.width as u64;
            attributes.insert(column.name.to_owned(), self.accessor(accessor));
        }
        attributes
    }

    /// Accessors of joints and of weights.
    fn influences(&mut self, primitive: &crate::Primitive) -> (usize, usize) {
        let influences = &primitive.influences;
        let joints = || influences.iter().flat_map(|influence| influence.joints);
        let narrow = joints().all(|joint| joint < 256);
        let (bytes, component_type) = if narrow { (4, UNSIGNED_BYTE) } else { (8, UNSIGNED_SHORT) };
        let view = self.view_of(Some(bytes), Some(ARRAY_BUFFER), |bin| {
            if narrow {
                bin.extend(joints().map(|joint| joint as u8));
            } else {
                joints().for_each(|joint| bin.extend_from_slice(&joint.to_le_bytes()));
            }
        });
        let joints = self.accessor(whole(view, component_type, influences.len(), "VEC4"));
        let view = self.view_of(Some(16), Some(ARRAY_BUFFER), |bin| {
            influences.iter().for_each(|it| bin.extend_from_slice(bytemuck::cast_slice(&it.weights)));
        });
        (joints, self.accessor(whole(view, FLOAT, influences.len(), "VEC4")))
    }

    fn target(&mut self, deltas: &[MorphDelta]) -> BTreeMap<String, usize> {
        let all: [Column<MorphDelta>; 3] = [
            Column { name: "POSITION", width: 3, read: |it| pad(it.position) },
            Column { name: "NORMAL", width: 3, read: |it| pad(it.normal) },
            Column { name: "TANGENT", width: 3, read: |it| pad(it.tangent) },
        ];
        let is_written = |column: &Column<MorphDelta>| {
            column.name == "POSITION" || deltas.iter().any(|delta| (column.read)(delta) != [0.0; 4])
        };
        let columns: Vec<_> = all.into_iter().filter(is_written).collect();
        let mut bounds = Bounds { min: glam::Vec3::INFINITY, max: glam::Vec3::NEG_INFINITY };
        for delta in deltas {
            bounds.min = bounds.min.min(delta.position.into());
            bounds.max = bounds.max.max(delta.position.into());
        }
        self.interleaved(deltas, &columns, bounds)
    }

    fn indices(&mut self, indices: &[u32], vertex_count: usize) -> usize {
        // 65535 itself is reserved for primitive restart.
        let narrow = vertex_count <= usize::from(u16::MAX);
        let view = self.view_of(None, Some(ELEMENT_ARRAY_BUFFER), |bin| {
            if narrow {
                indices.iter().for_each(|&index| bin.extend_from_slice(&(index as u16).to_le_bytes()));
            } else {
                indices.iter().for_each(|index| bin.extend_from_slice(&index.to_le_bytes()));
            }
        });
        let component_type = if narrow { UNSIGNED_SHORT } else { UNSIGNED_INT };
        self.accessor(whole(view, component_type, indices.len(), "SCALAR"))
    }

    /// A draw's node, wherever it stands.
    pub fn draw_node(&mut self, scene: &Scene, draw: &Draw) -> Node {
        let mut written = node(Some(draw.name.clone()), glam::Mat4::IDENTITY);
        written.mesh = Some(draw.primitive);
        written.skin = draw.skin;
        written.weights = draw.morph.map(|morph| scene.morphs[morph].clone());
        if !draw.instances.is_empty() {
            let instances = &draw.instances;
            let mut column = |width: usize, value: &dyn Fn(usize) -> [f32; 4]| {
                let view = self.view_of(None, None, |bin| {
                    let values = (0..instances.len()).map(value);
                    values.for_each(|it| bin.extend_from_slice(bytemuck::cast_slice(&it[..width])));
                });
                self.accessor(whole(view, FLOAT, instances.len(), &format!("VEC{width}")))
            };
            let attributes = [
                ("TRANSLATION", column(3, &|at| pad(instances[at].translation))),
                ("ROTATION", column(4, &|at| instances[at].rotation)),
                ("SCALE", column(3, &|at| pad(instances[at].scale))),
            ];
            let attributes = attributes.into_iter().map(|(name, index)| (name.to_owned(), index)).collect();
            written.extensions.instancing = Some(Instancing { attributes });
        }
        written
    }

    /// Writes skins whose joints are among the scene's nodes, which begin at `first_node`.
    pub fn skins(&mut self, skins: &[Skin], first_node: usize) {
        for skin in skins {
            let view = self.view(bytemuck::cast_slice(&skin.inverse_binds), None, None);
            let inverse_binds = self.accessor(whole(view, FLOAT, skin.inverse_binds.len(), "MAT4"));
            let joints = skin.joints.iter().map(|joint| first_node + joint).collect();
            self.root.skins.push(schema::Skin { inverse_bind_matrices: Some(inverse_binds), joints });
        }
    }
}

/// An accessor of a view from its beginning.
pub(crate) fn whole(view: usize, component_type: u32, count: usize, kind: &str) -> Accessor {
    Accessor {
        buffer_view: Some(view),
        byte_offset: 0,
        component_type,
        normalized: false,
        count: count as u64,
        kind: kind.to_owned(),
        min: None,
        max: None,
        sparse: None,
    }
}

struct Column<T> {
    name: &'static str,
    width: usize,
    read: fn(&T) -> [f32; 4],
}

/// Attributes that one of the materials reads or that differ from the neutral value. Absent normals and tangents
/// would be made up by whoever reads the pack, so they are written even where they are neutral.
fn columns(vertices: &[Vertex], materials: &[&Material]) -> Vec<Column<Vertex>> {
    let lit = materials.iter().any(|material| !material.effects.contains(&Effect::Unlit));
    let mapped = materials.iter().any(|material| {
        material.normal_texture.is_some()
            || material.clearcoat_normal_texture.is_some()
            || material.effects.contains(&Effect::Anisotropy)
    });
    let all: [(bool, Column<Vertex>); 6] = [
        (true, Column { name: "POSITION", width: 3, read: |v| pad(v.position) }),
        (lit, Column { name: "NORMAL", width: 3, read: |v| pad(v.normal) }),
        (mapped, Column { name: "TANGENT", width: 4, read: |v| v.tangent }),
        (false, Column { name: "TEXCOORD_0", width: 2, read: |v| pad(v.uv0) }),
        (false, Column { name: "TEXCOORD_1", width: 2, read: |v| pad(v.uv1) }),
        (false, Column { name: "COLOR_0", width: 4, read: |v| v.color }),
    ];
    let differs = |column: &Column<Vertex>| {
        let neutral = (column.read)(&NEUTRAL);
        vertices.iter().any(|vertex| (column.read)(vertex) != neutral)
    };
    all.into_iter().filter(|(needed, column)| *needed || differs(column)).map(|(_, column)| column).collect()
}

fn pad<const N: usize>(values: [f32; N]) -> [f32; 4] {
    let mut padded = [0.0; 4];
    padded[..N].copy_from_slice(&values);
    padded
}
