//! What the scene is made of, and why each variant of its shader is there.

use egui::{CollapsingHeader, RichText, Ui};

use super::PanelState;
use super::side::section;
use crate::theme;

pub(super) fn show(ui: &mut Ui, state: &PanelState) {
    let materials = &state.report.materials;
    if materials.is_empty() {
        return;
    }
    section(ui, "Materials");
    for (index, material) in materials.iter().enumerate() {
        let header = CollapsingHeader::new(&material.name).id_salt(("material", index));
        header.show(ui, |ui| {
            let draws = if material.draw_count == 1 {
                "1 draw".to_owned()
            } else {
                format!("{} draws", material.draw_count)
            };
            ui.label(
                RichText::new(format!("variant {}, {draws}", material.variant))
                    .small()
                    .color(theme::of(ui).accent),
            );
            for (effect, why) in &material.effects {
                ui.horizontal_wrapped(|ui| {
                    ui.label(RichText::new(effect.name()).small().strong());
                    ui.label(RichText::new(why).small().color(theme::of(ui).weak));
                });
            }
            if material.effects.is_empty() {
                ui.label(RichText::new("metal and roughness alone").small().color(theme::of(ui).weak));
            }
        });
    }
}
