//! Every real file against what independent readers saw in it.

use super::{check_texels, corpus, decode_default};
use crate::{Cancel, DecodeError, Decoded, Environment, Limits, colour::luminance, decode_environment};
use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

/// Damaged and hostile files must be refused this fast; measured are microseconds, the rest is a busy machine.
const REFUSAL_TIME_MAX: Duration = Duration::from_secs(1);

/// Statistics agree to the six digits the table has.
const STATISTICS_TOLERANCE: f64 = 1e-5;

/// One row of IMAGE_STATS.tsv with numbers in it.
struct Row {
    path: String,
    size: (usize, usize),
    /// Smallest, largest, mean.
    luminance: [f64; 3],
    /// NaN, infinite, negative.
    counts: [usize; 3],
}

fn rows(folder: &Path, start: &str) -> Vec<Row> {
    let text = std::fs::read_to_string(folder.join("IMAGE_STATS.tsv")).expect("the table is there");
    let rows: Vec<Row> =
        text.lines().skip(1).filter(|line| line.starts_with(start)).filter_map(parse_row).collect();
    assert!(!rows.is_empty(), "no rows of {start}");
    rows
}

fn parse_row(line: &str) -> Option<Row> {
    let fields: Vec<&str> = line.split('\t').collect();
    let number = |index: usize| fields.get(index)?.parse::<f64>().ok();
    let count = |index: usize| fields.get(index)?.parse::<usize>().ok();
    Some(Row {
        path: fields[0].to_owned(),
        size: (count(1)?, count(2)?),
        luminance: [number(3)?, number(4)?, number(5)?],
        counts: [count(6)?, count(7)?, count(8)?],
    })
}

fn decode_row(folder: &Path, row: &Row) -> Result<Decoded, DecodeError> {
    decode_default(&std::fs::read(folder.join(&row.path)).expect("a file of the corpus"))
}

/// Smallest, largest and mean luminance of finite texels.
fn luminance_stats(decoded: &Decoded) -> [f64; 3] {
    let values = decoded.image.rgb.chunks_exact(3).map(|t| luminance([t[0], t[1], t[2]]));
    let finite: Vec<f64> = values.filter(|y| y.is_finite()).collect();
    let min = finite.iter().copied().fold(f64::INFINITY, f64::min);
    let max = finite.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    [min, max, finite.iter().sum::<f64>() / finite.len() as f64]
}

/// Luminance as stored has weights from the primaries, not BT.709's rounded to four digits.
const STORED_LUMINANCE_TOLERANCE: f64 = 1e-4;

/// `None` where the decoded values have the row's statistics, else what differs.
fn difference(row: &Row, decoded: &Decoded, scale: f64) -> Option<String> {
    let is_from_luminance = decoded.notes.iter().any(|note| note.contains("luminance and chroma"));
    let relative = if is_from_luminance { STORED_LUMINANCE_TOLERANCE } else { STATISTICS_TOLERANCE };
    let [min_wanted, max_wanted, mean_wanted] = row.luminance.map(|value| value * scale);
    let tolerance = max_wanted.abs() * relative;
    // A mean of 0 is a sum that cancels: what is left is rounding of the largest terms.
    let mean_tolerance = mean_wanted.abs() * relative + tolerance * 1e-6;
    let [min, max, mean] = luminance_stats(decoded);
    let compared = [
        ("smallest luminance", min, min_wanted, tolerance),
        ("largest luminance", max, max_wanted, tolerance),
        ("mean luminance", mean, mean_wanted, mean_tolerance),
    ];
    let is_close = |actual: f64, wanted: f64, tolerance: f64| (actual - wanted).abs() <= tolerance;
    if let Some((what, actual, wanted, _)) = compared.into_iter().find(|&(_, a, w, t)| !is_close(a, w, t)) {
        return Some(format!("{}: {what} is {actual}, not {wanted}", row.path));
    }
    let report = check_texels(&decoded.image);
    let counts = [report.nan.count, report.infinite.count, report.negative.count];
    // Chroma between its samples overshoots at edges, which luminance, all that the table has, does not show.
    (counts != row.counts && !is_from_luminance)
        .then(|| format!("{}: NaN, infinite, negative are {counts:?}", row.path))
}

#[test]
fn every_hdr_row_decodes_to_its_statistics() {
    let Some(folder) = corpus("every_hdr_row_decodes_to_its_statistics") else { return };
    for row in rows(&folder, "hdr/") {
        let decoded = decode_row(&folder, &row).unwrap_or_else(|error| panic!("{}: {error}", row.path));
        assert_eq!(decoded.format, "Radiance HDR");
        let is_rotated = row.path.contains("/rotate");
        let upright = if is_rotated { (row.size.1, row.size.0) } else { row.size };
        assert_eq!((decoded.image.width, decoded.image.height), upright, "{}", row.path);
        // The table has values as stored. Other primaries are compared in `corpus_orientation`.
        let is_other_space = ["/xyze", "/rgbe_flat"].iter().any(|name| row.path.contains(name));
        if !is_other_space {
            let scale = if row.path.contains("exposure_plus2") { 0.25 } else { 1.0 };
            assert_eq!(difference(&row, &decoded, scale), None);
        }
    }
}

#[test]
fn statistics_reject_one_percent_too_bright_and_one_nan() {
    let row = Row { path: String::new(), size: (2, 1), luminance: [1.0; 3], counts: [0; 3] };
    let difference_of = |rgb: Vec<f32>| {
        let image = crate::Image::new(2, 1, rgb).expect("six values");
        difference(&row, &Decoded { image, format: "Radiance HDR", notes: Vec::new() }, 1.0)
    };
    assert_eq!(difference_of(vec![1.0; 6]), None);
    assert!(difference_of(vec![1.0, 1.0, 1.0, 1.01, 1.01, 1.01]).is_some());
    assert!(difference_of(vec![1.0, 1.0, 1.0, 1.0, 1.0, f32::NAN]).is_some());
    assert!(difference_of(vec![f32::NAN; 6]).is_some());
}

/// What is refused, and why that is right.
const EXR_REFUSED: [(&str, &str); 8] = [
    ("comp_b44.exr", "subsampling of B44"),
    ("depth32f-custom-channels.exr", "no part has colour"),
    ("depth32f.exr", "no part has colour"),
    ("depth32ui.exr", "no part has colour"),
    ("custom-channels", "no part has colour"),
    ("az.exr", "no part has colour"),
    ("tiled_half_1x1_alpha.exr", "no part has colour"),
    ("deep-nosamples.exr", "deep"),
];

/// Whether the decoded values differ from the stored ones by intent, as the notes say.
fn is_converted(decoded: &Decoded) -> bool {
    let intents = ["was placed in", "were converted to Rec. 709", "reads as 0"];
    decoded.notes.iter().any(|note| intents.iter().any(|intent| note.contains(intent)))
}

#[test]
fn every_exr_row_decodes_to_its_statistics_or_says_why_not() {
    let Some(folder) = corpus("every_exr_row_decodes_to_its_statistics_or_says_why_not") else { return };
    let mut compared = 0;
    for row in rows(&folder, "exr/") {
        match decode_row(&folder, &row) {
            Ok(decoded) if is_converted(&decoded) => {}
            Ok(decoded) => {
                assert_eq!((decoded.image.width, decoded.image.height), row.size, "{}", row.path);
                assert_eq!(difference(&row, &decoded, 1.0), None);
                compared += 1;
            }
            Err(error) => {
                let text = error.to_string();
                let is_known = |(name, why): &(&str, &str)| row.path.contains(name) && text.contains(why);
                assert!(EXR_REFUSED.iter().any(is_known), "{}: {text}", row.path);
            }
        }
    }
    assert!(compared > 80, "{compared} files were compared");
}

/// Faces are only put in order and mirrored: the numbers stay.
#[test]
fn every_cube_row_decodes_to_its_statistics_as_a_cube() {
    let Some(folder) = corpus("every_cube_row_decodes_to_its_statistics_as_a_cube") else { return };
    let rows = rows(&folder, "cube/");
    for row in &rows {
        let bytes = std::fs::read(folder.join(&row.path)).expect("a file of the corpus");
        let decoded = decode_environment(&bytes, None, &Limits::default(), Cancel::NEVER);
        let decoded = decoded.unwrap_or_else(|error| panic!("{}: {error}", row.path));
        let Environment::Cube(cube) = decoded.environment else { panic!("{} is no cube", row.path) };
        assert_eq!((cube.face_size, 6 * cube.face_size), row.size, "{}", row.path);
        let (width, height) = row.size;
        // The table's reader makes grey of absent channels; radiance has none of what is absent.
        let is_complete = !decoded.notes.iter().any(|note| note.contains("reads as 0"));
        let image = crate::Image::new(width, height, cube.rgb).expect("six faces");
        if is_complete {
            assert_eq!(
                difference(row, &Decoded { image, format: decoded.format, notes: Vec::new() }, 1.0),
                None
            );
        }
    }
    assert!(rows.len() >= 8, "{} cubes", rows.len());
}

#[test]
fn cube_strips_say_that_they_are_cubes() {
    let Some(folder) = corpus("cube_strips_say_that_they_are_cubes") else { return };
    let bytes =
        std::fs::read(folder.join("cube/openexr-images/StageEnvCube.exr")).expect("a file of the corpus");
    let decoded = decode_default(&bytes).expect("a tiled file with mip levels");
    assert_eq!((decoded.image.width, decoded.image.height), (256, 1536));
    assert!(decoded.notes.iter().any(|note| note.contains("cube map")), "{:?}", decoded.notes);
}

#[test]
fn damaged_and_hostile_files_are_refused_at_once() {
    let Some(folder) = corpus("damaged_and_hostile_files_are_refused_at_once") else { return };
    // One is the very file that also stands among the valid ones; the other merely has one channel, R.
    let sound = ["v1.7.test.tiled.exr", "v1.7.test.interleaved.exr"];
    let folders = ["hdr/hostile-oiio", "hdr/hostile-truncated", "exr-invalid"];
    let paths: Vec<PathBuf> = folders.iter().flat_map(|name| files(&folder.join(name))).collect();
    assert!(paths.len() > 100, "{} files", paths.len());
    for path in paths {
        let bytes = std::fs::read(&path).expect("a file of the corpus");
        let start = Instant::now();
        let result = decode_default(&bytes);
        let elapsed = start.elapsed();
        assert!(elapsed <= REFUSAL_TIME_MAX, "{}: {elapsed:?}", path.display());
        let is_sound = sound.iter().any(|name| path.ends_with(name));
        assert_eq!(result.is_ok(), is_sound, "{}: {result:?}", path.display());
    }
}

#[test]
fn truncated_hdr_names_the_row_and_the_byte() {
    let Some(folder) = corpus("truncated_hdr_names_the_row_and_the_byte") else { return };
    let bytes =
        std::fs::read(folder.join("hdr/hostile-truncated/trunc_lastbyte.hdr")).expect("in the corpus");
    let error = decode_default(&bytes).expect_err("its last byte is missing").to_string();
    assert_eq!(error, "Radiance HDR: the file ends in scanline 127, at byte 132656");
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).expect("a folder of the corpus") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            found.extend(files(&path));
        } else {
            found.push(path);
        }
    }
    found.sort();
    found
}
