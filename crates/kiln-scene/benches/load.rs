//! `cargo xtask bench scenes`: time and memory of reading a large GLB, each figure in a process of its own.
//!
//! ```text
//! … [MEGABYTES] [RUNS]
//! ```
//!
//! A figure that misses its target is marked MISSED, and the program then ends with exit code 1. Times are medians
//! of several processes, with the least beside them; memory is the most that was resident (VmHWM), file included.

#![expect(clippy::print_stdout, reason = "a bench prints")]

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::Instant;

/// The argument that makes a process the child.
const CHILD: &str = "--child";
const LOAD_MAX_S: f64 = 1.0;
/// Of the file's size, the file's own bytes included.
const PEAK_MAX: f64 = 2.5;
const PRIMITIVE_COUNT: usize = 6;
/// Position, normal, tangent and coordinates, and six indices of four bytes: what a vertex of a grid takes.
const BYTES_PER_VERTEX: usize = 4 * (3 + 3 + 4 + 2) + 6 * 4;

fn main() -> ExitCode {
    // Cargo adds `--bench`.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    if let [child, step, file] = arguments.as_slice()
        && child == CHILD
    {
        run_child(step, Path::new(file));
        return ExitCode::SUCCESS;
    }
    let number = |at: usize, default| arguments.get(at).and_then(|it| it.parse().ok()).unwrap_or(default);
    let (megabytes, runs): (usize, usize) = (number(0, 100), number(1, 5));
    let glb = dense_glb(megabytes * 1_000_000, 1);
    let file = std::env::temp_dir().join(format!("kiln-bench-scenes-{}.glb", std::process::id()));
    std::fs::write(&file, &glb).expect("the temporary folder can be written");
    let size = glb.len();
    drop(glb);
    println!(
        "{:.1} MB GLB: {PRIMITIVE_COUNT} primitives of positions, normals, tangents, coordinates and u32 indices",
        size as f64 / 1e6
    );
    let met: Vec<bool> =
        ["read", "load", "pack", "both"].iter().map(|step| report(step, &file, size, runs)).collect();
    // It may be gone already.
    let _ = std::fs::remove_file(&file);
    if met.iter().all(|met| *met) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Prints what a step took; whether it met its targets, if it has any.
fn report(step: &str, file: &PathBuf, size: usize, runs: usize) -> bool {
    let program = std::env::current_exe().expect("this program has a path");
    let (mut times, mut peaks) = (Vec::new(), Vec::new());
    for _ in 0..runs {
        let output = Command::new(&program).args([CHILD, step]).arg(file).output();
        let output = output.expect("this program starts again");
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let mut numbers = text.split_whitespace().filter_map(|word| word.parse::<f64>().ok());
        let (Some(time), Some(peak)) = (numbers.next(), numbers.next()) else {
            println!("{step}: {} {text}{}  MISSED", output.status, String::from_utf8_lossy(&output.stderr));
            return false;
        };
        times.push(time);
        peaks.push(peak * 1024.0 / size as f64);
    }
    times.sort_by(f64::total_cmp);
    peaks.sort_by(f64::total_cmp);
    let (time, least, peak) = (times[times.len() / 2], times[0], peaks[peaks.len() / 2]);
    // A target of loading; packing is done once for a file and kept.
    let met = step != "load" || time <= LOAD_MAX_S && peak <= PEAK_MAX;
    let target =
        if step == "load" { format!(", targets {LOAD_MAX_S} s and {PEAK_MAX}") } else { String::new() };
    let mark = if met { "" } else { "  MISSED" };
    println!(
        "{step}: median {time:.2} s, least {least:.2} s, peak resident {peak:.2} of the file's size{target}{mark}"
    );
    met
}

/// Does one step and prints its seconds and the peak of resident memory in KiB.
fn run_child(step: &str, file: &Path) {
    let bytes = std::fs::read(file).expect("the bench made it");
    let start = Instant::now();
    let done = match step {
        "load" => kiln_scene::load(&bytes).expect("the bench's file is valid").primitives.len(),
        "pack" => packed(&bytes).len(),
        // What a viewer of one file does.
        "both" => kiln_scene::load(&packed(&bytes)).expect("a pack is valid").primitives.len(),
        _ => bytes.len(),
    };
    let seconds = start.elapsed().as_secs_f64();
    assert!(done > 0, "nothing was read");
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or_default();
    println!("{seconds} {}", peak.trim().trim_end_matches("kB").trim());
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    let packed = kiln_scene::pack("bench.glb", bytes, &mut |_| None);
    packed.glb.unwrap_or_else(|| panic!("{:?}", packed.diagnostics))
}

/// Bumpy grids, as many vertices as fit.
fn dense_glb(size_bytes: usize, seed: u64) -> Vec<u8> {
    let edge = ((size_bytes / PRIMITIVE_COUNT / BYTES_PER_VERTEX) as f64).sqrt() as usize;
    let (mut bin, mut views, mut accessors, mut primitives) = (Vec::new(), vec![], vec![], vec![]);
    let mut random = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    for primitive in 0..PRIMITIVE_COUNT {
        let heights: Vec<f32> = (0..edge * edge)
            .map(|_| {
                // xorshift64 (G. Marsaglia, 2003).
                random ^= random << 13;
                random ^= random >> 7;
                random ^= random << 17;
                (random >> 40) as f32 / 16_777_216.0
            })
            .collect();
        let grid = Grid { edge, heights, offset: primitive as f32 * 2.0 };
        let columns = [
            (grid.positions(), "VEC3", r#","min":[-1,-1,-1],"max":[99,99,99]"#),
            (grid.normals(), "VEC3", ""),
            (grid.tangents(), "VEC4", ""),
            (grid.coordinates(), "VEC2", ""),
        ];
        let first = accessors.len();
        for (values, kind, bounds) in columns {
            let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
            let count = edge * edge;
            let view = push_view(&mut bin, &mut views, &bytes);
            accessors.push(format!(
                r#"{{"bufferView":{view},"componentType":5126,"count":{count},"type":"{kind}"{bounds}}}"#
            ));
        }
        let bytes: Vec<u8> = grid.indices().iter().flat_map(|index| index.to_le_bytes()).collect();
        let view = push_view(&mut bin, &mut views, &bytes);
        let count = bytes.len() / 4;
        accessors
            .push(format!(r#"{{"bufferView":{view},"componentType":5125,"count":{count},"type":"SCALAR"}}"#));
        primitives.push(format!(
            r#"{{"attributes":{{"POSITION":{first},"NORMAL":{},"TANGENT":{},"TEXCOORD_0":{}}},"indices":{},"material":0}}"#,
            first + 1, first + 2, first + 3, first + 4
        ));
    }
    // Brushed, so that tangents are read although there is no picture.
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["KHR_materials_anisotropy"],"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],"materials":[{{"extensions":{{"KHR_materials_anisotropy":{{"anisotropyStrength":0.5}}}}}}],"meshes":[{{"primitives":[{}]}}],"accessors":[{}],"bufferViews":[{}],"buffers":[{{"byteLength":{}}}]}}"#,
        primitives.join(","),
        accessors.join(","),
        views.join(","),
        bin.len()
    );
    glb(json.into_bytes(), bin)
}

struct Grid {
    edge: usize,
    heights: Vec<f32>,
    offset: f32,
}

impl Grid {
    fn at<const N: usize>(&self, value: impl Fn(f32, f32, usize) -> [f32; N]) -> Vec<f32> {
        let scale = 1.0 / (self.edge - 1) as f32;
        let cells = (0..self.edge * self.edge).map(|at| (at % self.edge, at / self.edge, at));
        cells.flat_map(|(x, y, at)| value(x as f32 * scale, y as f32 * scale, at)).collect()
    }

    fn positions(&self) -> Vec<f32> {
        self.at(|u, v, at| [u + self.offset, 0.01 * self.heights[at], v])
    }

    fn normals(&self) -> Vec<f32> {
        self.at(|u, v, _| {
            let length = (u * u + v * v + 4.0).sqrt();
            [u / length, 2.0 / length, v / length]
        })
    }

    fn tangents(&self) -> Vec<f32> {
        self.at(|_, v, _| {
            let length = (v * v + 4.0).sqrt();
            [0.0, -v / length, 2.0 / length, 1.0]
        })
    }

    fn coordinates(&self) -> Vec<f32> {
        self.at(|u, v, _| [u, v])
    }

    fn indices(&self) -> Vec<u32> {
        let edge = self.edge as u32;
        let cells = (0..edge - 1).flat_map(|y| (0..edge - 1).map(move |x| y * edge + x));
        cells.flat_map(|at| [at, at + edge, at + 1, at + 1, at + edge, at + edge + 1]).collect()
    }
}

/// Appends bytes and their buffer view; returns its index.
fn push_view(bin: &mut Vec<u8>, views: &mut Vec<String>, bytes: &[u8]) -> usize {
    views.push(format!(r#"{{"buffer":0,"byteOffset":{},"byteLength":{}}}"#, bin.len(), bytes.len()));
    bin.extend_from_slice(bytes);
    views.len() - 1
}

fn glb(mut json: Vec<u8>, bin: Vec<u8>) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let total = 12 + 8 + json.len() + 8 + bin.len();
    let mut glb = Vec::with_capacity(total);
    for (word, bytes) in [(0x4e4f_534a, json), (0x004e_4942, bin)] {
        if glb.is_empty() {
            [0x4654_6c67, 2, total as u32].iter().for_each(|word: &u32| glb.extend(word.to_le_bytes()));
        }
        glb.extend((bytes.len() as u32).to_le_bytes());
        glb.extend(u32::to_le_bytes(word));
        glb.extend(bytes);
    }
    glb
}
