//! A skybox as a picture: the layouts that other tools read.

use std::path::Path;
use std::str::FromStr;

use anyhow::Context as _;
use kiln_build::{Disk, Engine, Target, write_atomically};
use kiln_image::cube_layout::{CubeLayout, FACE_STEMS, face_image, octahedral, unfold};
use kiln_image::{Cancel, Cube, Image, exr_write, hdr, png};
use serde_json::Value;

/// A layout and a file type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Picture {
    layout: Layout,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Layout {
    Unfolded(CubeLayout),
    Faces,
    Octahedral,
    Equirect,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Exr,
    Hdr,
    /// 8-bit sRGB: for looking at.
    Png,
}

const LAYOUTS: [(&str, Layout); 7] = [
    ("cross", Layout::Unfolded(CubeLayout::HorizontalCross)),
    ("cross-tall", Layout::Unfolded(CubeLayout::VerticalCross)),
    ("strip", Layout::Unfolded(CubeLayout::HorizontalStrip)),
    ("strip-tall", Layout::Unfolded(CubeLayout::VerticalStrip)),
    ("faces", Layout::Faces),
    ("octahedral", Layout::Octahedral),
    ("equirect", Layout::Equirect),
];
const KINDS: [(&str, Kind); 3] = [("exr", Kind::Exr), ("hdr", Kind::Hdr), ("png", Kind::Png)];

impl FromStr for Picture {
    type Err = String;

    fn from_str(text: &str) -> Result<Picture, String> {
        let wrong = || {
            let names = |names: Vec<&str>| names.join(", ");
            let layouts = names(LAYOUTS.iter().map(|(name, _)| *name).collect());
            let kinds = names(KINDS.iter().map(|(name, _)| *name).collect());
            format!("`{text}` is no picture; write LAYOUT.TYPE with {layouts} and {kinds}")
        };
        let (layout, kind) = text.split_once('.').ok_or_else(wrong)?;
        let layout = LAYOUTS.iter().find(|(name, _)| *name == layout).ok_or_else(wrong)?.1;
        let kind = KINDS.iter().find(|(name, _)| *name == kind).ok_or_else(wrong)?.1;
        Ok(Picture { layout, kind })
    }
}

/// Writes level 0 of a skybox target into `folder`, as `skybox_LAYOUT.TYPE` or six `skybox_px.TYPE` ….
pub(crate) fn write(engine: &Engine, target: &Target, picture: Picture, folder: &Path) -> anyhow::Result<()> {
    let cube = level_0(engine, target).context("reading the skybox")?;
    let name_of =
        |layout: Layout| LAYOUTS.iter().find(|(_, known)| *known == layout).map_or("", |known| known.0);
    let images: Vec<(&str, Image)> = match picture.layout {
        Layout::Unfolded(layout) => vec![(name_of(picture.layout), unfold(&cube, layout))],
        Layout::Faces => {
            FACE_STEMS.into_iter().enumerate().map(|(face, stem)| (stem, face_image(&cube, face))).collect()
        }
        // As many texels as the cube has, about.
        Layout::Octahedral => {
            let size = 5 * cube.face_size / 2;
            vec![(name_of(picture.layout), octahedral(&cube, size.max(1), Cancel::NEVER)?)]
        }
        Layout::Equirect => {
            let panorama = kiln_project::panorama_of_cube(&cube, Cancel::NEVER)?;
            vec![(name_of(picture.layout), panorama.into_image())]
        }
    };
    let kind = KINDS.iter().find(|(_, known)| *known == picture.kind).map_or("", |known| known.0);
    for (stem, image) in images {
        let bytes = match picture.kind {
            Kind::Exr => exr_write::encode_image(&image, Cancel::NEVER)?,
            Kind::Hdr => hdr::encode(&image),
            Kind::Png => {
                let (bytes, clamped) = png::encode_radiance(&image, 1.0, Cancel::NEVER)?;
                if clamped > 0.0 {
                    eprintln!(
                        "note: skybox_{stem}.png holds 0 to 1 alone: {:.1} % of its texels are cut",
                        100.0 * clamped
                    );
                }
                bytes
            }
        };
        let path = folder.join(format!("skybox_{stem}.{kind}"));
        write_atomically(&Disk, &path, &bytes).with_context(|| format!("writing {}", path.display()))?;
    }
    Ok(())
}

/// The values of a cube target's first level.
fn level_0(engine: &Engine, target: &Target) -> Option<Cube> {
    let part = target.parts.first()?;
    let bytes = engine.store().get(&part.digest)?;
    let size = usize::try_from(target.meta.get("size")?.as_u64()?).ok()?;
    let scale_log2 = target.meta.get("scale_log2").and_then(Value::as_i64).unwrap_or(0);
    let name = target.meta.get("format")?.as_str()?;
    let format = kiln_project::FORMATS.iter().find(|(known, _)| *known == name)?.1;
    kiln_project::decode_level(&bytes, size, format, i32::try_from(scale_log2).ok()?)
}

#[cfg(test)]
mod tests {
    use super::Picture;

    #[test]
    fn pictures_are_told_by_layout_and_type() {
        for text in ["cross.exr", "cross-tall.hdr", "faces.png", "octahedral.exr", "equirect.hdr"] {
            assert!(text.parse::<Picture>().is_ok(), "{text}");
        }
        for text in ["cross", "cross.jpg", "ball.exr", ""] {
            let said = text.parse::<Picture>().unwrap_err();
            assert!(said.contains("equirect") && said.contains("png"), "{said}");
        }
    }
}
