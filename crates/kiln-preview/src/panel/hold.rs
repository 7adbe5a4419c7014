//! Holding a revision: news go on being told, the picture stays until it is let go.

use egui::{Align2, Area, Id, Order, Rect, RichText, Ui, vec2};

use super::PanelState;
use crate::theme;

/// Whether the shown revision is held, and what waits meanwhile.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Hold {
    pub is_on: bool,
    /// The newest revision that came since.
    pub waiting: Option<u64>,
}

/// The button in the bar on top.
pub(super) fn show(ui: &mut Ui, state: &mut PanelState) {
    if state.report.revision == 0 {
        return;
    }
    let label = if state.hold.is_on { "Let go" } else { "Hold" };
    let help = "L: keep this revision on screen while newer ones are built";
    if ui.selectable_label(state.hold.is_on, label).on_hover_text(help).clicked() {
        state.hold.is_on = !state.hold.is_on;
    }
}

/// Says over the picture that it is held, and what waits.
pub(super) fn show_over(ui: &Ui, place: Rect, state: &mut PanelState) {
    if !state.hold.is_on {
        return;
    }
    let area = Area::new(Id::unique("kiln hold")).order(Order::Middle).constrain_to(place);
    area.pivot(Align2::RIGHT_TOP).fixed_pos(place.right_top() + vec2(-14.0, 14.0)).show(ui.ctx(), |ui| {
        theme::card_frame(ui, theme::of(ui).accent).show(ui, |ui| {
            let text = format!("revision {} is held", state.report.revision);
            ui.label(RichText::new(text).color(theme::of(ui).accent));
            if let Some(waiting) = state.hold.waiting
                && ui.button(format!("Go to revision {waiting}")).on_hover_text("L").clicked()
            {
                state.hold.is_on = false;
            }
        });
    });
}
