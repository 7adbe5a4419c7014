// Moves a vertex in its draw: morphed, then skinned, then placed as a copy. glTF 2.0, sections 3.7.2.2 and 3.7.3.3;
// EXT_mesh_gpu_instancing. Normals and tangents come out at any length.

@if(instancing || skin) import lib::vector::max_component;
@if(instancing) import super::interface::instances;
import super::interface::Vertex;

@if(skin) @group(2) @binding(1) var<storage, read> joint_matrices: array<mat4x4f>;
// For each vertex, for each weight: what a weight of 1 adds to position, normal and tangent.
@if(morph) @group(2) @binding(2) var<storage, read> morph_deltas: array<f32>;
@if(morph) @group(2) @binding(3) var<storage, read> morph_weights: array<f32>;

@if(morph)
fn morphed(source: Vertex) -> Vertex {
    var vertex = source;
    let count = arrayLength(&morph_weights);
    for (var index = 0u; index < count; index++) {
        let weight = morph_weights[index];
        // Most targets rest most of the time.
        if weight == 0.0 {
            continue;
        }
        let delta = 9u * (source.index * count + index);
        vertex.position += weight * morph_delta(delta);
        @if(!unlit) vertex.normal += weight * morph_delta(delta + 3u);
        @if((anisotropy || clearcoat || normal_map) && !unlit) vertex.tangent += vec4f(weight * morph_delta(delta + 6u), 0.0);
    }
    return vertex;
}

@if(morph)
fn morph_delta(at: u32) -> vec3f {
    return vec3f(morph_deltas[at], morph_deltas[at + 1u], morph_deltas[at + 2u]);
}

@if(skin)
fn skinned(source: Vertex) -> Vertex {
    let joints = source.joints;
    let weights = source.weights;
    let blend = weights.x * joint_matrices[joints.x] + weights.y * joint_matrices[joints.y]
        + weights.z * joint_matrices[joints.z] + weights.w * joint_matrices[joints.w];
    return moved(source, blend);
}

@if(instancing)
fn instanced(source: Vertex) -> Vertex {
    return moved(source, instances[source.instance]);
}

@if(instancing || skin)
fn moved(source: Vertex, matrix: mat4x4f) -> Vertex {
    var vertex = source;
    vertex.position = (matrix * vec4f(source.position, 1.0)).xyz;
    let linear = mat3x3f(matrix[0].xyz, matrix[1].xyz, matrix[2].xyz);
    @if(!unlit) vertex.normal = normal_matrix(linear) * source.normal;
    @if((anisotropy || clearcoat || normal_map) && !unlit) {
        let side = select(1.0, -1.0, determinant(linear) < 0.0);
        vertex.tangent = vec4f(linear * source.tangent.xyz, side * source.tangent.w);
    }
    return vertex;
}

// The inverse transpose up to a positive factor, finite for singular matrices too: cofactors with the determinant's sign.
@if((instancing || skin) && !unlit)
fn normal_matrix(linear: mat3x3f) -> mat3x3f {
    let largest = max(max_component(abs(linear[0])), max(max_component(abs(linear[1])), max_component(abs(linear[2]))));
    // Products of very small or large scales would leave the range of f32.
    let scale = 1.0 / clamp(largest, 1e-30, 1e30);
    let x = scale * linear[0];
    let y = scale * linear[1];
    let z = scale * linear[2];
    let sign = select(1.0, -1.0, dot(x, cross(y, z)) < 0.0);
    return mat3x3f(sign * cross(y, z), sign * cross(z, x), sign * cross(x, y));
}
