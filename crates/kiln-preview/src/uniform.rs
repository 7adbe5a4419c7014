//! Uniform blocks filled by member name, as `docs/shader-interface.md` lists them.

use glam::{Mat3, Mat4, Vec3};
use kiln_scene::{AlphaMode, Material, TextureRef};
use kiln_shader::Member;

use crate::parameter::{OfferedParameter, ParameterValues};
use crate::slot::Map;
use crate::sun::SunValues;

/// A value that a uniform member can take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Value {
    F32(f32),
    Vec2([f32; 2]),
    Vec3([f32; 3]),
    Vec4([f32; 4]),
    Mat4([f32; 16]),
    U32(u32),
}

impl Value {
    /// The one WGSL type that takes it.
    pub fn wgsl_type(&self) -> &'static str {
        match self {
            Value::F32(_) => "f32",
            Value::Vec2(_) => "vec2<f32>",
            Value::Vec3(_) => "vec3<f32>",
            Value::Vec4(_) => "vec4<f32>",
            Value::Mat4(_) => "mat4x4<f32>",
            Value::U32(_) => "u32",
        }
    }

    fn bytes(&self) -> &[u8] {
        match self {
            Value::F32(value) => bytemuck::bytes_of(value),
            Value::Vec2(values) => bytemuck::cast_slice(values),
            Value::Vec3(values) => bytemuck::cast_slice(values),
            Value::Vec4(values) => bytemuck::cast_slice(values),
            Value::Mat4(values) => bytemuck::cast_slice(values),
            Value::U32(value) => bytemuck::bytes_of(value),
        }
    }
}

impl From<f32> for Value {
    fn from(value: f32) -> Self {
        Value::F32(value)
    }
}

impl From<Mat4> for Value {
    fn from(value: Mat4) -> Self {
        Value::Mat4(value.to_cols_array())
    }
}

/// What the whole frame shares.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FrameValues {
    pub clip_from_world: Mat4,
    pub camera_position: Vec3,
    pub exposure: f32,
    pub environment_from_world: Mat4,
    pub environment_intensity: f32,
    pub specular_level_max: f32,
    pub skybox_scale: f32,
    pub irradiance_scale: f32,
    pub specular_scale: f32,
    pub background_blur: f32,
    pub viewport_size: [f32; 2],
    pub time_s: f32,
    /// For the uniform `sun`.
    pub sun: SunValues,
}

impl FrameValues {
    /// The value of a member of `frame`; `None` for unknown names.
    pub fn member(&self, name: &str) -> Option<Value> {
        Some(match name {
            "clip_from_world" => self.clip_from_world.into(),
            "world_from_clip" => self.clip_from_world.inverse().into(),
            "camera_position" => Value::Vec3(self.camera_position.to_array()),
            "exposure" => self.exposure.into(),
            "environment_from_world" => self.environment_from_world.into(),
            "environment_intensity" => self.environment_intensity.into(),
            "specular_level_max" => self.specular_level_max.into(),
            "skybox_scale" => self.skybox_scale.into(),
            "irradiance_scale" => self.irradiance_scale.into(),
            "specular_scale" => self.specular_scale.into(),
            "background_blur" => self.background_blur.into(),
            "viewport_size" => Value::Vec2(self.viewport_size),
            "time_s" => self.time_s.into(),
            _ => return None,
        })
    }
}

/// What variants that show channels are told.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct InspectValues {
    pub channel: u32,
    pub radiance_max: f32,
    pub variant_color: [f32; 3],
}

impl InspectValues {
    /// The value of a member of `inspect`; `None` for unknown names.
    pub fn member(&self, name: &str) -> Option<Value> {
        match name {
            "channel" => Some(Value::U32(self.channel)),
            "radiance_max" => Some(self.radiance_max.into()),
            "variant_color" => Some(Value::Vec3(self.variant_color)),
            _ => None,
        }
    }
}

/// The value of a member of `material`; `None` for unknown names.
pub(crate) fn material_member(material: &Material, name: &str) -> Option<Value> {
    Some(match name {
        "base_color_factor" => Value::Vec4(material.base_color_factor),
        "metallic_factor" => material.metallic_factor.into(),
        "roughness_factor" => material.roughness_factor.into(),
        "emissive_factor" => Value::Vec3(material.emissive_factor),
        "normal_scale" => material.normal_scale.into(),
        "occlusion_strength" => material.occlusion_strength.into(),
        "alpha_cutoff" => alpha_cutoff(material).into(),
        "ior" => material.ior.into(),
        "specular_factor" => material.specular_factor.into(),
        "specular_color_factor" => Value::Vec3(material.specular_color_factor),
        "clearcoat_factor" => material.clearcoat_factor.into(),
        "clearcoat_roughness_factor" => material.clearcoat_roughness_factor.into(),
        "clearcoat_normal_scale" => material.clearcoat_normal_scale.into(),
        "sheen_color_factor" => Value::Vec3(material.sheen_color_factor),
        "sheen_roughness_factor" => material.sheen_roughness_factor.into(),
        "transmission_factor" => material.transmission_factor.into(),
        "anisotropy_strength" => material.anisotropy_strength.into(),
        "anisotropy_rotation" => material.anisotropy_rotation.into(),
        "iridescence_factor" => material.iridescence_factor.into(),
        "iridescence_ior" => material.iridescence_ior.into(),
        "iridescence_thickness_minimum" => material.iridescence_thickness_minimum.into(),
        "iridescence_thickness_maximum" => material.iridescence_thickness_maximum.into(),
        "thickness_factor" => material.thickness_factor.into(),
        "attenuation_distance" => attenuation_distance(material).into(),
        "attenuation_color" => Value::Vec3(material.attenuation_color),
        "dispersion" => material.dispersion.into(),
        "diffuse_transmission_factor" => material.diffuse_transmission_factor.into(),
        "diffuse_transmission_color_factor" => Value::Vec3(material.diffuse_transmission_color_factor),
        _ => return uv_member(material, name),
    })
}

fn alpha_cutoff(material: &Material) -> f32 {
    match material.alpha_mode {
        AlphaMode::Mask { cutoff } => cutoff,
        AlphaMode::Opaque | AlphaMode::Blend => 0.0,
    }
}

/// WGSL promises nothing about infinite values: 0, which no medium has, stands for them.
fn attenuation_distance(material: &Material) -> f32 {
    if material.attenuation_distance.is_finite() { material.attenuation_distance } else { 0.0 }
}

/// `X_uv_u` and `X_uv_v`: the rows of the texture's affine map, the UV set in `X_uv_u.w`.
fn uv_member(material: &Material, name: &str) -> Option<Value> {
    let (map, row) = match (name.strip_suffix("_uv_u"), name.strip_suffix("_uv_v")) {
        (Some(map), _) => (map, 0),
        (_, Some(map)) => (map, 1),
        _ => return None,
    };
    let identity = TextureRef { texture: 0, uv_set: 0, transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };
    let texture = Map::from_name(map)?.of(material).unwrap_or(identity);
    let [x, y, z] = texture.transform[row];
    let set = if row == 0 { texture.uv_set as f32 } else { 0.0 };
    Some(Value::Vec4([x, y, z, set]))
}

/// The value of a member of `draw`; `None` for unknown names.
pub(crate) fn draw_member(world_from_object: Mat4, name: &str) -> Option<Value> {
    match name {
        "world_from_object" => Some(world_from_object.into()),
        "world_from_object_normal" => Some(normal_matrix(world_from_object).into()),
        _ => None,
    }
}

/// The inverse transpose up to a positive factor, finite for singular matrices too: cofactors with the
/// determinant's sign, scaled to unit range. Normals are normalised after it, so the factor cancels.
fn normal_matrix(world_from_object: Mat4) -> Mat4 {
    let linear = Mat3::from_mat4(world_from_object);
    let (x, y, z) = (linear.x_axis, linear.y_axis, linear.z_axis);
    let largest = x.abs().max(y.abs()).max(z.abs()).max_element();
    if !(largest > 0.0 && largest.is_finite()) {
        return Mat4::IDENTITY;
    }
    let (x, y, z) = (x / largest, y / largest, z / largest);
    let sign = if x.dot(y.cross(z)) < 0.0 { -1.0 } else { 1.0 };
    Mat4::from_mat3(Mat3::from_cols(y.cross(z) * sign, z.cross(x) * sign, x.cross(y) * sign))
}

/// The bytes of a uniform block of `size_bytes`: each member that `lookup` knows at its offset, zeros elsewhere.
/// Members were checked against `lookup` when the shader was accepted.
pub(crate) fn fill_block(
    size_bytes: u32,
    members: &[Member],
    lookup: impl Fn(&str) -> Option<Value>,
) -> Vec<u8> {
    let mut block = vec![0; size_bytes as usize];
    for member in members {
        let Some(value) = lookup(&member.name) else { continue };
        let bytes = value.bytes();
        let start = member.offset_bytes as usize;
        if let Some(place) = block.get_mut(start..start + bytes.len()) {
            place.copy_from_slice(bytes);
        }
    }
    block
}

/// The bytes of the author's own uniform block: each parameter's value at its member, zeros elsewhere. A member with more
/// components than the value has ones there, as the alpha of a colour.
pub(crate) fn parameter_block(
    size_bytes: u32,
    fields: &[(Member, OfferedParameter)],
    values: &ParameterValues,
) -> Vec<u8> {
    let mut block = vec![0; size_bytes as usize];
    for (member, parameter) in fields {
        let value = values.of(parameter);
        let words = block.iter_mut().skip(member.offset_bytes as usize).take(member.size_bytes as usize);
        let bytes = (0..member.size_bytes as usize / 4).flat_map(|index| {
            let component = value.get(index).copied().unwrap_or(1.0);
            match &*member.ty {
                ty if ty.contains("i32") => (component as i32).to_le_bytes(),
                ty if ty.contains("u32") => (component as u32).to_le_bytes(),
                _ => (component as f32).to_le_bytes(),
            }
        });
        words.zip(bytes).for_each(|(place, byte)| *place = byte);
    }
    block
}

/// Spells WGSL's short names of types out: `vec3f` is `vec3<f32>`, `vec4u` is `vec4<u32>`.
pub(crate) fn long_type_name(ty: &str) -> String {
    let shortened = (ty.starts_with("vec") || ty.starts_with("mat")) && !ty.contains('<');
    match (ty.strip_suffix('f'), ty.strip_suffix('u')) {
        (Some(stem), _) if shortened => format!("{stem}<f32>"),
        (_, Some(stem)) if shortened => format!("{stem}<u32>"),
        _ => ty.replace(' ', ""),
    }
}
