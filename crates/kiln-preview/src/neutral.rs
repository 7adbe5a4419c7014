//! What is bound where nothing was given: values that change as little as possible.

use kiln_scene::{AlphaMode, EffectSet, Material};
use kiln_shader::{Binding, BindingKind, EntryPoint, Reflection, Stage};

/// Radiance of the environment that stands in for an absent one: middle grey, so that shapes stay visible.
pub(crate) const RADIANCE: f32 = 0.18;

/// glTF's default material.
pub(crate) fn material() -> Material {
    Material {
        name: String::new(),
        base_color_factor: [1.0; 4],
        metallic_factor: 1.0,
        roughness_factor: 1.0,
        emissive_factor: [0.0; 3],
        normal_scale: 1.0,
        occlusion_strength: 1.0,
        ior: 1.5,
        specular_factor: 1.0,
        specular_color_factor: [1.0; 3],
        clearcoat_factor: 0.0,
        clearcoat_roughness_factor: 0.0,
        clearcoat_normal_scale: 1.0,
        sheen_color_factor: [0.0; 3],
        sheen_roughness_factor: 0.0,
        transmission_factor: 0.0,
        anisotropy_strength: 0.0,
        anisotropy_rotation: 0.0,
        iridescence_factor: 0.0,
        iridescence_ior: 1.3,
        iridescence_thickness_minimum: 100.0,
        iridescence_thickness_maximum: 400.0,
        thickness_factor: 0.0,
        attenuation_distance: f32::INFINITY,
        attenuation_color: [1.0; 3],
        dispersion: 0.0,
        diffuse_transmission_factor: 0.0,
        diffuse_transmission_color_factor: [1.0; 3],
        alpha_mode: AlphaMode::Opaque,
        double_sided: false,
        base_color_texture: None,
        metallic_roughness_texture: None,
        normal_texture: None,
        occlusion_texture: None,
        emissive_texture: None,
        clearcoat_texture: None,
        clearcoat_roughness_texture: None,
        clearcoat_normal_texture: None,
        sheen_color_texture: None,
        sheen_roughness_texture: None,
        specular_texture: None,
        specular_color_texture: None,
        transmission_texture: None,
        anisotropy_texture: None,
        iridescence_texture: None,
        iridescence_thickness_texture: None,
        thickness_texture: None,
        diffuse_transmission_texture: None,
        diffuse_transmission_color_texture: None,
        effects: EffectSet::new(),
    }
}

/// Shows linear values up to 1, for projects without a tonemap shader: one that has none still sees its scene.
pub(crate) const TONEMAP_WGSL: &str = "
@group(0) @binding(0) var hdr_color: texture_2d<f32>;

@vertex
fn vs_main(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn fs_main(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let linear = clamp(textureLoad(hdr_color, vec2i(position.xy), 0).rgb, vec3f(0.0), vec3f(1.0));
    let curve = 1.055 * pow(linear, vec3f(1.0 / 2.4)) - 0.055;
    return vec4f(select(curve, 12.92 * linear, linear <= vec3f(0.0031308)), 1.0);
}
";

/// The interface of [`TONEMAP_WGSL`].
pub(crate) fn tonemap_reflection() -> Reflection {
    let entry = |name: &str, stage| EntryPoint {
        name: name.to_owned(),
        stage,
        inputs: Vec::new(),
        workgroup_size: [0; 3],
    };
    let kind = BindingKind::Texture { dimension: "2d".into(), sample: "float".into(), multisampled: false };
    let stages = vec![Stage::Fragment];
    let hdr_color = Binding { group: 0, binding: 0, name: "hdr_color".into(), kind, stages };
    Reflection {
        entry_points: vec![entry("vs_main", Stage::Vertex), entry("fs_main", Stage::Fragment)],
        bindings: vec![hdr_color],
        ..Reflection::default()
    }
}
