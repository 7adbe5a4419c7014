//! Hot swaps: how much of one a frame waits for, and what a thousand of them leave behind.
//!
//! `cargo xtask bench swap [COUNT]` runs these alone, with more swaps, and shows what they print.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use kiln_gpu::Gpu;
use serde_json::{Value, json};

use super::corpus::say;
use super::fixture::{Build, SIX_COLORS, gpu, sphere_glb};
use crate::channel::Channel;
use crate::parameter::ParameterValues;
use crate::prepare::Preparer;
use crate::renderer::Renderer;
use crate::upload::PIECE_BYTES;
use crate::view::{Selection, View};
use crate::worker::{Request, Worker};

const PATIENCE: Duration = Duration::from_secs(60);

/// A chain of 1024² faces in half floats, without the levels below 16².
const CHAIN: [u32; 2] = [1024, 7];

fn ball(color: f32) -> Build {
    let mut build = Build::ball(material(color));
    build.table.number = 1;
    build
}

fn material(color: f32) -> Value {
    json!({ "pbrMetallicRoughness": { "baseColorFactor": [color, 0.5, 0.5, 1.0], "roughnessFactor": 0.4 } })
}

fn with_large_chain(build: &mut Build) -> &mut Build {
    build.table.number += 1;
    build.cube("env/sky/specular", CHAIN[0], CHAIN[1], 0, SIX_COLORS)
}

#[test]
fn chain_of_1024_faces_comes_in_pieces_and_a_frame_fits_between_any_two() {
    let Some(gpu) = gpu() else { return };
    let mut build = ball(0.5);
    let mut preparer = Preparer::new(&gpu);
    let prepare = |preparer: &mut Preparer, build: &Build| {
        let prepared =
            preparer.prepare(&build.revision(), &Selection::default(), &ParameterValues::default());
        Arc::new(prepared.expect("the built-in tonemap is sound"))
    };
    let mut renderer = Renderer::new(&gpu, [64, 36]);
    renderer.show(prepare(&mut preparer, &build));
    let frames = Arc::new(AtomicUsize::new(0));
    let (renderer, drawn, draws_on) = (Mutex::new(renderer), Arc::clone(&frames), gpu.clone());
    preparer.after_piece(move || {
        let mut renderer = renderer.lock().expect("nobody panicked");
        assert!(renderer.render(&View::default()).is_some());
        draws_on.wait().expect("the device finishes the frame");
        drawn.fetch_add(1, Ordering::Relaxed);
    });
    let uploaded = prepare(&mut preparer, with_large_chain(&mut build)).report.uploaded;
    let expected: u64 = (0..CHAIN[1]).map(|level| 6 * 8 * u64::from(CHAIN[0] >> level).pow(2)).sum();
    assert_eq!(uploaded.bytes, expected);
    assert!(uploaded.piece_bytes_max <= PIECE_BYTES as u64, "{uploaded:?}");
    assert_eq!(frames.load(Ordering::Relaxed) as u64, uploaded.pieces);
    assert!(uploaded.pieces >= expected / PIECE_BYTES as u64, "{uploaded:?}");
    // What did not change is not brought again.
    build.table.number += 1;
    assert_eq!(prepare(&mut preparer, &build).report.uploaded.bytes, 0);
}

#[test]
fn frames_are_drawn_while_a_large_chain_is_swapped_in() {
    let Some(gpu) = gpu() else { return };
    let mut build = ball(0.5);
    let (wake, woken) = channel();
    let worker =
        Worker::spawn(gpu.clone(), move || wake.send(()).unwrap_or_default()).expect("a thread starts");
    let ask = |build: &Build| {
        worker.request(Request {
            revision: Arc::new(build.revision()),
            selection: Selection::default(),
            overrides: ParameterValues::default(),
            received_unix_ms: 0.0,
        });
    };
    ask(&build);
    woken.recv_timeout(PATIENCE).expect("the first revision is prepared");
    let mut renderer = Renderer::new(&gpu, [640, 360]);
    renderer.show(worker.take().expect("it woke us").prepared);
    let mut frame_ms = || {
        let start = Instant::now();
        assert!(renderer.render(&View::default()).is_some());
        let drawn_ms = start.elapsed().as_secs_f64() * 1e3;
        gpu.wait().expect("the device finishes the frame");
        (drawn_ms, start.elapsed().as_secs_f64() * 1e3)
    };
    let before: Vec<(f64, f64)> = (0..12).map(|_| frame_ms()).collect();
    let revision = with_large_chain(&mut build);
    let start = Instant::now();
    ask(revision);
    let mut during = Vec::new();
    while woken.try_recv().is_err() {
        assert!(start.elapsed() < PATIENCE, "the swap ends");
        during.push(frame_ms());
    }
    let swap_ms = start.elapsed().as_secs_f64() * 1e3;
    let ready = worker.take().expect("it woke us");
    let uploaded = ready.prepared.report.uploaded;
    let text = |frames: &[(f64, f64)]| {
        let worst =
            |part: fn(&(f64, f64)) -> f64| frames.iter().map(part).fold(0.0, |a: f64, b: f64| a.max(b));
        let mut whole: Vec<f64> = frames.iter().map(|frame| frame.1).collect();
        whole.sort_by(f64::total_cmp);
        let median = whole.get(whole.len() / 2).copied().unwrap_or(f64::NAN);
        format!(
            "{} frames, {median:.1} ms each, at worst {:.1}, of which encoding and submitting {:.1}",
            frames.len(),
            worst(|frame| frame.1),
            worst(|frame| frame.0)
        )
    };
    say(&format!(
        "1024-face chain: {:.1} MB in {} pieces of at most {:.2} MB, {swap_ms:.0} ms from the request to the last piece",
        uploaded.bytes as f64 / 1e6,
        uploaded.pieces,
        uploaded.piece_bytes_max as f64 / 1e6,
    ));
    say(&format!("  before: {}\n  during: {}", text(&before), text(&during)));
    assert!(!during.is_empty(), "no frame was drawn while the chain was swapped in");
}

/// Bytes that the device has handed out, and resident bytes of this process.
fn memory(gpu: &Gpu) -> [Option<u64>; 2] {
    let statm = std::fs::read_to_string("/proc/self/statm").ok();
    let pages = statm.and_then(|text| text.split(' ').nth(1)?.parse::<u64>().ok());
    [gpu.memory_bytes(), pages.map(|pages| pages * 4096)]
}

/// The `step`-th edit: a shader's text, the light, or a material, each as never before.
fn edit(build: &mut Build, step: usize) {
    build.table.number += 1;
    let value = step as f32 / 65536.0;
    match step % 3 {
        0 => {
            let text = format!(
                "@vertex fn vs_main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {{
                    return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
                }}
                @fragment fn fs_main() -> @location(0) vec4f {{ return vec4f({value:?}, 0.6, 0.2, 1.0); }}"
            );
            build.shader_text("background", "background", &text);
        }
        1 => {
            build.cube("env/sky/specular", 64, 7, 0, SIX_COLORS.map(|[r, g, _]| [r, g, value]));
        }
        _ => {
            build.scene("ball", "sky", sphere_glb(material(value)));
        }
    }
}

#[test]
fn hot_swaps_leave_nothing_on_the_device() {
    // A device of its own: what other tests allocate must not count.
    let Some(gpu) = gpu().and_then(|_| Gpu::headless().ok()) else { return };
    let asked = std::env::var("KILN_SWAPS").ok().and_then(|text| text.parse::<usize>().ok());
    let count = asked.unwrap_or(45);
    let mut build = ball(0.5);
    let mut preparer = Preparer::new(&gpu);
    let mut renderer = Renderer::new(&gpu, [64, 36]);
    let warm = (count / 5).max(9);
    let (mut settled, mut kept) = ([None, None], Vec::new());
    let start = Instant::now();
    for step in 0..count + warm {
        edit(&mut build, step);
        let revision = build.revision();
        let prepared = preparer.prepare(&revision, &Selection::default(), &ParameterValues::default());
        let prepared = prepared.expect("the built-in tonemap is sound");
        assert_eq!(prepared.report.diagnostics, vec![]);
        renderer.show(Arc::new(prepared));
        assert!(renderer.render(&View::default()).is_some());
        gpu.wait().expect("the device finishes the frame");
        // The fixture keeps every content it ever had; a client does not.
        build.forget_unused();
        if step + 1 == warm {
            settled = memory(&gpu);
        }
        if asked.is_some() && step % 100 == 99 {
            kept.push(memory(&gpu));
        }
    }
    assert_eq!(gpu.take_errors(), Vec::<String>::new());
    let now = memory(&gpu);
    let megabytes =
        |bytes: Option<u64>| bytes.map_or("unknown".to_owned(), |it| format!("{:.2} MB", it as f64 / 1e6));
    let [device, host] = [0, 1].map(|at| {
        format!("{} after {warm}, {} after {count} more", megabytes(settled[at]), megabytes(now[at]))
    });
    say(&format!(
        "{count} swaps, {:.1} ms each; device: {device}; process: {host}",
        start.elapsed().as_secs_f64() * 1e3 / (count + warm) as f64
    ));
    for [device, host] in kept {
        say(&format!("  {}, {}", megabytes(device), megabytes(host)));
    }
    if let [Some(settled), Some(now)] = [settled[0], now[0]] {
        assert!(now <= settled + settled / 20, "{settled} bytes became {now}");
    }
    // Other tests share the process unless this one was asked for.
    if let (Some(_), [Some(settled), Some(now)]) = (asked, [settled[1], now[1]]) {
        assert!(now <= settled + 32_000_000, "{settled} bytes became {now}");
    }
}

#[test]
fn check_of_memory_sees_a_swap_that_is_kept() {
    let Some(gpu) = gpu().and_then(|_| Gpu::headless().ok()) else { return };
    let Some(before) = gpu.memory_bytes() else { return };
    let mut build = ball(0.5);
    let mut preparer = Preparer::new(&gpu);
    let mut kept = Vec::new();
    for step in 0..9 {
        edit(&mut build, step);
        kept.push(preparer.prepare(&build.revision(), &Selection::default(), &ParameterValues::default()));
    }
    let now = gpu.memory_bytes().expect("as before");
    assert!(now > before + before / 20 + 3 * 6 * 8 * 64 * 64, "{before} bytes became {now}");
}

#[test]
fn frames_of_lights_and_channels_keep_nothing() {
    let Some(mut viewer) = super::inspect::viewer(&super::inspect::layered()) else { return };
    let asked = std::env::var("KILN_SWAPS").ok().and_then(|text| text.parse::<usize>().ok());
    let count = asked.map_or(3, |asked| asked.min(200));
    for channel in [None, Some(Channel::Roughness), Some(Channel::Specular)] {
        viewer.view.channel = channel;
        let mut resident = Vec::new();
        let start = Instant::now();
        for _ in 0..2 {
            for _ in 0..count {
                viewer.draw().expect("the device draws");
            }
            resident.push(memory(viewer.gpu())[1]);
        }
        let frame_ms = start.elapsed().as_secs_f64() * 1e3 / (2 * count) as f64;
        let megabytes: Vec<f64> = resident.iter().flatten().map(|bytes| *bytes as f64 / 1e6).collect();
        say(&format!(
            "{channel:?}: {frame_ms:.1} ms a frame; process: {megabytes:.1?} MB after {count} and as many more"
        ));
        // Other tests share the process unless this one was asked for.
        if let ([Some(first), Some(second)], Some(_)) = (&resident[..], asked) {
            assert!(*second <= first + 8_000_000, "{first} bytes became {second}");
        }
    }
}
