//! The bar on top: which project, which revision, whether all is well.

use egui::{Color32, CornerRadius, Frame, Margin, RichText, Sense, Ui, Vec2};

use super::{Connection, PanelState};
use crate::theme;

pub(super) fn show(ui: &mut Ui, state: &PanelState) {
    ui.horizontal(|ui| {
        ui.label(RichText::new("Kiln").heading().strong().color(theme::ACCENT));
        let name = if state.project.is_empty() { "no project yet" } else { &state.project };
        ui.label(RichText::new(name).heading());
        ui.add_space(8.0);
        show_connection(ui, &state.connection);
        if state.report.revision > 0 {
            ui.label(RichText::new(format!("revision {}", state.report.revision)).color(theme::WEAK));
        }
        show_progress(ui, state);
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| show_badges(ui, state));
    });
}

fn show_connection(ui: &mut Ui, connection: &Connection) {
    let (color, text) = match connection {
        Connection::Connecting => (theme::WARNING, "looking for a daemon"),
        Connection::Connected => (theme::GOOD, "connected"),
        Connection::Gone { .. } => (theme::ERROR, "daemon gone, reconnecting"),
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
    ui.add(egui::ProgressBar::new(fraction).desired_width(110.0).desired_height(6.0).fill(theme::ACCENT));
    let text = format!("{} of {}  {}", progress.done, progress.total, progress.current);
    ui.add(egui::Label::new(RichText::new(text).small().color(theme::WEAK)).truncate());
}

fn show_badges(ui: &mut Ui, state: &PanelState) {
    let errors = state.all_diagnostics().filter(|diagnostic| diagnostic.is_error()).count();
    if errors > 0 {
        let plural = if errors == 1 { "" } else { "s" };
        badge(ui, &format!("{errors} error{plural}"), theme::ERROR);
    }
    if !state.report.stale.is_empty() {
        let all = state.report.stale.join("\n");
        badge(ui, "stale", theme::WARNING).on_hover_text(format!("older than their sources:\n{all}"));
    }
}

fn badge(ui: &mut Ui, text: &str, color: Color32) -> egui::Response {
    let frame = Frame::new().fill(color.gamma_multiply(0.18)).corner_radius(CornerRadius::same(9));
    frame
        .inner_margin(Margin::symmetric(9, 2))
        .show(ui, |ui| ui.label(RichText::new(text).small().color(color)))
        .inner
}
