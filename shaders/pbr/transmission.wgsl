// What shines through from behind: the opaque scene, and through its gaps the environment. KHR_materials_transmission.

import lib::environment::specular_radiance;
import lib::frame::{frame, lut_sampler, scene_color};
import lib::material::texture_coordinate;
import lib::volume::roughness_refracted;
import super::interface::{material, Varying};

@group(1) @binding(25) var transmission_texture: texture_2d<f32>;
@group(1) @binding(26) var transmission_sampler: sampler;

// Where light leaves the eye's view to come back from behind. Directions have unit length.
struct Entry {
    position: vec3f,
    normal: vec3f,
    view: vec3f,
    perceptual_roughness: f32,
    // World units through the medium; a thin wall has none and bends nothing.
    @if(volume) depth: f32,
}

fn transmission(in: Varying) -> f32 {
    let uv = texture_coordinate(material.transmission_uv_u, material.transmission_uv_v, in.uv0, in.uv1);
    return saturate(material.transmission_factor * textureSample(transmission_texture, transmission_sampler, uv).r);
}

// Approximate: one refraction, on the way in; what lies behind is looked up where the way out is on the screen.
fn transmitted_radiance(entry: Entry, ior: f32) -> vec3f {
    // ior 0 stands for a perfect mirror (KHR_materials_ior); below 1 light may not enter at all.
    let medium = max(ior, 1.0);
    let roughness = roughness_refracted(entry.perceptual_roughness, medium);
    @if(volume) let direction = refract(-entry.view, entry.normal, 1.0 / medium);
    @else let direction = -entry.view;
    var exit = entry.position;
    @if(volume) exit += entry.depth * direction;
    let scene = scene_behind(exit, roughness);
    return scene.rgb + (1.0 - scene.a) * specular_radiance(direction, roughness);
}

// The opaque scene around the pixel where a point of the world is seen, times the share that it covers (alpha); nothing beside the
// picture and behind the eye. Rougher surfaces read smaller levels, as wide on the screen as Khronos' sample viewer makes them.
fn scene_behind(point: vec3f, perceptual_roughness: f32) -> vec4f {
    let clip = frame.clip_from_world * vec4f(point, 1.0);
    // Also false for what is no number.
    if !(clip.w > 1e-6) {
        return vec4f(0.0);
    }
    let uv = vec2f(0.5) + vec2f(0.5, -0.5) * clip.xy / max(clip.w, 1e-6);
    if any(uv < vec2f(0.0)) || any(uv > vec2f(1.0)) {
        return vec4f(0.0);
    }
    let size = vec2f(textureDimensions(scene_color));
    let level = perceptual_roughness * log2(max(size.x, size.y));
    return textureSampleLevel(scene_color, lut_sampler, uv, level);
}
