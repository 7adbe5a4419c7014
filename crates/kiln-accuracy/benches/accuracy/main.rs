//! `cargo xtask bench accuracy`: whether maps keep the error that was asked for, what is predicted of it, and what it costs.
//!
//! ```text
//! … [--only NAME] [--lobes ggx,lambert,charlie] [--probes COUNT]
//! ```
//!
//! Every real panorama below the folder that KILN_CORPUS names, every lobe, errors from 3e-2 to 1e-4 as 32-bit floats and to
//! 5e-4 as 16-bit ones. The error is that of the texels as stored, the worst level's RMS beside brute force at weighted probes.
//! Predicted is what the map expects of truncation with what encoding changed. A figure that misses its target is marked MISSED, and the program
//! then ends with exit code 1: measured ≤ asked; predicted ≤ 2 × measured where truncation dominates; a 10 times looser error
//! takes less counted work, unless that is at its floor.

#![expect(clippy::print_stdout, reason = "a bench prints")]

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use kiln_accuracy::{LobeKind, Truth, chain, convolve};
use kiln_bake::{BruteForce, Prefiltered, RoughnessLaw, TexelFormat, decode_level, encode_level, scale_log2};
use kiln_image::{Cancel, Limits, Panorama, TexelPolicy, decode};

const WANTED: &str = "nobody cancels";
/// Folders of the corpus with panoramas of real places.
const FOLDERS: [&str; 5] =
    ["hdr/polyhaven-bevy", "hdr/polyhaven-pmndrs", "hdr/nvpro", "hdr/loadersgl", "exr/pmndrs-npm"];
const FACE_SIZE: usize = 256;
const ERRORS: [f64; 6] = [3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4];
/// Halves are off by 2e-4 as they are.
const HALF_ERRORS: [f64; 5] = [3e-2, 1e-2, 3e-3, 1e-3, 5e-4];
/// Truncation dominates where it is well above what evaluation and rounding leave.
const TRUNCATION_MIN: f64 = 1e-4;
/// What 10 times the error must save at least, unless the work is at its floor: reading the panorama and its rows' FFTs.
const FLOOR: f64 = 1.25;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let after =
        |name: &str| arguments.iter().skip_while(|argument| *argument != name).nth(1).map(String::as_str);
    let only = after("--only").unwrap_or("");
    let lobes = after("--lobes").unwrap_or("ggx,lambert,charlie");
    let probes = after("--probes").and_then(|count| count.parse().ok());
    let mut bench = Bench { probes, missed: 0, worst_ratio: 0.0, count: 0 };
    for (name, panorama) in panoramas(only) {
        println!("{name}, {}×{}, brightest {:.4}", panorama.width(), panorama.height(), panorama.max_value());
        let force = BruteForce::new(&panorama, Cancel::NEVER).expect(WANTED);
        for kind in LobeKind::ALL.into_iter().filter(|kind| lobes.contains(kind.name())) {
            bench.lobe(&panorama, &force, kind);
        }
    }
    println!(
        "\n{} chains; predicted at most {:.2} times what was measured where truncation dominates; {} MISSED",
        bench.count, bench.worst_ratio, bench.missed
    );
    if bench.missed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

struct Bench {
    probes: Option<usize>,
    missed: usize,
    worst_ratio: f64,
    count: usize,
}

/// What a chain was found to have.
struct Found {
    /// The worst level's.
    measured: f64,
    /// Predicted for that level, over what was measured; `None` where truncation does not dominate.
    ratio: Option<f64>,
}

impl Bench {
    fn mark(&mut self, is_met: bool) -> &'static str {
        self.missed += usize::from(!is_met);
        if is_met { "" } else { "  MISSED" }
    }

    fn lobe(&mut self, panorama: &Panorama, force: &BruteForce, kind: LobeKind) {
        // With 48 probes the RMS of an error around many lamps comes out up to a third of what it is.
        let usual = if kind == LobeKind::Charlie { 16 } else { 256 };
        let texels = panorama.width() * panorama.height();
        let probes = self.probes.unwrap_or((usual << 19) / texels.max(1)).clamp(8, 256);
        let levels = chain(kind, FACE_SIZE, &RoughnessLaw::Linear);
        let truths: Vec<Truth> = levels
            .into_iter()
            .map(|level| Truth::new(force, level, probes, Cancel::NEVER).expect(WANTED))
            .collect();
        let levels: Vec<_> = truths.iter().map(|truth| truth.level).collect();
        let mut work = Vec::new();
        for error in ERRORS.into_iter().chain([5e-4]) {
            let (maps, made) = convolve(panorama, &levels, error, Cancel::NEVER).expect(WANTED);
            let mut line = format!("  {:<8} {error:>7.0e}", kind.name());
            if ERRORS.contains(&error) {
                work.push(made.flops as f64);
                let found = compare(&truths, &maps, TexelFormat::Rgba32Float);
                line += &self.judged("f32", error, &found);
            }
            if HALF_ERRORS.contains(&error) {
                let found = compare(&truths, &maps, TexelFormat::Rgba16Float);
                line += &self.judged("f16", error, &found);
            }
            println!("{line}  {:.2e} operations", made.flops as f64);
            self.count += 1;
        }
        // Two steps of the list are a factor of ten.
        let floor = work[0] * FLOOR;
        for pair in work.windows(3) {
            let is_cheaper = pair[0] < pair[2] || pair[2] <= floor;
            if !is_cheaper {
                println!("  {}: 10 times the error saves no work: {pair:?}{}", kind.name(), self.mark(false));
            }
        }
    }

    fn judged(&mut self, format: &str, asked: f64, found: &Found) -> String {
        let ratio =
            found.ratio.map_or_else(String::new, |ratio| format!(", predicted {ratio:.2} times that"));
        self.worst_ratio = found.ratio.unwrap_or(0.0).max(self.worst_ratio);
        let is_met = found.measured <= asked && found.ratio.is_none_or(|ratio| ratio <= 2.0);
        format!("  {format} {:.1e}{ratio}{}", found.measured, self.mark(is_met))
    }
}

/// The worst level of a chain as it is stored.
fn compare(truths: &[Truth], maps: &[Prefiltered], format: TexelFormat) -> Found {
    let mut found = Found { measured: 0.0, ratio: None };
    for (truth, map) in truths.iter().zip(maps) {
        let brightest = map.cube.rgb.iter().copied().fold(0.0, f32::max);
        let scale = if format == TexelFormat::Rgba32Float { 0 } else { scale_log2(brightest) };
        let encoded = encode_level(&map.cube, format, scale, Cancel::NEVER).expect(WANTED);
        let stored = decode_level(&encoded.bytes, map.cube.face_size, format, scale).expect("our own bytes");
        let measured = truth.compare_map(&stored).rms;
        if measured > found.measured || measured.is_nan() {
            found.measured = measured;
        }
        let expected = map.accuracy.rms_expected;
        if expected >= TRUNCATION_MIN.max(4.0 * encoded.rounding_rms) {
            let predicted = (expected * expected + encoded.rounding_rms * encoded.rounding_rms).sqrt();
            found.ratio = Some(found.ratio.unwrap_or(0.0_f64).max(predicted / measured));
        }
    }
    found
}

fn panoramas(only: &str) -> Vec<(String, Panorama)> {
    let Some(root) = std::env::var_os("KILN_CORPUS").map(PathBuf::from) else {
        println!("SKIPPED: all panoramas: KILN_CORPUS is not set");
        return Vec::new();
    };
    let mut found = Vec::new();
    for folder in FOLDERS {
        let Ok(entries) = std::fs::read_dir(root.join(folder)) else {
            println!("SKIPPED: {folder} is not in the corpus");
            continue;
        };
        let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        files.sort();
        for file in files {
            let name = format!("{folder}/{}", file.file_name().unwrap_or_default().to_string_lossy());
            let is_image = file.extension().is_some_and(|extension| extension == "hdr" || extension == "exr");
            if !is_image || !name.contains(only) {
                continue;
            }
            match read(&file) {
                Ok(panorama) => found.push((name, panorama)),
                Err(reason) => println!("SKIPPED: {name}: {reason}"),
            }
        }
    }
    found
}

fn read(file: &Path) -> Result<Panorama, String> {
    let text = |error: &dyn std::fmt::Display| error.to_string();
    let bytes = std::fs::read(file).map_err(|error| text(&error))?;
    let mut image = decode(&bytes, &Limits::default(), Cancel::NEVER).map_err(|error| text(&error))?.image;
    TexelPolicy::Repair.apply(&mut image, Cancel::NEVER).map_err(|error| text(&error))?;
    Panorama::new(image).map_err(|error| text(&error))
}
