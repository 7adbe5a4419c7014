//! `conventions.json`: what a reader of the files has to know.

use crate::cube_file::Container;
use crate::{BakedEnvironment, ExportFile, Preset};
use kiln_bake::{RoughnessLaw, TexelFormat};
use kiln_image::cube_layout::Mirror;
use serde_json::{Map, Value, json};

/// What encoding one level cost, see `kiln_bake::EncodedLevel`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LevelError {
    pub(crate) rounding_rms: f64,
    pub(crate) rounding_max: f64,
    pub(crate) clamped_flux: f64,
}

/// A cube file's facts.
#[derive(Clone, Debug)]
pub(crate) struct CubeFacts {
    pub(crate) face_size: usize,
    pub(crate) format: TexelFormat,
    pub(crate) container: Container,
    pub(crate) mirror: Option<Mirror>,
    pub(crate) errors: Vec<LevelError>,
}

impl CubeFacts {
    /// As JSON, with what the file `holds`.
    pub(crate) fn json(&self, path: &str, holds: &str) -> Value {
        let container = match self.container {
            Container::Ktx2 => "KTX2",
            Container::Ktx2Zstd => "KTX2 with Zstandard",
            Container::Ktx1Filament => "KTX1 as Filament reads it",
        };
        let lookup = match self.mirror {
            None => "direction (x, y, z)",
            Some(Mirror::X) => "direction (-x, y, z)",
            Some(Mirror::Z) => "direction (x, y, -z)",
        };
        let each = |value: fn(&LevelError) -> f64| self.errors.iter().map(value).collect::<Vec<f64>>();
        json!({
            "path": path,
            "holds": holds,
            "container": container,
            "format": format_name(self.format),
            "face_size": self.face_size,
            "levels": self.errors.len(),
            "faces": "+X -X +Y -Y +Z -Z",
            "lookup": lookup,
            "encoding_error": {
                "rms_relative_to_rms": each(|error| error.rounding_rms),
                "max_relative_to_value_plus_mean": each(|error| error.rounding_max),
                "clamped_flux": each(|error| error.clamped_flux),
            },
        })
    }
}

/// A format's name in files and messages.
pub(crate) fn format_name(format: TexelFormat) -> &'static str {
    match format {
        TexelFormat::Rgba16Float => "RGBA16F",
        TexelFormat::Rgba32Float => "RGBA32F",
        TexelFormat::Rgb9e5Ufloat => "RGB9E5",
        TexelFormat::R11g11b10Ufloat => "R11F_G11F_B10F",
        TexelFormat::Bc6hUfloat => "BC6H_UFLOAT",
    }
}

/// Adds the roughness of each level to a file's facts.
pub(crate) fn with_law(mut facts: Value, law: &RoughnessLaw, chain: impl Iterator<Item = f64>) -> Value {
    facts["law"] =
        json!({"name": law.name(), "formula": law.formula(), "roughness": chain.collect::<Vec<_>>()});
    facts
}

/// The file, from the facts of the others and the engine's own notes.
pub(crate) fn conventions(
    preset: Preset,
    environment: &BakedEnvironment,
    scale_log2: i32,
    files: Vec<Value>,
    notes: &[(&str, &str)],
) -> ExportFile {
    let notes: Map<String, Value> =
        notes.iter().map(|(key, note)| ((*key).to_owned(), json!(note))).collect();
    let document = json!({
        "schema": 1,
        "preset": preset.name(),
        "environment": environment.name,
        "world": {
            "handedness": "right",
            "up": "+Y",
            "source_panorama_centre": "-Z",
            "source_panorama_right_half": "+X",
            "directions": "what Kiln shows in a direction, the engine shows in the same direction of its world",
        },
        "units": "relative radiance, linear Rec. 709 with white D65, no exposure applied",
        "irradiance": "E / pi: the outgoing radiance of a white Lambertian surface",
        "specular": "split sum, N = V = R: the environment convolved with the lobe and normalised",
        "scale_log2": scale_log2,
        "multiply_by": power_of_two(scale_log2),
        "files": files,
        "engine": notes,
    });
    let mut bytes = serde_json::to_vec_pretty(&document).expect("numbers and strings");
    bytes.push(b'\n');
    ExportFile { path: "conventions.json".to_owned(), bytes }
}

/// 2^s, exactly.
fn power_of_two(s: i32) -> f64 {
    (0..s).fold(1.0, |value, _| value * 2.0)
}
