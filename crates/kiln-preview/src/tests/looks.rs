//! Looks, screenshots and what a window remembers: files that come back as they went.

use serde_json::json;

use crate::panel::PanelState;
use crate::readout::Rgb;
use crate::saved::{Saved, SavedFile, ThemeChoice};
use crate::shot::{Composition, compose, stem};
use crate::{AnimationTime, ApplyReport, Look, LookSheet, OrbitCamera, Selection, View};

fn view() -> View {
    let camera = OrbitCamera { target: glam::Vec3::new(0.1, 0.2, 1.0 / 3.0), ..OrbitCamera::BACKGROUND_ONLY };
    View {
        exposure_ev: 0.1,
        environment_rotation_rad: 1.0 / 3.0,
        camera: Some(camera),
        animation: Some(AnimationTime { index: 1, time_s: 0.7 }),
        ..View::default()
    }
}

fn selection() -> Selection {
    Selection { scene: Some("ball".to_owned()), env: Some("sky".to_owned()), ..Selection::default() }
}

fn sheet() -> LookSheet {
    let report = ApplyReport { revision: 7, shown: selection(), ..ApplyReport::default() };
    LookSheet::new(&report, &view(), [1280, 720], "llvmpipe")
}

#[test]
fn look_comes_back_bit_for_bit() {
    let read = LookSheet::read(&sheet().text()).expect("it was just written");
    assert_eq!(read, sheet());
    assert_eq!(read.look, Look { selection: selection(), view: view() });
}

#[test]
fn look_of_a_later_kiln_with_more_in_it_is_read() {
    let mut value: serde_json::Value = serde_json::from_str(&sheet().text()).expect("it is JSON");
    value["look"]["view"]["fog"] = json!(1.0);
    assert_eq!(LookSheet::read(&value.to_string()), Ok(sheet()));
}

#[test]
fn wrong_looks_are_refused_with_a_reason() {
    let broken = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut value: serde_json::Value = serde_json::from_str(&sheet().text()).expect("it is JSON");
        change(&mut value);
        LookSheet::read(&value.to_string()).expect_err("it is wrong")
    };
    assert!(broken(&|it| it["kiln_look"] = json!(2)).contains("format 2"));
    assert!(broken(&|it| it["size"] = json!([0, 720])).contains("0x720"));
    let endless = broken(&|it| it["look"]["view"]["exposure_ev"] = json!(1e300));
    assert!(endless.contains("exposure_ev") || endless.contains("out of range"), "{endless}");
    assert!(broken(&|it| it["look"]["view"]["camera"]["distance"] = json!(-1.0)).contains("camera"));
    assert!(
        broken(&|it| it["look"]["view"]["camera"]["distance"] = json!("far")).contains("no parameter sheet")
    );
    assert!(
        LookSheet::read(&" ".repeat(crate::LOOK_BYTES_MAX + 1)).expect_err("it is long").contains("bytes")
    );
}

#[test]
fn names_of_pictures_are_plain_and_say_what_is_on_them() {
    let shown =
        Selection { scene: Some("../a b".to_owned()), env: Some("sky".to_owned()), ..Selection::default() };
    assert_eq!(stem(&shown, 12), "-a-b-sky_r12");
    assert_eq!(stem(&Selection::default(), 1), "picture_r1");
}

#[test]
fn swiped_picture_has_a_to_the_left_of_the_divider_and_b_to_its_right() {
    let plain = |value: u8| Rgb { width: 4, height: 2, bytes: vec![value; 24] };
    let composed = compose(&[plain(10), plain(20)], Composition::Swipe(0.25)).expect("sizes are equal");
    let row = [vec![10; 3], vec![20; 9]].concat();
    assert_eq!(composed.bytes, [row.clone(), row].concat());
    assert_eq!(compose(&[plain(10), plain(20)], Composition::One).expect("there is one").bytes, [10; 24]);
    let heat = compose(&[plain(10), plain(10)], Composition::HeatMap).expect("sizes are equal");
    assert_eq!(heat.bytes[..3], [0, 0, 4], "no difference is the darkest colour");
    assert!(compose(&[], Composition::One).is_err());
}

fn window() -> PanelState {
    let mut state = PanelState::new(String::new(), selection(), view());
    state.layout.theme = ThemeChoice::Light;
    state.layout.zoom = 1.5;
    state.are_panels_hidden = true;
    state
}

#[test]
fn window_comes_back_as_it_was() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("state/kiln/window.json");
    assert_eq!(Saved::read(&path), (Saved::default(), None), "nothing there is no mistake");
    let mut file = SavedFile::new(path.clone(), Saved::default());
    assert!(file.keep(Saved::of(&window()), false).is_some(), "not at once");
    assert!(!path.exists());
    assert!(file.keep(Saved::of(&window()), true).is_none());
    let (read, note) = Saved::read(&path);
    assert_eq!(note, None);
    let mut restored = PanelState::new(String::new(), Selection::default(), View::default());
    read.restore(&mut restored);
    assert_eq!((restored.selection, restored.view), (selection(), view()));
    assert_eq!((restored.layout.theme, restored.are_panels_hidden), (ThemeChoice::Light, true));
    let left: Vec<_> = std::fs::read_dir(path.parent().expect("it has one")).expect("it is there").collect();
    assert_eq!(left.len(), 1, "no temporary file stays");
}

#[test]
fn damaged_memory_of_a_window_is_the_default_with_a_note() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("window.json");
    let whole = serde_json::to_value(Saved::of(&window())).expect("plain data");
    let with = |pointer: &str, value: serde_json::Value| {
        let mut changed = whole.clone();
        *changed.pointer_mut(pointer).expect("it is there") = value;
        changed.to_string()
    };
    let damaged = [
        String::new(),
        "{}".to_owned(),
        whole.to_string()[..40].to_owned(),
        with("/kiln_window", json!(9)),
        with("/layout/zoom", json!(0.0)),
        with("/layout/zoom", json!(1e300)),
        with("/look/view/camera/distance", json!(-1.0)),
        with("/layout/theme", json!("pink")),
        "x".repeat(2 << 20),
    ];
    for text in damaged {
        std::fs::write(&path, &text).expect("the folder can be written");
        let (read, note) = Saved::read(&path);
        assert_eq!(read, Saved::default());
        assert!(note.is_some_and(|note| note.contains("window.json")), "no note for {text:.60}");
    }
    std::fs::write(&path, whole.to_string()).expect("the folder can be written");
    assert_eq!(Saved::read(&path).1, None, "the whole one is read");
}

#[test]
fn command_line_wins_over_what_is_remembered() {
    let saved = Saved::of(&window());
    let nothing = saved.clone().with_given(&Selection::default(), &View::default());
    assert_eq!(nothing, saved);
    let brighter = View { exposure_ev: 3.0, ..View::default() };
    let env = Selection { env: Some("studio".to_owned()), ..Selection::default() };
    let given = saved.clone().with_given(&env, &brighter);
    assert_eq!(given.look.view, View { exposure_ev: 3.0, ..view() });
    assert_eq!(given.look.selection.scene.as_deref(), Some("ball"));
    assert_eq!(given.look.selection.env.as_deref(), Some("studio"));
    let other = Selection { scene: Some("car".to_owned()), ..Selection::default() };
    let given = saved.with_given(&other, &View::default());
    assert_eq!((given.look.selection, given.look.view.camera), (other, None));
}
