//! What shaders' authors offer to be changed, under the shaders' names.

use egui::{Checkbox, ComboBox, RichText, Slider, Ui, WidgetInfo};
use kiln_shader::Widget;

use crate::parameter::{OfferedParameter, ParameterValues};
use crate::theme;

pub(super) fn show(ui: &mut Ui, offered: &[OfferedParameter], values: &mut ParameterValues) {
    for of_shader in offered.chunk_by(|a, b| a.shader == b.shader) {
        let shader = &of_shader[0].shader;
        super::side::section(ui, &format!("Shader {shader}"));
        of_shader.iter().for_each(|parameter| show_parameter(ui, parameter, values));
        let is_any_set = of_shader.iter().any(|parameter| values.is_set(parameter));
        let reset = egui::Button::new(format!("Reset {shader}"));
        if ui.add_enabled(is_any_set, reset).clicked() {
            of_shader.iter().for_each(|parameter| values.reset(parameter));
        }
    }
}

/// Its name and the way back above, the widget below: authors choose long names.
fn show_parameter(ui: &mut Ui, parameter: &OfferedParameter, values: &mut ParameterValues) {
    let label = ui.horizontal(|ui| {
        let label = ui.label(&parameter.name).on_hover_text(help(parameter));
        if values.is_set(parameter) {
            let reset = ui.add(egui::Button::new(RichText::new("reset").small()).frame(false));
            let name = parameter.full_name();
            reset.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, format!("reset {name}")));
            if reset.on_hover_text("back to its first value").clicked() {
                values.reset(parameter);
            }
        }
        label.id
    });
    let before = values.of(parameter);
    let mut value = before.clone();
    if show_widget(ui, parameter, &mut value, label.inner) && value != before {
        values.set(parameter, value);
    }
}

/// True if the value changed.
fn show_widget(ui: &mut Ui, parameter: &OfferedParameter, value: &mut [f64], label: egui::Id) -> bool {
    match &parameter.widget {
        Widget::Slider { least, greatest } => {
            let mut changed = false;
            for component in value {
                let slider = Slider::new(component, *least..=*greatest).max_decimals(3);
                let slider = if parameter.is_integer() { slider.integer() } else { slider };
                changed |= ui.add(slider).labelled_by(label).changed();
            }
            changed
        }
        Widget::Color => {
            let mut rgb = [0, 1, 2].map(|channel| value.get(channel).copied().unwrap_or(0.0) as f32);
            let changed = ui.color_edit_button_rgb(&mut rgb).labelled_by(label).changed();
            if changed {
                value.iter_mut().zip(rgb).for_each(|(component, channel)| *component = f64::from(channel));
            }
            changed
        }
        Widget::Toggle => {
            let Some(component) = value.first_mut() else { return false };
            let mut is_on = *component != 0.0;
            let changed = ui.add(Checkbox::without_text(&mut is_on)).labelled_by(label).changed();
            *component = f64::from(u8::from(is_on));
            changed
        }
        Widget::Choice { names } => {
            let Some(component) = value.first_mut() else { return false };
            show_choice(ui, parameter, names, component)
        }
    }
}

fn show_choice(ui: &mut Ui, parameter: &OfferedParameter, names: &[String], value: &mut f64) -> bool {
    let chosen = *value as usize;
    let mut changed = false;
    let shown = names.get(chosen).map_or("", String::as_str);
    let list = ComboBox::from_id_salt(parameter.full_name()).selected_text(shown);
    let response = list.show_ui(ui, |ui| {
        for (index, name) in names.iter().enumerate() {
            if ui.selectable_label(index == chosen, name).clicked() {
                (*value, changed) = (index as f64, index != chosen);
            }
        }
    });
    let name = &parameter.name;
    response.response.widget_info(|| WidgetInfo::labeled(egui::Role::ComboBox, true, name));
    changed
}

fn help(parameter: &OfferedParameter) -> RichText {
    let kind = if parameter.is_override { "override" } else { "member of params" };
    let about = if parameter.label.is_empty() { "" } else { "\n" };
    RichText::new(format!("{}{about}{}, {kind}", parameter.label, parameter.ty)).color(theme::TEXT)
}
