//! What a node carries besides a mesh: cameras, punctual lights, instances.

use glam::{DMat4, DVec3};

use crate::accessor::Data;
use crate::pose::trs;
use crate::{Camera, Light, LightKind, LightProperty, SceneError, limits, schema};

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
    let (yfov_rad, znear, zfar) = match (&source.perspective, &source.orthographic) {
        (Some(it), _) if source.kind == "perspective" => (Some(it.yfov), it.znear, it.zfar),
        (_, Some(it)) if source.kind == "orthographic" => (None, it.znear, Some(it.zfar)),
        _ => {
            let reason = format!("`{}` is no type of camera or lacks its properties", source.kind);
            return Err(SceneError::new(format!("/cameras/{index}"), reason));
        }
    };
    let source = schema::Camera { name: Some(name.clone()), ..source.clone() };
    Ok((Camera { name, world: world.as_mat4(), yfov_rad, znear, zfar }, source))
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
    let direction = world.transform_vector3(DVec3::NEG_Z).try_normalize().unwrap_or(DVec3::NEG_Z);
    let light = Light {
        intensity: source.color.map(|value| value * source.intensity),
        position: world.w_axis.truncate().as_vec3(),
        direction: direction.as_vec3(),
        kind: light_kind(source, index)?,
        range: source.range,
    };
    Ok((light, source.clone()))
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

fn light_kind(source: &schema::Light, index: usize) -> Result<LightKind, SceneError> {
    let quarter_pi = std::f32::consts::FRAC_PI_4;
    let spot = source.spot.unwrap_or(schema::Spot { inner_cone_angle: 0.0, outer_cone_angle: quarter_pi });
    match source.kind.as_str() {
        "directional" => Ok(LightKind::Directional),
        "point" => Ok(LightKind::Point),
        "spot" => {
            let (inner_cone_rad, outer_cone_rad) = (spot.inner_cone_angle, spot.outer_cone_angle);
            Ok(LightKind::Spot { inner_cone_rad, outer_cone_rad })
        }
        other => {
            let place = format!("/extensions/KHR_lights_punctual/lights/{index}/type");
            Err(SceneError::new(place, format!("`{other}` is no kind of light")))
        }
    }
}

/// Local matrices of `EXT_mesh_gpu_instancing`; those that are not finite are left out.
///
/// # Errors
/// Accessors out of range.
pub(crate) fn instances(
    data: &Data<'_>,
    node: usize,
    instancing: &schema::Instancing,
) -> Result<Vec<DMat4>, SceneError> {
    let place = format!("/nodes/{node}/extensions/EXT_mesh_gpu_instancing/attributes");
    let read = |name: &str, kind: &str| match instancing.attributes.get(name) {
        Some(&index) => data.floats::<4>(index, &format!("{place}/{name}"), &[kind], [0.0; 4]).map(Some),
        None => Ok(None),
    };
    let (translations, rotations, scales) =
        (read("TRANSLATION", "VEC3")?, read("ROTATION", "VEC4")?, read("SCALE", "VEC3")?);
    let columns = [&translations, &rotations, &scales];
    let count = columns.iter().filter_map(|column| column.as_ref().map(Vec::len)).min().unwrap_or(0);
    let at = |column: &Option<Vec<[f32; 4]>>, index: usize, neutral| {
        column.as_ref().map_or(neutral, |it| it[index])
    };
    let three = |[x, y, z, _]: [f32; 4]| DVec3::from_array([x, y, z].map(f64::from));
    let matrices = (0..count.min(limits::DRAW_COUNT_MAX)).map(|index| {
        let rotation = at(&rotations, index, [0.0, 0.0, 0.0, 1.0]);
        trs(three(at(&translations, index, [0.0; 4])), rotation, three(at(&scales, index, [1.0; 4])))
    });
    Ok(matrices.filter(|matrix| matrix.is_finite()).collect())
}
