//! The environment's extracted sun: what a revision says of it, and the uniform `sun` of `docs/shader-interface.md`.

use glam::{Mat4, Vec3};
use kiln_diagnostic::Diagnostic;
use kiln_link::Revision;
use serde::Deserialize;

use crate::uniform::Value;
use crate::view::View;

/// Largest irradiance: seen through the sharpest lobe it is still an `f32`.
const IRRADIANCE_MAX: f64 = 1e18;

/// A sun as it was extracted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sun {
    /// Towards it, in the environment; unit length.
    pub direction: Vec3,
    /// Of a surface that faces it, in the environment's radiance times steradian.
    pub irradiance: Vec3,
    /// Half of the angle that it is wide.
    pub angular_radius_rad: f32,
}

/// Part `json` of `env/NAME/sun`.
#[derive(Deserialize)]
struct Extracted {
    /// `None` where the environment has no dominant small light.
    light: Option<Light>,
}

#[derive(Deserialize)]
struct Light {
    direction: [f64; 3],
    irradiance: [f64; 3],
    angular_diameter: f64,
}

impl Sun {
    /// The sun of an environment, if it has one that is a light of its own.
    ///
    /// # Errors
    /// The target is not what `docs/protocol.md` says.
    pub fn of(revision: &Revision, env: &str) -> Result<Option<Sun>, Diagnostic> {
        let name = format!("env/{env}/sun");
        let Some(target) = revision.table.targets.get(&name) else { return Ok(None) };
        let faulty = |reason: String| Diagnostic::error(format!("`{name}` cannot be used: {reason}"));
        if target.kind != "light" {
            return Err(faulty(format!("it is a `{}`, not a `light`", target.kind)));
        }
        let json = revision.part(&name, "json").ok_or_else(|| faulty("it has no part `json`".to_owned()))?;
        let found: Extracted = serde_json::from_slice(json).map_err(|error| faulty(error.to_string()))?;
        let Some(light) = found.light else { return Ok(None) };
        let direction = glam::DVec3::from(light.direction).try_normalize();
        let numbers = [light.irradiance[0], light.irradiance[1], light.irradiance[2], light.angular_diameter];
        let is_number = |value: &f64| value.is_finite() && *value >= 0.0;
        match direction {
            Some(direction) if numbers.iter().all(is_number) => Ok(Some(Sun {
                direction: direction.as_vec3(),
                irradiance: Vec3::from(light.irradiance.map(|value| value.min(IRRADIANCE_MAX) as f32)),
                angular_radius_rad: (light.angular_diameter / 2.0).min(1.0) as f32,
            })),
            _ => Err(faulty("its numbers are no light's".to_owned())),
        }
    }

    /// The sun as the environment is turned and scaled in `view`.
    pub fn in_view(self, view: &View) -> Sun {
        let turn = Mat4::from_rotation_y(view.environment_rotation_rad);
        Sun {
            direction: turn.transform_vector3(self.direction).normalize(),
            irradiance: self.irradiance * view.environment_intensity,
            ..self
        }
    }
}

/// What the uniform `sun` is filled with; all zeros where nothing shines.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SunValues {
    pub direction: Vec3,
    pub irradiance: Vec3,
    pub angular_radius: f32,
    /// World to the shadow map: x and y from its upper left corner, and depth.
    pub shadow_from_world: Mat4,
    /// Edge of a texel in the world.
    pub shadow_texel: f32,
}

impl SunValues {
    /// The value of a member of `sun`; `None` for unknown names.
    pub fn member(&self, name: &str) -> Option<Value> {
        Some(match name {
            "direction" => Value::Vec3(self.direction.to_array()),
            "irradiance" => Value::Vec3(self.irradiance.to_array()),
            "angular_radius" => self.angular_radius.into(),
            "shadow_from_world" => self.shadow_from_world.into(),
            "shadow_texel" => self.shadow_texel.into(),
            _ => return None,
        })
    }
}
