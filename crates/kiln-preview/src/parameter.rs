//! What a shader's author offers to be changed, and what the user made of it.

use std::collections::BTreeMap;

use kiln_shader::{BindingKind, Parameter, ParameterPlace, Reflection, Widget};
use serde::{Deserialize, Serialize};

use crate::slot::Slot;
use crate::uniform::long_type_name;

/// A parameter of a shader that is shown.
#[derive(Clone, Debug, PartialEq)]
pub struct OfferedParameter {
    /// The shader's name in kiln.toml.
    pub shader: String,
    /// Its name there.
    pub name: String,
    /// WGSL type: a scalar or a vector.
    pub ty: String,
    /// Whether it is an `override`: a change makes pipelines anew.
    pub is_override: bool,
    /// How one changes it.
    pub widget: Widget,
    /// Its first value, component by component; a colour has three.
    pub first: Vec<f64>,
    /// What it does, in the author's words; may be empty.
    pub label: String,
}

impl OfferedParameter {
    /// Whether its components are whole numbers.
    pub fn is_integer(&self) -> bool {
        ["i32", "u32", "bool"].contains(&scalar_of(&self.ty))
    }

    /// Name of the shader and its own, as the command line takes them.
    pub fn full_name(&self) -> String {
        format!("{}.{}", self.shader, self.name)
    }

    /// The nearest value that its widget can be brought to.
    pub(crate) fn allowed(&self, value: f64) -> f64 {
        let value = match &self.widget {
            Widget::Slider { least, greatest } => value.clamp(*least, *greatest),
            Widget::Color => value.max(0.0),
            Widget::Toggle => f64::from(u8::from(value != 0.0)),
            Widget::Choice { names } => value.clamp(0.0, names.len().saturating_sub(1) as f64),
            Widget::Number if scalar_of(&self.ty) == "u32" => value.max(0.0),
            Widget::Number => value,
        };
        if self.is_integer() { value.round() } else { value }
    }
}

/// The parameters of a shader, and a sentence for each that nothing can change.
pub(crate) fn offered(shader: &str, reflection: &Reflection) -> (Vec<OfferedParameter>, Vec<String>) {
    let (mut parameters, mut notes) = (Vec::new(), Vec::new());
    for parameter in &reflection.parameters {
        let Some(ty) = type_of(parameter, reflection) else { continue };
        let count = component_count(&ty);
        let is_suited = if parameter.widget == Widget::Color { count >= 3 } else { count >= 1 };
        if !is_suited {
            let name = &parameter.name;
            notes
                .push(format!("`{name}` of shader `{shader}` is a {ty}, which its annotation cannot change"));
            continue;
        }
        parameters.push(OfferedParameter {
            shader: shader.to_owned(),
            name: parameter.name.clone(),
            is_override: parameter.place == ParameterPlace::Override,
            widget: parameter.widget.clone(),
            first: first_value(parameter, count),
            label: parameter.label.clone(),
            ty,
        });
    }
    (parameters, notes)
}

/// Its type, if it is an override or a member of the author's own block: Kiln fills the others.
fn type_of(parameter: &Parameter, reflection: &Reflection) -> Option<String> {
    let ty = match &parameter.place {
        ParameterPlace::Override => {
            &reflection.overrides.iter().find(|constant| constant.name == parameter.name)?.ty
        }
        ParameterPlace::Member { uniform } => {
            let own = |name: &str| Slot::from_name(name) == Some(Slot::Params);
            let binding = reflection.bindings.iter().find(|it| it.name == *uniform && own(&it.name))?;
            let BindingKind::Uniform { members, .. } = &binding.kind else { return None };
            &members.iter().find(|member| member.name == parameter.name)?.ty
        }
    };
    Some(long_type_name(ty))
}

/// `f32` of `vec3<f32>`.
fn scalar_of(ty: &str) -> &str {
    ty.split_once('<').map_or(ty, |(_, inner)| inner.trim_end_matches('>'))
}

/// Components of a scalar or vector; 0 for other types.
fn component_count(ty: &str) -> usize {
    match ty.split_once('<').map_or(ty, |(outer, _)| outer) {
        "f32" | "i32" | "u32" | "bool" => 1,
        "vec2" => 2,
        "vec3" => 3,
        "vec4" => 4,
        _ => 0,
    }
}

/// A vector under one number has it in every component.
fn first_value(parameter: &Parameter, count: usize) -> Vec<f64> {
    if parameter.widget == Widget::Color {
        return parameter.default.clone();
    }
    let last = parameter.default.last().copied().unwrap_or(0.0);
    (0..count).map(|index| parameter.default.get(index).copied().unwrap_or(last)).collect()
}

/// What the user set; every other parameter has its first value. A value outlives reloads of its shader as long as the
/// shader has, or gets again, a parameter of that name and type.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "Vec<Written>", into = "Vec<Written>")]
pub struct ParameterValues {
    by_name: BTreeMap<(String, String), Setting>,
}

/// A setting as files have it: a list, because keys of JSON objects are single strings.
#[derive(Serialize, Deserialize)]
struct Written {
    shader: String,
    name: String,
    #[serde(rename = "type")]
    ty: String,
    #[serde(default, rename = "override")]
    is_override: bool,
    value: Vec<f64>,
}

impl From<Vec<Written>> for ParameterValues {
    fn from(written: Vec<Written>) -> Self {
        let setting = |Written { shader, name, ty, is_override, value }: Written| {
            ((shader, name), Setting { ty, is_override, value })
        };
        ParameterValues { by_name: written.into_iter().map(setting).collect() }
    }
}

impl From<ParameterValues> for Vec<Written> {
    fn from(values: ParameterValues) -> Self {
        let written = |((shader, name), Setting { ty, is_override, value }): ((String, String), Setting)| {
            Written { shader, name, ty, is_override, value }
        };
        values.by_name.into_iter().map(written).collect()
    }
}

#[derive(Clone, Debug, PartialEq)]
struct Setting {
    ty: String,
    is_override: bool,
    value: Vec<f64>,
}

impl ParameterValues {
    /// The value of a parameter, component by component, within what its widget allows today.
    pub fn of(&self, parameter: &OfferedParameter) -> Vec<f64> {
        let setting = self.setting(parameter).map(|setting| &setting.value);
        let value = setting.unwrap_or(&parameter.first);
        value.iter().map(|&component| parameter.allowed(component)).collect()
    }

    /// Gives a parameter as many components as it has.
    pub fn set(&mut self, parameter: &OfferedParameter, value: Vec<f64>) {
        if value == parameter.first {
            return self.reset(parameter);
        }
        let setting = Setting { ty: parameter.ty.clone(), is_override: parameter.is_override, value };
        self.by_name.insert(key(parameter), setting);
    }

    /// Gives a parameter its first value back.
    pub fn reset(&mut self, parameter: &OfferedParameter) {
        self.by_name.remove(&key(parameter));
    }

    /// Forgets what the sources say by now, as after it was written there: to as many digits as the parameter's type has.
    pub fn settle(&mut self, offered: &[OfferedParameter]) {
        for parameter in offered {
            let narrow = |values: &[f64]| values.iter().map(|value| *value as f32).collect::<Vec<f32>>();
            let is_said = self.setting(parameter).is_some_and(|setting| match parameter.is_integer() {
                true => setting.value == parameter.first,
                false => narrow(&setting.value) == narrow(&parameter.first),
            });
            if is_said {
                self.reset(parameter);
            }
        }
    }

    /// Whether a parameter has another value than its first.
    pub fn is_set(&self, parameter: &OfferedParameter) -> bool {
        self.setting(parameter).is_some()
    }

    /// What pipelines depend on.
    pub(crate) fn overrides(&self) -> ParameterValues {
        let by_name = self.by_name.iter().filter(|(_, setting)| setting.is_override);
        ParameterValues { by_name: by_name.map(|(name, setting)| (name.clone(), setting.clone())).collect() }
    }

    fn setting(&self, parameter: &OfferedParameter) -> Option<&Setting> {
        let setting = self.by_name.get(&key(parameter))?;
        let fits = setting.ty == parameter.ty && setting.value.len() == parameter.first.len();
        fits.then_some(setting)
    }
}

fn key(parameter: &OfferedParameter) -> (String, String) {
    (parameter.shader.clone(), parameter.name.clone())
}
