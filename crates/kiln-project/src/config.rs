//! kiln.toml as data.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use kiln_check::{Allowance, Check};
use kiln_diagnostic::Diagnostic;
use kiln_scene::{Effect, EffectOverrides, SpecularGlossinessAs};
use kiln_shader::{Language, Program};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::env_config::{EnvConfig, read_env};
use crate::lut_config::{LutConfig, read_lut};
use crate::reader::{Document, Section, suggest};

/// Version of the project file that this Kiln reads.
pub const PROJECT_VERSION: usize = 1;

/// What a kiln.toml asks for.
#[derive(Clone, Debug, PartialEq)]
pub struct Project {
    /// For window titles and status lines.
    pub name: String,
    /// Folders outside the project whose files scenes may refer to; see [`kiln_scene::PackOptions`].
    pub allowed_folders: Vec<String>,
    /// `[env.NAME]`.
    pub envs: BTreeMap<String, EnvConfig>,
    /// `[lut.NAME]`.
    pub luts: BTreeMap<String, LutConfig>,
    /// `[scene.NAME]`.
    pub scenes: BTreeMap<String, SceneConfig>,
    /// `[shader.NAME]`.
    pub shaders: BTreeMap<String, ShaderConfig>,
    /// Folder for baked files, relative to the project.
    pub output_dir: String,
    /// Whether the GGX table that the preview's shaders read is left out; no key of kiln.toml.
    pub is_without_default_lut: bool,
    /// What the baked files may take together: the budget of `[check]`.
    pub bytes_max: Option<u64>,
    /// Findings of `kiln check` that are known and accepted: `allow` of `[check]`.
    pub allowances: Vec<Allowance>,
    /// `[effects]`.
    pub effects: EffectOverrides,
}

/// A scene, and what it is looked at with.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneConfig {
    /// A .gltf or .glb file.
    pub source: String,
    /// Name of an environment.
    pub env: String,
    /// Name of a material shader.
    pub shader: String,
    /// How materials of `KHR_materials_pbrSpecularGlossiness` are drawn.
    pub specular_glossiness: SpecularGlossinessAs,
}

/// A shader.
#[derive(Clone, Debug, PartialEq)]
pub struct ShaderConfig {
    /// Its files, and how they are to be read.
    pub program: Program,
    /// What it is used for.
    pub role: Role,
    /// Feature sets that are compiled whatever scenes ask for.
    pub variants: BTreeSet<BTreeSet<String>>,
    /// Languages that its variants are written in, for engines.
    pub emit: BTreeSet<Language>,
    /// The author's own textures, by the names of the shader's variables.
    pub textures: BTreeMap<String, OwnTexture>,
}

/// A texture that no material has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OwnTexture {
    /// A PNG or JPEG file.
    pub source: String,
    /// Whether it holds sRGB-encoded colour; else its values are read as they are.
    pub is_srgb: bool,
}

/// What a shader is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Draws surfaces; compiled once per set of effects.
    Material,
    /// Draws the environment behind the scene.
    Background,
    /// Turns linear radiance into display values.
    Tonemap,
    /// Nothing that Kiln draws with: compiled, checked and emitted for an engine.
    Engine,
}

impl Role {
    /// All of them.
    pub const ALL: [Role; 4] = [Role::Material, Role::Background, Role::Tonemap, Role::Engine];
}

impl Role {
    /// As kiln.toml and target facts spell it.
    pub fn name(self) -> &'static str {
        match self {
            Role::Material => "material",
            Role::Background => "background",
            Role::Tonemap => "tonemap",
            Role::Engine => "engine",
        }
    }
}

/// Reads kiln.toml. What is wrong is left out and said; the rest is usable.
pub fn parse_project(text: &str) -> (Project, Vec<Diagnostic>) {
    let (root, errors) = DeTable::parse_recoverable(text);
    let mut document = Document { text, diagnostics: Vec::new() };
    for error in errors {
        let diagnostic = document.error(error.message().replace('\n', "; "), error.span().unwrap_or(0..0));
        document.diagnostics.push(diagnostic);
    }
    let mut project = Project {
        name: "kiln".to_owned(),
        allowed_folders: Vec::new(),
        envs: BTreeMap::new(),
        luts: BTreeMap::new(),
        scenes: BTreeMap::new(),
        shaders: BTreeMap::new(),
        output_dir: "baked".to_owned(),
        is_without_default_lut: false,
        bytes_max: None,
        allowances: Vec::new(),
        effects: EffectOverrides::default(),
    };
    read_root(&mut document, root.get_ref(), &mut project);
    (project, document.diagnostics)
}

const TABLES: [&str; 9] =
    ["version", "project", "env", "lut", "scene", "shader", "effects", "output", "check"];

fn read_root<'a>(document: &mut Document<'a>, root: &DeTable<'a>, project: &mut Project) {
    check_version(document, root);
    // References are checked last, against everything that was declared, broken or not.
    let declared = |table: &str| -> Vec<String> {
        let table = root.iter().find(|(key, _)| key.get_ref() == table);
        let table = table.and_then(|(_, value)| value.get_ref().as_table());
        table.into_iter().flatten().map(|(name, _)| name.get_ref().to_string()).collect()
    };
    let (envs, shaders) = (declared("env"), declared("shader"));
    for (key, value) in root {
        match key.get_ref().as_ref() {
            "version" => {}
            "project" => read_single(document, "project", value, |section| {
                if let Some(name) = section.text("name") {
                    project.name = name;
                }
                project.allowed_folders = read_allowed_folders(section);
            }),
            "output" => read_single(document, "output", value, |section| {
                if let Some(dir) = read_output_dir(section) {
                    project.output_dir = dir;
                }
            }),
            "check" => read_single(document, "check", value, |section| {
                project.bytes_max = section.bytes("max_bytes");
                project.allowances = read_allowances(section);
            }),
            "effects" => read_single(document, "effects", value, |section| {
                project.effects = read_effects(section);
            }),
            "env" => read_named(document, "env", value, |section, _| read_env(section), &mut project.envs),
            // [lut.ggx] stands for the default table.
            "lut" => read_named(document, "lut", value, read_lut, &mut project.luts),
            "scene" => {
                let read = |section: &mut Section, _: &str| read_scene(section, &envs, &shaders);
                read_named(document, "scene", value, read, &mut project.scenes);
            }
            "shader" => read_named(document, "shader", value, read_shader, &mut project.shaders),
            other => {
                let mut diagnostic = document.error(format!("unknown table `{other}`"), key.span());
                diagnostic.help = suggest(other, TABLES.into_iter());
                document.diagnostics.push(diagnostic);
            }
        }
    }
}

fn check_version(document: &mut Document, root: &DeTable) {
    let version = root.iter().find(|(key, _)| key.get_ref() == "version").map(|(_, value)| value);
    let is_known =
        version.and_then(|value| value.get_ref().as_integer()).is_some_and(|number| number.as_str() == "1");
    if !is_known {
        let place = version.map_or(0..0, Spanned::span);
        let message = match version {
            None => "the project file does not say its version".to_owned(),
            Some(_) => format!("this Kiln reads project files of version {PROJECT_VERSION}"),
        };
        let diagnostic = document.error(message, place).with_help("the first line should be `version = 1`");
        document.diagnostics.push(diagnostic);
    }
}

fn read_single<'a>(
    document: &mut Document<'a>,
    name: &str,
    value: &Spanned<DeValue<'a>>,
    read: impl FnOnce(&mut Section),
) {
    let Some(table) = as_table(document, name, value) else { return };
    let mut section = Section::new(document, name.to_owned(), value.span(), table);
    read(&mut section);
    section.finish();
}

fn read_named<'a, T>(
    document: &mut Document<'a>,
    kind: &str,
    value: &Spanned<DeValue<'a>>,
    read: impl Fn(&mut Section, &str) -> T,
    into: &mut BTreeMap<String, T>,
) {
    let Some(tables) = as_table(document, kind, value) else { return };
    for (name, value) in tables {
        let path = format!("{kind}.{}", name.get_ref());
        let Some(table) = as_table(document, &path, value) else { continue };
        let mut section = Section::new(document, path.clone(), name.span(), table);
        let config = read(&mut section, name.get_ref());
        if !is_name(name.get_ref()) {
            let message = format!("[{path}]: names have letters, digits, `-` and `_` only");
            section.fail(message, name.span(), None);
        }
        if section.finish() {
            into.insert(name.get_ref().to_string(), config);
        }
    }
}

fn as_table<'v, 'a>(
    document: &mut Document<'a>,
    name: &str,
    value: &'v Spanned<DeValue<'a>>,
) -> Option<&'v DeTable<'a>> {
    let table = value.get_ref().as_table();
    if table.is_none() {
        let message = format!("`{name}` must be a table, not {}", value.get_ref().type_str());
        let diagnostic = document.error(message, value.span()).with_help(format!("write `[{name}.NAME]`"));
        document.diagnostics.push(diagnostic);
    }
    table
}

/// Names become parts of target names and file names.
fn is_name(name: &str) -> bool {
    let fits = |character: char| character.is_ascii_alphanumeric() || "-_".contains(character);
    !name.is_empty() && name.len() <= 80 && name.chars().all(fits)
}

/// A folder of its own inside the project: files in it are overwritten and removed.
fn read_output_dir(section: &mut Section) -> Option<String> {
    let place = section.place("dir");
    let dir = section.text("dir")?;
    let is_inside = !dir.is_empty() && dir.split('/').all(|part| !["", ".", ".."].contains(&part));
    if !is_inside || dir.contains('\\') || dir.contains(':') {
        let help = "name a folder inside the project that holds nothing else, as `dir = \"baked\"`";
        section.fail(format!("`dir` in [output] is `{dir}`"), place, Some(help.to_owned()));
        return None;
    }
    Some(dir)
}

/// Folders that glTF files may refer to though they lie outside the project.
fn read_allowed_folders(section: &mut Section) -> Vec<String> {
    let mut folders = Vec::new();
    for folder in section.texts("allow_folders").unwrap_or_default() {
        let path = normalised(&folder);
        if leaves_project(&path) {
            folders.push(path);
            continue;
        }
        let help = "name folders outside, as `allow_folders = [\"../library\", \"/srv/assets\"]`";
        let message =
            format!("`{folder}` in `allow_folders` lies in the project, where all may be referred to");
        section.fail(message, section.place("allow_folders"), Some(help.to_owned()));
    }
    folders
}

/// A source's path, in the one spelling by which the rest knows it.
fn read_source(section: &mut Section, example: &'static str) -> String {
    normalised(&section.required_text("source", example))
}

pub(crate) fn normalised(path: &str) -> String {
    let path = path.replace('\\', "/");
    let parts: Vec<&str> = path
        .split('/')
        .enumerate()
        .filter(|(at, part)| *at == 0 || !part.is_empty())
        .map(|(_, part)| part)
        .collect();
    parts.into_iter().filter(|part| *part != ".").collect::<Vec<_>>().join("/")
}

fn read_scene(section: &mut Section, envs: &[String], shaders: &[String]) -> SceneConfig {
    let mut reference = |key: &'static str, declared: &[String], default: &str| {
        let name = section.text(key).unwrap_or_else(|| default.to_owned());
        if !declared.contains(&name) {
            let help = suggest(&name, declared.iter().map(String::as_str))
                .unwrap_or_else(|| format!("declared are: {}", declared.join(", ")));
            section.fail(format!("there is no [{key}.{name}]"), section.place(key), Some(help));
        }
        name
    };
    let first_env = envs.first().cloned().unwrap_or_default();
    SceneConfig {
        env: reference("env", envs, &first_env),
        shader: reference("shader", shaders, "pbr"),
        specular_glossiness: section
            .choice(
                "specular_glossiness",
                &[
                    ("metallic_roughness", SpecularGlossinessAs::MetallicRoughness),
                    ("specular", SpecularGlossinessAs::Specular),
                ],
            )
            .unwrap_or_default(),
        source: read_source(section, "scenes/scene.gltf"),
    }
}

/// `allow = [{ check = "poles", target = "env/sky", reason = "…" }]`; what is wrong with one leaves that one out.
fn read_allowances(section: &mut Section) -> Vec<Allowance> {
    section.tables("allow", |section| {
        let names = Check::ALL.map(|check| (check.name(), check));
        if section.place("check") == section.place("") {
            section.missing("check", "wrap-column");
        }
        let check = section.choice("check", &names);
        let target = section.required_text("target", "env/sky");
        let place = section.place("reason");
        let reason = section.required_text("reason", "hidden behind the set");
        if reason.trim().is_empty() && place != section.place("") {
            let help = "say why it may stay: the next one to read the report asks".to_owned();
            section.fail("an allowance needs a reason".to_owned(), place, Some(help));
        }
        check.map(|check| Allowance { check, target, reason })
    })
}

fn read_effects(section: &mut Section) -> EffectOverrides {
    let mut overrides = EffectOverrides::default();
    for (key, effects) in [("force", &mut overrides.force), ("forbid", &mut overrides.forbid)] {
        for name in section.texts(key).unwrap_or_default() {
            match Effect::from_name(&name) {
                Some(effect) => _ = effects.insert(effect),
                None => {
                    let known = Effect::ALL.map(Effect::name);
                    let help = suggest(&name, known.into_iter())
                        .unwrap_or_else(|| format!("effects are: {}", known.join(", ")));
                    section.fail(format!("there is no effect `{name}`"), section.place(key), Some(help));
                }
            }
        }
    }
    if let Some(both) = overrides.force.intersection(&overrides.forbid).next() {
        let message = format!("`{}` is both forced and forbidden", both.name());
        section.fail(message, section.place("forbid"), None);
        overrides.force.clear();
    }
    for effect in overrides.force.iter().filter(|effect| !effect.is_of_material()) {
        let (message, help) = if effect.is_of_geometry() {
            let message =
                format!("`{0}` cannot be forced: no setting gives a mesh what `{0}` reads", effect.name());
            (message, "take it out of `force`; draws whose scene moves or repeats them have it already")
        } else {
            let message = format!("`{}` cannot be forced: it is the environment's", effect.name());
            (message, "`sun = \"extract\"` of an [env] makes its sun a light")
        };
        section.warn(message, section.place("force"), help);
    }
    overrides
}

fn read_shader(section: &mut Section, name: &str) -> ShaderConfig {
    let roles = Role::ALL.map(|role| (role.name(), role));
    // A shader named after a role has it.
    let by_name = roles.iter().find(|(role, _)| *role == name).map_or(Role::Material, |(_, role)| *role);
    let roots: Vec<String> = match section.texts("source") {
        Some(sources) => sources.iter().map(|source| normalised(source)).collect(),
        None => vec![read_source(section, "shaders/pbr/pbr.wgsl")],
    };
    let paths =
        |texts: Option<Vec<String>>| texts.unwrap_or_default().iter().map(|path| normalised(path)).collect();
    let program = Program {
        roots,
        defines: read_each(section, "defines", parse_define),
        include_dirs: paths(section.texts("include")),
        prelude: paths(section.texts("prelude")),
    };
    check_program(section, &program);
    check_inside(section, "source", &program.roots);
    check_inside(section, "include", &program.include_dirs);
    check_inside(section, "prelude", &program.prelude);
    let variants = read_each(section, "variants", parse_variant);
    ShaderConfig {
        program,
        role: section.choice("role", &roles).unwrap_or(by_name),
        variants: variants.into_iter().collect(),
        emit: read_languages(section),
        textures: read_textures(section),
    }
}

/// Reads each text of a list; those that are wrong are said.
fn read_each<T>(
    section: &mut Section,
    key: &'static str,
    read: impl Fn(&str) -> Result<T, String>,
) -> Vec<T> {
    let mut values = Vec::new();
    for text in section.texts(key).unwrap_or_default() {
        match read(&text) {
            Ok(value) => values.push(value),
            Err(message) => section.fail(message, section.place(key), None),
        }
    }
    values
}

/// `textures = ["noise=textures/noise.png", "ramp=textures/ramp.png srgb"]`.
fn read_textures(section: &mut Section) -> BTreeMap<String, OwnTexture> {
    let mut textures = BTreeMap::new();
    for text in section.texts("textures").unwrap_or_default() {
        let is_variable = |name: &str| {
            let word = |character: char| character.is_ascii_alphanumeric() || character == '_';
            name.chars().all(word) && name.starts_with(|first: char| first.is_ascii_alphabetic())
        };
        match text.split_once('=').map(|(name, file)| (name.trim(), file.trim())) {
            Some((name, file)) if is_variable(name) && !file.is_empty() => {
                let (source, is_srgb) = file.strip_suffix(" srgb").map_or((file, false), |file| (file, true));
                let texture = OwnTexture { source: normalised(source.trim()), is_srgb };
                textures.insert(name.to_owned(), texture);
            }
            _ => {
                let message = format!("`textures` has `{text}`, which names no variable and file");
                let help =
                    "write \"noise=textures/noise.png\", or \"ramp=textures/ramp.png srgb\" for colours";
                section.fail(message, section.place("textures"), Some(help.to_owned()));
            }
        }
    }
    let sources: Vec<String> = textures.values().map(|texture: &OwnTexture| texture.source.clone()).collect();
    check_inside(section, "textures", &sources);
    textures
}

fn read_languages(section: &mut Section) -> BTreeSet<Language> {
    let mut languages = BTreeSet::new();
    for name in section.texts("emit").unwrap_or_default() {
        match Language::parse(&name) {
            Some(language) => _ = languages.insert(language),
            None => {
                let known = Language::ALL.map(Language::name);
                let help = suggest(&name, known.into_iter());
                let help = help.unwrap_or_else(|| format!("known are: {}", known.join(", ")));
                section.fail(format!("`emit` names no language `{name}`"), section.place("emit"), Some(help));
            }
        }
    }
    languages
}

fn check_program(section: &mut Section, program: &Program) {
    if program.roots.is_empty() {
        let help = "name a WGSL file, or a GLSL file for each stage".to_owned();
        section.fail("`source` names no file".to_owned(), section.place("source"), Some(help));
    }
    let is_wgsl = program.subject().ends_with(".wgsl");
    if program.roots.len() > 1 && program.roots.iter().any(|root| root.ends_with(".wgsl")) {
        let help = "a WGSL shader has one root module, which imports the others";
        section.fail(
            "`source` names several WGSL files".to_owned(),
            section.place("source"),
            Some(help.to_owned()),
        );
    }
    for key in ["defines", "include", "prelude"] {
        if is_wgsl && section.place(key) != section.place("") {
            let help = "WGSL has `import` and `@if(feature)`".to_owned();
            section.fail(format!("`{key}` is for GLSL"), section.place(key), Some(help));
        }
    }
}

/// The name of a feature set that targets have: `base`, or features joined by `+`.
pub fn variant_name(features: &BTreeSet<String>) -> String {
    if features.is_empty() {
        "base".to_owned()
    } else {
        features.iter().cloned().collect::<Vec<_>>().join("+")
    }
}

/// The feature set of a name.
///
/// # Errors
/// A feature that is no identifier: targets, and so files, are named after it.
pub fn parse_variant(name: &str) -> Result<BTreeSet<String>, String> {
    let features = name.split('+').map(str::trim).filter(|feature| !["", "base"].contains(feature));
    features
        .map(|feature| match is_identifier(feature) {
            true => Ok(feature.to_owned()),
            false => Err(format!("`{feature}` is no feature: they are words of letters, digits and `_`")),
        })
        .collect()
}

/// A macro as compilers take it: `NAME=VALUE`, or `NAME` for 1.
///
/// # Errors
/// The name is no identifier, or the value has more than one line.
pub fn parse_define(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').unwrap_or((text, "1"));
    let (name, value) = (name.trim(), value.trim());
    if !is_identifier(name) || name.starts_with("gl_") || name.starts_with("__") {
        return Err(format!("`{name}` is no name of a macro"));
    }
    if value.contains(['\n', '\r']) {
        return Err(format!("the value of `{name}` has more than one line"));
    }
    Ok((name.to_owned(), value.to_owned()))
}

fn is_identifier(name: &str) -> bool {
    let fits = |character: char| character.is_ascii_alphanumeric() || character == '_';
    name.len() <= 80
        && name.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
        && name.chars().all(fits)
}

/// What leaves the project is refused: what is read may be shown.
fn check_inside(section: &mut Section, key: &'static str, paths: &[String]) {
    for path in paths {
        if leaves_project(path) {
            let help = "copy or link it into the project's folder";
            let message = format!("`{path}` in `{key}` lies outside the project");
            section.fail(message, section.place(key), Some(help.to_owned()));
        }
    }
}

/// Whether a path, taken from the project's folder, leads out of it, links aside.
pub(crate) fn leaves_project(path: &str) -> bool {
    let mut depth = 0_i32;
    let mut goes_above = |part: &str| {
        depth += if part == ".." { -1 } else { 1 };
        depth < 0
    };
    Path::new(path).is_absolute() || path.split('/').any(&mut goes_above)
}
