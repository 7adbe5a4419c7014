//! `kiln doctor`: is this machine fit, is the cache sound?

use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use kiln_build::{Digest, Disk, Store, Usage};
use serde::Serialize;

use crate::args::DoctorArgs;
use crate::out::say;
use crate::{INPUT_IS_WRONG, place, report};

/// How many bytes are hashed to learn the speed.
const HASH_SAMPLE_BYTES: usize = 64 << 20;

#[derive(Serialize)]
struct Findings {
    cache: Cache,
    machine: Machine,
    adapters: Vec<Adapter>,
    limits: Limits,
    /// What is wrong, in words.
    problems: Vec<String>,
    /// What could be better, in words.
    hints: Vec<String>,
}

#[derive(Serialize)]
struct Cache {
    folder: String,
    can_be_written: bool,
    has_locks: bool,
    usage: Usage,
    bytes_max: u64,
    /// Seconds since the last collection.
    since_collection_s: Option<u64>,
    /// How many files were read, with --deep.
    checked: Option<usize>,
    damaged: usize,
    /// Writing, syncing and renaming one small file.
    write_ms: Option<f64>,
}

#[derive(Serialize)]
struct Machine {
    version: &'static str,
    cores: usize,
    memory_for_actions: u64,
    hash_bytes_per_s: f64,
}

#[derive(Serialize)]
struct Adapter {
    name: String,
    texture_edge_max: u32,
    is_software: bool,
    /// Whether the preview would take it.
    is_chosen: bool,
}

#[derive(Serialize)]
struct Limits {
    source_bytes: u64,
    panorama_texels: usize,
    panorama_edge: usize,
    band_limit: usize,
}

pub(crate) fn run(args: &DoctorArgs) -> anyhow::Result<ExitCode> {
    let findings = examine(args)?;
    if args.json {
        say!("{:#}", serde_json::to_value(&findings)?);
    } else {
        print(&findings);
    }
    Ok(if findings.problems.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(INPUT_IS_WRONG) })
}

fn examine(args: &DoctorArgs) -> anyhow::Result<Findings> {
    let folder = place::cache_folder()?;
    let store = Store::open(&folder).context("opening the cache")?;
    let checked = if args.deep { Some(deep_check(&store)?) } else { None };
    let cache = Cache {
        folder: folder.display().to_string(),
        can_be_written: !store.is_read_only(),
        has_locks: store.has_locks(),
        usage: store.usage().context("listing the cache")?,
        bytes_max: place::cache_bytes_max()?,
        since_collection_s: store.since_collection().map(|since| since.as_secs()),
        checked,
        damaged: store.damaged_count(),
        write_ms: write_ms(store.root()),
    };
    let machine = Machine {
        version: env!("CARGO_PKG_VERSION"),
        cores: place::jobs(None),
        memory_for_actions: place::memory_bytes(None),
        hash_bytes_per_s: hash_speed(),
    };
    let image = kiln_image::Limits::default();
    let limits = Limits {
        source_bytes: kiln_build::SOURCE_BYTES_MAX,
        panorama_texels: image.texels_max,
        panorama_edge: image.width_max,
        band_limit: kiln_project::BAND_LIMIT_MAX,
    };
    let adapters = adapters();
    let mut findings = Findings { cache, machine, adapters, limits, problems: Vec::new(), hints: Vec::new() };
    judge(&mut findings);
    Ok(findings)
}

fn judge(findings: &mut Findings) {
    let Findings { cache, adapters, problems, hints, .. } = findings;
    if !cache.can_be_written {
        problems.push(format!(
            "the cache {} cannot be written: nothing new is kept; set KILN_CACHE to another folder",
            cache.folder
        ));
    }
    if cache.damaged > 0 {
        problems.push(format!(
            "{} found damaged and dropped; the next bake makes what is needed anew. If this happens again, suspect the disk",
            report::count(cache.damaged, "cached file")
        ));
    }
    if !cache.has_locks {
        problems
            .push("the cache's file system has no locks: do not run `kiln gc` while builds run".to_owned());
    }
    if cache.usage.bytes > cache.bytes_max {
        hints.push(format!(
            "the cache is over its {}; `kiln gc` frees the rest",
            report::size(cache.bytes_max)
        ));
    }
    if cache.usage.other_formats_bytes > 0 {
        hints.push(format!(
            "{} belong to other versions of Kiln; `kiln gc` removes them when they were unused for a week",
            report::size(cache.usage.other_formats_bytes)
        ));
    }
    if cfg!(feature = "preview") && adapters.is_empty() {
        hints.push("no graphics adapter: baking and watching work, previews do not; for software rendering install mesa-vulkan-drivers".to_owned());
    }
}

fn deep_check(store: &Store) -> anyhow::Result<usize> {
    let _hold = store.hold();
    let bar = crate::commands::bake::progress_bar();
    let progress = |done: usize, total: usize| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
    };
    let checked = store.check(&progress).context("checking the cache");
    bar.finish_and_clear();
    Ok(checked?.0)
}

fn write_ms(folder: &Path) -> Option<f64> {
    let path = folder.join("doctor");
    let start = Instant::now();
    kiln_build::write_atomically(&Disk, &path, &[0; 4096]).ok()?;
    let ms = start.elapsed().as_secs_f64() * 1e3;
    // Left behind it would be overwritten by the next examination.
    let _ = std::fs::remove_file(&path);
    Some(ms)
}

fn hash_speed() -> f64 {
    let sample = vec![0x5a; HASH_SAMPLE_BYTES];
    let start = Instant::now();
    std::hint::black_box(Digest::of(&sample));
    sample.len() as f64 / start.elapsed().as_secs_f64()
}

#[cfg(feature = "preview")]
fn adapters() -> Vec<Adapter> {
    let adapter = |found: kiln_gpu::FoundAdapter| Adapter {
        name: found.description,
        texture_edge_max: found.texture_edge_max,
        is_software: found.is_software,
        is_chosen: found.is_chosen,
    };
    kiln_gpu::list_adapters().into_iter().map(adapter).collect()
}

#[cfg(not(feature = "preview"))]
fn adapters() -> Vec<Adapter> {
    Vec::new()
}

fn print(findings: &Findings) {
    let Findings { cache, machine, adapters, limits, problems, hints } = findings;
    let usage = &cache.usage;
    say!("cache      {}", cache.folder);
    say!(
        "           {} of {}: {} artefacts, {} records, {} scans; {} held by published revisions",
        report::size(usage.bytes),
        report::size(cache.bytes_max),
        usage.blobs,
        usage.records,
        usage.scans,
        report::size(usage.held_bytes)
    );
    for project in &usage.projects {
        let state = if project.is_held { "" } else { ", no longer held" };
        say!("           {}: {} published{state}", project.folder, report::count(project.targets, "target"));
    }
    if usage.temporary_bytes > 0 {
        say!(
            "           {} in files that are being written, or that killed processes left",
            report::size(usage.temporary_bytes)
        );
    }
    let collected = cache.since_collection_s.map(Duration::from_secs);
    say!(
        "           {}; a small file is durable after {}",
        collected.map_or_else(
            || "never collected".to_owned(),
            |since| format!("collected {} h ago", since.as_secs() / 3600)
        ),
        cache.write_ms.map_or_else(|| "— (it cannot be written)".to_owned(), report::duration)
    );
    if let Some(checked) = cache.checked {
        say!("           {} read, {} damaged", report::count(checked, "file"), cache.damaged);
    }
    say!(
        "machine    kiln {}, {}, {} for actions, hashes {:.2} GB/s",
        machine.version,
        report::count(machine.cores, "core"),
        report::size(machine.memory_for_actions),
        machine.hash_bytes_per_s / 1e9
    );
    for adapter in adapters {
        let kind = if adapter.is_software { "software" } else { "hardware" };
        let chosen = if adapter.is_chosen { ", the preview takes it" } else { "" };
        say!("adapter    {} ({kind}, textures up to {}{chosen})", adapter.name, adapter.texture_edge_max);
    }
    say!(
        "limits     sources {}, panoramas {} texels along an edge and {} in all, harmonics up to degree {}",
        report::size(limits.source_bytes),
        limits.panorama_edge,
        limits.panorama_texels,
        limits.band_limit
    );
    for hint in hints {
        say!("hint       {hint}");
    }
    for problem in problems {
        say!("problem    {problem}");
    }
    if problems.is_empty() {
        say!("all well");
    }
}
