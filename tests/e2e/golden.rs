//! Golden frames of the sample project, drawn by the real program.
//!
//! `KILN_UPDATE_GOLDEN=1 cargo test --release -p kiln golden` records them anew; look at each before it is
//! committed. They were recorded on lavapipe of Mesa 22.3.6.

use std::path::{Path, PathBuf};

use image::{Rgb, RgbImage};
use serde_json::Value;

use crate::harness::{Project, skip, text};

/// On the driver that recorded them, frames differ by rounding in the last places of f32 at most.
const TOLERANCE_SAME_DRIVER: Tolerance = Tolerance { difference_max: 2, outlier_share_max: 0.0 };
/// Other drivers filter and rasterise with other roundings, most visible along edges.
const TOLERANCE_OTHER_DRIVER: Tolerance = Tolerance { difference_max: 8, outlier_share_max: 0.01 };

#[derive(Clone, Copy)]
struct Tolerance {
    /// Largest difference of a channel, in 1/255.
    difference_max: u8,
    /// Share of pixels that may differ by more.
    outlier_share_max: f64,
}

#[test]
fn sample_under_each_environment() {
    let project = Project::sample();
    let watch = project.watch();
    watch.published();
    for env in ["sky", "studio", "orientation"] {
        let out = project.beside(env);
        let mut command =
            project.command(&["preview", "DIR", "--headless", "--size", "320x180", "--env", env, "--out"]);
        let output = command.arg(&out).output().unwrap();
        let said = text(&output.stderr);
        if said.contains("mesa-vulkan-drivers") {
            return skip("golden frames", "there is no graphics device");
        }
        assert!(output.status.success(), "{said}");
        let report: Value = serde_json::from_slice(&std::fs::read(out.join("report.json")).unwrap()).unwrap();
        let actual = image::open(out.join("frame_0001.png")).unwrap().to_rgb8();
        check(&format!("balls-{env}"), &actual, report["adapter"].as_str().unwrap());
    }
}

/// The first of them is the one that frames have unless somebody chooses.
#[test]
fn sample_through_each_tone_curve() {
    let project = Project::sample();
    let out = project.beside("curves");
    let arguments = ["render", "DIR", "--size", "320x180", "--env", "sky", "--exposure", "1.5", "--json"];
    let mut command = project.command(&arguments);
    let output = command.args(["--vary", "tone_mapper", "--out"]).arg(&out).output().unwrap();
    let said = text(&output.stderr);
    if said.contains("mesa-vulkan-drivers") {
        return skip("golden frames", "there is no graphics device");
    }
    assert!(output.status.success(), "{said}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    for curve in ["neutral", "agx", "aces", "reinhard", "none"] {
        let actual = image::open(out.join(format!("balls-sky-{curve}.png"))).unwrap().to_rgb8();
        check(&format!("curve-{curve}"), &actual, report["adapter"].as_str().unwrap());
    }
}

pub fn check(name: &str, actual: &RgbImage, adapter: &str) {
    if std::env::var_os("KILN_UPDATE_GOLDEN").is_some() {
        actual.save(golden_path(name)).unwrap();
        return;
    }
    let expected = expected(name);
    if let Err(reason) = compare(&expected, actual, tolerance_of(adapter)) {
        let shown = show_difference(name, &expected, actual);
        panic!("{name} on {adapter}: {reason}; expected | difference | actual: {}", shown.display());
    }
}

/// The recorded frame.
pub fn expected(name: &str) -> RgbImage {
    let path = golden_path(name);
    let read = image::open(&path);
    read.unwrap_or_else(|error| panic!("{}: {error}; record it with KILN_UPDATE_GOLDEN=1", path.display()))
        .to_rgb8()
}

/// Whether a frame passes for another.
pub fn is_within_tolerance(expected: &RgbImage, actual: &RgbImage, adapter: &str) -> bool {
    compare(expected, actual, tolerance_of(adapter)).is_ok()
}

fn tolerance_of(adapter: &str) -> Tolerance {
    let is_same_driver = adapter.contains("llvmpipe") && adapter.contains("22.3.6");
    if is_same_driver { TOLERANCE_SAME_DRIVER } else { TOLERANCE_OTHER_DRIVER }
}

fn golden_path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden").join(format!("{name}.png"))
}

fn difference(a: &Rgb<u8>, b: &Rgb<u8>) -> u8 {
    (0..3).map(|channel| a.0[channel].abs_diff(b.0[channel])).max().unwrap_or(0)
}

fn compare(expected: &RgbImage, actual: &RgbImage, tolerance: Tolerance) -> Result<(), String> {
    if expected.dimensions() != actual.dimensions() {
        return Err(format!("{:?} became {:?}", expected.dimensions(), actual.dimensions()));
    }
    let differences = expected.pixels().zip(actual.pixels()).map(|(a, b)| difference(a, b));
    let outliers = differences.filter(|&difference| difference > tolerance.difference_max).count();
    let share = outliers as f64 / f64::from(expected.width() * expected.height());
    if share <= tolerance.outlier_share_max {
        return Ok(());
    }
    Err(format!("{outliers} pixels differ by more than {}/255", tolerance.difference_max))
}

fn show_difference(name: &str, expected: &RgbImage, actual: &RgbImage) -> PathBuf {
    let (width, height) = expected.dimensions();
    let picture = RgbImage::from_fn(width * 3, height, |x, y| {
        let at =
            |image: &RgbImage| image.get_pixel_checked(x % width, y).copied().unwrap_or(Rgb([255, 0, 255]));
        match x / width {
            0 => at(expected),
            1 => Rgb([difference(&at(expected), &at(actual)).saturating_mul(16); 3]),
            _ => at(actual),
        }
    });
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("golden");
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(format!("{name}.png"));
    picture.save(&path).unwrap();
    path
}

#[test]
fn one_texel_moved_by_more_than_the_tolerance_is_rejected() {
    let expected = RgbImage::from_pixel(8, 8, Rgb([100, 100, 100]));
    let mut actual = expected.clone();
    actual.put_pixel(3, 3, Rgb([100, 102, 100]));
    assert!(compare(&expected, &actual, TOLERANCE_SAME_DRIVER).is_ok());
    actual.put_pixel(3, 3, Rgb([100, 103, 100]));
    assert!(compare(&expected, &actual, TOLERANCE_SAME_DRIVER).is_err());
    assert!(compare(&expected, &RgbImage::new(8, 7), TOLERANCE_SAME_DRIVER).is_err());
    let all = RgbImage::from_pixel(8, 8, Rgb([100, 100, 109]));
    assert!(compare(&expected, &all, TOLERANCE_OTHER_DRIVER).is_err());
}
