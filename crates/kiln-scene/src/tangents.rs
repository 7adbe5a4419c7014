//! Tangents where a normal texture needs them and the file has none: MikkTSpace, as glTF 2.0 section
//! 3.7.2.1 recommends, with the roots and arc cosines of `libm`, for the same bits everywhere.

use bevy_mikktspace::{Geometry as Mesh, Ops, TangentSpace};

use crate::TextureRef;
use crate::shape::Geometry;

/// Sets the tangents of a geometry without shared vertices, for the UV set and placement of `normal_texture`.
pub(crate) fn generate(geometry: &mut Geometry, normal_texture: TextureRef) {
    let mut corners = Corners { geometry, placement: normal_texture };
    // The error type has no value today; a corner left without a tangent is seen to by the repair.
    if bevy_mikktspace::generate_tangents(&mut corners).is_ok() {
        geometry.has_tangents = true;
    }
}

struct Corners<'a> {
    geometry: &'a mut Geometry,
    placement: TextureRef,
}

struct LibmOps;

impl Ops for LibmOps {
    fn sqrt(x: f32) -> f32 {
        libm::sqrtf(x)
    }

    fn acos(x: f32) -> f32 {
        libm::acos(f64::from(x)) as f32
    }
}

impl Mesh<LibmOps> for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.geometry.vertices.len() / 3
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.geometry.vertices[3 * face + corner].position
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.geometry.vertices[3 * face + corner].normal
    }

    /// As the texture is looked up, with v upwards: glTF's bitangent points to where v falls.
    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        let vertex = &self.geometry.vertices[3 * face + corner];
        let [u, v] = if self.placement.uv_set == 1 { vertex.uv1 } else { vertex.uv0 };
        let place = |row: [f32; 3]| row[0] * u + row[1] * v + row[2];
        let [row_u, row_v] = self.placement.transform;
        [place(row_u), 1.0 - place(row_v)]
    }

    fn set_tangent(&mut self, tangent: Option<TangentSpace>, face: usize, corner: usize) {
        // A zero tangent is what the repair looks for.
        let tangent = tangent.map_or([0.0, 0.0, 0.0, 1.0], |space| space.tangent_encoded());
        self.geometry.vertices[3 * face + corner].tangent = tangent;
    }
}
