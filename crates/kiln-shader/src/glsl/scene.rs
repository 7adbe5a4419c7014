//! What a stage knows while its functions are rewritten: which names mean something else to naga.

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use super::Parsed;
use super::bindings;
use super::builtin::{self, Combined};
use super::declare::{Block, Item, Qualifiers, Variable};
use super::locations;
use super::source::Place;
use super::texture::{self, Parts};
use super::texture_array::{self, Constants};
use super::types::Types;
use crate::Stage;

/// How the use of a global name is written for naga.
#[derive(Clone, Debug)]
pub enum Meaning {
    /// A combined texture: both parts, by the name of its sampler.
    Texture(Combined, String),
    /// An array of them, by the parts of its elements.
    Textures(Combined, Vec<Parts>),
    /// A uniform that is stored as another type.
    Stored(Stored),
    /// The instance of a block, with members that are written otherwise.
    Instance(BTreeMap<String, Member>),
    /// Another expression.
    Expression(Vec<String>),
}

/// How the use of a block's member is written.
#[derive(Clone, Debug)]
pub enum Member {
    /// A variable of its own.
    Renamed(String),
    /// Stored as another type.
    Stored(Stored),
}

/// A uniform that cannot be stored as what it is: truth values, and arrays of less than four components.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stored {
    /// The components that are used of each array element.
    pub swizzle: Option<&'static str>,
    /// How many truth values are stored as numbers.
    pub flags: Option<u32>,
    /// Whether matrices are stored in rows, and whether there is an array of them.
    pub rows: Option<bool>,
}

/// What a stage knows while its functions are rewritten.
#[derive(Debug)]
pub struct Scene {
    /// The stage.
    pub stage: Stage,
    /// Global names that are written otherwise.
    pub meanings: BTreeMap<String, Meaning>,
    /// Names of structs.
    pub structs: BTreeSet<Rc<str>>,
    /// Names of functions.
    pub functions: BTreeSet<Rc<str>>,
    /// Those that take a combined texture.
    pub textured: BTreeSet<Rc<str>>,
    /// Functions to define, with the place of their first use.
    pub polyfills: BTreeMap<&'static str, Place>,
    /// Values of global integer constants.
    pub constants: Constants,
    /// Names of functions that read one of several textures, by what they do.
    pub selectors: BTreeMap<String, String>,
    /// Types of global names.
    pub types: Types,
    /// Types whose comparison is defined, and columns whose assignment is.
    pub compared: BTreeSet<String>,
    /// Functions to define, each after those it calls.
    pub helpers: Vec<Helper>,
}

/// A function that Kiln defines for one it found in use.
#[derive(Clone, Debug)]
pub struct Helper {
    /// Its definitions, one for each way to call it.
    pub text: String,
    /// Where it is used first.
    pub place: Place,
}

/// Names that are written otherwise, and what else a function's text means.
pub fn scene(stage: &Parsed) -> Scene {
    let mut scene = Scene {
        stage: stage.stage,
        meanings: BTreeMap::new(),
        structs: BTreeSet::new(),
        functions: BTreeSet::new(),
        textured: BTreeSet::new(),
        polyfills: BTreeMap::new(),
        constants: texture_array::constants(&stage.items),
        selectors: BTreeMap::new(),
        types: Types::of(stage),
        compared: BTreeSet::new(),
        helpers: Vec::new(),
    };
    for name in ["gl_VertexID", "gl_VertexIndex", "gl_InstanceID", "gl_InstanceIndex"] {
        let texts = builtin::variable(name).unwrap_or_default().iter().map(|text| (*text).to_owned());
        scene.meanings.insert(name.to_owned(), Meaning::Expression(texts.collect()));
    }
    let mut size = [1_u32; 3];
    for item in &stage.items {
        match item {
            Item::Struct(structure) => drop(scene.structs.insert(Rc::clone(&structure.name.text))),
            Item::Function(function) => {
                scene.functions.insert(Rc::clone(&function.name.text));
                let mut tokens = function.parameters.iter().flatten();
                if tokens.any(|token| builtin::combined(&token.text).is_some()) {
                    scene.textured.insert(Rc::clone(&function.name.text));
                }
            }
            Item::Variable(variable) if variable.qualifiers.is("uniform") => {
                let name = variable.name.text.to_string();
                if let Some(combined) = builtin::combined(&variable.ty.text) {
                    let sampler = bindings::sampler_name(&variable.name.text, &combined);
                    scene.meanings.insert(name, Meaning::Texture(combined, sampler));
                } else if let (_, Some(stored)) = stored_type(variable) {
                    scene.meanings.insert(name, Meaning::Stored(stored));
                }
            }
            Item::Block(block) => block_meanings(&mut scene, stage, block),
            Item::Qualifiers(qualifiers, _) => {
                for (axis, name) in ["local_size_x", "local_size_y", "local_size_z"].iter().enumerate() {
                    size[axis] = qualifiers.integer(name).unwrap_or(size[axis]);
                }
            }
            _ => {}
        }
    }
    texture_array_meanings(&mut scene, stage);
    let [x, y, z] = size.map(|count| format!("{count}u"));
    let texts = ["uvec3", "(", &x, ",", &y, ",", &z, ")"].map(str::to_owned).to_vec();
    scene.meanings.insert("gl_WorkGroupSize".to_owned(), Meaning::Expression(texts));
    scene
}

fn texture_array_meanings(scene: &mut Scene, stage: &Parsed) {
    for (name, count) in &stage.texture_arrays {
        let first = texture_array::element_name(name, 0);
        let Some(Meaning::Texture(combined, _)) = scene.meanings.get(&first).cloned() else { continue };
        let sampler = |texture: &str| bindings::sampler_name(texture, &combined);
        let elements = texture::elements(name, *count, sampler);
        scene.meanings.insert(name.to_string(), Meaning::Textures(combined.clone(), elements));
    }
}

fn block_meanings(scene: &mut Scene, stage: &Parsed, block: &Block) {
    let is_passed = locations::direction(&block.qualifiers, stage.stage).is_some();
    let is_uniform = block.qualifiers.is("uniform");
    let is_flat = block.is_flattened();
    let mut members = BTreeMap::new();
    for member in &block.members {
        let name = member.name.text.to_string();
        if is_passed || is_flat {
            members.insert(name, Member::Renamed(locations::member_name(&block.name, &member.name)));
            continue;
        }
        let is_turned = is_row_major(stage, block, member);
        let turned = is_turned.then(|| Stored { rows: Some(!member.array.is_empty()), ..Stored::default() });
        if let Some(stored) = turned.or_else(|| stored_type(member).1.filter(|_| is_uniform)) {
            if block.instance.is_none() {
                scene.meanings.insert(name, Meaning::Stored(stored));
            } else {
                members.insert(name, Member::Stored(stored));
            }
        }
    }
    if let Some(instance) = &block.instance
        && !members.is_empty()
    {
        scene.meanings.insert(instance.text.to_string(), Meaning::Instance(members));
    }
}

/// The type that a uniform is stored as, and how its uses are written if that is another.
pub fn stored_type(variable: &Variable) -> (String, Option<Stored>) {
    let ty = &*variable.ty.text;
    let is_array = !variable.array.is_empty();
    let len =
        builtin::vector_len(ty).or_else(|| matches!(ty, "float" | "int" | "uint" | "bool").then_some(1));
    let Some(len) = len else { return (ty.to_owned(), None) };
    let is_flag = ty.starts_with('b');
    let kind = match ty.as_bytes().first() {
        Some(b'b' | b'u') => "u",
        Some(b'i') => "i",
        _ => "",
    };
    let swizzle = match len {
        1 => Some("x"),
        2 => Some("xy"),
        3 if is_flag => Some("xyz"),
        _ => None,
    };
    let stored = Stored { swizzle: swizzle.filter(|_| is_array), flags: is_flag.then_some(len), rows: None };
    if stored == Stored::default() {
        return (ty.to_owned(), None);
    }
    let stored_len = if is_array { 4 } else { len };
    let name = match (stored_len, kind) {
        (1, _) => "uint".to_owned(),
        (len, kind) => format!("{kind}vec{len}"),
    };
    (name, Some(stored))
}

/// Whether a member has matrices that its block stores in rows: as it says itself, or its block, or all blocks.
pub fn is_row_major(stage: &Parsed, block: &Block, member: &Variable) -> bool {
    let says = |qualifiers: &Qualifiers| {
        let last = qualifiers.layout.iter().rfind(|layout| layout.name.text.ends_with("_major"));
        last.map(|layout| layout.name.is("row_major"))
    };
    let of_all = || {
        stage.items.iter().rev().find_map(|item| match item {
            Item::Qualifiers(qualifiers, _)
                if block.qualifiers.storage.as_ref().is_some_and(|storage| qualifiers.is(&storage.text)) =>
            {
                says(qualifiers)
            }
            _ => None,
        })
    };
    let has_matrices =
        builtin::columns(&member.ty.text).is_some() || !builtin::is_value_type(&member.ty.text);
    has_matrices
        && says(&member.qualifiers).or_else(|| says(&block.qualifiers)).or_else(of_all).unwrap_or(false)
}

/// The type that holds the rows of a matrix as columns.
pub fn turned(ty: &str) -> Option<String> {
    Some(format!("mat{}x{}", builtin::rows(ty)?, builtin::columns(ty)?))
}
