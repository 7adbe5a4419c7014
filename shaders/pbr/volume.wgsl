// What a medium swallows of the light that passes it. KHR_materials_volume.

import lib::material::texture_coordinate;
import lib::vector::normalize_or;
import lib::volume::volume_attenuation;
import super::interface::{base_color_sampler, draw, material, Varying};
@if(instancing) import super::interface::instances;

@group(1) @binding(30) var thickness_texture: texture_2d<f32>;

// World units through the medium below a point.
fn medium_depth(in: Varying, normal: vec3f) -> f32 {
    let uv = texture_coordinate(material.thickness_uv_u, material.thickness_uv_v, in.uv0, in.uv1);
    let thickness = material.thickness_factor * textureSample(thickness_texture, base_color_sampler, uv).g;
    return thickness * object_scale_along(in, normal);
}

// Share of light left after that way.
fn medium_transmittance(depth: f32) -> vec3f {
    return volume_attenuation(depth, material.attenuation_color, material.attenuation_distance);
}

// World units to one of the object's, along a world normal: thickness is given in the object's units, distances in the world's.
fn object_scale_along(in: Varying, normal: vec3f) -> f32 {
    var m = draw.world_from_object;
    @if(instancing) m = m * instances[in.instance];
    let linear = mat3x3f(m[0].xyz, m[1].xyz, m[2].xyz);
    // A normal goes back to the object by the transpose.
    return length(linear * normalize_or(transpose(linear) * normal, vec3f(0.0)));
}
