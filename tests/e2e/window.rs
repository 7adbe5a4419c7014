//! A real window on a virtual display.

use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};

use crate::harness::{Process, Project, skip};

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
