//! A real window on a virtual display.

use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};

use crate::harness::{LIMIT, Process, Project, skip};

/// A virtual display of its own number.
struct Display {
    _process: Process,
    name: String,
}

impl Display {
    fn open() -> Option<Display> {
        // Xvfb picks a free number and writes it to the descriptor it is told, here its standard output.
        let mut command = Command::new("Xvfb");
        command.args(["-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp"]);
        let mut child =
            command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().ok()?;
        let mut line = String::new();
        BufReader::new(child.stdout.take()?).read_line(&mut line).ok()?;
        Some(Display { _process: Process(child), name: format!(":{}", line.trim()) })
    }
}

#[test]
fn window_shows_revisions_and_outlives_the_daemon() {
    let Some(display) = Display::open() else { return skip("window", "Xvfb is not installed") };
    let project = Project::sample();
    let watch = project.watch();
    watch.published();
    let mut command = project.command(&["preview", "DIR"]);
    command.env("DISPLAY", &display.name).env_remove("WAYLAND_DISPLAY");
    let mut window = Process(command.spawn().unwrap());
    let frame = watch.wait_for("frame");
    assert_eq!(frame["report"]["revision"], 1, "{frame}");
    project.edit("shaders/pbr/tonemap.wgsl", "vec3f(1.0, 1.0, 1.0)", "vec3f(1.0, 0.9, 0.8)");
    assert_eq!(watch.wait_for("frame")["report"]["revision"], 2);
    watch.kill();
    let watch = project.watch();
    assert_eq!(watch.wait_for("client connected")["name"], "preview, window");
    assert_eq!(watch.wait_for("frame")["report"]["revision"], 1);
    assert!(window.0.try_wait().unwrap().is_none(), "the window must still be open");
}

#[test]
fn window_that_loses_its_device_is_opened_anew_as_it_was() {
    let Some(display) = Display::open() else { return skip("window", "Xvfb is not installed") };
    let project = Project::sample();
    let watch = project.watch();
    watch.published();
    let mut command = project.command(&["preview", "DIR", "--env", "studio", "--exposure", "1.5"]);
    command.args(["--lose-device-after-frames", "3"]);
    command.env("DISPLAY", &display.name).env_remove("WAYLAND_DISPLAY");
    let mut window = Process(command.spawn().unwrap());
    for _ in 0..2 {
        assert_eq!(watch.wait_for("client connected")["name"], "preview, window");
        assert_eq!(watch.wait_for("frame")["report"]["revision"], 1);
    }
    assert!(window.0.try_wait().unwrap().is_none(), "the window must be open again");
    let saved = written_into(&project.beside("state/kiln/windows"));
    assert_eq!(saved["look"]["selection"]["env"], "studio", "{saved}");
    assert_eq!(saved["look"]["view"]["exposure_ev"], 1.5, "{saved}");
}

#[test]
fn window_remembers_how_it_was_and_headless_runs_do_not() {
    let Some(display) = Display::open() else { return skip("window", "Xvfb is not installed") };
    let project = Project::sample();
    let watch = project.watch();
    watch.published();
    let shown = project.beside("shown");
    let mut headless = project.command(&["preview", "DIR", "--headless", "--size", "32x32", "--out"]);
    assert!(headless.arg(&shown).status().unwrap().success());
    let folder = project.beside("state/kiln/windows");
    assert!(!folder.exists(), "a headless run has no window to remember");
    let open = |more: &[&str]| {
        let mut command = project.command(&["preview", "DIR"]);
        command.args(more).env("DISPLAY", &display.name).env_remove("WAYLAND_DISPLAY");
        Process(command.spawn().unwrap())
    };
    let window = open(&["--env", "studio", "--exposure", "1.5"]);
    let saved = written_into(&folder);
    assert_eq!(saved["look"]["selection"]["env"], "studio", "{saved}");
    assert_eq!(saved["look"]["view"]["exposure_ev"], 1.5, "{saved}");
    drop(window);
    std::fs::remove_dir_all(&folder).unwrap();
    let window = open(&["--fresh"]);
    assert_eq!(watch.wait_for("frame")["report"]["revision"], 1);
    drop(window);
    assert!(!folder.exists(), "--fresh writes nothing");
}

/// The JSON file that appears in `folder`.
fn written_into(folder: &std::path::Path) -> serde_json::Value {
    let deadline = std::time::Instant::now() + LIMIT;
    while std::time::Instant::now() < deadline {
        let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let mut json = files.filter(|file| file.path().extension().is_some_and(|ending| ending == "json"));
        if let Some(file) = json.next() {
            return serde_json::from_slice(&std::fs::read(file.path()).unwrap()).unwrap();
        }
        std::thread::yield_now();
    }
    panic!("nothing was written into {}", folder.display());
}
