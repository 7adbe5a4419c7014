// Brushed surfaces under the environment. KHR_materials_anisotropy.

import lib::anisotropy::anisotropic_normal;
import lib::vector::normalize_or;
import super::interface::{material, Varying};

// The normal that mirror directions are taken at; `normal` itself where the mesh has no tangents.
fn brushed_normal(in: Varying, normal: vec3f, view: vec3f, perceptual_roughness: f32) -> vec3f {
    let t = in.tangent.xyz;
    let b = in.tangent.w * cross(in.normal, t);
    let brush = cos(material.anisotropy_rotation) * t + sin(material.anisotropy_rotation) * b;
    let across = normalize_or(cross(normal, brush), vec3f(0.0));
    return anisotropic_normal(normal, across, view, saturate(material.anisotropy_strength), perceptual_roughness);
}
