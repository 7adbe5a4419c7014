//! Automation: `cargo xtask help`.
//!
//! Start at [`main`]. Everything here runs other programs (cargo, the built `kiln`, apt-get) and uses the standard
//! library alone, so that it builds in a second.
//!
//! Conventions: a step that fails ends the program with its message and exit code 1; what was skipped is said.
//!
//! Not here: anything a user of Kiln needs.

#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a command-line tool")]

use std::process::ExitCode;

mod bench;
mod bench_bake;
mod bench_cache;
mod bench_check;
mod bench_demand;
mod bench_loop;
mod bench_render;
mod bench_scenes;
mod bench_shaders;
mod corpus;
mod mutant_list;
mod mutants;
mod packages;
mod shader_files;
mod shell;
mod test;

const HELP: &str = "\
cargo xtask test [--no-install]   install what tests need where that is allowed, then run all tests, clippy, fmt and docs
cargo xtask bench [EDITS]         save-to-frame of shader and HDR edits, no-op bake, bake of one panorama
cargo xtask bench cache           no-op bakes, planning, overhead and hashing on generated projects of up to 10 000 files
cargo xtask bench shaders         save to first diagnostic, variants a second, what an edit runs, shaders in all languages
cargo xtask bench scenes [MB] [RUNS]
                                  time and memory of loading and packing a generated GLB (default 100 MB, 5 runs)
cargo xtask bench render [FRAMES] milliseconds a frame of real scenes, and what each effect costs; $KILN_CORPUS
cargo xtask bench swap [COUNT]    a large chain swapped in while frames are drawn, and the memory of COUNT hot swaps (default 1000)
cargo xtask bench demand          the corpus as one project: baked as its scenes need it and in full; $KILN_CORPUS
cargo xtask bench bake […]        error and cost of prefiltered maps beside a sampled estimator; accuracy, sampled, model, time, scaling:
                                  one part alone; --huge: memory of a 16384×8192 panorama; panoramas from $KILN_CORPUS
cargo xtask bench accuracy […]    whether maps keep the error asked for on every panorama of $KILN_CORPUS; --only NAME, --lobes LIST
cargo xtask bench check           `kiln check` on a 2048×1024 panorama: under a second
cargo xtask mutants [native|FILTER]
                                  take each guard of shaders away once (native: of Rust code too) and see the tests of hard cases fail
cargo xtask faults [COUNT]        kill COUNT processes at random moments and flip COUNT bits (default 1000)
cargo xtask fuzz [COUNT] [SEED]   decode COUNT damaged copies of each image file of the tests (default 100000)
cargo xtask bench loop [EDITS]    every stage from a save to its picture, p50, p95 and p99 (default 200)
cargo xtask bench wire            a revision of 64 MiB over the socket, beside a plain copy over a socket and SHA-256 alone
cargo xtask fuzz shaders [COUNT] [SEED]
                                  compile COUNT damaged, COUNT random WGSL and COUNT random GLSL shaders in the worker (default 10000)
cargo xtask fuzz wire [COUNT] [SEED]
                                  damage COUNT talks of a daemon and COUNT of a client, some over real sockets (default 100000)
cargo xtask soak [EDITS] [SEED]   edits, typing mistakes, kills and reconnections in random order beside a model of what must be published
                                  (default 20000)
cargo xtask corpus [OUT]          bake and render the files of $KILN_CORPUS into OUT (default target/corpus)
cargo xtask size                  build with and without the preview and compare time and size
";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match arguments.as_slice() {
        ["test"] => test::run(true),
        ["test", "--no-install"] => test::run(false),
        ["bench"] => bench::run(20),
        ["bench", "cache"] => bench_cache::run(),
        ["bench", "check"] => bench_check::run(),
        ["bench", "swap"] => test::swaps("1000"),
        ["bench", "swap", count] => test::swaps(count),
        ["bench", "loop"] => bench_loop::run(200),
        ["bench", "loop", edits] => match edits.parse() {
            Ok(edits) => bench_loop::run(edits),
            Err(_) => Err(format!("`{edits}` is no number of edits")),
        },
        ["bench", "wire"] => test::wire(),
        ["bench", "demand"] => bench_demand::run(),
        ["bench", "render"] => bench_render::run(8),
        ["bench", "render", frames] => match frames.parse() {
            Ok(frames) => bench_render::run(frames),
            Err(_) => Err(format!("`{frames}` is no number of frames")),
        },
        ["bench", "shaders"] => bench_shaders::run(),
        ["bench", "scenes", arguments @ ..] => bench_scenes::run(arguments),
        ["bench", "accuracy", arguments @ ..] => bench_bake::run("accuracy", arguments),
        ["bench", "bake", arguments @ ..] => bench_bake::run("bake", arguments),
        ["mutants"] => mutants::run(false, ""),
        ["mutants", "native"] => mutants::run(true, ""),
        ["mutants", filter] => mutants::run(true, filter),
        ["faults"] => test::faults("1000"),
        ["faults", count] => test::faults(count),
        ["fuzz"] => test::fuzz(None, None),
        ["fuzz", "shaders"] => test::fuzz_shaders(None, None),
        ["fuzz", "shaders", count] => test::fuzz_shaders(Some(count), None),
        ["fuzz", "shaders", count, seed] => test::fuzz_shaders(Some(count), Some(seed)),
        ["fuzz", "wire"] => test::fuzz_wire(None, None),
        ["fuzz", "wire", count] => test::fuzz_wire(Some(count), None),
        ["fuzz", "wire", count, seed] => test::fuzz_wire(Some(count), Some(seed)),
        ["soak"] => test::soak("20000", None),
        ["soak", count] => test::soak(count, None),
        ["soak", count, seed] => test::soak(count, Some(seed)),
        ["fuzz", count] => test::fuzz(Some(count), None),
        ["fuzz", count, seed] => test::fuzz(Some(count), Some(seed)),
        ["bench", edits] => match edits.parse() {
            Ok(edits) => bench::run(edits),
            Err(_) => Err(format!("`{edits}` is no number of edits")),
        },
        ["corpus"] => corpus::run("target/corpus"),
        ["corpus", out] => corpus::run(out),
        ["size"] => bench::size(),
        ["help" | "--help" | "-h"] | [] => {
            print!("{HELP}");
            Ok(())
        }
        other => Err(format!("unknown command `{}`\n\n{HELP}", other.join(" "))),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("xtask: {message}");
            ExitCode::FAILURE
        }
    }
}
