//! What the user sets: which scene under which light, seen how.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::camera::OrbitCamera;
use crate::channel::Channel;
use crate::inspect::GROUP;
use crate::parameter::ParameterValues;

/// Which scene and environment to show.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Selection {
    /// Name of the scene; `None` = the project's first.
    pub scene: Option<String>,
    /// Name of the environment; `None` = the one that the scene names.
    pub env: Option<String>,
    /// Name of one of the scene's `KHR_materials_variants`; `None` = the materials without any.
    pub variant: Option<String>,
    /// What diffuse light is read from.
    pub diffuse: DiffuseSource,
}

/// Where the irradiance of an environment comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DiffuseSource {
    /// The baked map.
    #[default]
    Map,
    /// The spherical harmonics, as engines read them that have no map: what these look like there.
    Harmonics,
}

/// A moment of one of the scene's animations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnimationTime {
    /// Index into [`crate::ApplyReport::animations`]; an index that is not there is the rest pose.
    pub index: usize,
    /// Seconds since it began; before its first key and after its last one their values hold.
    pub time_s: f64,
}

impl Selection {
    /// The targets, or groups of them, that it names; with those that a view of it needs besides.
    pub fn targets(&self, view: &View) -> Vec<String> {
        let scene = self.scene.iter().map(|name| format!("scene/{name}"));
        let env = self.env.iter().map(|name| format!("env/{name}"));
        scene.chain(env).chain(view.inspects().then(|| GROUP.to_owned())).collect()
    }
}

/// What is to be seen behind the scene. What shines through glass is the environment in any case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Background {
    /// The environment, as blurred as [`View::background_blur`] says.
    #[default]
    Environment,
    /// One colour, linear Rec. 709: exposure leaves it as it is, the tone mapper does not.
    Color([f32; 3]),
    /// Squares of two greys, by which one sees what is transparent.
    Checker,
}

impl FromStr for Background {
    type Err = String;

    /// `environment`, `checker`, or a colour as `#rrggbb`, sRGB-encoded.
    fn from_str(text: &str) -> Result<Self, String> {
        let color = || {
            let digits = text
                .strip_prefix('#')
                .filter(|digits| digits.len() == 6 && digits.bytes().all(|it| it.is_ascii_hexdigit()))?;
            let number = u32::from_str_radix(digits, 16).ok()?;
            Some(number.to_be_bytes())
        };
        match text {
            "environment" => Ok(Background::Environment),
            "checker" => Ok(Background::Checker),
            _ => color().map(|[_, rgb @ ..]| Background::Color(rgb.map(from_srgb))).ok_or_else(|| {
                format!("`{text}` is no background: environment, checker or a colour as #rrggbb")
            }),
        }
    }
}

/// The linear value of an sRGB-encoded one. IEC 61966-2-1.
pub(crate) fn from_srgb(value: u8) -> f32 {
    let value = f32::from(value) / 255.0;
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// What is drawn on the floor, which is at the lowest point of the scene at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Ground {
    /// Lines, each tenth one stronger: 1 m and 10 m apart under things of some metres, else a power of ten as far.
    pub has_grid: bool,
    /// Darkens by the sun's shadow what lies behind. Without a sun that is a light of its own there is none.
    pub catches_shadow: bool,
}

impl FromStr for Ground {
    type Err = String;

    /// `none`, `grid`, `shadow` or `grid+shadow`.
    fn from_str(text: &str) -> Result<Self, String> {
        let (has_grid, catches_shadow) = match text {
            "none" => (false, false),
            "grid" => (true, false),
            "shadow" => (false, true),
            "grid+shadow" | "shadow+grid" => (true, true),
            _ => return Err(format!("`{text}` is no ground: none, grid, shadow or grid+shadow")),
        };
        Ok(Ground { has_grid, catches_shadow })
    }
}

/// How the selected scene is shown. None of it needs a rebuild, but that channels and marks need variants of the scene's
/// shader which the daemon makes for who wants them. As JSON it keeps every bit, and what a file does not say is
/// as in [`View::default`]: what is added here later needs no new format.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
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
    /// Which of the scene's own, as an index into [`crate::ApplyReport::cameras`]; it moves as the animation has it.
    pub scene_camera: usize,
    /// What plays; `None` = the rest pose.
    pub animation: Option<AnimationTime>,
    /// Seconds for shaders that move; 0 in headless frames.
    pub time_s: f32,
    /// The parameters that shaders' authors offer.
    pub parameters: ParameterValues,
    /// What is behind the scene.
    pub background: Background,
    /// What is below it.
    pub ground: Ground,
    /// What is shown in place of the picture, where the scene's shader can show it.
    pub channel: Option<Channel>,
    /// Marks radiance that is no number, infinite, negative, or above this; `None` marks nothing.
    pub fault_limit: Option<f32>,
}

impl View {
    /// Whether it needs the shaders that show channels.
    pub(crate) fn inspects(&self) -> bool {
        self.channel.is_some() || self.fault_limit.is_some()
    }
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
            scene_camera: 0,
            animation: None,
            time_s: 0.0,
            parameters: ParameterValues::default(),
            background: Background::Environment,
            ground: Ground::default(),
            channel: None,
            fault_limit: None,
        }
    }
}
