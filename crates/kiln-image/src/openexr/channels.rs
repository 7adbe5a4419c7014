//! Which channels are colour.

use crate::{Cancel, Cancelled, colour};
use exr::meta::{
    attribute::{ChannelDescription, SampleType},
    header::Header,
};

/// Channel indices of one part, and how they become RGB.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ColourChannels {
    /// For each of R, G, B (or RY, Y, BY where `has_chroma`) the channel it is read from; `None` reads 0.
    pub sources: [Option<usize>; 3],
    /// Luminance only, written to all three.
    pub is_grey: bool,
    /// RY, Y, BY instead of R, G, B.
    pub has_chroma: bool,
    /// What to tell about the choice.
    pub notes: Vec<String>,
}

impl ColourChannels {
    /// R, G, B first, then Y (with RY and BY), then the same names in the first layer that has them.
    pub(super) fn find(header: &Header) -> Option<ColourChannels> {
        let list = &header.channels.list;
        let names: Vec<String> = list.iter().map(|channel| channel.name.to_string()).collect();
        let layers = names.iter().map(|name| name.rsplit_once('.').map_or("", |(layer, _)| layer));
        let mut candidates = vec![""];
        candidates.extend(layers.filter(|layer| !layer.is_empty()));
        let (layer, mut found) =
            candidates.into_iter().find_map(|layer| Some((layer, Self::in_layer(&names, layer)?)))?;
        if !layer.is_empty() {
            found.notes.push(format!("the colour channels of layer {layer:?} were taken"));
        }
        if found.sources.iter().flatten().any(|&index| is_integer(&list[index])) {
            found.notes.push("unsigned integer samples were taken as they are, as radiance".to_owned());
        }
        Some(found)
    }

    fn in_layer(names: &[String], layer: &str) -> Option<ColourChannels> {
        let find = |suffix: &str| {
            let wanted = if layer.is_empty() { suffix.to_owned() } else { format!("{layer}.{suffix}") };
            names.iter().position(|name| *name == wanted)
        };
        let rgb = [find("R"), find("G"), find("B")];
        if rgb.iter().any(Option::is_some) {
            let missing: Vec<&str> = ["R", "G", "B"]
                .into_iter()
                .zip(rgb)
                .filter(|(_, i)| i.is_none())
                .map(|(name, _)| name)
                .collect();
            let notes = if missing.is_empty() {
                Vec::new()
            } else {
                vec![format!("channel {} is absent and reads as 0", missing.join(", "))]
            };
            return Some(ColourChannels { sources: rgb, is_grey: false, has_chroma: false, notes });
        }
        // With an X beside it, Y is the component of a vector.
        let y = find("Y").filter(|_| find("X").is_none())?;
        Some(match (find("RY"), find("BY")) {
            (Some(ry), Some(by)) => ColourChannels {
                sources: [Some(ry), Some(y), Some(by)],
                is_grey: false,
                has_chroma: true,
                notes: vec!["luminance and chroma were converted to RGB".to_owned()],
            },
            _ => ColourChannels {
                sources: [Some(y); 3],
                is_grey: true,
                has_chroma: false,
                notes: vec!["luminance only: the image is grey".to_owned()],
            },
        })
    }
}

/// Turns (RY, Y, BY) into (R, G, B): RY = (R − Y)/Y, BY = (B − Y)/Y, Y = w · (R, G, B).
///
/// Source: "Technical Introduction to OpenEXR", Luminance/Chroma Images.
pub(super) fn undo_luminance_chroma(
    texels: &mut [f32],
    weights: [f64; 3],
    cancel: Cancel,
) -> Result<(), Cancelled> {
    let to_rgb = |[ry, y, by]: [f64; 3]| {
        let (r, b) = ((ry + 1.0) * y, (by + 1.0) * y);
        [r, (y - weights[0] * r - weights[2] * b) / weights[1], b]
    };
    colour::change_texels(texels, to_rgb, cancel)
}

fn is_integer(channel: &ChannelDescription) -> bool {
    channel.sample_type == SampleType::U32
}
