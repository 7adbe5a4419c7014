//! What the user sets: which scene under which light, seen how.

use crate::camera::OrbitCamera;
use crate::parameter::ParameterValues;

/// Which scene and environment to show.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// Name of the scene; `None` = the project's first.
    pub scene: Option<String>,
    /// Name of the environment; `None` = the one that the scene names.
    pub env: Option<String>,
}

/// How the selected scene is shown. None of it needs a rebuild.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Exposure in stops: radiance is multiplied by 2^EV.
    pub exposure_ev: f32,
    /// Turns the environment around +Y, counter-clockwise from above.
    pub environment_rotation_rad: f32,
    /// Linear factor on all environment light.
    pub environment_intensity: f32,
    /// Perceptual roughness at which the background is read, 0 = sharp, to 1.
    pub background_blur: f32,
    /// Where the eye is; `None` = the scene's own camera, or one that shows all of it.
    pub camera: Option<OrbitCamera>,
    /// Seconds for shaders that move; 0 in headless frames.
    pub time_s: f32,
    /// The parameters that shaders' authors offer.
    pub parameters: ParameterValues,
}

impl Default for View {
    /// The light as it is, the scene's own camera.
    fn default() -> Self {
        View {
            exposure_ev: 0.0,
            environment_rotation_rad: 0.0,
            environment_intensity: 1.0,
            background_blur: 0.0,
            camera: None,
            time_s: 0.0,
            parameters: ParameterValues::default(),
        }
    }
}
