//! The help overlay: every key, from the table that dispatches them, and what the hand does.

use egui::{Align2, Area, Grid, Id, Order, RichText, ScrollArea, Ui};

use super::PanelState;
use super::keys::{BINDINGS, Binding};
use crate::theme;

/// What is not a key of the table: the hand's doing, and keys that egui knows by itself.
const OTHERS: &[(&str, &str)] = &[
    ("drag", "turn around the target"),
    ("right or Shift drag", "move sideways"),
    ("wheel", "come closer"),
    ("double click", "frame what is there, or the scene"),
    ("Ctrl + / −", "larger or smaller panels"),
];

/// Width of keys and their words.
const COLUMN: f32 = 400.0;
/// Narrower windows have one column.
const TWO_COLUMNS: f32 = 2.0 * COLUMN + 60.0;

/// Over the whole window: the picture may have less room than the list.
pub(super) fn show_over(ui: &Ui, state: &mut PanelState) {
    if !state.is_help_open {
        return;
    }
    let window = ui.ctx().content_rect();
    let area = Area::new(Id::unique("kiln help")).order(Order::Foreground).constrain_to(window);
    area.pivot(Align2::CENTER_CENTER).fixed_pos(window.center()).show(ui.ctx(), |ui| {
        theme::card_frame(ui, theme::of(ui).accent).show(ui, |ui| {
            ui.label(RichText::new("Keys and hand").strong());
            let columns = if window.width() < TWO_COLUMNS { 1 } else { 2 };
            ui.set_width((COLUMN * columns as f32).min(window.width() - 60.0));
            let scroll = ScrollArea::both().max_height((window.height() - 110.0).max(80.0));
            scroll.show(ui, |ui| show_rows(ui, columns));
            if ui.button("Close help").clicked() {
                state.is_help_open = false;
            }
        });
    });
}

fn show_rows(ui: &mut Ui, columns: usize) {
    Grid::new("help").num_columns(2 * columns).spacing([14.0, 4.0]).show(ui, |ui| {
        let rows = rows();
        let height = rows.len().div_ceil(columns);
        for row in 0..height {
            for (keys, help) in rows.iter().skip(row).step_by(height) {
                ui.label(RichText::new(keys).monospace().color(theme::of(ui).accent));
                ui.label(*help);
            }
            ui.end_row();
        }
    });
}

/// Keys with the same words share a row.
pub(super) fn rows() -> Vec<(String, &'static str)> {
    let of_keys = BINDINGS.chunk_by(|a, b| a.help == b.help).map(|same| (names(same), same[0].help));
    of_keys.chain(OTHERS.iter().map(|(hand, help)| ((*hand).to_owned(), *help))).collect()
}

fn names(bindings: &[Binding]) -> String {
    let mut names: Vec<&str> = bindings.iter().map(|binding| binding.name).collect();
    names.dedup();
    names.join(" ")
}
