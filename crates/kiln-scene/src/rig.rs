//! What a node carries besides a mesh: cameras, punctual lights, instances.

use glam::{DMat4, DVec3};

use crate::accessor::Data;
use crate::pose::trs;
use crate::{Camera, Instance, Light, LightKind, LightProperty, SceneError, limits, schema};

/// A node's camera in world space, and its properties under the name it goes by.
///
/// # Errors
/// A camera that does not exist or lacks its type's properties.
pub(crate) fn camera(
    root: &schema::Root,
    node: usize,
    index: usize,
    world: DMat4,
) -> Result<(Camera, schema::Camera), SceneError> {
    let missing =
        || SceneError::new(format!("/nodes/{node}/camera"), format!("camera {index} does not exist"));
    let source = root.cameras.get(index).ok_or_else(missing)?;
    let name = root.nodes[node].name.clone().or_else(|| source.name.clone());
    let name = name.unwrap_or_else(|| format!("camera {index}"));
    let (yfov_rad, znear, zfar, ymag) = match (&source.perspective, &source.orthographic) {
        (Some(it), _) if source.kind == "perspective" => (Some(it.yfov), it.znear, it.zfar, None),
        (_, Some(it)) if source.kind == "orthographic" => (None, it.znear, Some(it.zfar), Some(it.ymag)),
        _ => {
            let reason = format!("`{}` is no type of camera or lacks its properties", source.kind);
            return Err(SceneError::new(format!("/cameras/{index}"), reason));
        }
    };
    let source = schema::Camera { name: Some(name.clone()), ..source.clone() };
    Ok((Camera { name, world: world.as_mat4(), yfov_rad, znear, zfar, ymag }, source))
}

/// A node's light (`KHR_lights_punctual`) in world space, and its properties.
///
/// # Errors
/// A light that does not exist or is of an unknown kind.
pub(crate) fn light(
    root: &schema::Root,
    node: usize,
    index: usize,
    world: DMat4,
) -> Result<(Light, schema::Light), SceneError> {
    let place = format!("/nodes/{node}/extensions/KHR_lights_punctual");
    let source = root.extensions.lights.as_ref().and_then(|lights| lights.lights.get(index));
    let source = source.ok_or_else(|| SceneError::new(place, format!("light {index} does not exist")))?;
    Ok((placed_light(source, world).map_err(|kind| unknown_kind(&kind, index))?, source.clone()))
}

/// A light where `world` puts it.
///
/// # Errors
/// The name of a kind that there is not.
pub(crate) fn placed_light(source: &schema::Light, world: DMat4) -> Result<Light, String> {
    let direction = world.transform_vector3(DVec3::NEG_Z).try_normalize().unwrap_or(DVec3::NEG_Z);
    Ok(Light {
        intensity: source.color.map(|value| value * source.intensity),
        position: world.w_axis.truncate().as_vec3(),
        direction: direction.as_vec3(),
        kind: light_kind(source)?,
        range: source.range,
    })
}

/// Whether a light does anything, now or at some time of an animation that takes its values through `ranges`.
pub(crate) fn ever_shines(light: &schema::Light, ranges: &[(LightProperty, Vec<[f32; 2]>)]) -> bool {
    let largest = |property: LightProperty, component: usize, at_rest: f32| {
        let animated = ranges.iter().filter(|(other, _)| *other == property);
        animated.fold(at_rest, |largest, (_, range)| largest.max(range[component][1]))
    };
    let has_power = largest(LightProperty::Intensity, 0, light.intensity) > 0.0;
    let has_color = (0..3).any(|channel| largest(LightProperty::Color, channel, light.color[channel]) > 0.0);
    // glTF has ranges for what has a place.
    let has_range = light.kind == "directional"
        || light.range.is_none_or(|range| largest(LightProperty::Range, 0, range) > 0.0);
    let is_open = light.kind != "spot"
        || light
            .spot
            .is_none_or(|spot| largest(LightProperty::OuterConeAngle, 0, spot.outer_cone_angle) > 0.0);
    has_power && has_color && has_range && is_open
}

fn unknown_kind(kind: &str, index: usize) -> SceneError {
    let place = format!("/extensions/KHR_lights_punctual/lights/{index}/type");
    SceneError::new(place, format!("`{kind}` is no kind of light"))
}

fn light_kind(source: &schema::Light) -> Result<LightKind, String> {
    let quarter_pi = std::f32::consts::FRAC_PI_4;
    let spot = source.spot.unwrap_or(schema::Spot { inner_cone_angle: 0.0, outer_cone_angle: quarter_pi });
    match source.kind.as_str() {
        "directional" => Ok(LightKind::Directional),
        "point" => Ok(LightKind::Point),
        "spot" => {
            let (inner_cone_rad, outer_cone_rad) = (spot.inner_cone_angle, spot.outer_cone_angle);
            Ok(LightKind::Spot { inner_cone_rad, outer_cone_rad })
        }
        other => Err(other.to_owned()),
    }
}

/// Copies of `EXT_mesh_gpu_instancing`; those that are not finite are left out. The text says what is odd about them.
///
/// # Errors
/// Accessors out of range, more copies than `limit`.
pub(crate) fn instances(
    data: &Data<'_>,
    node: usize,
    instancing: &schema::Instancing,
    limit: usize,
) -> Result<(Vec<Instance>, Option<String>), SceneError> {
    let place = format!("/nodes/{node}/extensions/EXT_mesh_gpu_instancing/attributes");
    let mut counts = Vec::new();
    for name in ["TRANSLATION", "ROTATION", "SCALE"] {
        if let Some(&index) = instancing.attributes.get(name) {
            counts.push(data.count(index, &format!("{place}/{name}"))?);
        }
    }
    let count = counts.iter().copied().min().unwrap_or(0);
    if counts.iter().any(|&it| it > limit as u64) {
        let limit = limits::INSTANCE_COUNT_MAX;
        return Err(SceneError::new(place, format!("the instances of all nodes exceed {limit}")));
    }
    let uneven = counts.iter().any(|&it| it != count);
    let remark =
        uneven.then(|| format!("{place}: they differ in length, the first {count} instances are drawn"));
    let read = |name: &str, kind: &str, neutral: [f32; 4]| match instancing.attributes.get(name) {
        Some(&index) => data.floats::<4>(index, &format!("{place}/{name}"), &[kind], neutral),
        None => Ok(vec![neutral; count as usize]),
    };
    let translations = read("TRANSLATION", "VEC3", [0.0; 4])?;
    let rotations = read("ROTATION", "VEC4", [0.0, 0.0, 0.0, 1.0])?;
    let scales = read("SCALE", "VEC3", [1.0; 4])?;
    let three = |[x, y, z, _]: [f32; 4]| [x, y, z];
    let parts = translations.into_iter().zip(rotations).zip(scales);
    let instances = parts.map(|((translation, rotation), scale)| Instance {
        translation: three(translation),
        rotation: unit(rotation),
        scale: three(scale),
    });
    Ok((instances.filter(|instance| matrix(instance).is_finite()).collect(), remark))
}

/// Place of a copy in full precision.
pub(crate) fn matrix(instance: &Instance) -> DMat4 {
    let wide = |values: [f32; 3]| DVec3::from_array(values.map(f64::from));
    trs(wide(instance.translation), instance.rotation, wide(instance.scale))
}

/// At unit length; untouched where it has it, so that what was made stays as it is.
fn unit(rotation: [f32; 4]) -> [f32; 4] {
    const SQUARED_LENGTH_TOLERANCE: f64 = 1e-6;
    let squared: f64 = rotation.iter().map(|&value| f64::from(value) * f64::from(value)).sum();
    if (squared - 1.0).abs() <= SQUARED_LENGTH_TOLERANCE {
        rotation
    } else if squared > 0.0 && squared.is_finite() {
        rotation.map(|value| (f64::from(value) / squared.sqrt()) as f32)
    } else {
        [0.0, 0.0, 0.0, 1.0]
    }
}
