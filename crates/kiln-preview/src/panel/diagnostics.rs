//! Diagnostics and badges over the picture, which goes on living below them.

use egui::text::{LayoutJob, TextFormat};
use egui::{Align2, Area, Id, Order, Rect, RichText, ScrollArea, Ui, vec2};
use kiln_diagnostic::{Diagnostic, Severity, Span};

use super::{Connection, PanelState};
use crate::theme;

/// Cards grow up to this part of the picture's height, then scroll.
const HEIGHT_MAX: f32 = 0.45;
/// Room between cards and the picture's edge.
const MARGIN: f32 = 14.0;

pub(super) fn show_over(ui: &Ui, place: Rect, state: &mut PanelState) {
    show_status(ui, place, state);
    let has_any = state.all_diagnostics().next().is_some() || !state.report.stale.is_empty();
    if !has_any || !state.are_diagnostics_open {
        return;
    }
    let mut is_closed = false;
    let area = Area::new(Id::unique("kiln diagnostics")).order(Order::Middle).constrain_to(place);
    let corner = place.left_bottom() + vec2(MARGIN, -MARGIN);
    area.pivot(Align2::LEFT_BOTTOM).fixed_pos(corner).show(ui.ctx(), |ui| {
        let worst = state.all_diagnostics().map(|diagnostic| diagnostic.severity).max();
        theme::card_frame(ui, color_of(theme::of(ui), worst.unwrap_or(Severity::Note))).show(ui, |ui| {
            ui.set_max_width((place.width() - 4.0 * MARGIN).clamp(160.0, 760.0));
            ui.horizontal(|ui| {
                if ui.small_button("Copy").on_hover_text("all of it, as text").clicked() {
                    ui.ctx().copy_text(as_text(state));
                }
                is_closed = ui.small_button("Close").on_hover_text("Esc; the badge opens it again").clicked();
                let stale = state.stale_lines().join("; ");
                let text = RichText::new(stale).small().color(theme::of(ui).warning);
                ui.add(egui::Label::new(text).truncate()).on_hover_text(state.stale_lines().join("\n"));
            });
            ScrollArea::both().max_height(place.height() * HEIGHT_MAX).show(ui, |ui| {
                for (index, diagnostic) in state.all_diagnostics().enumerate() {
                    if index > 0 {
                        ui.separator();
                    }
                    show_diagnostic(ui, diagnostic);
                }
            });
        });
    });
    state.are_diagnostics_open &= !is_closed;
}

/// All diagnostics as the command line prints them, then what is stale.
fn as_text(state: &PanelState) -> String {
    let diagnostics = state.all_diagnostics().map(Diagnostic::to_string);
    diagnostics.chain(state.stale_lines()).collect::<Vec<_>>().join("\n")
}

impl PanelState {
    /// What is stale on screen, and since when.
    pub(super) fn stale_lines(&self) -> Vec<String> {
        let line = |name: &String| match self.stale_since.get(name) {
            Some(since) => format!("{name} is stale since revision {since}"),
            None => format!("{name} is stale"),
        };
        self.report.stale.iter().map(line).collect()
    }
}

/// What the picture itself is, where it is not what the sources say.
fn show_status(ui: &Ui, place: Rect, state: &PanelState) {
    let gone = matches!(state.connection, Connection::Gone { .. });
    let (text, color) = if gone {
        ("daemon gone, reconnecting: this is the last picture", theme::of(ui).error)
    } else if !state.report.stale.is_empty() {
        ("stale: this is the last good picture", theme::of(ui).warning)
    } else {
        return;
    };
    let area =
        Area::new(Id::unique("kiln status")).order(Order::Middle).fixed_pos(place.min + vec2(MARGIN, MARGIN));
    area.show(ui.ctx(), |ui| {
        theme::card_frame(ui, color).show(ui, |ui| ui.label(RichText::new(text).color(color)));
    });
}

pub(super) fn show_diagnostic(ui: &mut Ui, diagnostic: &Diagnostic) {
    ui.spacing_mut().item_spacing.y = 3.0;
    ui.horizontal_wrapped(|ui| {
        let color = color_of(theme::of(ui), diagnostic.severity);
        ui.label(RichText::new(diagnostic.severity.to_string()).strong().color(color));
        ui.label(RichText::new(&diagnostic.message).strong());
    });
    if let Some(file) = &diagnostic.file {
        let place = diagnostic.span.as_ref().map(|span| format!(":{}:{}", span.line, span.column));
        let text = format!("{file}{}", place.unwrap_or_default());
        ui.label(RichText::new(text).monospace().color(theme::of(ui).accent));
    }
    if let Some(span) = &diagnostic.span {
        show_excerpt(ui, span, color_of(theme::of(ui), diagnostic.severity));
    }
    for note in &diagnostic.notes {
        ui.label(RichText::new(note).small().color(theme::of(ui).weak));
    }
    if let Some(help) = &diagnostic.help {
        ui.label(RichText::new(format!("help: {help}")).color(theme::of(ui).good));
    }
}

/// The source line, and carets below the place.
fn show_excerpt(ui: &mut Ui, span: &Span, color: egui::Color32) {
    ui.spacing_mut().item_spacing.y = 0.0;
    let number = span.line.to_string();
    let margin = " ".repeat(number.len());
    // Tabs would be of unknown width here: both lines get the same spaces instead.
    let expand = |text: &str| text.replace('\t', "    ");
    let before: String = span.source_line.chars().take(span.column as usize - 1).collect();
    let indent = " ".repeat(expand(&before).chars().count());
    let visible = span.source_line.chars().count().saturating_sub(before.chars().count()).max(1);
    let carets = "^".repeat((span.length_chars as usize).min(visible));
    let line =
        [(format!("{number} | "), theme::of(ui).weak), (expand(&span.source_line), theme::of(ui).text)];
    ui.add(egui::Label::new(monospace(line)).extend());
    let place = [(format!("{margin} | {indent}"), theme::of(ui).weak), (carets, color)];
    ui.add(egui::Label::new(monospace(place)).extend());
    ui.spacing_mut().item_spacing.y = 3.0;
}

/// One line of text in several colours.
fn monospace<const N: usize>(runs: [(String, egui::Color32); N]) -> LayoutJob {
    let mut line = LayoutJob::default();
    for (text, color) in runs {
        line.append(&text, 0.0, TextFormat::simple(egui::FontId::monospace(12.0), color));
    }
    line
}

fn color_of(palette: &theme::Palette, severity: Severity) -> egui::Color32 {
    match severity {
        Severity::Error => palette.error,
        Severity::Warning => palette.warning,
        Severity::Note => palette.weak,
    }
}
