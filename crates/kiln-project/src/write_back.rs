//! Values of shader parameters, written into the sources that declare them.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use kiln_build::{Digest, Engine, Target};
use kiln_diagnostic::Diagnostic;
use kiln_shader::{Reflection, Widget, write_parameter};

use crate::replace::{changed_meanwhile, read_text, replace_text};
use crate::{PROJECT_FILE, ShaderConfig, parse_project, suggest};

/// A value to write: component by component; a colour has three, a truth value is 0 or 1.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterValue {
    /// The shader's name in kiln.toml.
    pub shader: String,
    /// The parameter's name there.
    pub name: String,
    /// Its value.
    pub value: Vec<f64>,
}

/// A source that says another value now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WrittenSource {
    /// Path relative to the project.
    pub path: String,
    /// What it has now.
    pub digest: Digest,
}

/// Writes values into the sources of their shaders, all or none: at every place where a published variant has its first value.
/// A source counts as changed meanwhile unless it is as the engine last saw it, or as `written` says.
///
/// # Errors
/// What is wrong with a value, a shader or a file; then nothing was written, unless the message says that a file cannot be.
pub fn write_parameters(
    engine: &Engine,
    values: &[ParameterValue],
    written: &BTreeMap<String, Digest>,
) -> Result<Vec<WrittenSource>, Box<Diagnostic>> {
    let (project, _) = parse_project(&read_text(engine.folder(), PROJECT_FILE)?.text);
    let mut sources = Sources { engine, texts: BTreeMap::new() };
    for value in values {
        let config = project.shaders.get(&value.shader).ok_or_else(|| {
            let fault = Diagnostic::error(format!("there is no shader `{}` in kiln.toml", value.shader));
            Diagnostic { help: suggest(&value.shader, project.shaders.keys().map(String::as_str)), ..fault }
        })?;
        sources.write(config, value)?;
    }
    let read = sources.texts.iter().filter_map(|(path, source)| Some((path, source.as_ref()?)));
    let changed: Vec<(&String, &Source)> = read.filter(|(_, source)| source.is_changed).collect();
    for (path, source) in &changed {
        let is_known =
            written.get(*path) == Some(&source.digest) || engine.source(path).digest() == Some(source.digest);
        if !is_known {
            return Err(changed_meanwhile(path).into());
        }
    }
    let mut done = Vec::new();
    for (path, source) in changed {
        replace_text(engine.folder(), path, &source.digest, &source.text)?;
        done.push(WrittenSource { path: path.clone(), digest: Digest::of(source.text.as_bytes()) });
    }
    Ok(done)
}

/// What was written, in a sentence.
pub fn describe_written(written: &[WrittenSource]) -> String {
    let paths: Vec<&str> = written.iter().map(|source| source.path.as_str()).collect();
    match paths[..] {
        [] => "the source says this already".to_owned(),
        _ => format!("wrote {}", paths.join(", ")),
    }
}

/// A value as people write it: `shader.name=0.5`, numbers with commas between, `true`, `false`, or the name of a choice.
///
/// # Errors
/// It is written in another way, or nothing that is published has such a parameter.
pub fn parse_parameter_value(engine: &Engine, text: &str) -> Result<ParameterValue, Box<Diagnostic>> {
    let wrong = || {
        let fault = Diagnostic::error(format!("`{text}` names no parameter and value"));
        fault.with_help("write it as pbr.wetness=0.5 or tonemap.tint=1,0.9,0.8")
    };
    let (path, value) = text.split_once('=').ok_or_else(wrong)?;
    let (shader, name) = path.trim().rsplit_once('.').ok_or_else(wrong)?;
    let variants = variants(engine, shader)?;
    let mut parameters = variants.iter().flat_map(|(_, reflection)| &reflection.parameters);
    let widget = parameters.find(|parameter| parameter.name == name).map(|parameter| &parameter.widget);
    let component = |text: &str| match (text.trim(), widget) {
        ("true", _) => Some(1.0),
        ("false", _) => Some(0.0),
        (chosen, Some(Widget::Choice { names })) if names.iter().any(|name| name == chosen) => {
            names.iter().position(|name| name == chosen).map(|index| index as f64)
        }
        (number, _) => number.parse().ok().filter(|number: &f64| number.is_finite()),
    };
    let value = value.split(',').map(component).collect::<Option<Vec<f64>>>().ok_or_else(wrong)?;
    Ok(ParameterValue { shader: shader.to_owned(), name: name.to_owned(), value })
}

/// Sources that were read, with what is to be written.
struct Sources<'a> {
    engine: &'a Engine,
    texts: BTreeMap<String, Option<Source>>,
}

struct Source {
    text: Arc<str>,
    /// Of the file as it was read.
    digest: Digest,
    is_changed: bool,
}

impl Sources<'_> {
    fn read(&mut self, path: &str) -> Option<Arc<str>> {
        let read = || {
            let found = read_text(self.engine.folder(), path).ok()?;
            Some(Source { text: found.text.into(), digest: found.digest, is_changed: false })
        };
        let source = self.texts.entry(path.to_owned()).or_insert_with(read);
        source.as_ref().map(|source| source.text.clone())
    }

    fn write(&mut self, config: &ShaderConfig, value: &ParameterValue) -> Result<(), Box<Diagnostic>> {
        let mut names = BTreeSet::new();
        let mut is_written = false;
        for (features, reflection) in variants(self.engine, &value.shader)? {
            names.extend(reflection.parameters.iter().map(|parameter| parameter.name.clone()));
            if !reflection.parameters.iter().any(|parameter| parameter.name == value.name) {
                continue;
            }
            let (program, name) = (&config.program, &value.name);
            let edit = write_parameter(program, &features, &reflection, name, &value.value, &mut |path| {
                self.read(path)
            })?;
            is_written = true;
            if let Some(Some(source)) = self.texts.get_mut(&edit.path)
                && !edit.replacements.is_empty()
            {
                source.text = edit.apply(&source.text).into();
                source.is_changed = true;
            }
        }
        if is_written {
            return Ok(());
        }
        let fault = Diagnostic::error(format!("shader `{}` has no parameter `{}`", value.shader, value.name));
        Err(Diagnostic { help: suggest(&value.name, names.iter().map(String::as_str)), ..fault }.into())
    }
}

/// What is published of a shader: the features and the interface of each variant.
fn variants(engine: &Engine, shader: &str) -> Result<Vec<(BTreeSet<String>, Reflection)>, Box<Diagnostic>> {
    let published = engine.published();
    let of_shader = |target: &&Target| target.kind == "shader" && target.meta["shader"] == shader;
    let variant = |target: &Target| {
        let features = serde_json::from_value(target.meta["features"].clone()).ok()?;
        let part = target.parts.iter().find(|part| part.name == "reflection")?;
        let reflection = serde_json::from_slice(&engine.store().get(&part.digest)?).ok()?;
        Some((features, reflection))
    };
    let variants: Vec<_> = published.values().filter(of_shader).filter_map(variant).collect();
    if variants.is_empty() {
        let fault =
            Diagnostic::error(format!("shader `{shader}` is not built, so its parameters are not known"));
        return Err(fault.with_help("`kiln bake` builds it; if it has an error, mend that first").into());
    }
    Ok(variants)
}
