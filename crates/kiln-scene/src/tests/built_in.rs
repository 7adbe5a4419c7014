//! The shapes that are shown where there is no scene.

use glam::Vec3;

use crate::{BUILT_IN, built_in, load, pack};

#[test]
fn built_in_shapes_stand_on_the_ground_with_true_normals_and_coordinates() {
    for name in BUILT_IN {
        let packed = pack(name, &built_in(name).expect("it is in the list"), &mut |_| None);
        assert_eq!(packed.diagnostics, vec![], "{name}");
        assert_eq!(packed.effects[0].variant_name(), "base", "{name} is drawn with the plainest variant");
        let scene = load(&packed.glb.expect("it can be drawn")).expect("what was packed loads");
        let bounds = scene.bounds.expect("there is something");
        assert!((-0.2..=1e-6).contains(&bounds.min.y), "{name}: {bounds:?}");
        let primitive = &scene.primitives[0];
        let point = |index: u32| Vec3::from(primitive.vertices[index as usize].position);
        for corners in primitive.indices.chunks_exact(3) {
            let face = (point(corners[1]) - point(corners[0])).cross(point(corners[2]) - point(corners[0]));
            for corner in corners {
                let normal = Vec3::from(primitive.vertices[*corner as usize].normal);
                assert!(normal.dot(face.normalize()) > 0.8, "{name}: {normal} on a face towards {face}");
            }
        }
        let coordinates = || primitive.vertices.iter().flat_map(|vertex| vertex.uv0);
        let (least, greatest) = (coordinates().fold(1.0, f32::min), coordinates().fold(0.0, f32::max));
        assert_eq!((least, greatest), (0.0, 1.0), "{name}");
    }
    assert_eq!(built_in("teapot"), None);
}
