// Where a pass writes: the six faces of one level of a cube map, one invocation a texel and one layer of workgroups a face.

import lib::sphere::{cube_direction, cube_texel_centre};

@group(0) @binding(0) var faces: texture_storage_2d_array<rgba32float, write>;

// The last workgroups of a row reach beyond faces whose size no workgroup divides.
fn is_inside(id: vec3u) -> bool {
    return all(id < vec3u(textureDimensions(faces), 6u));
}

// (s, t) in [-1, 1]² of a texel's centre.
fn face_position(id: vec3u) -> vec2f {
    return cube_texel_centre(id.xy, textureDimensions(faces).x);
}

fn face_direction(id: vec3u) -> vec3f {
    return cube_direction(id.z, face_position(id));
}

fn store_radiance(id: vec3u, radiance: vec3f) {
    textureStore(faces, id.xy, id.z, vec4f(radiance, 1.0));
}
