//! The panel below: what each build did, why it ran, and where the time went on the way to the picture.

use egui::{Color32, CornerRadius, Rect, RichText, ScrollArea, Sense, Ui, Vec2, pos2, vec2};
use kiln_link::{ActionTime, Work};

use super::PanelState;
use crate::history::{Build, Stage};
use crate::theme;

/// Width of the list of builds.
const LIST_WIDTH: f32 = 470.0;
/// Width of a build's bar.
const BAR: f32 = 170.0;

pub(super) fn show(ui: &mut Ui, state: &mut PanelState) {
    let Some(chosen) = state.history.chosen().cloned() else {
        ui.label(RichText::new("No build yet").color(theme::of(ui).weak));
        return;
    };
    ui.horizontal(|ui| {
        ui.label(RichText::new("Builds").strong().color(theme::of(ui).weak));
        show_legend(ui);
        if let Some(latency_ms) = state.latency_ms {
            let text = format!("change to picture {latency_ms:.0} ms");
            ui.label(RichText::new(text).strong().color(theme::of(ui).accent));
        }
    });
    ui.horizontal_top(|ui| {
        let height = ui.available_height();
        // Half of a narrow window, so that the actions have room too.
        let width = LIST_WIDTH.min(ui.available_width() * 0.5);
        ui.allocate_ui_with_layout(vec2(width, height), egui::Layout::top_down(egui::Align::Min), |ui| {
            show_builds(ui, state, chosen.serial);
        });
        ui.separator();
        ui.vertical(|ui| show_build(ui, &chosen));
    });
}

fn show_legend(ui: &mut Ui) {
    for stage in Stage::ALL {
        let (dot, _) = ui.allocate_exact_size(Vec2::splat(8.0), Sense::hover());
        ui.painter().rect_filled(dot, CornerRadius::same(2), color_of(stage));
        ui.label(RichText::new(stage.name()).small().color(theme::of(ui).weak)).on_hover_text(stage.help());
    }
}

/// Bars are the same in both themes, so that one learns them.
fn color_of(stage: Stage) -> Color32 {
    match stage {
        Stage::Plan => Color32::from_rgb(0x6f, 0x8f, 0xc9),
        Stage::Run => Color32::from_rgb(0xd9, 0x85, 0x40),
        Stage::Publish => Color32::from_rgb(0x9a, 0x7f, 0xb8),
        Stage::Receive => Color32::from_rgb(0x58, 0xa6, 0xa6),
        Stage::Prepare => Color32::from_rgb(0xc9, 0xa4, 0x45),
        Stage::Draw => Color32::from_rgb(0x6d, 0xab, 0x75),
    }
}

fn show_builds(ui: &mut Ui, state: &mut PanelState, chosen: u64) {
    let longest_ms = state.history.newest_first().map(Build::total_ms).fold(0.0, f64::max);
    let mut clicked = None;
    ScrollArea::vertical().id_salt("builds").min_scrolled_height(0.0).auto_shrink([false, false]).show(
        ui,
        |ui| {
            ui.spacing_mut().item_spacing.y = 2.0;
            ui.spacing_mut().interact_size.y = 16.0;
            for build in state.history.newest_first() {
                if show_row(ui, build, longest_ms, build.serial == chosen) {
                    clicked = Some(build.serial);
                }
            }
        },
    );
    if let Some(serial) = clicked {
        state.history.choose(serial);
    }
}

/// Revision, stages, time, cause; whether it was clicked.
fn show_row(ui: &mut Ui, build: &Build, longest_ms: f64, is_chosen: bool) -> bool {
    let row = ui.horizontal(|ui| {
        let color = if is_chosen { theme::of(ui).accent } else { theme::of(ui).text };
        let name = format!("revision {}", build.revision);
        let name = ui.add(egui::Label::new(RichText::new(name).color(color)).sense(Sense::click()));
        let bar = show_stages(ui, build, longest_ms);
        ui.label(
            RichText::new(format!("{:>8.1} ms", build.total_ms())).monospace().color(theme::of(ui).weak),
        );
        if build.errors > 0 {
            let count = format!("{} of them", build.errors);
            ui.label(RichText::new("has errors").small().color(theme::of(ui).error)).on_hover_text(count);
        } else if build.stale > 0 {
            ui.label(RichText::new(format!("{} stale", build.stale)).small().color(theme::of(ui).warning));
        }
        let cause = RichText::new(build.cause()).small().color(theme::of(ui).weak);
        let cause = ui.add(egui::Label::new(cause).truncate().sense(Sense::click()));
        name.clicked() || bar || cause.clicked()
    });
    row.inner
}

/// One bar of all stages, as long as they took compared with the longest build.
fn show_stages(ui: &mut Ui, build: &Build, longest_ms: f64) -> bool {
    let (track, response) = ui.allocate_exact_size(Vec2::new(BAR, 10.0), Sense::click());
    ui.painter().rect_filled(track, CornerRadius::same(2), theme::of(ui).raised);
    let scale = if longest_ms > 0.0 { f64::from(track.width()) / longest_ms } else { 0.0 };
    let mut left = track.left();
    for (stage, ms) in build.stages() {
        let right = (left + (ms * scale) as f32).min(track.right());
        let part = Rect::from_min_max(pos2(left, track.top()), pos2(right, track.bottom()));
        ui.painter().rect_filled(part, CornerRadius::ZERO, color_of(stage));
        left = right;
    }
    response.on_hover_text(times(build)).clicked()
}

fn times(build: &Build) -> String {
    let line = |(stage, ms): (Stage, f64)| format!("{} {ms:.1} ms", stage.name());
    let stages = build.stages().into_iter().map(line).collect::<Vec<_>>().join(", ");
    if build.shown_unix_ms.is_some() { stages } else { format!("{stages}, not drawn") }
}

/// What a build did.
fn show_build(ui: &mut Ui, build: &Build) {
    ui.horizontal(|ui| {
        ui.label(RichText::new(format!("Revision {}", build.revision)).strong());
        ui.add(egui::Label::new(summary(&build.work)).truncate());
    });
    ui.add(egui::Label::new(RichText::new(times(build)).small().color(theme::of(ui).weak)).truncate());
    let changed = build.work.changed_files.join(", ");
    if !changed.is_empty() {
        let text = RichText::new(format!("changed: {changed}")).small().color(theme::of(ui).weak);
        ui.add(egui::Label::new(text).truncate()).on_hover_text(build.work.changed_files.join("\n"));
    }
    let longest_ms = build.work.ran.iter().map(|action| action.wall_ms).fold(0.0, f64::max);
    ScrollArea::vertical().id_salt("actions").min_scrolled_height(0.0).auto_shrink([false, false]).show(
        ui,
        |ui| {
            ui.spacing_mut().item_spacing.y = 2.0;
            ui.spacing_mut().interact_size.y = 16.0;
            for action in &build.work.ran {
                show_action(ui, action, longest_ms);
            }
            if build.actions_left_out > 0 {
                let text = format!("{} more are not kept", build.actions_left_out);
                ui.label(RichText::new(text).small().color(theme::of(ui).weak));
            }
        },
    );
}

fn summary(work: &Work) -> String {
    let (ran, reused) = (work.ran.len(), work.reused);
    format!("{ran} ran, {reused} reused, plan {:.1} ms, run {:.1} ms", work.plan_ms, work.run_ms)
}

/// A bar as long as the action took compared with the longest one, its name, its time, its reason.
fn show_action(ui: &mut Ui, action: &ActionTime, longest_ms: f64) {
    ui.horizontal(|ui| {
        let (track, _) = ui.allocate_exact_size(Vec2::new(70.0, 10.0), Sense::hover());
        let fraction =
            if longest_ms > 0.0 { (action.wall_ms / longest_ms).clamp(0.0, 1.0) as f32 } else { 0.0 };
        // Even an action too short to measure leaves a mark.
        let right = track.left() + (track.width() * fraction).max(2.0);
        let bar = Rect::from_min_max(track.min, pos2(right, track.bottom()));
        ui.painter().rect_filled(track, CornerRadius::same(2), theme::of(ui).raised);
        ui.painter().rect_filled(bar, CornerRadius::same(2), theme::of(ui).accent.gamma_multiply(0.8));
        ui.label(RichText::new(format!("{:>8.1} ms", action.wall_ms)).monospace().color(theme::of(ui).weak));
        ui.label(&action.name);
        let reason = RichText::new(&action.reason).small().color(theme::of(ui).weak);
        ui.add(egui::Label::new(reason).truncate()).on_hover_text(&action.reason);
    });
}
