// Brushed surfaces. KHR_materials_anisotropy.

import lib::anisotropy::anisotropic_normal;
import lib::material::texture_coordinate;
import lib::sampling::orthonormal_basis;
import lib::vector::normalize_or;
import super::interface::{base_color_sampler, material, Varying};

@group(1) @binding(27) var anisotropy_texture: texture_2d<f32>;

// The frame that the surface is brushed in.
struct Brush {
    // Tangent along the brush, bitangent, normal; any frame around the normal where the mesh has no tangents.
    frame: mat3x3f,
    strength: f32,
}

fn brush(in: Varying, normal: vec3f) -> Brush {
    let uv = texture_coordinate(material.anisotropy_uv_u, material.anisotropy_uv_v, in.uv0, in.uv1);
    // Red and green hold the brush's direction in the tangent frame, blue how strong it is.
    let texel = textureSample(anisotropy_texture, base_color_sampler, uv);
    let direction = texel.rg * 2.0 - 1.0;
    let turn = vec2f(cos(material.anisotropy_rotation), sin(material.anisotropy_rotation));
    let along = vec2f(turn.x * direction.x - turn.y * direction.y, turn.y * direction.x + turn.x * direction.y);
    let t = in.tangent.xyz;
    let b = in.tangent.w * cross(in.normal, t);
    let across = normalize_or(cross(normal, along.x * t + along.y * b), vec3f(0.0));
    if dot(across, across) == 0.0 {
        return Brush(orthonormal_basis(normal), 0.0);
    }
    let strength = saturate(material.anisotropy_strength * texel.b);
    return Brush(mat3x3f(cross(across, normal), across, normal), strength);
}

// The normal that mirror directions are taken at.
fn brushed_normal(brush: Brush, view: vec3f, perceptual_roughness: f32) -> vec3f {
    return anisotropic_normal(brush.frame[2], brush.frame[1], view, brush.strength, perceptual_roughness);
}
