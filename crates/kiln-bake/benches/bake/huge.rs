//! Peak memory of the largest panorama, 16384×8192, in a process of its own.

use crate::Verdict;
use crate::accuracy::WANTED;
use crate::clock::once;
use kiln_bake::{AnalysisRequest, Cancel, analyse, specular_level};
use kiln_image::{Image, Panorama};
use std::process::Command;

/// The argument that makes a process the child.
pub(crate) const CHILD: &str = "--huge-child";
const WIDTH: usize = 16384;
const PEAK_MAX_KIB: f64 = 3.0 * 1048576.0;
const ALPHA: f64 = 1.0 / 64.0;

/// Runs this program again as the child and reads what it says.
pub(crate) fn run(verdict: &mut Verdict) {
    println!(
        "\n== Memory: {WIDTH}x{} analysed at error = 1e-3, one GGX mip of 512 at α = {ALPHA}",
        WIDTH / 2
    );
    let program = std::env::current_exe().expect("this program has a path");
    let output = Command::new(program).arg(CHILD).output().expect("this program starts again");
    let text = String::from_utf8_lossy(&output.stdout);
    let peak =
        text.lines().find_map(|line| line.strip_prefix("peak ")?.strip_suffix(" KiB")?.parse::<f64>().ok());
    print!("{text}");
    match peak {
        Some(peak) => println!(
            "peak resident {:.2} GiB, panorama included, target 3 GiB{}",
            peak / 1048576.0,
            verdict.mark(peak <= PEAK_MAX_KIB)
        ),
        None => println!(
            "no peak ({}): {}{}",
            output.status,
            String::from_utf8_lossy(&output.stderr),
            verdict.mark(false)
        ),
    }
}

/// Makes, analyses and prefilters the panorama, then prints VmHWM.
pub(crate) fn child() {
    let height = WIDTH / 2;
    let mut rgb = Vec::with_capacity(WIDTH * height * 3);
    for row in 0..height {
        for column in 0..WIDTH {
            // Coarse and fine detail without a transcendental function a texel, and a sun.
            let hash =
                (row as u32 / 3).wrapping_mul(0x9e37_79b1) ^ (column as u32 / 3).wrapping_mul(0x85eb_ca6b);
            let grain = (hash.wrapping_mul(hash >> 13 | 1) >> 24) as f32 / 255.0;
            let is_lamp = row % 1024 < 64 && column % 2048 < 64;
            let is_sun = row.abs_diff(2000) < 12 && column.abs_diff(5000) < 12;
            let value = 0.3 + grain + if is_lamp { 300.0 } else { 0.0 } + if is_sun { 1e5 } else { 0.0 };
            rgb.extend([value, 0.9 * value, 0.8 * value]);
        }
    }
    let image = Image::new(WIDTH, height, rgb).expect("sizes that fit");
    let panorama = Panorama::new(image).expect(WANTED);
    let request = AnalysisRequest { alpha_min: ALPHA, sheen_alpha_min: None, error: 1e-3 };
    let (analysis, took) = once(|| analyse(&panorama, &request, Cancel::NEVER).expect(WANTED));
    println!("analysis to L = {}: cpu {:.2} s, wall {:.2} s", analysis.band_limit(), took.cpu_s, took.wall_s);
    let (_, took) = once(|| specular_level(&analysis, ALPHA, 512, Cancel::NEVER).expect(WANTED));
    println!("one mip: cpu {:.2} s, wall {:.2} s", took.cpu_s, took.wall_s);
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or_default();
    println!("peak {} KiB", peak.trim().trim_end_matches("kB").trim());
}
