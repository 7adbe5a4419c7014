//! What the shown scene offers: material variants, animations with their player, cameras.

use egui::{Checkbox, ComboBox, Slider, Ui};
use serde::{Deserialize, Serialize};

use super::PanelState;
use crate::camera::OrbitCamera;
use crate::report::OfferedAnimation;
use crate::view::AnimationTime;

/// How the chosen animation runs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Playback {
    pub is_playing: bool,
    /// Seconds of the animation a second.
    pub speed: f64,
    /// Whether it begins again when it ends.
    pub is_looping: bool,
}

impl Default for Playback {
    fn default() -> Self {
        Playback { is_playing: false, speed: 1.0, is_looping: true }
    }
}

/// Lets the animation run on by the time since the last frame.
pub(super) fn play(ui: &Ui, state: &mut PanelState) {
    if state.playback.is_playing {
        advance(state, f64::from(ui.input(|input| input.stable_dt)));
        ui.ctx().request_repaint();
    }
}

/// Plays or pauses; without animations nothing happens.
pub(super) fn toggle(state: &mut PanelState) {
    let Some(first) = state.report.animations.first() else { return };
    let time = state.view.animation.get_or_insert(AnimationTime { index: 0, time_s: 0.0 });
    let playing = state.report.animations.get(time.index).unwrap_or(first);
    // One that has ended plays again.
    if !state.playback.is_playing && time.time_s >= playing.duration_s {
        time.time_s = 0.0;
    }
    state.playback.is_playing = !state.playback.is_playing;
}

fn advance(state: &mut PanelState, seconds: f64) {
    let PanelState { view, playback, report, .. } = state;
    let Some(time) = &mut view.animation else { return playback.is_playing = false };
    let duration_s = report.animations.get(time.index).map_or(0.0, |animation| animation.duration_s);
    time.time_s += seconds * playback.speed;
    if time.time_s <= duration_s {
        return;
    }
    if playback.is_looping && duration_s > 0.0 {
        time.time_s %= duration_s;
    } else {
        time.time_s = duration_s;
        playback.is_playing = false;
    }
}

pub(super) fn show_variants(ui: &mut Ui, state: &mut PanelState) {
    let PanelState { report, selection, .. } = state;
    if report.variants.is_empty() {
        return;
    }
    let shown =
        report.shown.variant.as_ref().and_then(|name| report.variants.iter().position(|it| it == name));
    if let Some(chosen) = pick_or_none(ui, "material variant", "no variant", &report.variants, shown) {
        selection.variant = chosen.map(|index| report.variants[index].clone());
    }
}

pub(super) fn show_animations(ui: &mut Ui, state: &mut PanelState) {
    let names: Vec<String> = state.report.animations.iter().map(|it| it.name.clone()).collect();
    if names.is_empty() {
        return;
    }
    let shown = state.view.animation.map(|time| time.index).filter(|index| *index < names.len());
    if let Some(chosen) = pick_or_none(ui, "animation", "rest pose", &names, shown) {
        state.view.animation = chosen.map(|index| AnimationTime { index, time_s: 0.0 });
        state.playback.is_playing = chosen.is_some();
    }
    let Some(index) = shown else { return };
    let OfferedAnimation { duration_s, .. } = state.report.animations[index];
    ui.horizontal(|ui| {
        let label = if state.playback.is_playing { "Pause" } else { "Play" };
        if ui.button(label).on_hover_text("space").clicked() {
            toggle(state);
        }
        ui.add(Checkbox::new(&mut state.playback.is_looping, "loop"));
    });
    egui::Grid::new("player").num_columns(2).spacing([12.0, 8.0]).show(ui, |ui| {
        if let Some(time) = &mut state.view.animation {
            let scrubber = Slider::new(&mut time.time_s, 0.0..=duration_s).suffix(" s").max_decimals(2);
            super::side::row(ui, "Time", scrubber);
        }
        let speed = Slider::new(&mut state.playback.speed, 0.05..=4.0).logarithmic(true).suffix("×");
        super::side::row(ui, "Speed", speed.max_decimals(2));
    });
}

pub(super) fn show_cameras(ui: &mut Ui, state: &mut PanelState) {
    let PanelState { report, view, .. } = state;
    if report.cameras.is_empty() {
        return;
    }
    let shown = view.camera.is_none().then_some(view.scene_camera).filter(|it| *it < report.cameras.len());
    if let Some(chosen) = pick(ui, "camera", "moved by hand", &report.cameras, shown) {
        view.camera = None;
        view.scene_camera = chosen;
    }
}

/// A camera that the user keeps under a name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct NamedView {
    pub name: String,
    /// The scene it belongs to.
    pub scene: String,
    pub camera: OrbitCamera,
}

/// Views kept at most.
pub(crate) const NAMED_VIEWS_MAX: usize = 64;

/// Keeps the camera under a number, and goes back to those that were kept for this scene.
pub(super) fn show_named_views(ui: &mut Ui, state: &mut PanelState) {
    let PanelState { named_views, view, report, .. } = state;
    let Some(scene) = &report.shown.scene else { return };
    ui.horizontal_wrapped(|ui| {
        let keep = ui.add_enabled(
            view.camera.is_some() && named_views.len() < NAMED_VIEWS_MAX,
            egui::Button::new("Keep view"),
        );
        if let Some(camera) =
            view.camera.filter(|_| keep.on_hover_text("this camera, under a number").clicked())
        {
            let is_free =
                |name: &String| !named_views.iter().any(|it| it.scene == *scene && it.name == *name);
            let name = (1..).map(|number| format!("view {number}")).find(is_free).unwrap_or_default();
            named_views.push(NamedView { name, scene: scene.clone(), camera });
        }
        let mut dropped = None;
        for (index, kept) in named_views.iter().enumerate().filter(|(_, kept)| kept.scene == *scene) {
            let button = ui.selectable_label(view.camera == Some(kept.camera), &kept.name);
            if button.clicked() {
                view.camera = Some(kept.camera);
            }
            if button.on_hover_text("right click drops it").secondary_clicked() {
                dropped = Some(index);
            }
        }
        dropped.map(|index| named_views.remove(index));
    });
}

/// A list with nothing as its first choice; the new choice, if one was made.
fn pick_or_none(
    ui: &mut Ui,
    what: &str,
    nothing: &str,
    names: &[String],
    shown: Option<usize>,
) -> Option<Option<usize>> {
    let all: Vec<String> = std::iter::once(nothing.to_owned()).chain(names.iter().cloned()).collect();
    let chosen = pick(ui, what, nothing, &all, Some(shown.map_or(0, |index| index + 1)));
    chosen.map(|index| index.checked_sub(1))
}

/// A list to choose from, by place: names need not differ.
fn pick(ui: &mut Ui, what: &str, otherwise: &str, names: &[String], shown: Option<usize>) -> Option<usize> {
    let mut chosen = None;
    let text = shown.and_then(|index| names.get(index)).map_or(otherwise, String::as_str);
    let list = ComboBox::from_id_salt(what).width(ui.available_width() - 8.0);
    let response = list.selected_text(text).show_ui(ui, |ui| {
        for (index, name) in names.iter().enumerate() {
            let is_shown = shown == Some(index);
            if ui.selectable_label(is_shown, name).clicked() && !is_shown {
                chosen = Some(index);
            }
        }
    });
    response.response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ComboBox, true, what));
    chosen
}
