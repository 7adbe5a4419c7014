//! Maps as stored texels.

use kiln_bake::{Cancel, EncodedLevel, TexelFormat};
use kiln_build::{ActionOutput, Error};
use kiln_diagnostic::Diagnostic;
use kiln_image::Cube;
use serde_json::{Value, json};

use super::source::Report;
use super::{ended, success};
use crate::env_config::{EnvConfig, Range, format_name};

/// How the maps of one environment are stored: all with the same format and scale.
pub(super) struct Encode {
    pub(super) format: TexelFormat,
    pub(super) scale_log2: i32,
    max: f32,
}

impl Encode {
    pub(super) fn new(env: &EnvConfig, report: &Report) -> Encode {
        let scale_log2 = kiln_bake::scale_log2(report.max);
        let (format, scale_log2) = match (env.format, env.range) {
            (TexelFormat::Rgba32Float, _) => (TexelFormat::Rgba32Float, 0),
            (_, Range::F32) if scale_log2 > 0 => (TexelFormat::Rgba32Float, 0),
            (format, _) => (format, scale_log2),
        };
        Encode { format, scale_log2, max: report.max }
    }

    pub(super) fn level(&self, cube: &Cube, cancel: Cancel) -> Result<EncodedLevel, Error> {
        kiln_bake::encode_level(cube, self.format, self.scale_log2, cancel).map_err(ended)
    }

    /// The values that a level's bytes stand for.
    pub(super) fn decode(&self, face_size: usize, bytes: &[u8]) -> Option<Cube> {
        kiln_bake::decode_level(bytes, face_size, self.format, self.scale_log2)
    }

    pub(super) fn facts(&self) -> Value {
        json!({"format": format_name(self.format), "scale_log2": self.scale_log2})
    }

    pub(super) fn output(
        &self,
        name: &str,
        cube: &Cube,
        mut detail: Value,
        cancel: Cancel,
    ) -> Result<ActionOutput, Error> {
        let level = self.level(cube, cancel)?;
        detail["rounding_rms"] = json!(level.rounding_rms);
        detail["rounding_max"] = json!(level.rounding_max);
        detail["format_clamped_flux"] = json!(level.clamped_flux);
        Ok(success(name, level.bytes, json!({"shared": self.facts(), "detail": detail})))
    }

    /// Said once per environment, with the skybox.
    pub(super) fn notes(&self) -> Vec<Diagnostic> {
        if self.scale_log2 == 0 {
            return Vec::new();
        }
        let message = format!(
            "the peak {:.3e} is above 65000, where half floats end but for a margin: texels are stored divided by 2^{}",
            self.max, self.scale_log2
        );
        let help =
            "`range = \"f32\"` stores 32-bit floats instead, `sun = \"extract\"` makes the sun a light";
        vec![Diagnostic::note(message).with_help(help)]
    }

    /// What the format costs, where that is more than the error asked for, or where it cannot hold the values.
    pub(super) fn cost(&self, skybox: &EncodedLevel, error: f64) -> Vec<Diagnostic> {
        let name = format_name(self.format);
        let mut said = Vec::new();
        if skybox.rounding_rms > error {
            let message = format!(
                "`format = \"{name}\"` alone rounds the skybox by {:.1e}, more than `error = {error}`",
                skybox.rounding_rms
            );
            let better = match self.format {
                TexelFormat::Rgba32Float | TexelFormat::Rgba16Float => {
                    "`format = \"rgba32f\"` rounds by 3e-8"
                }
                _ => "`format = \"rgba16f\"` rounds by 2e-4",
            };
            said.push(Diagnostic::note(message).with_help(better));
        }
        if skybox.clamped_flux > 0.0 {
            let message = format!(
                "`format = \"{name}\"` cannot hold all values: {:.2e} of the skybox's flux is cut",
                skybox.clamped_flux
            );
            said.push(Diagnostic::warning(message));
        }
        said
    }
}
