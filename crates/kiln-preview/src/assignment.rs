//! Parameters set by text, as `--param wetness=0.5` does.

use std::str::FromStr;

use kiln_shader::Widget;

use crate::parameter::{OfferedParameter, ParameterValues};

/// `name=value`, or `shader.name=value` where several shaders have that name. A value is a number, numbers with commas between,
/// `true`, `false`, or the name of a choice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Assignment {
    shader: Option<String>,
    name: String,
    value: String,
}

/// Why a parameter was not set, in a sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RefusedParameter(String);

impl std::fmt::Display for RefusedParameter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for RefusedParameter {}

impl FromStr for Assignment {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` sets nothing; write it as name=0.5 or shader.name=1,0.9,0.8");
        let (name, value) = text.split_once('=').ok_or_else(wrong)?;
        let (shader, name) = match name.trim().rsplit_once('.') {
            Some((shader, name)) => (Some(shader.to_owned()), name),
            None => (None, name.trim()),
        };
        if name.is_empty() || shader.as_deref() == Some("") || value.trim().is_empty() {
            return Err(wrong());
        }
        Ok(Assignment { shader, name: name.to_owned(), value: value.trim().to_owned() })
    }
}

impl ParameterValues {
    /// Sets every parameter that `assignment` names.
    ///
    /// # Errors
    /// There is no such parameter among `offered`, or its type or widget does not take the value.
    pub fn assign(
        &mut self,
        assignment: &Assignment,
        offered: &[OfferedParameter],
    ) -> Result<(), RefusedParameter> {
        let Assignment { shader, name, value } = assignment;
        let is_meant = |parameter: &&OfferedParameter| {
            parameter.name == *name && shader.as_ref().is_none_or(|shader| *shader == parameter.shader)
        };
        let meant: Vec<&OfferedParameter> = offered.iter().filter(is_meant).collect();
        if meant.is_empty() {
            return Err(RefusedParameter(unknown(assignment, offered)));
        }
        for parameter in meant {
            self.set(parameter, read(parameter, value).map_err(RefusedParameter)?);
        }
        Ok(())
    }
}

fn unknown(assignment: &Assignment, offered: &[OfferedParameter]) -> String {
    let shader = assignment.shader.as_ref().map_or(String::new(), |shader| format!(" `{shader}`"));
    let name = &assignment.name;
    let all: Vec<String> = offered.iter().map(OfferedParameter::full_name).collect();
    let all =
        if all.is_empty() { "there are none".to_owned() } else { format!("there are {}", all.join(", ")) };
    format!("no shader{shader} that is shown has a parameter `{name}`; {all}")
}

fn read(parameter: &OfferedParameter, text: &str) -> Result<Vec<f64>, String> {
    let OfferedParameter { ty, widget, .. } = parameter;
    let name = parameter.full_name();
    if let Widget::Choice { names } = widget
        && let Some(index) = names.iter().position(|name| name == text)
    {
        return Ok(vec![index as f64]);
    }
    match (widget, text) {
        (Widget::Toggle, "true") => return Ok(vec![1.0]),
        (Widget::Toggle, "false") => return Ok(vec![0.0]),
        _ => {}
    }
    let number = |text: &str| {
        let number = text.trim().parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| format!("`{name}` is {}; `{text}` is none", expected(parameter)))
    };
    let value = text.split(',').map(number).collect::<Result<Vec<f64>, String>>()?;
    let (given, taken) = (value.len(), parameter.first.len());
    if given != taken {
        let plural = if taken == 1 { "" } else { "s" };
        return Err(format!("`{name}` is a {ty} and takes {taken} number{plural}; {given} are given"));
    }
    let refused = value.iter().find(|component| parameter.allowed(**component) != **component);
    refused.map_or(Ok(value.clone()), |refused| {
        Err(format!("`{name}` is {}; {refused} is none", expected(parameter)))
    })
}

/// What a component of its value may be.
fn expected(parameter: &OfferedParameter) -> String {
    let ty = &parameter.ty;
    match &parameter.widget {
        Widget::Slider { least, greatest } => format!("a {ty} from {least} to {greatest}"),
        Widget::Color => format!("a {ty}, a colour of components from 0 on"),
        Widget::Toggle => "true or false".to_owned(),
        Widget::Choice { names } => format!("one of {}", names.join(", ")),
        Widget::Number => format!("a {ty}"),
    }
}
