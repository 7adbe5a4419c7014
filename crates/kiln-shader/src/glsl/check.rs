//! What a declaration may not say, because WGSL or naga has nothing for it.

use std::collections::BTreeSet;

use super::Parsed;
use super::bindings;
use super::builtin;
use super::declare::{Block, DROPPED, Item, Qualifiers, Struct, Variable};
use super::lex::Token;
use super::scene;
use super::source::{Place, Sources};
use crate::names;

/// Layouts that are understood, or change nothing because everything is filled by name.
const LAYOUTS: [&str; 22] = [
    "binding",
    "column_major",
    "constant_id",
    "depth_any",
    "depth_greater",
    "depth_less",
    "depth_unchanged",
    "early_fragment_tests",
    "local_size_x",
    "local_size_y",
    "local_size_z",
    "location",
    "origin_upper_left",
    "packed",
    "push_constant",
    "set",
    "shared",
    "std140",
    "std430",
    "r32f",
    "rgba8",
    "rgba16f",
];

/// Layouts that ask for what is not there, with what to do instead.
const REFUSED_LAYOUTS: [(&str, &str); 17] = [
    ("align", "only members of blocks have an alignment"),
    ("index", "WGSL has one colour for each location: leave out the second source"),
    ("offset", "only members of blocks have an offset"),
    ("row_major", "write it at a block or its members"),
    ("scalar", "use `std430`, and `float` members in place of a `vec3` that others follow closely"),
    ("bindless_sampler", "declare each texture as a uniform"),
    ("bindless_image", "declare each image as a uniform"),
    ("buffer_reference", "use a storage buffer and an index"),
    ("component", "give each variable a location of its own"),
    ("input_attachment_index", "read a texture that an earlier pass wrote"),
    ("local_size_x_id", "write the size as a literal"),
    ("local_size_y_id", "write the size as a literal"),
    ("local_size_z_id", "write the size as a literal"),
    ("pixel_center_integer", "pixel centres lie at one half: subtract `0.5` from `gl_FragCoord.xy`"),
    ("xfb_buffer", "write to a storage buffer in a compute stage"),
    ("xfb_offset", "write to a storage buffer in a compute stage"),
    ("triangles", "build the geometry before"),
];

fn report(sources: &mut Sources<'_, '_>, place: Place, message: String, help: &str) {
    let diagnostic = sources.error(place, message).with_help(help);
    sources.diagnostics.push(diagnostic);
}

/// Whether `name` is the format of an image, as `rgba8`.
pub fn is_format(name: &str) -> bool {
    name.starts_with('r') && name.bytes().any(|byte| byte.is_ascii_digit()) && !name.contains("major")
}

/// Whether a token says nothing to WGSL.
pub fn is_dropped(token: &Token) -> bool {
    DROPPED.contains(&&*token.text)
}

/// Checks the names and numbers in `layout(…)`.
pub fn layouts(sources: &mut Sources<'_, '_>, qualifiers: &Qualifiers) {
    layouts_but(sources, qualifiers, &[]);
}

/// Checks the layouts of a declaration without a variable, as `layout(row_major) uniform;`.
pub fn default_layouts(sources: &mut Sources<'_, '_>, qualifiers: &Qualifiers) {
    let is_of_blocks = qualifiers.is("uniform") || qualifiers.is("buffer");
    layouts_but(sources, qualifiers, if is_of_blocks { &["row_major"] } else { &[] });
}

/// Checks the layouts of a block and of its members, which say where they lie.
pub fn block_layouts(sources: &mut Sources<'_, '_>, stage: &Parsed, block: &Block) {
    layouts_but(sources, &block.qualifiers, &["align", "row_major"]);
    for member in &block.members {
        layouts_but(sources, &member.qualifiers, &["offset", "align", "row_major"]);
        if scene::is_row_major(stage, block, member) {
            row_major(sources, stage, block, member);
        }
    }
}

/// A matrix in rows is stored as its transpose, which is turned round where it is read.
fn row_major(sources: &mut Sources<'_, '_>, stage: &Parsed, block: &Block, member: &Variable) {
    let is_known = names::GROUPS.iter().any(|group| group.block() == bindings::block_name(block));
    let is_written = block.qualifiers.is("buffer") && buffer_access(block).is_empty();
    let has_members = structure(stage, &member.ty).is_some();
    let (why, help) = if is_known {
        ("but Kiln fills it in columns", "leave `row_major` out")
    } else if is_written {
        (
            "which a shader cannot write",
            "declare the buffer `readonly`, or store the transpose and write `transpose(m)`",
        )
    } else if block.is_flattened() {
        ("and its block has an array without length", "leave the name of the instance out")
    } else if has_members {
        ("but is a struct", "declare its matrices as members of the block")
    } else {
        return;
    };
    report(sources, member.place(), format!("`{}` is stored in rows, {why}", member.name.text), help);
}

fn layouts_but(sources: &mut Sources<'_, '_>, qualifiers: &Qualifiers, free: &[&str]) {
    for layout in &qualifiers.layout {
        let name = &*layout.name.text;
        if free.contains(&name) {
            continue;
        }
        if let Some((_, help)) = REFUSED_LAYOUTS.iter().find(|(refused, _)| *refused == name) {
            report(sources, layout.name.place, format!("layout `{name}` is not supported"), help);
        } else if !LAYOUTS.contains(&name) && !is_format(name) {
            let help = crate::suggest::closest(name, LAYOUTS.into_iter());
            let mut diagnostic = sources.error(layout.name.place, format!("there is no layout `{name}`"));
            diagnostic.help = help.map(|name| format!("did you mean `{name}`?"));
            sources.diagnostics.push(diagnostic);
        } else if ["set", "binding", "location", "constant_id"].contains(&name)
            && qualifiers.integer(name).is_none()
        {
            let place = layout.value.first().map_or(layout.name.place, |value| value.place);
            report(sources, place, format!("`{name}` must be an integer literal"), "use a macro for a name");
        }
    }
}

/// Checks what is said of the layout of a block's members, or of all blocks: WGSL has one for uniforms, about
/// `std140`, and one for buffers, `std430`.
pub fn packing(
    sources: &mut Sources<'_, '_>,
    stage: &Parsed,
    qualifiers: &Qualifiers,
    members: Option<&[Variable]>,
) {
    let is_buffer = qualifiers.is("buffer");
    let other = if is_buffer { "std140" } else { "std430" };
    let differs =
        members.is_none_or(|members| members.iter().any(|member| !is_same_in_both(stage, member, 0)));
    if let Some(layout) =
        qualifiers.layout(other).filter(|_| differs && (is_buffer || qualifiers.is("uniform")))
    {
        let (message, help) = if is_buffer {
            (
                "`std140` is not supported for this buffer",
                "write `std430`, or use arrays of `vec4` for others",
            )
        } else {
            ("`std430` is not supported for uniforms", "write `std140`, or use a buffer")
        };
        report(sources, layout.name.place, message.to_owned(), help);
    }
    for name in ["packed", "shared"] {
        if let Some(layout) = qualifiers.layout(name) {
            let used = if is_buffer { "std430" } else { "std140" };
            let warning = sources.warning(layout.name.place, format!("`{name}` is the same as `{used}`"));
            sources.diagnostics.push(warning.with_help(format!("write `{used}`, which says the layout")));
        }
    }
}

/// Structs inside of each other that are looked into.
const STRUCTS_MAX: usize = 16;

/// Whether `std140` and `std430` store a member alike: it has no array of what is less than 16 bytes, and no
/// struct that is aligned to less.
fn is_same_in_both(stage: &Parsed, member: &Variable, depth: usize) -> bool {
    let ty = &*member.ty.text;
    let is_short_matrix = builtin::columns(ty).is_some() && (ty.ends_with("x2") || ty == "mat2");
    if is_short_matrix || (!member.array.is_empty() && is_narrow(ty)) {
        return false;
    }
    let Some(structure) = structure(stage, &member.ty) else { return true };
    let is_wide = |member: &Variable| {
        builtin::vector_len(&member.ty.text).is_some_and(|len| len > 2)
            || builtin::columns(&member.ty.text).is_some()
    };
    depth < STRUCTS_MAX
        && structure.members.iter().any(is_wide)
        && structure.members.iter().all(|member| is_same_in_both(stage, member, depth + 1))
}

/// Checks a type's name.
pub fn type_name(sources: &mut Sources<'_, '_>, ty: &Token) {
    if let Some(help) = builtin::replacement(&ty.text) {
        report(sources, ty.place, format!("type `{}` is not supported", ty.text), help);
    }
}

/// Checks the words of what is not understood.
pub fn words(sources: &mut Sources<'_, '_>, tokens: &[Token]) {
    for token in tokens {
        if let Some(help) = builtin::replacement(&token.text) {
            return report(sources, token.place, format!("`{}` is not supported", token.text), help);
        }
    }
}

/// Checks a member of any struct.
pub fn struct_member(sources: &mut Sources<'_, '_>, member: &Variable) {
    type_name(sources, &member.ty);
    if builtin::combined(&member.ty.text).is_some() {
        let message = format!("`{}` is a texture inside of a struct", member.name.text);
        report(sources, member.place(), message, "declare the texture as a uniform of its own");
    }
}

/// Checks that a uniform's type can be stored.
pub fn uniform_type(sources: &mut Sources<'_, '_>, stage: &Parsed, variable: &Variable) {
    if variable.array.len() > 3 {
        let message = format!("`{}` is an array of arrays", variable.name.text);
        report(sources, variable.place(), message, "use one array, and compute the index");
    }
    members_of(sources, stage, &variable.ty);
}

fn structure<'a>(stage: &'a Parsed, name: &Token) -> Option<&'a Struct> {
    stage.items.iter().find_map(|item| match item {
        Item::Struct(structure) if structure.name.text == name.text => Some(structure),
        _ => None,
    })
}

/// Members of a struct that is stored in a uniform, and of those in it.
fn members_of(sources: &mut Sources<'_, '_>, stage: &Parsed, ty: &Token) {
    let mut todo = vec![ty];
    let mut seen = BTreeSet::new();
    while let Some(ty) = todo.pop() {
        let Some(structure) = structure(stage, ty).filter(|_| seen.insert(&ty.text)) else { continue };
        for member in &structure.members {
            let (name, ty) = (&member.name.text, &*member.ty.text);
            if ty == "bool" || ty.starts_with("bvec") {
                let message = format!("`{name}` is `{ty}`, inside of a struct that is a uniform");
                report(sources, member.place(), message, "use `int` and compare it with 0");
            } else if !member.array.is_empty() && is_narrow(ty) {
                let message = format!("`{name}` is an array of `{ty}`, inside of a struct that is a uniform");
                report(sources, member.place(), message, "use an array of `vec4`");
            }
            todo.push(&member.ty);
        }
    }
}

/// Whether array elements of `ty` are closer than the 16 bytes that uniforms need.
fn is_narrow(ty: &str) -> bool {
    matches!(ty, "float" | "int" | "uint") || builtin::vector_len(ty) == Some(2)
}

/// Checks a member of a block.
pub fn block_member(sources: &mut Sources<'_, '_>, stage: &Parsed, member: &Variable, is_uniform: bool) {
    type_name(sources, &member.ty);
    if is_uniform {
        return uniform_type(sources, stage, member);
    }
    if member.ty.is("bool") || member.ty.text.starts_with("bvec") {
        let message =
            format!("`{}` is `{}`, which cannot be stored in a buffer", member.name.text, member.ty.text);
        report(sources, member.place(), message, "use `uint` and compare it with 0");
    }
}

/// `readonly` or nothing; WGSL has no buffers that are only written.
pub fn buffer_access(block: &Block) -> &'static str {
    let says = |qualifiers: &Qualifiers| qualifiers.access.iter().any(|access| access.is("readonly"));
    let all = !block.members.is_empty() && block.members.iter().all(|member| says(&member.qualifiers));
    if says(&block.qualifiers) || all { "readonly" } else { "" }
}

/// Checks that an image says its format: WGSL wants it for all.
pub fn image_format(sources: &mut Sources<'_, '_>, variable: &Variable) {
    let has_format = variable.qualifiers.layout.iter().any(|layout| is_format(&layout.name.text));
    if variable.ty.text.contains("image") && !has_format {
        let message = format!("the image `{}` has no format", variable.name.text);
        report(sources, variable.place(), message, "write it in the layout, as in `layout(rgba8)`");
    }
}

/// Checks that a separate texture is compared or read, but not both: the two are of different types.
pub fn comparison(sources: &mut Sources<'_, '_>, stage: &Parsed, variable: &Variable) {
    if !variable.ty.text.contains("texture") {
        return;
    }
    let uses = stage.tokens.windows(3).filter(|join| join[1].is("(") && join[2].text == variable.name.text);
    let joined = uses.filter_map(|join| Some((&join[0], builtin::combined(&join[0].text)?.sampler)));
    let (compared, read): (Vec<_>, Vec<_>) = joined.partition(|(_, sampler)| *sampler == "samplerShadow");
    if let (Some((first, _)), Some((other, _))) = (read.first(), compared.first()) {
        let message = format!("`{}` is read here, and compared elsewhere", variable.name.text);
        let mut fault = sources.error(first.place, message);
        fault.notes.insert(0, format!("compared at {}", sources.describe(other.place)));
        let help = "declare a second texture for the comparison, and give both the same image";
        sources.diagnostics.push(fault.with_help(help));
    }
}

/// How an image is accessed: as declared, else by what is done with it.
pub fn image_access(sources: &mut Sources<'_, '_>, stage: &Parsed, variable: &Variable) -> &'static str {
    let is_image = variable.ty.text.contains("image");
    if !is_image {
        return "";
    }
    let says = |word: &str| variable.qualifiers.access.iter().any(|access| access.is(word));
    let calls = |function: &str| {
        let mut calls = stage.tokens.windows(3);
        calls.any(|call| call[0].is(function) && call[1].is("(") && call[2].text == variable.name.text)
    };
    match (says("readonly"), says("writeonly")) {
        (true, _) => return "readonly",
        (_, true) => return "writeonly",
        _ => {}
    }
    match (calls("imageLoad"), calls("imageStore")) {
        (true, false) => "readonly",
        (false, _) => "writeonly",
        (true, true) => {
            let single =
                ["r32f", "r32i", "r32ui"].iter().any(|format| variable.qualifiers.layout(format).is_some());
            if !single {
                let message =
                    format!("`{}` is read and written, which its format does not allow", variable.name.text);
                report(sources, variable.place(), message, "use `r32f`, `r32i` or `r32ui`, or two images");
            }
            ""
        }
    }
}
