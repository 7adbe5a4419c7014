//! The scripted edits: each as an artist would make it, in a text editor or by replacing a file.

use anyhow::Context as _;

use crate::args::SampleArgs;
use crate::commands::init;

/// One edit of one file.
pub(super) struct Edit {
    /// For the picture's name.
    pub(super) name: &'static str,
    pub(super) title: &'static str,
    pub(super) file: &'static str,
    /// Whether the project has an error afterwards.
    pub(super) breaks: bool,
    pub(super) change: Change,
}

/// The file's content before and after.
type Change = Box<dyn Fn(&[u8]) -> anyhow::Result<Vec<u8>>>;

const TONEMAP: &str = "shaders/pbr/tonemap.wgsl";
const WHITE_BALANCE: &str = "const WHITE_BALANCE = vec3f(1.0, 1.0, 1.0);";
const WARM: &str = "const WHITE_BALANCE = vec3f(1.12, 1.0, 0.82);";
const TYPO: &str = "const WHITE_BALANCE = vec3f(1.12, 1.0, WARMTH);";
/// Where the sun goes, in degrees above the horizon.
const LOW_SUN_DEG: f64 = 6.0;

/// The edits in order.
pub(super) fn script(sample: &SampleArgs) -> anyhow::Result<Vec<Edit>> {
    let mut options = init::options(sample);
    options.sun.elevation_deg = LOW_SUN_DEG;
    // Made before the clock starts: the demo measures Kiln, not the sky model.
    let low_sun = kiln_sample::sky_hdr(options.panorama_width, options.sun);
    let text_edit = |name, title, file, breaks, from: &'static str, to: &'static str| Edit {
        name,
        title,
        file,
        breaks,
        change: Box::new(move |old| replace(old, from, to)),
    };
    Ok(vec![
        text_edit("warm", "a shader constant: warmer white balance", TONEMAP, false, WHITE_BALANCE, WARM),
        text_edit("broken", "a typo in the shader", TONEMAP, true, WARM, TYPO),
        text_edit("mended", "the typo mended, white balance back", TONEMAP, false, TYPO, WHITE_BALANCE),
        Edit {
            name: "low-sun",
            title: "the sun goes down to 6 degrees",
            file: "environments/sky.hdr",
            breaks: false,
            change: Box::new(move |_| Ok(low_sun.clone())),
        },
        text_edit(
            "studio",
            "the scene moves into the studio",
            "kiln.toml",
            false,
            "env = \"sky\"",
            "env = \"studio\"",
        ),
    ])
}

fn replace(old: &[u8], from: &str, to: &str) -> anyhow::Result<Vec<u8>> {
    let text = std::str::from_utf8(old).context("the file is no text")?;
    anyhow::ensure!(text.contains(from), "the file no longer contains `{from}`");
    Ok(text.replacen(from, to, 1).into_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_edit_finds_its_place_in_the_sample() {
        let sample = SampleArgs { panorama_width: 16, sun_elevation: 38.0, sun_azimuth: 40.0 };
        let mut files: std::collections::BTreeMap<String, Vec<u8>> =
            kiln_sample::files(&init::options(&sample)).into_iter().collect();
        for edit in script(&sample).unwrap() {
            let old = &files[edit.file];
            let new = (edit.change)(old).unwrap();
            assert_ne!(*old, new, "{}", edit.title);
            files.insert(edit.file.to_owned(), new);
        }
    }

    #[test]
    fn edit_of_another_file_is_refused() {
        assert!(replace(b"nothing here", WHITE_BALANCE, WARM).is_err());
    }
}
