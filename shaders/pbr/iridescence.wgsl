// A thin film on the base. KHR_materials_iridescence.

import lib::brdf::{f0_of_schlick, f_schlick};
import lib::iridescence::f_iridescence;
import lib::material::texture_coordinate;
import super::interface::{base_color_sampler, material, Varying};

@group(1) @binding(28) var iridescence_texture: texture_2d<f32>;
@group(1) @binding(29) var iridescence_thickness_texture: texture_2d<f32>;

struct Film {
    weight: f32,
    thickness_nm: f32,
}

fn film(in: Varying) -> Film {
    let uv = texture_coordinate(material.iridescence_uv_u, material.iridescence_uv_v, in.uv0, in.uv1);
    let weight = material.iridescence_factor * textureSample(iridescence_texture, base_color_sampler, uv).r;
    let thickness_uv = texture_coordinate(
        material.iridescence_thickness_uv_u,
        material.iridescence_thickness_uv_v,
        in.uv0,
        in.uv1,
    );
    let texel = textureSample(iridescence_thickness_texture, base_color_sampler, thickness_uv);
    let thickness_nm = mix(material.iridescence_thickness_minimum, material.iridescence_thickness_maximum, texel.g);
    return Film(saturate(weight), thickness_nm);
}

// The film's reflectance where light comes from one direction.
fn iridescent_reflectance(film: Film, f0: vec3f, f90: f32, v_dot_h: f32) -> vec3f {
    let reflectance = f_iridescence(v_dot_h, f0, material.iridescence_ior, film.thickness_nm);
    return mix(f_schlick(f0, f90, v_dot_h), reflectance, film.weight);
}

// The f0 with which Schlick's term gives the film's reflectance at this view: the split sum takes it from there.
fn iridescent_f0(film: Film, f0: vec3f, f90: f32, n_dot_v: f32) -> vec3f {
    let reflectance = f_iridescence(n_dot_v, f0, material.iridescence_ior, film.thickness_nm);
    return mix(f0, f0_of_schlick(reflectance, f90, n_dot_v), film.weight);
}
