//! Arrays of combined textures, which WGSL has not without optional features: each element becomes a uniform of
//! its own. An index that only the running shader knows goes to a function that has a `switch` over the elements.
//!
//! Neighbouring pixels may take different ways through that `switch`, where no derivative may be taken. So a
//! lookup with an implicit level takes its derivatives before; those that WGSL has with an implicit level only
//! (comparisons, `sampler1D`) read all elements before, and choose among what was read.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::rc::Rc;

use super::Parsed;
use super::builtin::{self, Combined};
use super::condition;
use super::declare::{Item, Layout, Qualifiers, Variable};
use super::lex::{Kind, Token};
use super::source::Sources;
use crate::Stage;

/// Most elements of an array: devices without optional features have as many textures in a stage.
const ELEMENTS_MAX: i64 = 16;

/// Values of integer constants, by name.
pub type Constants = BTreeMap<Rc<str>, i64>;

/// The name of element `index`: what Kiln binds by.
pub fn element_name(array: &str, index: usize) -> String {
    match array.strip_suffix("_texture") {
        Some(bare) => format!("{bare}_{index}_texture"),
        None => format!("{array}_{index}"),
    }
}

/// The value of an expression of literals and constants.
pub fn value(tokens: &[Token], known: &Constants) -> Option<i64> {
    let values = tokens.iter().map(|token| match known.get(&token.text) {
        Some(value) => Some(Token::new(Kind::Number, value.to_string(), token.place)),
        None => Some(token.clone()).filter(|token| !token.is_word()),
    });
    condition::evaluate(&values.collect::<Option<Vec<Token>>>()?).ok()
}

/// Global constants that are integers.
pub fn constants(items: &[Item]) -> Constants {
    let mut found = Constants::new();
    for item in items {
        let Item::Variable(variable) = item else { continue };
        let is_integer = ["int", "uint"].iter().any(|ty| variable.ty.is(ty)) && variable.array.is_empty();
        if !(is_integer && variable.qualifiers.is("const") && variable.qualifiers.layout.is_empty()) {
            continue;
        }
        if let Some(value) = variable.initial.as_ref().and_then(|initial| value(initial, &found)) {
            found.insert(Rc::clone(&variable.name.text), value);
        }
    }
    found
}

/// How many textures `[…]` stands for, or what is wrong with it and what to do.
pub fn count(name: &str, array: &[Token], known: &Constants) -> Result<usize, (String, &'static str)> {
    let inside = array.get(1..array.len() - 1).unwrap_or_default();
    if inside.is_empty() {
        return Err((
            format!("the length of the texture array `{name}` is not known"),
            "write it between the brackets",
        ));
    }
    if inside.iter().any(|token| token.is("[")) {
        return Err((
            format!("`{name}` is an array of arrays of textures"),
            "use one array, and compute the index",
        ));
    }
    let Some(count) = value(inside, known).filter(|count| *count > 0) else {
        return Err((
            format!("the length of the texture array `{name}` is no positive constant"),
            "write a literal, or a `const int` that is one",
        ));
    };
    usize::try_from(count).ok().filter(|_| count <= ELEMENTS_MAX).ok_or_else(|| {
        (
            format!(
                "`{name}` has {count} textures; devices need not have more than {ELEMENTS_MAX} in a stage"
            ),
            "use a texture array as `sampler2DArray`",
        )
    })
}

/// Replaces arrays of combined textures among a stage's uniforms by their elements, and notes how many there are.
pub fn expand(sources: &mut Sources<'_, '_>, stage: &mut Parsed) {
    let known = constants(&stage.items);
    let mut items = Vec::with_capacity(stage.items.len());
    for item in std::mem::take(&mut stage.items) {
        match item {
            Item::Variable(variable) if is_array(&variable) => {
                let name = &variable.name;
                match count(&name.text, &variable.array, &known) {
                    Ok(count) => {
                        items.extend((0..count).map(|index| Item::Variable(element(&variable, index))));
                        stage.texture_arrays.insert(Rc::clone(&name.text), count);
                        check_names(sources, stage, name, count);
                    }
                    Err((message, help)) => {
                        let fault = sources.error(name.place, message).with_help(help);
                        sources.diagnostics.push(fault);
                    }
                }
            }
            other => items.push(other),
        }
    }
    stage.items = items;
}

fn is_array(variable: &Variable) -> bool {
    variable.qualifiers.is("uniform")
        && !variable.array.is_empty()
        && builtin::combined(&variable.ty.text).is_some()
}

/// An element's name must be free: a local of that name would hide it.
fn check_names(sources: &mut Sources<'_, '_>, stage: &Parsed, name: &Token, count: usize) {
    let mut elements = (0..count).map(|index| element_name(&name.text, index));
    if let Some(taken) = elements.find(|element| stage.count(element) > 0) {
        let message = format!("`{taken}` is the name of an element of `{}`", name.text);
        let fault = sources.error(name.place, message).with_help(format!("rename the other `{taken}`"));
        sources.diagnostics.push(fault);
    }
}

fn element(array: &Variable, index: usize) -> Variable {
    let mut element = array.clone();
    element.name.text = Rc::from(element_name(&array.name.text, index));
    element.array.clear();
    element.qualifiers = placed(&array.qualifiers, index);
    element
}

/// The first element has the array's binding. The others follow it in OpenGL, where each has a number; with a set,
/// which is Vulkan's, the array has but one, and they get what is free.
fn placed(qualifiers: &Qualifiers, index: usize) -> Qualifiers {
    let mut placed = qualifiers.clone();
    let first = qualifiers.integer("binding").filter(|_| index > 0);
    let Some((first, place)) = first.zip(qualifiers.layout("binding").map(|layout| layout.name.place)) else {
        return placed;
    };
    placed.layout.retain(|layout| !layout.name.is("binding"));
    if qualifiers.layout("set").is_none() {
        let number = u32::try_from(index).map_or(first, |index| first.saturating_add(index));
        let value = vec![Token::new(Kind::Number, number.to_string(), place)];
        placed.layout.push(Layout { name: Token::new(Kind::Word, "binding", place), value });
    }
    placed
}

/// A lookup of GLSL's, by what its name says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Lookup<'a> {
    /// Its name without `Offset` and `Proj`.
    name: &'a str,
    is_projected: bool,
    has_offset: bool,
}

impl Lookup<'_> {
    fn of(name: &str) -> Option<Lookup<'_>> {
        let (rest, has_offset) = name.strip_suffix("Offset").map_or((name, false), |rest| (rest, true));
        let is_projected = rest.starts_with("textureProj");
        let name = match rest {
            "texture" | "textureProj" => "texture",
            "textureLod" | "textureProjLod" => "textureLod",
            "textureGrad" | "textureProjGrad" => "textureGrad",
            "texelFetch" | "textureSize" | "textureQueryLevels" => rest,
            _ => return None,
        };
        Some(Lookup { name, is_projected, has_offset })
    }
}

/// The lookup that `name` is, without `Offset` and `Proj`.
pub fn lookup(name: &str) -> Option<&str> {
    Lookup::of(name).map(|lookup| lookup.name)
}

/// Which argument of the lookup `name` is its offset, if one is, counted from the texture's 0.
pub fn offset_argument(name: &str) -> Option<usize> {
    let lookup = Lookup::of(name).filter(|lookup| lookup.has_offset)?;
    Some(match lookup.name {
        "texture" => 2,
        "textureGrad" => 4,
        _ => 3,
    })
}

/// The text of function `written`, which does what `name` does to element `index` of `count` textures. `offset` is
/// the constant that it adds to texel coordinates.
pub fn selector(
    written: &str,
    name: &str,
    combined: &Combined,
    count: usize,
    stage: Stage,
    offset: &str,
) -> Option<String> {
    let lookup = Lookup::of(name)?;
    let shape = Shape::of(combined)?;
    let mut text = String::new();
    for (parameters, call) in shape.calls(lookup, stage) {
        let textures: Vec<String> =
            (0..count).map(|i| format!("{} t{i}, {} s{i}", combined.texture, combined.sampler)).collect();
        let _ = writeln!(
            text,
            "{} {written}({}, int index{parameters}) {{",
            shape.result(lookup),
            textures.join(", ")
        );
        let offset = if lookup.has_offset { format!(", {offset}") } else { String::new() };
        let element = |i: usize| call.element(&format!("{}(t{i}, s{i})", combined.constructor), &offset);
        let _ = writeln!(text, "{}", call.before);
        let values: Vec<String> = if call.reads_all {
            for i in 0..count {
                let _ = writeln!(text, "{} v{i} = {};", shape.result(lookup), element(i));
            }
            (0..count).map(|i| format!("v{i}")).collect()
        } else {
            (0..count).map(element).collect()
        };
        text.push_str("switch (index) {\n");
        for (i, value) in values.iter().enumerate() {
            let label = if i + 1 == count { "default".to_owned() } else { format!("case {i}") };
            let _ = writeln!(text, "{label}: return {value};");
        }
        text.push_str("}\n}\n");
    }
    Some(text)
}

/// How one texture is read.
struct Call {
    /// Statements before.
    before: String,
    function: &'static str,
    /// Its arguments between the texture and the offset, each with a comma before it.
    arguments: &'static str,
    /// Whether all textures are read before the choice.
    reads_all: bool,
}

impl Call {
    fn element(&self, texture: &str, offset: &str) -> String {
        let (name, suffix) = (self.function, if offset.is_empty() { "" } else { "Offset" });
        format!("{name}{suffix}({texture}{}{offset})", self.arguments)
    }
}

/// The shape of a texture, as lookups see it.
struct Shape<'a> {
    /// The prefix of its type: `i`, `u` or nothing.
    kind: &'a str,
    name: &'a str,
    is_shadow: bool,
}

impl Shape<'_> {
    fn of(combined: &Combined) -> Option<Shape<'_>> {
        let (kind, name) = combined.texture.split_once("texture")?;
        Some(Shape { kind, name, is_shadow: combined.sampler == "samplerShadow" })
    }

    /// Components of a direction or place in it.
    fn dimensions(&self) -> usize {
        match self.name {
            "1D" => 1,
            "3D" | "Cube" | "CubeArray" => 3,
            _ => 2,
        }
    }

    /// Components of coordinates with the layer, and without what they are compared with.
    fn coordinates(&self) -> usize {
        self.dimensions() + usize::from(self.name.ends_with("Array"))
    }

    fn result(&self, lookup: Lookup<'_>) -> String {
        match lookup.name {
            "textureQueryLevels" => "int".to_owned(),
            "textureSize" => match self.name {
                "Cube" => vector("i", 2),
                "CubeArray" => vector("i", 3),
                _ => vector("i", self.coordinates()),
            },
            _ if self.is_shadow => "float".to_owned(),
            _ => vector(self.kind, 4),
        }
    }

    /// Parameters after the index, each list with a comma before it, and what is done with them.
    fn calls(&self, lookup: Lookup<'_>, stage: Stage) -> Vec<(String, Call)> {
        let plain =
            |function, arguments| Call { before: String::new(), function, arguments, reads_all: false };
        match lookup.name {
            "textureQueryLevels" => return vec![(String::new(), plain("textureQueryLevels", ""))],
            "textureSize" if self.name == "2DMS" => return vec![(String::new(), plain("textureSize", ""))],
            "textureSize" => return vec![(", int level".to_owned(), plain("textureSize", ", level"))],
            "texelFetch" => {
                let parameters = format!(", {} p, int level", vector("i", self.coordinates()));
                return vec![(parameters, plain("texelFetch", ", p, level"))];
            }
            _ => {}
        }
        let place = vector("", self.coordinates() + usize::from(self.is_shadow));
        let places =
            if lookup.is_projected { self.projected() } else { vec![(place.clone(), "p".to_owned())] };
        let mut calls = Vec::new();
        for (ty, expression) in places {
            let parameters = format!(", {ty} p");
            let before = format!("{place} q = {expression};");
            let slope = vector("", self.dimensions());
            match lookup.name {
                "textureLod" => {
                    let call = Call { before, ..plain("textureLod", ", q, level") };
                    calls.push((format!("{parameters}, float level"), call));
                }
                "textureGrad" => {
                    let call = Call { before, ..plain("textureGrad", ", q, dx, dy") };
                    calls.push((format!("{parameters}, {slope} dx, {slope} dy"), call));
                }
                _ if self.is_shadow || self.name == "1D" => {
                    // Neither takes a bias.
                    calls.push((parameters, Call { before, reads_all: true, ..plain("texture", ", q") }));
                }
                _ => {
                    let part = if self.dimensions() == self.coordinates() {
                        ""
                    } else {
                        &".xyz"[..=self.dimensions()]
                    };
                    let slopes =
                        format!("{before}\n{slope} dx = dFdx(q{part});\n{slope} dy = dFdy(q{part});");
                    // A level is the logarithm of the greater slope: a bias scales the slopes.
                    let biased = format!("{slopes}\ndx *= exp2(bias);\ndy *= exp2(bias);");
                    let call = |before| Call { before, ..plain("textureGrad", ", q, dx, dy") };
                    calls.push((parameters.clone(), call(slopes)));
                    if stage == Stage::Fragment {
                        calls.push((format!("{parameters}, float bias"), call(biased)));
                    }
                }
            }
        }
        calls
    }

    /// The types of coordinates that are divided by their last component, and their quotients.
    fn projected(&self) -> Vec<(String, String)> {
        let kept = self.dimensions() + usize::from(self.is_shadow);
        let part = &"xyz"[..kept.min(3)];
        let mut found = Vec::new();
        if kept < 3 {
            let divisor = &"xyzw"[kept..=kept];
            found.push((vector("", kept + 1), format!("p.{part} / p.{divisor}")));
        }
        found.push((vector("", 4), format!("p.{part} / p.w")));
        found
    }
}

/// A scalar or vector type.
fn vector(kind: &str, len: usize) -> String {
    match (kind, len) {
        ("i", 1) => "int".to_owned(),
        ("u", 1) => "uint".to_owned(),
        (_, 1) => "float".to_owned(),
        _ => format!("{kind}vec{len}"),
    }
}
