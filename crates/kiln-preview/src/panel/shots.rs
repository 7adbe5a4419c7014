//! Screenshots, as the panels see them: asked for, being written, written.

use std::path::PathBuf;

use egui::{Align2, Area, Id, Order, Rect, RichText, Ui, vec2};

use super::PanelState;
use super::keys::Command;
use crate::theme;

/// For how long the names of what was written stay.
const SHOWN_S: f64 = 8.0;

/// What was asked for and what came of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Shots {
    /// With radiance or without; taken by whoever has the pictures.
    pub asked: Option<bool>,
    /// The files that were written last, picture first, or why they were not.
    pub said: Option<Result<Vec<PathBuf>, String>>,
    /// When that was first shown.
    said_s: Option<f64>,
}

impl Shots {
    /// Asks for a picture of what is seen.
    pub fn ask(&mut self, radiance: bool) {
        self.asked = Some(radiance);
    }

    /// Takes over what came of it.
    pub fn say(&mut self, said: Result<Vec<PathBuf>, String>) {
        (self.said, self.said_s) = (Some(said), None);
    }
}

pub(super) fn show(ui: &mut Ui, state: &mut PanelState) {
    super::side::section(ui, "Picture");
    ui.horizontal(|ui| {
        for (label, key, radiance) in [("Save picture", "S", false), ("with EXR", "Shift S", true)] {
            if ui
                .add_enabled(state.report.revision > 0, egui::Button::new(label))
                .on_hover_text(key)
                .clicked()
            {
                state.run(Command::Screenshot { radiance });
            }
        }
    });
    let help = "A parameter sheet is saved beside it: kiln render --look SHEET.json draws it again.";
    ui.label(RichText::new(help).small().color(theme::of(ui).weak));
}

/// Names what was written, for a while.
pub(super) fn show_over(ui: &Ui, place: Rect, state: &mut PanelState) {
    let Shots { said: Some(said), said_s, .. } = &mut state.shots else { return };
    let now_s = ui.input(|input| input.time);
    let age_s = now_s - *said_s.get_or_insert(now_s);
    if age_s > SHOWN_S {
        state.shots.said = None;
        return;
    }
    ui.ctx().request_repaint_after_secs((SHOWN_S - age_s) as f32);
    let (color, lines) = match said {
        Ok(files) => (theme::of(ui).good, files.iter().map(|file| file.display().to_string()).collect()),
        Err(reason) => (theme::of(ui).error, vec![format!("the picture was not saved: {reason}")]),
    };
    let lines: Vec<String> = lines;
    let area = Area::new(Id::unique("kiln shots")).order(Order::Foreground).constrain_to(place);
    let corner = place.right_top() + vec2(-14.0, 44.0);
    area.pivot(Align2::RIGHT_TOP).fixed_pos(corner).show(ui.ctx(), |ui| {
        theme::card_frame(ui, color).show(ui, |ui| {
            ui.set_max_width((place.width() - 60.0).clamp(160.0, 620.0));
            for line in lines {
                ui.add(egui::Label::new(RichText::new(line).small().color(color)).wrap());
            }
        });
    });
}
