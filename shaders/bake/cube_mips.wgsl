// One level of a cube map from the level above it, which is twice its size: the mean of four texels, weighted by their
// solid angles. The plain mean of texture hardware gives a face's corners too much weight.

import lib::sphere::{cube_texel_centre, cube_texel_solid_angle_sr};
import super::faces::{is_inside, store_radiance};

@group(0) @binding(1) var level_above: texture_2d_array<f32>;

fn mean_above(id: vec3u) -> vec3f {
    let size = textureDimensions(level_above).x;
    var sum = vec4f(0.0);
    for (var i = 0u; i < 4u; i++) {
        let texel = 2u * id.xy + vec2u(i & 1u, i >> 1u);
        let weight = cube_texel_solid_angle_sr(cube_texel_centre(texel, size), size);
        sum += weight * vec4f(textureLoad(level_above, texel, id.z, 0).rgb, 1.0);
    }
    // No weight is 0.
    return sum.rgb / max(sum.w, 1e-30);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if is_inside(id) {
        store_radiance(id, mean_above(id));
    }
}
