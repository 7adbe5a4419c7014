//! The names that Kiln fills by, and the bind group of each: the table of `docs/shader-interface.md`.

/// Bind groups by how often they are filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// Once per frame.
    Frame,
    /// Once per material.
    Material,
    /// Once per draw.
    Draw,
    /// The shader's own parameters.
    Params,
}

/// All groups, by number.
pub const GROUPS: [Group; 4] = [Group::Frame, Group::Material, Group::Draw, Group::Params];

impl Group {
    /// `@group`.
    pub fn number(self) -> u32 {
        match self {
            Group::Frame => 0,
            Group::Material => 1,
            Group::Draw => 2,
            Group::Params => 3,
        }
    }

    /// The uniform that holds the group's loose members.
    pub fn block(self) -> &'static str {
        match self {
            Group::Frame => "frame",
            Group::Material => "material",
            Group::Draw => "draw",
            Group::Params => "params",
        }
    }
}

/// Members of the uniform `frame`.
pub const FRAME_MEMBERS: [&str; 13] = [
    "clip_from_world",
    "world_from_clip",
    "camera_position",
    "exposure",
    "environment_from_world",
    "environment_intensity",
    "specular_level_max",
    "skybox_scale",
    "irradiance_scale",
    "specular_scale",
    "background_blur",
    "viewport_size",
    "time_s",
];

/// Members of the uniform `material`, besides `X_uv_u` and `X_uv_v`.
pub const MATERIAL_MEMBERS: [&str; 28] = [
    "base_color_factor",
    "metallic_factor",
    "roughness_factor",
    "emissive_factor",
    "normal_scale",
    "occlusion_strength",
    "alpha_cutoff",
    "ior",
    "specular_factor",
    "specular_color_factor",
    "clearcoat_factor",
    "clearcoat_roughness_factor",
    "clearcoat_normal_scale",
    "sheen_color_factor",
    "sheen_roughness_factor",
    "transmission_factor",
    "anisotropy_strength",
    "anisotropy_rotation",
    "iridescence_factor",
    "iridescence_ior",
    "iridescence_thickness_minimum",
    "iridescence_thickness_maximum",
    "thickness_factor",
    "attenuation_distance",
    "attenuation_color",
    "dispersion",
    "diffuse_transmission_factor",
    "diffuse_transmission_color_factor",
];

/// Members of the uniform `draw`.
pub const DRAW_MEMBERS: [&str; 2] = ["world_from_object", "world_from_object_normal"];

/// The X of `X_texture`, `X_sampler`, `X_uv_u` and `X_uv_v`.
pub const MATERIAL_TEXTURES: [&str; 19] = [
    "base_color",
    "metallic_roughness",
    "normal",
    "occlusion",
    "emissive",
    "clearcoat",
    "clearcoat_roughness",
    "clearcoat_normal",
    "sheen_color",
    "sheen_roughness",
    "specular",
    "specular_color",
    "transmission",
    "anisotropy",
    "iridescence",
    "iridescence_thickness",
    "thickness",
    "diffuse_transmission",
    "diffuse_transmission_color",
];

/// Textures and samplers of the frame.
pub const FRAME_RESOURCES: [&str; 10] = [
    "env_skybox",
    "env_irradiance",
    "env_specular",
    "env_sheen",
    "lut_ggx",
    "lut_charlie",
    "hdr_color",
    "scene_color",
    "env_sampler",
    "lut_sampler",
];

/// The group of a uniform value.
pub fn group_of_member(name: &str) -> Group {
    let placement = ["_uv_u", "_uv_v"].iter().find_map(|end| name.strip_suffix(end));
    if FRAME_MEMBERS.contains(&name) {
        Group::Frame
    } else if MATERIAL_MEMBERS.contains(&name) || placement.is_some_and(|x| MATERIAL_TEXTURES.contains(&x)) {
        Group::Material
    } else if DRAW_MEMBERS.contains(&name) {
        Group::Draw
    } else {
        Group::Params
    }
}

/// The group of a texture, a sampler or a whole block.
pub fn group_of_resource(name: &str) -> Group {
    let material = ["_texture", "_sampler"].iter().find_map(|end| name.strip_suffix(end));
    let block = GROUPS.into_iter().find(|group| group.block() == name);
    if FRAME_RESOURCES.contains(&name) || name.starts_with("env_") || name.starts_with("lut_") {
        Group::Frame
    } else if material.is_some_and(|x| MATERIAL_TEXTURES.contains(&x)) {
        Group::Material
    } else {
        block.unwrap_or(Group::Params)
    }
}

/// The sampler that goes with a texture of a language where both are one. All environment maps share one,
/// and so do tables; pictures are read by the same clamped sampler as they.
pub fn sampler_of(texture: &str) -> String {
    if texture.starts_with("env_") {
        "env_sampler".to_owned()
    } else if texture.starts_with("lut_") || ["hdr_color", "scene_color"].contains(&texture) {
        "lut_sampler".to_owned()
    } else {
        format!("{}_sampler", texture.strip_suffix("_texture").unwrap_or(texture))
    }
}
