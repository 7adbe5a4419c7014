//! `kiln diff`: two pictures, or two folders of them.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use kiln_image::colour::linear_to_srgb;
use kiln_image::compare::{Comparison, Picture, compare, heat_map};
use kiln_image::sheet::{Shot, khronos_neutral, shot_sheet};
use kiln_image::{Limits, decode};
use serde_json::{Value, json};

use crate::args::DiffArgs;
use crate::out::say;
use crate::{INPUT_IS_WRONG, place};

/// Endings of files that are pictures.
const ENDINGS: [&str; 5] = ["png", "jpg", "jpeg", "exr", "hdr"];

pub(crate) fn run(args: &DiffArgs) -> anyhow::Result<ExitCode> {
    let names = names(&args.reference, &args.test)?;
    let judged: Vec<Judged> =
        names.iter().map(|name| judge(args, name.as_deref())).collect::<anyhow::Result<_>>()?;
    if args.json {
        let limits = json!({ "flip_mean": args.flip, "difference_max": args.steps });
        let pictures: Vec<Value> = judged.iter().map(Judged::to_json).collect();
        say!("{:#}", json!({ "limits": limits, "pictures": pictures }));
    } else {
        judged.iter().for_each(|judged| say!("{}", judged.line()));
    }
    let is_good = judged.iter().all(|judged| judged.fault.is_none());
    Ok(if is_good { ExitCode::SUCCESS } else { ExitCode::from(INPUT_IS_WRONG) })
}

/// Names of pictures below both folders; `None` for two files.
fn names(reference: &Path, test: &Path) -> anyhow::Result<Vec<Option<String>>> {
    match (reference.is_dir(), test.is_dir()) {
        (false, false) => Ok(vec![None]),
        (true, true) => {
            let names: BTreeSet<String> =
                pictures_in(reference)?.into_iter().chain(pictures_in(test)?).collect();
            if names.is_empty() {
                let reason =
                    format!("neither {} nor {} holds a picture", reference.display(), test.display());
                return Err(place::WrongInput(reason).into());
            }
            Ok(names.into_iter().map(Some).collect())
        }
        _ => Err(place::WrongInput("compare two pictures or two folders, not one of each".to_owned()).into()),
    }
}

fn pictures_in(folder: &Path) -> anyhow::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(|| format!("reading {}", folder.display()))? {
        let path = entry.with_context(|| format!("reading {}", folder.display()))?.path();
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        let is_picture = ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str())) && path.is_file();
        names.extend(path.file_name().filter(|_| is_picture).map(|name| name.to_string_lossy().into_owned()));
    }
    Ok(names)
}

/// A pair of pictures, and what came of comparing them.
struct Judged {
    name: String,
    found: Option<Comparison>,
    /// Why it does not pass.
    fault: Option<String>,
    /// What shows the difference.
    shown: Option<PathBuf>,
}

fn judge(args: &DiffArgs, name: Option<&str>) -> anyhow::Result<Judged> {
    let [reference, test] = [&args.reference, &args.test].map(|path| match name {
        Some(name) => path.join(name),
        None => path.clone(),
    });
    let shown_name = name.map_or_else(|| test.display().to_string(), str::to_owned);
    let failed = |reason| Judged { name: shown_name.clone(), found: None, fault: Some(reason), shown: None };
    let (reference, test) = match (Display::read(&reference), Display::read(&test)) {
        (Ok(reference), Ok(test)) => (reference, test),
        (Err(reason), _) | (_, Err(reason)) => return Ok(failed(reason)),
    };
    let found = match compare(reference.picture(), test.picture()) {
        Ok(found) => found,
        Err(error) => return Ok(failed(error.to_string())),
    };
    let fault = fault(args, &found);
    let stem =
        Path::new(&shown_name).file_stem().map_or_else(String::new, |it| it.to_string_lossy().into_owned());
    let shown = match args.out.as_ref().filter(|_| found.differing > 0) {
        Some(folder) => Some(show(&folder.join(format!("{stem}.png")), &reference, &found, &test)?),
        None => None,
    };
    Ok(Judged { name: shown_name, found: Some(found), fault, shown })
}

fn fault(args: &DiffArgs, found: &Comparison) -> Option<String> {
    if found.flip_mean > args.flip {
        return Some(format!("FLIP {:.4} is above {}", found.flip_mean, args.flip));
    }
    let steps = args.steps.filter(|steps| found.difference_max > *steps)?;
    let [x, y] = found.place_of_max;
    Some(format!("a channel at ({x}, {y}) differs by {}/255, more than {steps}", found.difference_max))
}

/// Reference, heat map, test in a row.
fn show(path: &Path, reference: &Display, found: &Comparison, test: &Display) -> anyhow::Result<PathBuf> {
    let shot =
        |title: String, rgb: Vec<u8>| Shot { title, width: reference.width, height: reference.height, rgb };
    let shots = [
        shot("reference".to_owned(), reference.rgb.clone()),
        shot(
            format!("FLIP, mean {:.4}, max {:.2}", found.flip_mean, found.flip_max),
            heat_map(&found.flip_map),
        ),
        shot("test".to_owned(), test.rgb.clone()),
    ];
    let (width, height, rgb) = shot_sheet(&shots, 3);
    let png = kiln_image::png::encode_rgb8(width, height, &rgb);
    kiln_build::write_atomically(&kiln_build::Disk, path, &png)
        .context("writing the picture of differences")?;
    Ok(path.to_owned())
}

impl Judged {
    fn line(&self) -> String {
        let verdict = if self.fault.is_some() { "DIFFERS" } else { "ok" };
        let mut line = format!("{verdict:<8} {}", self.name);
        if let Some(found) = &self.found {
            line += &format!(
                "  FLIP {:.4}  RMSE {:.5}  PSNR {:.1} dB  max {}/255  {} pixels",
                found.flip_mean, found.rmse, found.psnr_db, found.difference_max, found.differing
            );
        }
        if let Some(fault) = &self.fault {
            line += &format!("\n         {fault}");
        }
        if let Some(shown) = &self.shown {
            line += &format!("\n         {}", shown.display());
        }
        line
    }

    fn to_json(&self) -> Value {
        let numbers = self.found.as_ref().map(|found| {
            json!({
                "flip_mean": found.flip_mean,
                "flip_max": found.flip_max,
                "rmse": found.rmse,
                // JSON has no infinity: equal pictures have none.
                "psnr_db": found.psnr_db.is_finite().then_some(found.psnr_db),
                "difference_max": found.difference_max,
                "place_of_max": found.place_of_max,
                "differing_pixels": found.differing,
            })
        });
        json!({ "name": self.name, "passes": self.fault.is_none(), "fault": self.fault,
                "found": numbers, "shown": self.shown })
    }
}

/// A picture as a display shows it.
struct Display {
    width: usize,
    height: usize,
    rgb: Vec<u8>,
}

impl Display {
    fn read(path: &Path) -> Result<Display, String> {
        let bytes =
            std::fs::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
        let decoded = decode(&bytes, &Limits::default());
        let decoded = decoded.map_err(|error| format!("{} is no picture: {error}", path.display()))?;
        let is_display = ["PNG", "JPEG"].contains(&decoded.format);
        let image = decoded.image;
        let encode = |rgb: &[f32]| {
            let linear = [0, 1, 2].map(|channel| f64::from(rgb[channel]));
            let shown = if is_display { linear } else { khronos_neutral(linear.map(|value| value.max(0.0))) };
            shown.map(|value| (linear_to_srgb(value.clamp(0.0, 1.0)) * 255.0).round() as u8)
        };
        let rgb = image.rgb.chunks_exact(3).flat_map(encode).collect();
        Ok(Display { width: image.width, height: image.height, rgb })
    }

    fn picture(&self) -> Picture<'_> {
        Picture { width: self.width, height: self.height, rgb: &self.rgb }
    }
}
