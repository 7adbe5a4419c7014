//! What is behind the scene and below it.

use egui::{Checkbox, ComboBox, RichText, Ui, WidgetInfo};

use super::PanelState;
use crate::theme;
use crate::view::{Background, from_srgb};

/// What a colour begins with: middle grey.
const COLOR: u8 = 0x77;

/// Why a ground that catches shadows shows none.
const NO_SUN: &str =
    "This environment's sun is no light of its own: `sun = \"extract\"` in its [env] makes it one.";

pub(super) fn show(ui: &mut Ui, state: &mut PanelState) {
    let background = &mut state.view.background;
    ui.horizontal(|ui| {
        show_kinds(ui, background);
        if let Background::Color(color) = background {
            let button = ui.color_edit_button_rgb(color);
            button.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, "background colour"));
        }
    });
    let ground = &mut state.view.ground;
    ui.horizontal(|ui| {
        ui.add(Checkbox::new(&mut ground.has_grid, "Grid"));
        let help = "of the environment's sun, where it is a light of its own";
        ui.add(Checkbox::new(&mut ground.catches_shadow, "Shadow on the ground")).on_hover_text(help);
    });
    if ground.catches_shadow && !state.report.has_sun {
        ui.label(RichText::new(NO_SUN).small().color(theme::of(ui).weak));
    }
}

fn show_kinds(ui: &mut Ui, background: &mut Background) {
    let kinds = [
        ("Environment", Background::Environment),
        ("Colour", Background::Color([from_srgb(COLOR); 3])),
        ("Checker", Background::Checker),
    ];
    let is_of =
        |kind: &Background, other: &Background| std::mem::discriminant(kind) == std::mem::discriminant(other);
    let shown = kinds.iter().find(|(_, kind)| is_of(kind, background)).map_or("", |(name, _)| name);
    let list = ComboBox::from_id_salt("background").selected_text(shown);
    let response = list.show_ui(ui, |ui| {
        for (name, kind) in kinds {
            if ui.selectable_label(is_of(&kind, background), name).clicked() && !is_of(&kind, background) {
                *background = kind;
            }
        }
    });
    response.response.widget_info(|| WidgetInfo::labeled(egui::Role::ComboBox, true, "background"));
}
