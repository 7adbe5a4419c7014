//! Frames, layouts of the sphere, and meshes that are hardly any.

use kiln_bake::Lobe;
use kiln_brdf::sampling::orthonormal_basis;
use kiln_sphere::{cube_direction, cube_face_st, panorama_direction, panorama_uv};
use serde_json::{Value, json};

use crate::maps::{Random, baked, panorama, sky};
use crate::record::{hold, hold_wgsl, relative, worst};
use crate::support::{Comparison, first_infinite, gpu, grid, with_directions};

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[test]
fn basis_at_both_poles_is_orthonormal() {
    let mut random = Random(7);
    let mut normals = vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, -0.0]];
    normals.pop();
    for _ in 0..1000 {
        let tilt = random.between(1e-300, 1e-3);
        let sign = if random.bits() & 1 == 0 { 1.0 } else { -1.0 };
        normals.push([tilt, -0.5 * tilt, sign * (1.0 - 1.25 * tilt * tilt).sqrt()]);
        normals.push(random.direction());
    }
    let error = |normal: &[f64; 3]| {
        let [t, b] = orthonormal_basis(*normal);
        let products = [dot(t, b), dot(t, *normal), dot(b, *normal), dot(t, t) - 1.0, dot(b, b) - 1.0];
        worst(products.map(f64::abs))
    };
    hold("basis_at_both_poles_is_orthonormal", "f64", worst(normals.iter().map(error)));
    let basis = Comparison {
        function: "lib::sampling::orthonormal_basis",
        call: "vec4f(orthonormal_basis(a.xyz)[u32(a.w)], 0.0)",
        arguments: [
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
            [1e-20, 0.0, -1.0],
            [-1e-4, 1e-4, -1.0],
            [1e-4, 0.0, 1.0],
        ]
        .iter()
        .flat_map(|&[x, y, z]| [0.0, 1.0].map(|which| [x, y, z, which, 0.0, 0.0, 0.0, 0.0]))
        .collect(),
        truth: |a| {
            let [x, y, z] = orthonormal_basis([a[0], a[1], a[2]])[a[3] as usize];
            [x, y, z, 0.0]
        },
        wrong: |a| {
            let [x, y, z] = orthonormal_basis([a[0], a[1], -a[2]])[a[3] as usize];
            [x, y, z, 0.0]
        },
        tolerance: 1e-6,
        least: 1.0,
    };
    hold_wgsl("basis_at_both_poles_is_orthonormal", &[basis]);
}

#[test]
fn reflection_at_grazing_views_has_a_direction() {
    let Some(gpu) = gpu() else { return };
    // View and light opposite each other, along the surface: their sum has no length.
    let arguments = grid(&[&[1.0, -1.0], &[0.0, 1e-20, 1e-4], &[0.0, 1e-30, 1e-4, 1.0]]);
    let call = "vec4f(half_vector(vec3f(a.x, 0.0, a.y), vec3f(-a.x, 0.0, a.y), vec3f(0.0, 0.0, 1.0)), \
                ggx_reflected(vec3f(0.0, 0.0, 1.0), vec3f(-a.x, 0.0, a.y), vec3f(a.x, 0.0, a.y), max(a.z, 1e-4)))";
    assert_eq!(first_infinite(gpu, "lib::punctual::{ggx_reflected, half_vector}", call, &arguments), None);
    let naive = "vec4f((vec3f(a.x, 0.0, a.y) + vec3f(-a.x, 0.0, a.y)) / length(vec3f(a.x, 0.0, a.y) + vec3f(-a.x, 0.0, a.y)), 0.0)";
    assert!(first_infinite(gpu, "lib::punctual::half_vector", naive, &arguments).is_some(), "0/0 is seen");
    let views = with_directions(&[[0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0, 0.0]]);
    let bent = "vec4f(dominant_direction(a.xyz, -a.xyz, a.w), 0.0)";
    assert_eq!(first_infinite(gpu, "lib::environment::dominant_direction", bent, &views), None);
}

#[test]
fn poles_of_a_panorama_are_points() {
    let mut random = Random(8);
    let mut errors = Vec::new();
    for pole in [1.0, -1.0] {
        for u in [0.0, 0.25, 0.5, 1.0, random.unit()] {
            let v = if pole > 0.0 { 0.0 } else { 1.0 };
            let direction = panorama_direction(u, v);
            errors.push(relative(direction[1], pole, 1.0));
            errors.push(direction[0].abs().max(direction[2].abs()));
        }
        let [u, v] = panorama_uv([0.0, pole, 0.0]);
        assert_eq!([u, v], [0.5, if pole > 0.0 { 0.0 } else { 1.0 }], "atan2(0, 0) is no position");
        assert!(panorama_uv([1e-320, pole, -1e-320]).iter().all(|x| (0.0..=1.0).contains(x)));
    }
    hold("poles_of_a_panorama_are_points", "f64", worst(errors));
}

#[test]
fn wrap_column_continues() {
    let mut random = Random(9);
    let mut errors = Vec::new();
    for _ in 0..1000 {
        let (v, beyond) = (random.between(0.01, 0.99), random.between(1e-15, 1e-6));
        let [left, right] = [1.0 - beyond, 1.0 + beyond].map(|u| panorama_direction(u, v));
        let apart = worst((0..3).map(|i| (left[i] - right[i]).abs()));
        assert!(apart <= 13.0 * beyond + 1e-15, "{beyond}: the two sides of the wrap are {apart} apart");
        let [u, back] = panorama_uv(panorama_direction(beyond, v));
        errors.push(relative(u.min(1.0 - u), beyond, 1e-3));
        errors.push(relative(back, v, 1.0));
    }
    hold("wrap_column_continues", "f64", worst(errors));
    // A map of a sky that is continuous has no seam where the panorama wraps, towards +Z.
    let map = baked(&panorama(64, sky), Lobe::Ggx { alpha: 0.04 }, 32, 1e-4);
    let middle = |x: usize| f64::from(map.cube.texel(4, x, 16)[0]);
    let step = |x: usize| (middle(x + 1) - middle(x)).abs();
    assert!(step(15) <= 1.5 * step(12).max(step(18)), "{} beside {} and {}", step(15), step(12), step(18));
}

#[test]
fn edges_and_corners_of_a_cube_come_back_and_show_no_seam() {
    let mut random = Random(10);
    let mut errors = Vec::new();
    for face in 0..6 {
        for _ in 0..200 {
            let near = 1.0 - random.between(1e-16, 1e-3);
            for (s, t) in
                [(near, random.unit()), (-near, near), (random.unit() - 0.5, -near), (1.0, 1.0), (-1.0, 0.3)]
            {
                let direction = cube_direction(face, s, t);
                let (found, [s2, t2]) = cube_face_st(direction);
                let back = cube_direction(found, s2, t2);
                errors.push(worst((0..3).map(|i| (back[i] - direction[i]).abs())));
            }
        }
    }
    hold("edges_and_corners_of_a_cube_come_back_and_show_no_seam", "f64", worst(errors));
    let map = baked(&panorama(64, sky), Lobe::Ggx { alpha: 0.09 }, 32, 1e-4);
    for (faces, seam) in kiln_check::cube_edges(&map.cube, None) {
        assert!(seam.across <= 2.0 * seam.beside, "{faces}: {seam:?}");
    }
    let turned = cube_with_turned_face(&map.cube);
    let is_seam = |(_, seam): &(String, kiln_check::Seam)| seam.across > 2.0 * seam.beside;
    assert!(kiln_check::cube_edges(&turned, None).iter().any(is_seam), "the check sees a turned face");
}

fn cube_with_turned_face(cube: &kiln_image::Cube) -> kiln_image::Cube {
    let mut turned = cube.clone();
    let stride = cube.face(0).len();
    let face: Vec<f32> = cube.face(4).chunks_exact(3).rev().flatten().copied().collect();
    turned.rgb[4 * stride..5 * stride].copy_from_slice(&face);
    turned
}

/// A .gltf of one mesh, its numbers embedded, and what is put on its node.
fn gltf(
    positions: &[[f32; 3]],
    normals: Option<&[[f32; 3]]>,
    uvs: Option<&[[f32; 2]]>,
    node: Value,
) -> (Vec<u8>, Vec<u8>) {
    let mut bin: Vec<u8> = Vec::new();
    let (mut views, mut accessors) = (Vec::new(), Vec::new());
    let mut add = |values: Vec<f32>, kind: &str, width: usize| {
        let start = bin.len();
        values.iter().for_each(|value| bin.extend_from_slice(&value.to_le_bytes()));
        views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": bin.len() - start}));
        accessors.push(json!({"bufferView": views.len() - 1, "componentType": 5126, "type": kind, "count": values.len() / width}));
        accessors.len() - 1
    };
    let mut attributes = json!({"POSITION": add(positions.concat(), "VEC3", 3)});
    if let Some(normals) = normals {
        attributes["NORMAL"] = json!(add(normals.concat(), "VEC3", 3));
    }
    if let Some(uvs) = uvs {
        attributes["TEXCOORD_0"] = json!(add(uvs.concat(), "VEC2", 2));
    }
    let mut nodes = node;
    nodes["mesh"] = json!(0);
    let root = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [nodes],
        "meshes": [{"primitives": [{"attributes": attributes}]}],
        "accessors": accessors, "bufferViews": views, "buffers": [{"uri": "a.bin", "byteLength": bin.len()}],
    });
    (root.to_string().into_bytes(), bin)
}

/// The scene as it is drawn: no vertex, matrix or normal of it may be anything but a number.
#[track_caller]
fn drawn((text, bin): (Vec<u8>, Vec<u8>)) -> kiln_scene::Scene {
    let packed = kiln_scene::pack("scenes/test.gltf", &text, &mut |_| Some(bin.as_slice().into()));
    let said: Vec<String> = packed.diagnostics.iter().map(ToString::to_string).collect();
    let scene = kiln_scene::load(&packed.glb.unwrap_or_else(|| panic!("not packed: {said:#?}"))).unwrap();
    for primitive in &scene.primitives {
        for vertex in &primitive.vertices {
            let length: f32 = vertex.normal.iter().map(|x| x * x).sum();
            assert!((length - 1.0).abs() <= 1e-4, "normal {:?}", vertex.normal);
            assert!(vertex.tangent.iter().chain(&vertex.position).all(|x| x.is_finite()), "{vertex:?}");
        }
    }
    for draw in &scene.draws {
        assert!(draw.world.is_finite() && draw.world.determinant() > 0.0, "{:?}", draw.world);
    }
    scene
}

const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
const UVS: [[f32; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];

#[test]
fn degenerate_triangles_have_normals_and_tangents() {
    let line = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
    let point = [[1.0f32; 3]; 3];
    let sliver = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1e-30, 0.0]];
    for bad in [line, point, sliver] {
        let corners = [&TRIANGLE[..], &bad[..]].concat();
        let scene = drawn(gltf(&corners, None, Some(&[UVS, UVS].concat()), json!({})));
        assert!(scene.primitives[0].indices.len() >= 3, "the sound triangle stays");
    }
}

#[test]
fn normals_and_tangents_of_no_length_are_replaced() {
    let normals = [[0.0; 3], [0.0, 0.0, 1e-30], [f32::NAN, 0.0, f32::INFINITY]];
    let scene = drawn(gltf(&TRIANGLE, Some(&normals), Some(&UVS), json!({})));
    let vertices = &scene.primitives[0].vertices;
    let is_up = |normal: [f32; 3]| (normal[2] - 1.0).abs() < 1e-6;
    assert!(vertices.iter().all(|vertex| is_up(vertex.normal)), "of the triangle: {vertices:?}");
    // Texture coordinates that do not span a plane give no tangent of their own.
    drawn(gltf(&TRIANGLE, Some(&[[0.0, 0.0, 1.0]; 3]), Some(&[[0.5; 2]; 3]), json!({})));
    let wgsl = Comparison {
        function: "lib::vector::normalize_or",
        call: "vec4f(normalize_or(a.xyz * a.w, vec3f(0.0, 1.0, 0.0)), 0.0)",
        arguments: with_directions(&[
            [0.0; 5],
            [1e-20, 0.0, 0.0, 0.0, 0.0],
            [1e-12, 0.0, 0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0, 0.0, 0.0],
        ]),
        truth: |a| {
            let [x, y, z] =
                if a[3] < 1e-15 { [0.0, 1.0, 0.0] } else { crate::support::unit([a[0], a[1], a[2]]) };
            [x, y, z, 0.0]
        },
        wrong: |a| {
            let [x, y, z] = crate::support::unit([a[0], a[1], a[2]]);
            [x, y, z, 0.0]
        },
        tolerance: 1e-6,
        least: 1.0,
    };
    hold_wgsl("normals_and_tangents_of_no_length_are_replaced", &[wgsl]);
}

#[test]
fn mirrored_texture_coordinates_turn_the_bitangent_only() {
    let frame = |uvs: [[f32; 2]; 3]| {
        let scene = drawn(gltf(&TRIANGLE, None, Some(&uvs), json!({})));
        let vertex = scene.primitives[0].vertices[0];
        (vertex.normal, vertex.tangent)
    };
    let mirrored = UVS.map(|[u, v]| [1.0 - u, v]);
    let ((normal, tangent), (same_normal, turned)) = (frame(UVS), frame(mirrored));
    assert_eq!(normal, same_normal);
    assert!(tangent[3].abs() <= 1.0 && turned[3].abs() <= 1.0, "{tangent:?} {turned:?}");
}

#[test]
fn zero_and_negative_scales_are_drawn_with_true_normals() {
    let mut random = Random(11);
    let mut scales =
        vec![[1.0, 1.0, 0.0], [-1.0, 1.0, 1.0], [-1.0, -1.0, -1.0], [1e-20, 1.0, 1.0], [1e20, 1e20, 1e20]];
    scales.push([-random.between(1e-6, 1e6), random.between(1e-6, 1e6), 1.0]);
    for scale in scales {
        let scene = drawn(gltf(&TRIANGLE, Some(&[[0.0, 0.0, 1.0]; 3]), None, json!({"scale": scale})));
        assert!(!scene.draws.is_empty(), "{scale:?}");
    }
    // Of nothing there is nothing to draw, or something that is finite.
    drawn(gltf(&TRIANGLE, Some(&[[0.0, 0.0, 1.0]; 3]), None, json!({"scale": [0.0, 0.0, 0.0]})));
}

#[test]
fn vertices_that_are_no_numbers_are_left_out() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let broken = [[0.0, bad, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let scene = drawn(gltf(&[&TRIANGLE[..], &broken[..]].concat(), None, None, json!({})));
        assert_eq!(scene.primitives[0].indices.len(), 3, "{bad}: the sound triangle alone");
    }
}
