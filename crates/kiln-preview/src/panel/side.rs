//! The panel beside the picture: what to show, under which light, and what is approximate.

use egui::{ComboBox, RichText, ScrollArea, Slider, Ui};

use super::PanelState;
use crate::theme;
use crate::view::{DiffuseSource, View};

pub(super) fn show(ui: &mut Ui, state: &mut PanelState) {
    ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
        section(ui, "Scene");
        let shown = state.report.shown.scene.clone();
        if let Some(scene) = pick(ui, "scene", &state.report.scenes, shown.as_deref()) {
            state.choose_scene(scene);
        }
        super::scene::show_variants(ui, state);
        super::scene::show_animations(ui, state);
        section(ui, "Environment");
        let shown = state.report.shown.env.clone();
        if let Some(env) = pick(ui, "environment", &state.report.envs, shown.as_deref()) {
            state.selection.env = Some(env);
        }
        show_light(ui, &mut state.view);
        show_diffuse(ui, &mut state.selection.diffuse);
        section(ui, "Background and ground");
        super::surroundings::show(ui, state);
        let values = &mut state.view.parameters;
        super::parameters::show(ui, &state.report.parameters, values, &mut state.requests);
        section(ui, "Camera");
        super::scene::show_cameras(ui, state);
        show_camera(ui, state);
        super::inspect::show(ui, state);
        super::inspect::show_probe(ui, state.findings.probe.as_ref());
        super::inspect::show_times(ui, &state.findings);
        super::materials::show(ui, state);
        super::compare::show(ui, state);
        super::shots::show(ui, state);
        super::appearance::show(ui, state);
        show_notes(ui, state);
        ui.add_space(12.0);
        ui.label(RichText::new(&state.adapter).small().color(theme::of(ui).weak));
    });
}

pub(super) fn section(ui: &mut Ui, title: &str) {
    ui.add_space(10.0);
    ui.label(RichText::new(title).strong().color(theme::of(ui).weak));
}

/// A list to choose from; the new choice, if one was made.
fn pick(ui: &mut Ui, what: &str, names: &[String], shown: Option<&str>) -> Option<String> {
    let mut chosen = None;
    let nothing = format!("no {what} yet");
    let list = ComboBox::from_id_salt(what).width(ui.available_width() - 8.0);
    let response = list.selected_text(shown.unwrap_or(&nothing)).show_ui(ui, |ui| {
        for name in names {
            let is_shown = shown == Some(name);
            if ui.selectable_label(is_shown, name).clicked() && !is_shown {
                chosen = Some(name.clone());
            }
        }
    });
    // A name for whoever cannot see the section's title.
    response.response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ComboBox, true, what));
    chosen
}

fn show_light(ui: &mut Ui, view: &mut View) {
    let mut degrees = view.environment_rotation_rad.to_degrees();
    egui::Grid::new("light").num_columns(2).spacing([12.0, 8.0]).show(ui, |ui| {
        let exposure = Slider::new(&mut view.exposure_ev, -10.0..=10.0).suffix(" EV").step_by(0.05);
        row(ui, "Exposure", exposure.max_decimals(2));
        row(ui, "Rotation", Slider::new(&mut degrees, 0.0..=360.0).suffix("°").max_decimals(0));
        let intensity = Slider::new(&mut view.environment_intensity, 0.0..=8.0).logarithmic(true);
        row(ui, "Intensity", intensity.smallest_positive(0.01).max_decimals(2));
        row(ui, "Blur", Slider::new(&mut view.background_blur, 0.0..=1.0).max_decimals(2));
    });
    view.environment_rotation_rad = degrees.to_radians();
    let View { exposure_ev, environment_rotation_rad, environment_intensity, background_blur, .. } =
        View::default();
    let neutral = View {
        exposure_ev,
        environment_rotation_rad,
        environment_intensity,
        background_blur,
        ..view.clone()
    };
    if ui.add_enabled(*view != neutral, egui::Button::new("Reset light")).clicked() {
        *view = neutral;
    }
}

fn show_diffuse(ui: &mut Ui, source: &mut DiffuseSource) {
    let mut reads_harmonics = *source == DiffuseSource::Harmonics;
    let why = "Diffuse light as engines show it that read the harmonics instead of the map.";
    ui.checkbox(&mut reads_harmonics, "Diffuse from harmonics").on_hover_text(why);
    *source = if reads_harmonics { DiffuseSource::Harmonics } else { DiffuseSource::Map };
}

pub(super) fn row(ui: &mut Ui, label: &str, slider: Slider<'_>) {
    let label = ui.label(label);
    ui.add(slider).labelled_by(label.id);
    ui.end_row();
}

fn show_camera(ui: &mut Ui, state: &mut PanelState) {
    ui.horizontal(|ui| {
        if ui.button("Frame the scene").on_hover_text("F").clicked() {
            state.frame_asked = Some(super::Framing::Scene);
        }
        let reset = egui::Button::new("Scene's own");
        if ui
            .add_enabled(state.view.camera.is_some(), reset)
            .on_hover_text("the camera it came with")
            .clicked()
        {
            state.view.camera = None;
        }
    });
    super::scene::show_named_views(ui, state);
    super::turntable::show(ui, state);
    ui.label(RichText::new("H shows all keys and what the hand does.").small().color(theme::of(ui).weak));
}

fn show_notes(ui: &mut Ui, state: &PanelState) {
    if state.report.notes.is_empty() && state.device_errors.is_empty() && state.window_notes.is_empty() {
        return;
    }
    section(ui, "Notes");
    for note in state.window_notes.iter().chain(&state.report.notes) {
        ui.label(RichText::new(note).small());
    }
    for error in &state.device_errors {
        ui.label(RichText::new(error).small().color(theme::of(ui).error));
    }
}
