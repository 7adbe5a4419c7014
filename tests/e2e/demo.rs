//! `kiln demo`, with and without a graphics device.

use crate::harness::{PANORAMA_WIDTH, Project, kiln, skip, text};

fn demo(project: &Project, environment: &[(&str, &str)]) -> (String, std::path::PathBuf) {
    let dir = project.beside("demo");
    let mut command = project.command(&["demo"]);
    command.arg(&dir).args(["--no-window", "--size", "160x90", "--panorama-width", PANORAMA_WIDTH]);
    command.envs(environment.iter().copied());
    let output = command.output().unwrap();
    let said = text(&output.stdout) + &text(&output.stderr);
    assert!(output.status.success(), "{said}");
    (said, dir.join("frames"))
}

#[test]
fn demo_shows_every_edit_from_save_to_frame() {
    let project = Project::sample();
    let (said, frames) = demo(&project, &[]);
    if said.contains("no frames, only the artefacts") {
        return skip("demo_shows_every_edit_from_save_to_frame", "there is no graphics device");
    }
    let frame = |name: &str| {
        std::fs::read(frames.join(name)).unwrap_or_else(|error| panic!("{name}: {error}\n{said}"))
    };
    let first = frame("0-first.png");
    let warm = frame("1-warm.png");
    assert_ne!(first, warm, "the shader edit must be seen");
    assert_eq!(warm, frame("2-broken.png"), "the last good shader must still draw");
    assert_eq!(first, frame("3-mended.png"));
    assert_ne!(first, frame("4-low-sun.png"));
    assert_ne!(frame("4-low-sun.png"), frame("5-studio.png"));
    assert_eq!(said.matches("from save to frame").count(), 5, "{said}");
}

#[test]
fn demo_without_a_graphics_device_still_shows_the_artefacts() {
    let project = Project::sample();
    // No Vulkan driver and no EGL vendor can be found under these.
    let environment = [
        ("VK_ICD_FILENAMES", "/nonexistent"),
        ("VK_DRIVER_FILES", "/nonexistent"),
        ("__EGL_VENDOR_LIBRARY_DIRS", "/nonexistent"),
        ("__EGL_VENDOR_LIBRARY_FILENAMES", "/nonexistent"),
        ("LIBGL_DRIVERS_PATH", "/nonexistent"),
    ];
    let (said, frames) = demo(&project, &environment);
    assert!(said.contains("no frames, only the artefacts"), "{said}");
    if cfg!(feature = "preview") {
        assert!(said.contains("mesa-vulkan-drivers"), "{said}");
    }
    for env in ["sky", "studio", "orientation"] {
        let sheet = image::open(frames.join(format!("artefacts-{env}.png"))).unwrap().to_rgb8();
        assert!(sheet.width() > 300 && sheet.pixels().any(|pixel| pixel.0.iter().any(|&value| value > 128)));
    }
    assert!(!frames.join("0-first.png").exists());
}

#[test]
fn demo_leaves_a_foreign_folder_alone() {
    let project = Project::sample();
    let output = kiln().arg("demo").arg(project.dir()).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("no demo made it"));
}
