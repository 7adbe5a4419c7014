//! The panel below: what the last build did, how long it took, and why it ran.

use egui::{CornerRadius, Rect, RichText, ScrollArea, Sense, Ui, Vec2, pos2};
use kiln_link::{ActionTime, Work};

use super::PanelState;
use crate::theme;

pub(super) fn show(ui: &mut Ui, state: &PanelState) {
    ui.horizontal(|ui| {
        ui.label(RichText::new("Last build").strong().color(theme::WEAK));
        ui.label(summary(&state.work));
        if let Some(latency_ms) = state.latency_ms {
            let text = format!("change to picture {latency_ms:.0} ms");
            ui.label(RichText::new(text).strong().color(theme::ACCENT));
        }
        let changed = state.work.changed_files.join(", ");
        ui.add(egui::Label::new(RichText::new(changed).small().color(theme::WEAK)).truncate());
    });
    let longest_ms = state.work.ran.iter().map(|action| action.wall_ms).fold(0.0, f64::max);
    ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
        ui.spacing_mut().item_spacing.y = 2.0;
        ui.spacing_mut().interact_size.y = 16.0;
        for action in &state.work.ran {
            show_action(ui, action, longest_ms);
        }
    });
}

fn summary(work: &Work) -> String {
    let (ran, reused) = (work.ran.len(), work.reused);
    format!("{ran} ran, {reused} reused, plan {:.1} ms, run {:.1} ms", work.plan_ms, work.run_ms)
}

/// A bar as long as the action took compared with the longest one, its name, its time, its reason.
fn show_action(ui: &mut Ui, action: &ActionTime, longest_ms: f64) {
    ui.horizontal(|ui| {
        let (track, _) = ui.allocate_exact_size(Vec2::new(150.0, 10.0), Sense::hover());
        let fraction =
            if longest_ms > 0.0 { (action.wall_ms / longest_ms).clamp(0.0, 1.0) as f32 } else { 0.0 };
        // Even an action too short to measure leaves a mark.
        let right = track.left() + (track.width() * fraction).max(2.0);
        let bar = Rect::from_min_max(track.min, pos2(right, track.bottom()));
        ui.painter().rect_filled(track, CornerRadius::same(2), theme::RAISED);
        ui.painter().rect_filled(bar, CornerRadius::same(2), theme::ACCENT.gamma_multiply(0.8));
        ui.label(RichText::new(format!("{:>8.1} ms", action.wall_ms)).monospace().color(theme::WEAK));
        ui.label(&action.name);
        ui.add(egui::Label::new(RichText::new(&action.reason).small().color(theme::WEAK)).truncate());
    });
}
