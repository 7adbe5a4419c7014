//! What shaders' authors offer to be changed, under the shaders' names.

use egui::{Checkbox, ComboBox, RichText, Slider, Ui, WidgetInfo};
use kiln_shader::Widget;

use super::requests::Requests;
use crate::parameter::{OfferedParameter, ParameterValues};

/// Room for the number behind a slider.
const NUMBER_WIDTH: f32 = 72.0;

pub(super) fn show(
    ui: &mut Ui,
    offered: &[OfferedParameter],
    values: &mut ParameterValues,
    requests: &mut Requests,
) {
    for of_shader in offered.chunk_by(|a, b| a.shader == b.shader) {
        let shader = &of_shader[0].shader;
        super::side::section(ui, &format!("Shader {shader}"));
        of_shader.iter().for_each(|parameter| show_parameter(ui, parameter, values, requests));
        let set: Vec<&OfferedParameter> = of_shader.iter().filter(|it| values.is_set(it)).collect();
        ui.horizontal_wrapped(|ui| {
            let reset = egui::Button::new(format!("Reset {shader}"));
            if ui.add_enabled(!set.is_empty(), reset).clicked() {
                of_shader.iter().for_each(|parameter| values.reset(parameter));
            }
            let write = egui::Button::new(format!("Write all of {shader}"));
            let help = "write every value that you changed into the source that declares it";
            if ui.add_enabled(!set.is_empty(), write).on_hover_text(help).clicked() {
                requests.write(set, values);
            }
        });
    }
}

/// Its name with what is short beside it; sliders below, as wide as there is room.
fn show_parameter(
    ui: &mut Ui,
    parameter: &OfferedParameter,
    values: &mut ParameterValues,
    requests: &mut Requests,
) {
    let before = values.of(parameter);
    let mut value = before.clone();
    let is_slider = matches!(parameter.widget, Widget::Slider { .. });
    let label = ui.horizontal(|ui| {
        let label = ui.label(&parameter.name).on_hover_text(help(parameter)).id;
        if !is_slider {
            show_widget(ui, parameter, &mut value, label);
        }
        if values.is_set(parameter) {
            if is_pressed(ui, parameter, "reset", "back to its first value") {
                value.clone_from(&parameter.first);
            }
            if is_pressed(ui, parameter, "write", "write this value into the source that declares it") {
                requests.write([parameter], values);
            }
        }
        label
    });
    if is_slider {
        ui.scope(|ui| {
            ui.spacing_mut().slider_width = (ui.available_width() - NUMBER_WIDTH).max(60.0);
            show_widget(ui, parameter, &mut value, label.inner);
        });
    }
    if value != before {
        values.set(parameter, value);
    }
}

/// A small button behind the name; what it does is said by `verb` and the parameter's name to whoever cannot see where it is.
fn is_pressed(ui: &mut Ui, parameter: &OfferedParameter, verb: &str, help: &str) -> bool {
    let button = ui.add(egui::Button::new(RichText::new(verb).small()).frame(false));
    let name = parameter.full_name();
    button.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, format!("{verb} {name}")));
    button.on_hover_text(help).clicked()
}

fn show_widget(ui: &mut Ui, parameter: &OfferedParameter, value: &mut [f64], label: egui::Id) {
    match &parameter.widget {
        Widget::Slider { least, greatest } => {
            for component in value {
                let slider = Slider::new(component, *least..=*greatest).max_decimals(3);
                let slider = if parameter.is_integer() { slider.integer() } else { slider };
                ui.add(slider).labelled_by(label);
            }
        }
        Widget::Color => {
            let mut rgb = [0, 1, 2].map(|channel| value.get(channel).copied().unwrap_or(0.0) as f32);
            // Only where it changed: `f32` does not hold every value that an author may write.
            if ui.color_edit_button_rgb(&mut rgb).labelled_by(label).changed() {
                value.iter_mut().zip(rgb).for_each(|(component, channel)| *component = f64::from(channel));
            }
        }
        Widget::Toggle => {
            let Some(component) = value.first_mut() else { return };
            let mut is_on = *component != 0.0;
            ui.add(Checkbox::without_text(&mut is_on)).labelled_by(label);
            *component = f64::from(u8::from(is_on));
        }
        Widget::Choice { names } => {
            let Some(component) = value.first_mut() else { return };
            show_choice(ui, parameter, names, component);
        }
        Widget::Number => {
            for component in value {
                let speed = (component.abs() * 0.01).max(if parameter.is_integer() { 0.1 } else { 0.001 });
                let number = egui::DragValue::new(component).speed(speed);
                let number = if parameter.is_integer() { number.max_decimals(0) } else { number };
                ui.add(number).labelled_by(label);
            }
        }
    }
}

fn show_choice(ui: &mut Ui, parameter: &OfferedParameter, names: &[String], value: &mut f64) {
    let chosen = *value as usize;
    let shown = names.get(chosen).map_or("", String::as_str);
    let list = ComboBox::from_id_salt(parameter.full_name()).selected_text(shown);
    let response = list.show_ui(ui, |ui| {
        for (index, name) in names.iter().enumerate() {
            if ui.selectable_label(index == chosen, name).clicked() {
                *value = index as f64;
            }
        }
    });
    let name = &parameter.name;
    response.response.widget_info(|| WidgetInfo::labeled(egui::Role::ComboBox, true, name));
}

fn help(parameter: &OfferedParameter) -> RichText {
    let kind = if parameter.is_override { "override" } else { "member of params" };
    let about = if parameter.label.is_empty() { "" } else { "\n" };
    RichText::new(format!("{}{about}{}, {kind}", parameter.label, parameter.ty))
}
