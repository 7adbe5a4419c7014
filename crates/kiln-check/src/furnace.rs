//! The white furnace: white surfaces in uniform light of radiance 1 send radiance 1 everywhere, and cannot be seen.

use kiln_diagnostic::Severity;
use kiln_image::Image;

use crate::picture::{Fault, frame_map};
use crate::{Check, Finding, Subject};

/// How far from 1 a frame of a white furnace may be: binary16 maps, an 8-bit texture and a table's interpolation together stay
/// well below it.
pub const FURNACE_TOLERANCE: f32 = 0.01;
/// Places that are named.
const PLACES_MAX: usize = 3;

/// Judges a frame's radiance before exposure and tone mapping: 1 in every pixel is right. Energy that is missing is a
/// warning, since a single-scattering lobe loses it by design; energy that is made is an error.
pub fn check_furnace(name: &str, frame: &Image, with_picture: bool) -> Subject {
    let mut subject = Subject::new(name, "furnace");
    let mut non_finite = Vec::new();
    let (mut least, mut most) = ((f32::INFINITY, 0), (f32::NEG_INFINITY, 0));
    for (index, texel) in frame.rgb.as_chunks::<3>().0.iter().enumerate() {
        if !texel.iter().all(|value| value.is_finite()) {
            non_finite.push(index);
            continue;
        }
        for &value in texel {
            least = if value < least.0 { (value, index) } else { least };
            most = if value > most.0 { (value, index) } else { most };
        }
    }
    let place = |index: usize| format!("pixel ({}, {})", index % frame.width, index / frame.width);
    subject.fact("radiance", format!("{:.4} to {:.4}, where 1 is right", least.0, most.0));
    if !non_finite.is_empty() {
        let mut finding = Finding::new(
            Check::NonFinite,
            Severity::Error,
            format!("{} pixels are NaN or infinite", non_finite.len()),
        );
        finding.places.extend(non_finite.iter().take(PLACES_MAX).map(|&index| place(index)));
        subject.findings.push(
            finding
                .with_help("`kiln render --mark-faults` shows them; the lint names what may be their cause"),
        );
    }
    if most.0 > 1.0 + FURNACE_TOLERANCE {
        let message =
            format!("white surfaces in uniform light shine {:.2} % brighter than it", 100.0 * (most.0 - 1.0));
        let help = "some lobes together reflect more than they receive: check the split of diffuse and specular light";
        subject
            .findings
            .push(Finding::new(Check::Furnace, Severity::Error, message).at(place(most.1)).with_help(help));
    }
    if least.0 < 1.0 - FURNACE_TOLERANCE {
        let message = format!("white surfaces in uniform light lose {:.2} % of it", 100.0 * (1.0 - least.0));
        let help = "light that bounces between facets is left out, or a lobe's part is dropped";
        subject.findings.push(
            Finding::new(Check::Furnace, Severity::Warning, message).at(place(least.1)).with_help(help),
        );
    }
    if with_picture {
        let fault = |texel: [f32; 3]| match Fault::of(texel, f64::INFINITY) {
            Fault::None if texel.iter().any(|value| *value > 1.0 + FURNACE_TOLERANCE) => Fault::Made,
            Fault::None if texel.iter().any(|value| *value < 1.0 - FURNACE_TOLERANCE) => Fault::Lost,
            other => other,
        };
        subject.pictures.push(frame_map("the furnace", frame, fault));
    }
    subject
}
