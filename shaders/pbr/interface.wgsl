// What the material shader is filled with, and what passes between its stages. Docs: docs/shader-interface.md. Every member
// stands under the feature it belongs to.

struct Material {
    base_color_factor: vec4f,
    base_color_uv_u: vec4f,
    base_color_uv_v: vec4f,
    @if(alpha_mask) alpha_cutoff: f32,
    @if(!unlit) metallic_roughness_uv_u: vec4f,
    @if(!unlit) metallic_roughness_uv_v: vec4f,
    @if(!unlit) metallic_factor: f32,
    @if(!unlit) roughness_factor: f32,
    @if(normal_map && !unlit) normal_uv_u: vec4f,
    @if(normal_map && !unlit) normal_uv_v: vec4f,
    @if(normal_map && !unlit) normal_scale: f32,
    @if(occlusion && !unlit) occlusion_uv_u: vec4f,
    @if(occlusion && !unlit) occlusion_uv_v: vec4f,
    @if(occlusion && !unlit) occlusion_strength: f32,
    @if(emission && !unlit) emissive_uv_u: vec4f,
    @if(emission && !unlit) emissive_uv_v: vec4f,
    @if(emission && !unlit) emissive_factor: vec3f,
    @if((specular || transmission) && !unlit) ior: f32,
    @if(specular && !unlit) specular_uv_u: vec4f,
    @if(specular && !unlit) specular_uv_v: vec4f,
    @if(specular && !unlit) specular_color_uv_u: vec4f,
    @if(specular && !unlit) specular_color_uv_v: vec4f,
    @if(specular && !unlit) specular_color_factor: vec3f,
    @if(specular && !unlit) specular_factor: f32,
    @if(clearcoat && !unlit) clearcoat_uv_u: vec4f,
    @if(clearcoat && !unlit) clearcoat_uv_v: vec4f,
    @if(clearcoat && !unlit) clearcoat_roughness_uv_u: vec4f,
    @if(clearcoat && !unlit) clearcoat_roughness_uv_v: vec4f,
    @if(clearcoat && !unlit) clearcoat_normal_uv_u: vec4f,
    @if(clearcoat && !unlit) clearcoat_normal_uv_v: vec4f,
    @if(clearcoat && !unlit) clearcoat_factor: f32,
    @if(clearcoat && !unlit) clearcoat_roughness_factor: f32,
    @if(clearcoat && !unlit) clearcoat_normal_scale: f32,
    @if(sheen && !unlit) sheen_color_uv_u: vec4f,
    @if(sheen && !unlit) sheen_color_uv_v: vec4f,
    @if(sheen && !unlit) sheen_roughness_uv_u: vec4f,
    @if(sheen && !unlit) sheen_roughness_uv_v: vec4f,
    @if(sheen && !unlit) sheen_color_factor: vec3f,
    @if(sheen && !unlit) sheen_roughness_factor: f32,
    @if(transmission && !unlit) transmission_uv_u: vec4f,
    @if(transmission && !unlit) transmission_uv_v: vec4f,
    @if(transmission && !unlit) transmission_factor: f32,
    @if((diffuse_transmission || transmission) && volume && !unlit) thickness_uv_u: vec4f,
    @if((diffuse_transmission || transmission) && volume && !unlit) thickness_uv_v: vec4f,
    @if((diffuse_transmission || transmission) && volume && !unlit) attenuation_color: vec3f,
    @if((diffuse_transmission || transmission) && volume && !unlit) attenuation_distance: f32,
    @if((diffuse_transmission || transmission) && volume && !unlit) thickness_factor: f32,
    @if(transmission && dispersion && !unlit) dispersion: f32,
    @if(diffuse_transmission && !unlit) diffuse_transmission_uv_u: vec4f,
    @if(diffuse_transmission && !unlit) diffuse_transmission_uv_v: vec4f,
    @if(diffuse_transmission && !unlit) diffuse_transmission_color_uv_u: vec4f,
    @if(diffuse_transmission && !unlit) diffuse_transmission_color_uv_v: vec4f,
    @if(diffuse_transmission && !unlit) diffuse_transmission_color_factor: vec3f,
    @if(diffuse_transmission && !unlit) diffuse_transmission_factor: f32,
    @if(iridescence && !unlit) iridescence_uv_u: vec4f,
    @if(iridescence && !unlit) iridescence_uv_v: vec4f,
    @if(iridescence && !unlit) iridescence_thickness_uv_u: vec4f,
    @if(iridescence && !unlit) iridescence_thickness_uv_v: vec4f,
    @if(iridescence && !unlit) iridescence_factor: f32,
    @if(iridescence && !unlit) iridescence_ior: f32,
    @if(iridescence && !unlit) iridescence_thickness_minimum: f32,
    @if(iridescence && !unlit) iridescence_thickness_maximum: f32,
    @if(anisotropy && !unlit) anisotropy_uv_u: vec4f,
    @if(anisotropy && !unlit) anisotropy_uv_v: vec4f,
    @if(anisotropy && !unlit) anisotropy_strength: f32,
    @if(anisotropy && !unlit) anisotropy_rotation: f32,
}

struct Draw {
    world_from_object: mat4x4f,
    @if(!unlit) world_from_object_normal: mat4x4f,
}

@group(1) @binding(0) var<uniform> material: Material;
@group(2) @binding(0) var<uniform> draw: Draw;
// Where each copy stands in the draw.
@if(instancing) @group(2) @binding(4) var<storage, read> instances: array<mat4x4f>;

// Base colour is read through it, and so are the maps of anisotropy, iridescence, volume and diffuse transmission: backends have places
// for 16 samplers, and materials that wrap these otherwise than their base colour are rare.
@group(1) @binding(2) var base_color_sampler: sampler;

struct Vertex {
    @location(0) position: vec3f,
    @if(!unlit) @location(1) normal: vec3f,
    @location(2) uv0: vec2f,
    @location(3) uv1: vec2f,
    @if((anisotropy || clearcoat || normal_map) && !unlit) @location(4) tangent: vec4f,
    @if(vertex_color) @location(5) color: vec4f,
    @if(skin) @location(6) joints: vec4u,
    @if(skin) @location(7) weights: vec4f,
    @if(morph) @builtin(vertex_index) index: u32,
    @if(instancing) @builtin(instance_index) instance: u32,
}

struct Varying {
    @builtin(position) clip_position: vec4f,
    @location(0) world_position: vec3f,
    @if(!unlit) @location(1) normal: vec3f,
    @location(2) uv0: vec2f,
    @location(3) uv1: vec2f,
    @if((anisotropy || clearcoat || normal_map) && !unlit) @location(4) tangent: vec4f,
    @if(vertex_color) @location(5) color: vec4f,
    @if(instancing && (diffuse_transmission || transmission) && volume && !unlit) @location(6) @interpolate(flat, either) instance: u32,
}
