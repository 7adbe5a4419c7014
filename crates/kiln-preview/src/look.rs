//! A look, what is shown and how, as a file: the parameter sheet beside a screenshot, which `kiln render --look` draws again.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::report::ApplyReport;
use crate::view::{Background, Selection, View};

/// Number of the format; files of another one are refused.
const FORMAT: u32 = 1;
/// Sheets are a few kilobytes; nothing longer is read as one.
pub const LOOK_BYTES_MAX: usize = 1 << 20;
/// The widest and highest picture that a sheet may ask for.
const SIDE_PIXELS_MAX: u32 = 16_384;

/// What is shown, and how.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Look {
    /// What is shown.
    pub selection: Selection,
    /// How it is shown.
    pub view: View,
}

/// A look with all that is needed to draw the same picture again, and what a person wants to read beside it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LookSheet {
    /// Number of this format: 1.
    kiln_look: u32,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// What is drawn, each name filled in.
    pub look: Look,
    /// For people: name of the project.
    #[serde(default)]
    pub project: String,
    /// For people: number of the revision, as the daemon of that day counted.
    #[serde(default)]
    pub revision: u64,
    /// For people: the device that drew it.
    #[serde(default)]
    pub adapter: String,
    /// For people: the value of every parameter that shaders in use offer, `shader.name` to components, the untouched ones too.
    #[serde(default)]
    pub parameters: BTreeMap<String, Vec<f64>>,
}

impl LookSheet {
    /// The sheet of what `report` says is shown.
    pub fn new(report: &ApplyReport, view: &View, size: [u32; 2], adapter: &str) -> Self {
        let value =
            |parameter: &crate::OfferedParameter| (parameter.full_name(), view.parameters.of(parameter));
        LookSheet {
            kiln_look: FORMAT,
            size,
            look: Look { selection: report.shown.clone(), view: view.clone() },
            project: report.project.clone(),
            revision: report.revision,
            adapter: adapter.to_owned(),
            parameters: report.parameters.iter().map(value).collect(),
        }
    }

    /// JSON for people and for [`LookSheet::read`].
    pub fn text(&self) -> String {
        // Plain data: it can always be written.
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// Reads a sheet.
    ///
    /// # Errors
    /// A sentence: it is too long, no sheet, of another format, or says what cannot be drawn.
    pub fn read(text: &str) -> Result<Self, String> {
        if text.len() > LOOK_BYTES_MAX {
            return Err(format!(
                "it has {} bytes; a parameter sheet has at most {LOOK_BYTES_MAX}",
                text.len()
            ));
        }
        let sheet: LookSheet =
            serde_json::from_str(text).map_err(|error| format!("it is no parameter sheet: {error}"))?;
        if sheet.kiln_look != FORMAT {
            return Err(format!("it has format {}; this Kiln reads {FORMAT}", sheet.kiln_look));
        }
        let [width, height] = sheet.size;
        if !sheet.size.iter().all(|side| (1..=SIDE_PIXELS_MAX).contains(side)) {
            return Err(format!(
                "it asks for {width}x{height} pixels; 1 to {SIDE_PIXELS_MAX} a side can be drawn"
            ));
        }
        sheet.look.view.check()?;
        Ok(sheet)
    }
}

impl View {
    /// Whether it can be drawn: what a file says need not be.
    ///
    /// # Errors
    /// A sentence that names the number.
    pub(crate) fn check(&self) -> Result<(), String> {
        let numbers = [
            ("exposure_ev", self.exposure_ev),
            ("environment_rotation_rad", self.environment_rotation_rad),
            ("environment_intensity", self.environment_intensity),
            ("background_blur", self.background_blur),
            ("time_s", self.time_s),
            ("fault_limit", self.fault_limit.unwrap_or(0.0)),
        ];
        if let Some((name, value)) = numbers.into_iter().find(|(_, value)| !value.is_finite()) {
            return Err(format!("its `{name}` is {value}, which is no finite number"));
        }
        if let Background::Color(color) = self.background
            && !color.iter().all(|channel| channel.is_finite())
        {
            return Err("its background is no colour".to_owned());
        }
        if self.camera.is_some_and(|camera| !camera.is_usable()) {
            return Err("its camera cannot be looked through".to_owned());
        }
        Ok(())
    }
}
