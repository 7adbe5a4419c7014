//! The bar on top: which project, which revision, whether all is well.

use egui::{Color32, CornerRadius, Frame, Margin, RichText, Sense, Ui, Vec2};
use kiln_diagnostic::Severity;

use super::{Connection, PanelState};
use crate::theme;

pub(super) fn show(ui: &mut Ui, state: &mut PanelState) {
    ui.horizontal(|ui| {
        ui.label(RichText::new("Kiln").heading().strong().color(theme::of(ui).accent));
        let name = if state.project.is_empty() { "no project yet" } else { &state.project };
        ui.label(RichText::new(name).heading());
        ui.add_space(8.0);
        show_connection(ui, &state.connection);
        if state.report.revision > 0 {
            ui.label(RichText::new(format!("revision {}", state.report.revision)).color(theme::of(ui).weak));
        }
        super::hold::show(ui, state);
        show_progress(ui, state);
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| show_badges(ui, state));
    });
}

fn show_connection(ui: &mut Ui, connection: &Connection) {
    let (color, text) = match connection {
        Connection::Connecting => (theme::of(ui).warning, "looking for a daemon"),
        Connection::Connected => (theme::of(ui).good, "connected"),
        Connection::Gone { .. } => (theme::of(ui).error, "daemon gone, reconnecting"),
    };
    let (place, _) = ui.allocate_exact_size(Vec2::splat(10.0), Sense::hover());
    ui.painter().circle_filled(place.center(), 4.0, color);
    let label = ui.label(text);
    if let Connection::Gone { reason } = connection {
        label.on_hover_text(reason);
    }
}

fn show_progress(ui: &mut Ui, state: &PanelState) {
    let Some(progress) = &state.progress else { return };
    let fraction = progress.done as f32 / progress.total.max(1) as f32;
    ui.add_space(8.0);
    ui.add(
        egui::ProgressBar::new(fraction).desired_width(110.0).desired_height(6.0).fill(theme::of(ui).accent),
    );
    let text = format!("{} of {}  {}", progress.done, progress.total, progress.current);
    ui.add(egui::Label::new(RichText::new(text).small().color(theme::of(ui).weak)).truncate());
}

/// Badges; a click opens what they stand for.
fn show_badges(ui: &mut Ui, state: &mut PanelState) {
    if ui.small_button("?").on_hover_text("H: keys and what the hand does").clicked() {
        state.is_help_open = !state.is_help_open;
    }
    let errors = state.all_diagnostics().filter(|diagnostic| diagnostic.is_error()).count();
    let mut is_clicked = false;
    if errors > 0 {
        let plural = if errors == 1 { "" } else { "s" };
        is_clicked |= badge(ui, &format!("{errors} error{plural}"), theme::of(ui).error).clicked();
    }
    let others = state.all_diagnostics().count() - errors;
    if others > 0 {
        let worst = state.all_diagnostics().filter(|it| !it.is_error()).map(|it| it.severity).max();
        let is_warning = worst == Some(Severity::Warning);
        let (word, color) =
            if is_warning { ("warning", theme::of(ui).warning) } else { ("note", theme::of(ui).weak) };
        let plural = if others == 1 { "" } else { "s" };
        is_clicked |= badge(ui, &format!("{others} {word}{plural}"), color).clicked();
    }
    if !state.report.stale.is_empty() {
        let all = state.stale_lines().join("\n");
        let badge = badge(ui, "stale", theme::of(ui).warning);
        is_clicked |= badge.on_hover_text(format!("older than their sources:\n{all}")).clicked();
    }
    if is_clicked {
        state.are_diagnostics_open = !state.are_diagnostics_open;
    }
}

fn badge(ui: &mut Ui, text: &str, color: Color32) -> egui::Response {
    let frame = Frame::new().fill(theme::badge_fill(color)).corner_radius(CornerRadius::same(9));
    let label =
        egui::Label::new(RichText::new(text).small().color(color)).selectable(false).sense(Sense::click());
    let response = frame.inner_margin(Margin::symmetric(9, 2)).show(ui, |ui| ui.add(label)).inner;
    response.on_hover_cursor(egui::CursorIcon::PointingHand)
}
