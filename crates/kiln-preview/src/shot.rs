//! Screenshots: the picture as it is seen, its radiance and its parameter sheets, written on a thread of their own.

use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};

use anyhow::{Context as _, bail};
use kiln_gpu::{Gpu, Submitted};
use kiln_image::Cancel;
use kiln_image::compare::heat_map;

use crate::look::LookSheet;
use crate::measurer::compare_pictures;
use crate::readout::{COPY_LIMIT, Rgb, read_radiance, read_rgb};
use crate::view::Selection;

/// Numbers that are tried for a name.
const NUMBERS_MAX: u32 = 9999;

/// What is written of one moment.
pub(crate) struct Shot {
    /// Made if it is not there.
    pub folder: PathBuf,
    /// Name of the files without number and ending.
    pub stem: String,
    /// One copy, or those of A and B.
    pub pictures: Vec<wgpu::Texture>,
    pub composition: Composition,
    pub radiance: Option<wgpu::Texture>,
    /// When all of them are there.
    pub copied: Submitted,
    /// With what is added to the name of each.
    pub sheets: Vec<(&'static str, LookSheet)>,
}

/// How pictures become one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Composition {
    /// The first alone.
    One,
    /// The first up to this part of the width, then the second.
    Swipe(f32),
    /// FLIP of the two in colours.
    HeatMap,
}

/// Writes one shot after another.
pub(crate) struct ShotWriter {
    shots: Sender<Shot>,
    written: Receiver<Result<Vec<PathBuf>, String>>,
}

impl ShotWriter {
    /// Starts the thread; `wake` is called whenever [`ShotWriter::take`] has something new.
    pub fn spawn(gpu: Gpu, wake: impl Fn() + Send + 'static) -> anyhow::Result<Self> {
        let (shots, asked) = channel::<Shot>();
        let (sender, written) = channel();
        let write = move || {
            for shot in asked {
                let written = write(&gpu, &shot).map_err(|error| format!("{error:#}"));
                if sender.send(written).is_err() {
                    return;
                }
                wake();
            }
        };
        std::thread::Builder::new().name("shots".into()).spawn(write).context("starting a thread")?;
        Ok(ShotWriter { shots, written })
    }

    /// Writes a shot.
    pub fn write(&self, shot: Shot) {
        // The thread ends only with the window.
        drop(self.shots.send(shot));
    }

    /// The files of the oldest shot that was written, picture first, or why it was not; once.
    pub fn take(&self) -> Option<Result<Vec<PathBuf>, String>> {
        self.written.try_recv().ok()
    }
}

/// `SCENE-ENV-VARIANT_rN`, of characters that every file system takes.
pub(crate) fn stem(shown: &Selection, revision: u64) -> String {
    let names = [&shown.scene, &shown.env, &shown.variant].into_iter().flatten();
    let names: Vec<String> = names.map(|name| plain(name)).collect();
    let names = if names.is_empty() { "picture".to_owned() } else { names.join("-") };
    format!("{names}_r{revision}")
}

fn plain(name: &str) -> String {
    let plain = |letter: char| if letter.is_alphanumeric() || "._".contains(letter) { letter } else { '-' };
    // Nothing hidden, and short enough for three of them.
    name.trim_start_matches('.').chars().take(60).map(plain).collect()
}

fn write(gpu: &Gpu, shot: &Shot) -> anyhow::Result<Vec<PathBuf>> {
    // Reading waits with a lock that frames need: not for what is not there yet.
    shot.copied.wait(COPY_LIMIT);
    let pictures = shot.pictures.iter().map(|texture| read_rgb(gpu, texture)).collect::<Result<Vec<_>, _>>();
    let picture = compose(&pictures.context("reading the picture")?, shot.composition)?;
    let radiance = shot.radiance.as_ref().map(|texture| read_radiance(gpu, texture));
    let radiance = radiance.transpose().context("reading the radiance")?;
    std::fs::create_dir_all(&shot.folder)
        .with_context(|| format!("making the folder {}", shot.folder.display()))?;
    let endings: Vec<String> = shot.sheets.iter().map(|(suffix, _)| format!("{suffix}.json")).collect();
    let endings: Vec<&str> = endings.iter().map(String::as_str).chain([".exr"]).collect();
    let (base, file) = reserve(&shot.folder, &shot.stem, &endings)?;
    let png = kiln_image::png::encode_rgb8(picture.width, picture.height, &picture.bytes);
    let mut written = vec![finish(file, with_ending(&base, ".png"), &png)?];
    if let Some(radiance) = radiance {
        let exr = kiln_image::exr_write::encode_image(&radiance, Cancel::NEVER)?;
        written.push(write_new(with_ending(&base, ".exr"), &exr)?);
    }
    for (suffix, sheet) in &shot.sheets {
        written.push(write_new(with_ending(&base, &format!("{suffix}.json")), sheet.text().as_bytes())?);
    }
    Ok(written)
}

/// The first numbered name of which no file is there, and its picture, open. Whoever comes at the same time gets the next.
fn reserve(folder: &Path, stem: &str, endings: &[&str]) -> anyhow::Result<(PathBuf, File)> {
    for number in 1..=NUMBERS_MAX {
        let base = folder.join(format!("{stem}_{number:03}"));
        if endings.iter().any(|ending| with_ending(&base, ending).exists()) {
            continue;
        }
        let picture = with_ending(&base, ".png");
        match OpenOptions::new().write(true).create_new(true).open(&picture) {
            Ok(file) => return Ok((base, file)),
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error).with_context(|| format!("writing {}", picture.display())),
        }
    }
    bail!("{} has {NUMBERS_MAX} pictures named {stem} already; move some away", folder.display())
}

fn with_ending(base: &Path, ending: &str) -> PathBuf {
    let mut name = base.as_os_str().to_owned();
    name.push(ending);
    PathBuf::from(name)
}

fn write_new(path: PathBuf, bytes: &[u8]) -> anyhow::Result<PathBuf> {
    let file = OpenOptions::new().write(true).create_new(true).open(&path);
    finish(file.with_context(|| format!("writing {}", path.display()))?, path, bytes)
}

fn finish(mut file: File, path: PathBuf, bytes: &[u8]) -> anyhow::Result<PathBuf> {
    file.write_all(bytes).with_context(|| format!("writing {}", path.display()))?;
    Ok(path)
}

/// The picture as it is seen.
pub(crate) fn compose(pictures: &[Rgb], composition: Composition) -> anyhow::Result<Rgb> {
    let first = pictures.first().context("there is no picture yet")?;
    let second = pictures.get(1).unwrap_or(first);
    let mut composed = first.clone();
    match composition {
        Composition::One => {}
        Composition::Swipe(divider) => {
            let column = (divider.clamp(0.0, 1.0) * first.width as f32).round() as usize;
            let rows = composed.bytes.chunks_exact_mut(3 * first.width.max(1));
            for (row, other) in rows.zip(second.bytes.chunks_exact(3 * second.width.max(1))) {
                row[3 * column..].copy_from_slice(&other[3 * column..]);
            }
        }
        Composition::HeatMap => composed.bytes = heat_map(&compare_pictures(first, second)?.flip_map),
    }
    Ok(composed)
}
