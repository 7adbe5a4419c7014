// The environment as a camera at its centre sees it. The preview draws pbr/background.wgsl; this pass needs no pipeline
// but compute, for pictures of what was baked.

import super::source::environment_radiance;

struct Settings {
    // Of a camera at the origin: turns clip-space positions into directions.
    world_from_clip: mat4x4f,
    // Level of the map that is read.
    level: f32,
}

@group(0) @binding(0) var picture: texture_storage_2d<rgba32float, write>;
@group(0) @binding(3) var<uniform> settings: Settings;

// Direction through a pixel's centre, of any length; pixel rows go down, clip space goes up.
fn pixel_direction(pixel: vec2u, size: vec2u) -> vec3f {
    let at = (vec2f(pixel) + 0.5) / vec2f(max(size, vec2u(1u)));
    let far = settings.world_from_clip * vec4f(2.0 * at.x - 1.0, 1.0 - 2.0 * at.y, 1.0, 1.0);
    return far.xyz;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(picture);
    if all(id.xy < size) {
        let radiance = environment_radiance(pixel_direction(id.xy, size), settings.level);
        textureStore(picture, id.xy, vec4f(radiance, 1.0));
    }
}
