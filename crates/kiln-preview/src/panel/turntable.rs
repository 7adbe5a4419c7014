//! The turntable: camera or light go round at a set rate until the hand takes over.

use egui::{ComboBox, Slider, Ui};

use super::PanelState;

/// What goes round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Turning {
    Camera,
    Light,
}

/// A turn around +Y.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Turntable {
    /// `None` = all stands.
    pub turning: Option<Turning>,
    /// Counter-clockwise as seen from above, below 0 the other way.
    pub degrees_per_s: f32,
}

impl Default for Turntable {
    /// A turn in twelve seconds, when it is started.
    fn default() -> Self {
        Turntable { turning: None, degrees_per_s: 30.0 }
    }
}

/// Long frames do not make it jump.
const FRAME_S_MAX: f32 = 0.1;

impl Turntable {
    /// Starts, or stops what goes round.
    pub fn toggle(&mut self, turning: Turning) {
        self.turning = if self.turning == Some(turning) { None } else { Some(turning) };
    }

    /// How far to turn in a frame of `seconds`.
    pub fn step_rad(&self, seconds: f32) -> f32 {
        self.degrees_per_s.to_radians() * seconds.min(FRAME_S_MAX)
    }
}

/// What turns and how fast.
pub(super) fn show(ui: &mut Ui, state: &mut PanelState) {
    let choices = [(None, "standing"), (Some(Turning::Camera), "camera"), (Some(Turning::Light), "light")];
    let Turntable { turning, degrees_per_s } = &mut state.turntable;
    let shown = choices.iter().find(|(choice, _)| choice == turning).map_or("", |(_, name)| name);
    egui::Grid::new("turntable").num_columns(2).spacing([12.0, 8.0]).show(ui, |ui| {
        ui.label("Turntable");
        let list = ComboBox::from_id_salt("turntable").selected_text(shown).show_ui(ui, |ui| {
            for (choice, name) in choices {
                ui.selectable_value(turning, choice, name);
            }
        });
        list.response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ComboBox, true, "turntable"));
        ui.end_row();
        super::side::row(
            ui,
            "Speed",
            Slider::new(degrees_per_s, -180.0..=180.0).suffix("°/s").max_decimals(0),
        );
    });
}
