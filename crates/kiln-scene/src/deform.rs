//! Morphing and skinning: what vertices have for it, and the arithmetic in `f64`: the twin of a vertex shader.
//!
//! A vertex is morphed first and skinned then (glTF 2.0, sections 3.7.2.2 and 3.7.3.3):
//!
//! ```text
//! p' = M (p + Σ w_t Δp_t),   n' = C (n + Σ w_t Δn_t),   t' = L (t + Σ w_t Δt_t),   M = Σ w_j J_j
//! ```
//!
//! J_j: skin space to world, by [`crate::Posed::skins`]; L: the upper 3×3 of M; C: its cofactors, which do for normals
//! what the inverse transpose does and exist for singular matrices too. Normals and tangents end at unit length.

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DMat4, DVec3, Mat4};

use crate::{Primitive, Vertex};

/// The joints that a vertex hangs on; unused places are joint 0 with weight 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Influence {
    /// Indices into [`crate::Skin::joints`].
    pub joints: [u16; 4],
    /// Shares of 1, none negative.
    pub weights: [f32; 4],
}

/// What one morph weight adds to a primitive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphTarget {
    /// One entry a vertex.
    pub deltas: Vec<MorphDelta>,
}

/// What a weight of 1 adds to a vertex.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct MorphDelta {
    /// Object space.
    pub position: [f32; 3],
    /// Added to a unit normal.
    pub normal: [f32; 3],
    /// Added to a unit tangent; the handedness stays.
    pub tangent: [f32; 3],
}

/// A vertex after morphing or skinning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deformed {
    /// Object space; world space once skinned.
    pub position: DVec3,
    /// Unit length, or zero where there is no direction left.
    pub normal: DVec3,
    /// Unit length, or zero where there is no direction left.
    pub tangent: DVec3,
}

impl Primitive {
    /// Vertex `index` by `weights`, one for each target.
    pub fn morphed_vertex(&self, index: usize, weights: &[f32]) -> Deformed {
        let Vertex { position, normal, tangent: [x, y, z, _], .. } = self.vertices[index];
        let (mut position, mut normal, mut tangent) = (wide(position), wide(normal), wide([x, y, z]));
        for (target, &weight) in self.targets.iter().zip(weights) {
            let (delta, weight) = (&target.deltas[index], f64::from(weight));
            position += weight * wide(delta.position);
            normal += weight * wide(delta.normal);
            tangent += weight * wide(delta.tangent);
        }
        Deformed { position, normal: normal.normalize_or_zero(), tangent: tangent.normalize_or_zero() }
    }

    /// Vertex `index` morphed, then skinned by `joints` (skin space to world) if it hangs on any.
    pub fn deformed_vertex(&self, index: usize, weights: &[f32], joints: &[Mat4]) -> Deformed {
        let morphed = self.morphed_vertex(index, weights);
        match self.influences.get(index) {
            Some(influence) if !joints.is_empty() => skinned_vertex(&morphed, influence, joints),
            _ => morphed,
        }
    }
}

/// A vertex moved by the joints (skin space to world) that it hangs on.
pub fn skinned_vertex(vertex: &Deformed, influence: &Influence, joints: &[Mat4]) -> Deformed {
    let mut blend = DMat4::ZERO;
    for (&joint, &weight) in influence.joints.iter().zip(&influence.weights) {
        blend += joints[usize::from(joint)].as_dmat4() * f64::from(weight);
    }
    let linear = DMat3::from_mat4(blend);
    Deformed {
        position: blend.transform_point3(vertex.position),
        normal: (cofactor(linear) * vertex.normal).normalize_or_zero(),
        tangent: (linear * vertex.tangent).normalize_or_zero(),
    }
}

/// Moves a vertex and what morph weights add to it; normals and tangents that are absent keep their neutral values.
pub(crate) fn move_vertex<'a>(
    vertex: &mut Vertex,
    deltas: impl Iterator<Item = &'a mut MorphDelta>,
    matrix: DMat4,
    has_normal: bool,
    has_tangent: bool,
) {
    vertex.position = narrow(matrix.transform_point3(wide(vertex.position)));
    let linear = DMat3::from_mat4(matrix);
    let [x, y, z, handedness] = vertex.tangent;
    let (normal, tangent) = (cofactor(linear) * wide(vertex.normal), linear * wide([x, y, z]));
    if has_normal {
        vertex.normal = narrow(normal.normalize_or_zero());
    }
    if has_tangent {
        let [x, y, z] = narrow(tangent.normalize_or_zero());
        vertex.tangent = [x, y, z, handedness];
    }
    for delta in deltas {
        delta.position = narrow(linear * wide(delta.position));
        // What is added shrinks as much as what it is added to.
        delta.normal = narrow(cofactor(linear) * wide(delta.normal) / scale_of(normal));
        delta.tangent = narrow(linear * wide(delta.tangent) / scale_of(tangent));
    }
}

fn scale_of(vector: DVec3) -> f64 {
    let length = vector.length();
    if length > 0.0 { length } else { 1.0 }
}

/// Transforms normals like the inverse transpose, but exists for singular matrices too.
fn cofactor(m: DMat3) -> DMat3 {
    let cofactor =
        DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    if m.determinant() < 0.0 { -cofactor } else { cofactor }
}

fn wide(values: [f32; 3]) -> DVec3 {
    DVec3::from_array(values.map(f64::from))
}

fn narrow(vector: DVec3) -> [f32; 3] {
    vector.to_array().map(|value| value as f32)
}
