//! The whole window on a real device: comparing, pinning, shooting, framing.

use egui::{Event, Key, Modifiers, PointerButton, Pos2, pos2};
use kiln_diagnostic::Diagnostic;
use kiln_gpu::Gpu;
use kiln_link::{ActionTime, TargetState, Work};
use serde_json::json;

use super::fixture::{Build, SIX_COLORS, gpu};
use super::offscreen::Offscreen;
use crate::panel::compare::{Mode, Side};
use crate::panel::turntable::Turning;
use crate::panel::{Framing, keys::Command};
use crate::saved::ThemeChoice;
use crate::worker::unix_ms;
use crate::{HeadlessViewer, LookSheet};

/// A ball under six colours, in a window of 1280×720 pixels.
fn window(gpu: &Gpu, scale: f32, folder: &std::path::Path) -> (Offscreen, Build) {
    let build =
        Build::ball(json!({ "pbrMetallicRoughness": { "metallicFactor": 1.0, "roughnessFactor": 0.3 } }));
    let mut window = Offscreen::new(gpu, [1280, 720], scale, folder.to_owned());
    window.apply(&build.revision());
    for _ in 0..4 {
        window.frame(Vec::new());
    }
    (window, build)
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// The next revision, with another light.
fn darker(build: &mut Build) -> kiln_link::Revision {
    build.table.number += 1;
    build.env("sky", SIX_COLORS.map(|color| color.map(|channel| 0.25 * channel))).revision()
}

fn pixel(picture: &image::RgbaImage, place: [u32; 2]) -> [u8; 4] {
    picture.get_pixel(place[0], place[1]).0
}

#[test]
fn pinned_revision_stays_drawable_beside_the_live_one_and_is_freed() {
    let Some(gpu) = gpu() else { return };
    let folder = folder();
    let (mut window, mut build) = window(&gpu, 1.0, folder.path());
    let (left, right) = ([60, 200], [900, 200]);
    let before = window.picture_of("live");
    window.panels.run(Command::PinAsA);
    window.frame(Vec::new());
    window.apply(&darker(&mut build));
    window.frame(Vec::new());
    window.frame(Vec::new());
    let compared = window.picture_of("swipe");
    assert_eq!(pixel(&compared, left), pixel(&before, left), "A is as it was");
    assert_ne!(pixel(&compared, right), pixel(&before, right), "B is the new one");
    assert!(window.panels.compare.own_bytes > 0, "what only the pin holds is counted");
    let both = window.panels.compare.pins[0].bytes;
    assert!(window.panels.compare.own_bytes < both, "what both hold is not");
    window.panels.compare.unpin(1);
    window.frame(Vec::new());
    window.frame(Vec::new());
    let after = window.picture_of("unpinned");
    assert_eq!(pixel(&after, right), pixel(&compared, right));
    assert_ne!(pixel(&after, left), pixel(&compared, left), "all is live again");
}

#[test]
fn differences_are_measured_beside_the_frames_and_equal_sides_are_equal() {
    let Some(gpu) = gpu() else { return };
    let folder = folder();
    let (mut window, mut build) = window(&gpu, 1.0, folder.path());
    window.panels.run(Command::PinAsA);
    window.frames_until("numbers", |window| window.panels.compare.numbers.is_some());
    let equal = window.panels.compare.numbers.expect("they are there");
    assert_eq!((equal.rmse, equal.difference_max), (0.0, 0));
    window.apply(&darker(&mut build));
    window.panels.run(Command::CompareBy(Mode::HeatMap));
    window.frame(Vec::new());
    window.frame(Vec::new());
    assert_eq!(window.panels.compare.numbers, None, "old numbers are not shown for new pictures");
    window.frames_until("numbers", |window| window.panels.compare.numbers.is_some());
    let differing = window.panels.compare.numbers.expect("they are there");
    assert!(differing.flip_mean > 0.05 && differing.psnr_db < 40.0, "{differing:?}");
    window.frame(Vec::new());
    window.picture_of("heat_map");
}

#[test]
fn pinned_settings_are_drawn_with_the_newest_revision() {
    let Some(gpu) = gpu() else { return };
    let folder = folder();
    let (mut window, mut build) = window(&gpu, 1.0, folder.path());
    window.panels.run(Command::PinAsA);
    window.panels.compare.pins[0].is_settings = true;
    window.frame(Vec::new());
    window.apply(&darker(&mut build));
    window.frames_until("numbers", |window| window.panels.compare.numbers.is_some());
    assert_eq!(window.panels.compare.numbers.map(|it| it.rmse), Some(0.0), "equal settings, equal pictures");
    window.panels.view.exposure_ev = 1.0;
    window.frame(Vec::new());
    window.frame(Vec::new());
    window.frames_until("numbers", |window| window.panels.compare.numbers.is_some());
    assert!(window.panels.compare.numbers.is_some_and(|it| it.rmse > 0.01), "A keeps its exposure");
}

#[test]
fn both_sides_share_the_camera_until_they_are_unlinked() {
    let Some(gpu) = gpu() else { return };
    let folder = folder();
    let (mut window, _) = window(&gpu, 1.0, folder.path());
    window.panels.run(Command::PinAsA);
    window.frame(drag(pos2(700.0, 400.0), pos2(700.0, 400.0)));
    window.frame(vec![Event::PointerMoved(pos2(800.0, 400.0))]);
    window.frame(release(pos2(800.0, 400.0)));
    assert!(window.panels.view.camera.is_some(), "the hand moved it");
    window.frames_until("numbers", |window| window.panels.compare.numbers.is_some());
    assert_eq!(window.panels.compare.numbers.map(|it| it.rmse), Some(0.0), "both moved");
    window.panels.compare.is_linked = false;
    window.frame(Vec::new());
    window.frame(Vec::new());
    window.frames_until("numbers", |window| window.panels.compare.numbers.is_some());
    assert!(window.panels.compare.numbers.is_some_and(|it| it.rmse > 0.0), "A is seen as it was pinned");
    let live = window.panels.view.camera;
    window.frame(drag(pos2(100.0, 400.0), pos2(100.0, 400.0)));
    window.frame(vec![Event::PointerMoved(pos2(800.0, 400.0))]);
    window.frame(release(pos2(800.0, 400.0)));
    assert_eq!(window.panels.view.camera, live, "the hand is on A");
    assert!(window.panels.compare.pins[0].look.view.camera.is_some());
}

fn drag(from: Pos2, to: Pos2) -> Vec<Event> {
    let press = Event::PointerButton {
        pos: from,
        button: PointerButton::Primary,
        pressed: true,
        modifiers: Modifiers::NONE,
    };
    vec![Event::PointerMoved(from), press, Event::PointerMoved(to)]
}

fn release(at: Pos2) -> Vec<Event> {
    let button = PointerButton::Primary;
    vec![Event::PointerButton { pos: at, button, pressed: false, modifiers: Modifiers::NONE }]
}

#[test]
fn divider_follows_the_hand_and_the_camera_stays() {
    let Some(gpu) = gpu() else { return };
    let folder = folder();
    let (mut window, _) = window(&gpu, 1.0, folder.path());
    window.panels.run(Command::PinAsA);
    window.frame(Vec::new());
    window.frame(Vec::new());
    // The picture is as wide as what the panel beside it leaves.
    let middle = (1280.0 - window.panels.layout.side_points) / 2.0;
    window.frame(vec![Event::PointerMoved(pos2(middle, 300.0))]);
    window.frame(drag(pos2(middle, 300.0), pos2(middle, 300.0)));
    window.frame(vec![Event::PointerMoved(pos2(middle / 2.0, 300.0))]);
    window.frame(release(pos2(middle / 2.0, 300.0)));
    assert!((window.panels.compare.divider - 0.25).abs() < 0.01, "{}", window.panels.compare.divider);
    assert_eq!(window.panels.view.camera, None);
}

#[test]
fn screenshot_is_drawn_again_from_its_sheet_pixel_by_pixel_and_never_overwrites() {
    let Some(gpu) = gpu() else { return };
    let folder = folder();
    let (mut window, build) = window(&gpu, 1.0, folder.path());
    window.panels.view.exposure_ev = 0.7;
    for _ in 0..2 {
        window.frame(key(Key::S, Modifiers::SHIFT));
        window.frames_until("writing", |window| window.panels.shots.said.is_some());
        let files = window.panels.shots.said.take().expect("it was said").expect("it was written");
        assert_eq!(files.len(), 3, "{files:?}");
    }
    let path = |name: &str| folder.path().join(name);
    for name in ["ball-sky_r1_001", "ball-sky_r1_002"] {
        for ending in ["png", "exr", "json"] {
            assert!(path(&format!("{name}.{ending}")).is_file(), "{name}.{ending} is not there");
        }
    }
    let text = std::fs::read_to_string(path("ball-sky_r1_002.json")).expect("it is there");
    let sheet = LookSheet::read(&text).expect("it was just written");
    let mut viewer = HeadlessViewer::new(gpu, sheet.size);
    viewer.apply(&build.revision());
    viewer.view = sheet.look.view;
    viewer.select(sheet.look.selection);
    let again = viewer.render().expect("the device reads back");
    let saved = image::open(path("ball-sky_r1_002.png")).expect("it is a picture").to_rgb8();
    let again = image::DynamicImage::ImageRgba8(again).to_rgb8();
    assert!(saved == again, "the sheet draws another picture");
}

/// Down and up: a key that stays down repeats.
fn key(key: Key, modifiers: Modifiers) -> Vec<Event> {
    let event = |pressed| Event::Key { key, physical_key: None, pressed, repeat: false, modifiers };
    vec![event(true), event(false)]
}

#[test]
fn screenshot_that_cannot_be_written_says_why() {
    let Some(gpu) = gpu() else { return };
    let folder = folder();
    let file = folder.path().join("a file");
    std::fs::write(&file, "in the way").expect("the folder can be written");
    let (mut window, _) = window(&gpu, 1.0, &file);
    window.frame(key(Key::S, Modifiers::NONE));
    window.frames_until("writing", |window| window.panels.shots.said.is_some());
    let said = window.panels.shots.said.take().expect("it was said");
    assert!(said.expect_err("it cannot be written").contains("a file"));
}

#[test]
fn first_frame_of_each_revision_is_reported_and_stands_in_the_history() {
    let Some(gpu) = gpu() else { return };
    let folder = folder();
    let (mut window, mut build) = window(&gpu, 1.0, folder.path());
    window.apply(&darker(&mut build));
    window.frame(Vec::new());
    for expected in [1, 2] {
        let report = window.reports.recv_timeout(std::time::Duration::from_secs(60)).expect("it is reported");
        assert_eq!(report.revision, expected);
    }
    window.frames_until("the history", |window| {
        window.panels.history.newest_first().all(|build| build.shown_unix_ms.is_some())
    });
}

#[test]
fn turntable_turns_until_the_hand_takes_over() {
    let Some(gpu) = gpu() else { return };
    let folder = folder();
    let (mut window, _) = window(&gpu, 1.0, folder.path());
    window.panels.run(Command::Turn(Turning::Camera));
    window.frame(Vec::new());
    let early = window.panels.view.camera.expect("it turns").yaw_rad;
    window.frame(Vec::new());
    assert!(window.panels.view.camera.is_some_and(|camera| camera.yaw_rad > early));
    window.frame(drag(pos2(500.0, 300.0), pos2(500.0, 300.0)));
    window.frame(vec![Event::PointerMoved(pos2(560.0, 300.0))]);
    assert_eq!(window.panels.turntable.turning, None);
    window.frame(release(pos2(560.0, 300.0)));
    window.panels.run(Command::Turn(Turning::Light));
    window.frame(Vec::new());
    assert!(window.panels.view.environment_rotation_rad > 0.0);
}

#[test]
fn framing_keeps_the_direction_and_finds_what_is_below_the_pointer() {
    let Some(gpu) = gpu() else { return };
    let folder = folder();
    let (mut window, _) = window(&gpu, 1.0, folder.path());
    window.panels.run(Command::FrameScene);
    window.frame(Vec::new());
    let framed = window.panels.view.camera.expect("it was framed");
    let mut far = framed;
    far.dolly(5.0);
    far.pan(0.3, 0.2);
    for framing in [Framing::Scene, Framing::At([0.5, 0.5]), Framing::At([0.01, 0.01])] {
        window.panels.view.camera = Some(far);
        window.panels.frame_asked = Some(framing);
        window.frame(Vec::new());
        let again = window.panels.view.camera.expect("it was framed");
        assert!((again.target - framed.target).length() < 1e-4, "{framing:?}: {again:?}");
        assert!((again.distance / framed.distance - 1.0).abs() < 1e-4, "{framing:?}: {again:?}");
    }
}

/// A revision with much to tell.
fn busy(build: &mut Build) -> kiln_link::Revision {
    let text = "fn shade() -> vec3f {\n    return base_color * n_dot_vv;\n}";
    let at = text.find("n_dot_vv").expect("it is there");
    let error = Diagnostic::error("no definition in scope for `n_dot_vv`");
    let error = error.at("shaders/pbr/pbr.wgsl", text, at..at + 8).with_help("did you mean `n_dot_v`?");
    let action = |name: &str, wall_ms, reason: &str| ActionTime {
        name: name.to_owned(),
        wall_ms,
        reason: reason.to_owned(),
    };
    let sky = darker(build);
    build.table = sky.table;
    build.table.diagnostics = vec![error, Diagnostic::warning("2 texels of sky.hdr were not finite")];
    build.table.work = Work {
        changed_files: vec!["sky.hdr".to_owned(), "shaders/pbr/pbr.wgsl".to_owned()],
        ran: vec![
            action("decode env/sky", 12.0, "sky.hdr changed"),
            action("analyse env/sky", 31.5, "its panorama is new"),
            action("prefilter env/sky/specular mip 3", 8.0, "its spectrum is new"),
        ],
        reused: 20,
        plan_ms: 2.0,
        run_ms: 52.0,
        noticed_unix_ms: unix_ms() - 70.0,
        published_unix_ms: unix_ms() - 10.0,
    };
    if let Some(target) = build.table.targets.get_mut("env/sky/skybox") {
        target.state = TargetState::Stale;
    }
    build.revision()
}

#[test]
fn window_is_shown_in_both_themes_at_any_scale() {
    let Some(gpu) = gpu() else { return };
    let folder = folder();
    for (name, theme, scale) in [
        ("dark_1", ThemeChoice::Dark, 1.0),
        ("light_1", ThemeChoice::Light, 1.0),
        ("dark_2", ThemeChoice::Dark, 2.0),
        ("light_1_25", ThemeChoice::Light, 1.25),
    ] {
        let (mut window, mut build) = window(&gpu, scale, folder.path());
        window.panels.layout.theme = theme;
        window.panels.run(Command::PinAsA);
        window.frame(Vec::new());
        window.apply(&busy(&mut build));
        for _ in 0..20 {
            window.frame(Vec::new());
        }
        assert_eq!(window.panels.compare.sides, [Side::Pin(1), Side::Live]);
        window.picture_of(name);
        window.panels.run(Command::Help);
        // It fades in.
        for _ in 0..20 {
            window.frame(Vec::new());
        }
        window.picture_of(&format!("{name}_help"));
    }
}
