//! The window's own settings: theme and size of the panels.

use egui::{ComboBox, Ui, WidgetInfo};

use super::PanelState;
use crate::saved::ThemeChoice;

/// What egui allows.
const ZOOMS: std::ops::RangeInclusive<f32> = 0.5..=3.0;

pub(super) fn show(ui: &mut Ui, state: &mut PanelState) {
    super::side::section(ui, "Window");
    egui::Grid::new("window").num_columns(2).spacing([12.0, 8.0]).show(ui, |ui| {
        ui.label("Theme");
        let choices = [
            (ThemeChoice::System, "as the system"),
            (ThemeChoice::Dark, "dark"),
            (ThemeChoice::Light, "light"),
        ];
        let theme = &mut state.layout.theme;
        let shown = choices.iter().find(|(choice, _)| choice == theme).map_or("", |(_, name)| name);
        let list = ComboBox::from_id_salt("theme").selected_text(shown).show_ui(ui, |ui| {
            for (choice, name) in choices {
                ui.selectable_value(theme, choice, name);
            }
        });
        list.response.widget_info(|| WidgetInfo::labeled(egui::Role::ComboBox, true, "theme"));
        ui.end_row();
        ui.label("Size");
        ui.horizontal(|ui| {
            let zoom = ui.ctx().zoom_factor();
            for (label, name, factor) in [("−", "smaller", 1.0 / 1.1), ("+", "larger", 1.1)] {
                let button = ui.small_button(label).on_hover_text("Ctrl + / −");
                button.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, name));
                if button.clicked() {
                    ui.ctx().set_zoom_factor((zoom * factor).clamp(*ZOOMS.start(), *ZOOMS.end()));
                }
            }
            ui.label(format!("{:.0} %", zoom * 100.0));
        });
        ui.end_row();
    });
}
