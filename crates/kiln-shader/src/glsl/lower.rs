//! Writes a stage as the GLSL that naga reads: types first, then globals with their groups, bindings and
//! locations, then functions.

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use super::Parsed;
use super::bindings::{self, Bindings};
use super::builtin;
use super::check;
use super::declare::{self, Block, Function, Item, Qualifiers, Variable};
use super::effects;
use super::index;
use super::initial;
use super::layout::Moved;
use super::lazy;
use super::lex::{Kind, Token};
use super::locations::{self, Interface, Passed};
use super::order;
use super::padding;
use super::rewrite::Rewriter;
use super::scene::{self, Scene};
use super::source::{Mapped, Place, Sources};
use super::switch;
use super::texture_array;
use super::typed;
use crate::Stage;
use crate::names::{GROUPS, Group};

/// What naga is given first. Of its versions this one takes most.
const VERSION: &str = "#version 460 core\n";

/// The author's `main` where another one calls it: if there is work before or after, as it may return early.
pub const AUTHORS_MAIN: &str = "kiln_main";

/// A stage as naga reads it.
#[derive(Debug)]
pub struct Lowered {
    /// Its text.
    pub text: Mapped,
    /// Members of its blocks that naga is to put elsewhere.
    pub moved: Vec<Moved>,
}

/// Writes `stage`; what cannot be written is left in `sources`.
pub fn lower(
    sources: &mut Sources<'_, '_>,
    stage: &Parsed,
    interface: &Interface,
    bindings: &Bindings,
    holders: &BTreeMap<Group, String>,
) -> Lowered {
    let scene = scene::scene(stage);
    let mut writer = Writer {
        sources,
        stage,
        bindings,
        scene,
        types: Mapped::default(),
        globals: Mapped::default(),
        functions: Mapped::default(),
        members: BTreeMap::new(),
        samplers: BTreeSet::new(),
        runtime: BTreeSet::new(),
        padded: padding::padded_structs(stage),
        effects: effects::functions(stage),
        moved: Vec::new(),
        prologue: Mapped::default(),
        epilogue: Mapped::default(),
    };
    for item in &stage.items {
        writer.item(item);
    }
    writer.holders(holders);
    writer.interface(interface);
    for function in order::ordered(writer.sources, &stage.items) {
        writer.function(function);
    }
    writer.finish()
}

struct Writer<'a, 's, 'r> {
    sources: &'a mut Sources<'s, 'r>,
    stage: &'a Parsed,
    bindings: &'a Bindings,
    scene: Scene,
    types: Mapped,
    globals: Mapped,
    functions: Mapped,
    /// Loose uniforms of this stage.
    members: BTreeMap<Group, Vec<Variable>>,
    /// Samplers written so far: several textures share one.
    samplers: BTreeSet<String>,
    /// Constants whose value only a running shader can compute.
    runtime: BTreeSet<Rc<str>>,
    /// Structs that need one member more.
    padded: BTreeSet<Rc<str>>,
    /// Functions whose calls may not be left out or made twice.
    effects: BTreeSet<Rc<str>>,
    /// Members that say where they lie.
    moved: Vec<Moved>,
    /// What is done before the author's `main`.
    prologue: Mapped,
    /// What is done after it.
    epilogue: Mapped,
}

/// Appends tokens with space between.
pub fn put(out: &mut Mapped, tokens: &[Token]) {
    for token in tokens {
        out.push(&token.text, token.place);
        out.push(if matches!(&*token.text, ";" | "{" | "}") { "\n" } else { " " }, token.place);
    }
}

impl Writer<'_, '_, '_> {
    fn report(&mut self, place: Place, message: impl Into<String>, help: impl Into<String>) {
        let diagnostic = self.sources.error(place, message).with_help(help);
        self.sources.diagnostics.push(diagnostic);
    }

    fn item(&mut self, item: &Item) {
        match item {
            Item::Struct(structure) => {
                self.types.push("struct ", structure.name.place);
                put(&mut self.types, std::slice::from_ref(&structure.name));
                self.types.push("{\n", structure.name.place);
                for member in &structure.members {
                    check::struct_member(self.sources, member);
                    let (ty, array) = (member.ty.clone(), declare::reversed(&member.array));
                    put(&mut self.types, &[vec![ty, member.name.clone()], array].concat());
                    self.types.push(";\n", member.name.place);
                }
                if self.padded.contains(&structure.name.text) {
                    self.types.push(padding::MEMBER, structure.name.place);
                }
                self.types.push("};\n", structure.name.place);
            }
            Item::Variable(variable) => self.variable(variable),
            Item::Block(block) => self.block(block),
            Item::Qualifiers(qualifiers, names) => {
                check::default_layouts(self.sources, qualifiers);
                check::packing(self.sources, self.stage, qualifiers, None);
                let place = qualifiers.layout.first().map(|layout| layout.name.place);
                let place = place.or(names.first().map(|name| name.place));
                let Some(place) = place else { return };
                let invariant = names.iter().filter(|_| qualifiers.invariant.is_some());
                let invariant: Vec<&Token> = invariant.filter(|name| name.is("gl_Position")).collect();
                for name in invariant {
                    self.globals.push("invariant gl_Position;\n", name.place);
                }
                if let Some(early) = qualifiers.layout("early_fragment_tests") {
                    let place = early.name.place;
                    let warning = self.sources.warning(place, "`early_fragment_tests` has no effect");
                    let help = "devices test early by themselves where it changes nothing";
                    self.sources.diagnostics.push(warning.with_help(help));
                }
                let kept =
                    qualifiers.layout.iter().filter(|layout| layout.name.text.starts_with("local_size_"));
                for layout in kept {
                    let value: String = layout.value.iter().map(|token| &*token.text).collect();
                    let value = if value.is_empty() { value } else { format!(" = {value}") };
                    self.globals.push(&format!("layout({}{value}) in;\n", layout.name.text), place);
                }
            }
            Item::Function(_) => {}
            Item::Other(tokens) => {
                check::words(self.sources, tokens);
                put(&mut self.globals, tokens);
            }
        }
    }

    fn layout(&self, name: &str) -> String {
        // What has no binding was refused already.
        let (group, binding) = self.bindings.of.get(name).copied().unwrap_or_default();
        format!("set = {group}, binding = {binding}")
    }

    fn variable(&mut self, variable: &Variable) {
        check::layouts(self.sources, &variable.qualifiers);
        check::type_name(self.sources, &variable.ty);
        let is_built_in = variable.name.text.starts_with("gl_");
        match variable.qualifiers.storage.as_ref().map(|storage| &*storage.text) {
            _ if is_built_in => {}
            Some("uniform") => self.uniform(variable),
            Some("const") => self.constant(variable),
            Some("in" | "out" | "attribute" | "varying") => {}
            storage => {
                let mut qualifier: Vec<Token> = variable.qualifiers.storage.iter().cloned().collect();
                qualifier.retain(|_| storage == Some("shared"));
                self.global(variable, qualifier);
            }
        }
    }

    /// A variable of this stage alone. naga forgets initial values that are not constant: `main` gives them.
    fn global(&mut self, variable: &Variable, mut tokens: Vec<Token>) {
        let (ty, name) = (variable.ty.clone(), variable.name.clone());
        let rewritten = self.with_length(variable);
        tokens.extend([ty, name].into_iter().chain(rewritten));
        put(&mut self.globals, &tokens);
        self.globals.push(";\n", variable.place());
        let Some(initial) = &variable.initial else { return };
        if initial[0].is("{") {
            let message = format!("`{}` is initialised with a list", variable.name.text);
            return self.report(initial[0].place, message, "write a constructor, as in `float[2](1.0, 2.0)`");
        }
        index::check(self.sources, &self.effects, initial);
        let initial = lazy::lower(&self.effects, initial);
        let value = Rewriter::new(self.sources, &mut self.scene, None).tokens(&initial);
        let mark = |text: &str| Token::new(Kind::Mark, text, variable.place());
        let assignment = [variable.name.clone(), mark("=")].into_iter().chain(value).chain([mark(";")]);
        put(&mut self.prologue, &assignment.collect::<Vec<Token>>());
    }

    /// `[…]` of a variable, with the length that its initial value has.
    fn with_length(&mut self, variable: &Variable) -> Vec<Token> {
        let Some(initial) = &variable.initial else {
            return declare::reversed(&variable.array);
        };
        let equals = Token::new(Kind::Mark, "=", variable.place());
        let tokens: Vec<Token> = variable.array.iter().chain([&equals]).chain(initial).cloned().collect();
        let count = self.sources.diagnostics.len();
        let written = Rewriter::new(self.sources, &mut self.scene, None).tokens(&tokens);
        // The initial value is rewritten once more where it is kept, and reports its faults there.
        self.sources.diagnostics.truncate(count);
        let len = written.iter().position(|token| token.is("=")).unwrap_or(0);
        declare::reversed(&written[..len])
    }

    fn constant(&mut self, variable: &Variable) {
        let initial = variable.initial.clone().unwrap_or_default();
        let is_runtime = initial.windows(2).enumerate().any(|(at, pair)| {
            let name = &pair[0];
            let is_type = builtin::is_value_type(&name.text) || self.scene.structs.contains(&name.text);
            name.is_word() && pair[1].is("(") && (!is_type || typed::is_matrix_of_one(&initial, at))
        }) || initial.iter().any(|token| self.runtime.contains(&token.text));
        if is_runtime && variable.qualifiers.layout.is_empty() {
            self.runtime.insert(Rc::clone(&variable.name.text));
            return self.global(variable, Vec::new());
        }
        let place = variable.place();
        if let Some(id) = variable.qualifiers.integer("constant_id") {
            self.types.push(&format!("layout(constant_id = {id}) "), place);
        }
        self.types.push("const ", place);
        let array = self.with_length(variable);
        put(&mut self.types, &[vec![variable.ty.clone(), variable.name.clone()], array].concat());
        if !initial.is_empty() {
            self.types.push("= ", place);
            let value = Rewriter::new(self.sources, &mut self.scene, None).tokens(&initial);
            put(&mut self.types, &value);
        }
        self.types.push(";\n", place);
    }

    fn uniform(&mut self, variable: &Variable) {
        let (name, place) = (&*variable.name.text, variable.place());
        if builtin::is_opaque(&variable.ty.text) {
            if let Some(bracket) = variable.array.first() {
                let message = format!("`{name}` is an array of textures, which devices need not have");
                return self.report(
                    bracket.place,
                    message,
                    "declare each texture by itself, or use a texture array as `sampler2DArray`",
                );
            }
            return self.opaque(variable);
        }
        let initial = variable.initial.as_ref().and_then(|initial| initial.first());
        if let Some(initial) = initial.filter(|_| initial::value(variable).is_none()) {
            let message = format!("the initial value of `{name}` is not kept");
            let help = "a number or vector of literals is kept, unless Kiln fills the uniform by its name; or make it a `const`";
            let warning = self.sources.warning(initial.place, message).with_help(help);
            self.sources.diagnostics.push(warning);
        }
        check::uniform_type(self.sources, self.stage, variable);
        match bindings::holder(variable) {
            Some(group) if self.stage.count(name) > 1 => {
                self.members.entry(group).or_default().push(variable.clone());
            }
            // Nobody reads it.
            Some(_) => {}
            None => {
                let layout = self.layout(name);
                self.globals.push(&format!("layout({layout}) uniform "), place);
                put(&mut self.globals, &[variable.ty.clone(), variable.name.clone()]);
                self.globals.push(";\n", place);
            }
        }
    }

    fn opaque(&mut self, variable: &Variable) {
        let (name, place) = (&*variable.name.text, variable.place());
        let layout = self.layout(name);
        let Some(combined) = builtin::combined(&variable.ty.text) else {
            let format = variable.qualifiers.layout.iter().find(|layout| check::is_format(&layout.name.text));
            let format = format.map_or(String::new(), |format| format!("{}, ", format.name.text));
            check::image_format(self.sources, variable);
            check::comparison(self.sources, self.stage, variable);
            let access = check::image_access(self.sources, self.stage, variable);
            self.globals.push(&format!("layout({format}{layout}) {access} uniform "), place);
            put(&mut self.globals, &[variable.ty.clone(), variable.name.clone()]);
            return self.globals.push(";\n", place);
        };
        let text = format!("layout({layout}) uniform {} {name};\n", combined.texture);
        self.globals.push(&text, place);
        let sampler = bindings::sampler_name(&variable.name.text, &combined);
        if self.samplers.insert(sampler.clone()) {
            let layout = self.layout(&sampler);
            let text = format!("layout({layout}) uniform {} {sampler};\n", combined.sampler);
            self.globals.push(&text, place);
        }
    }

    fn block(&mut self, block: &Block) {
        let place = block.name.place;
        check::block_layouts(self.sources, self.stage, block);
        if locations::direction(&block.qualifiers, self.stage.stage).is_some() {
            return;
        }
        check::packing(self.sources, self.stage, &block.qualifiers, Some(&block.members));
        if let Some(bracket) = block.array.first() {
            let message = format!("`{}` is an array of blocks", block.name.text);
            return self.report(bracket.place, message, "declare an array inside of one block");
        }
        let is_uniform = block.qualifiers.is("uniform");
        let layout = self.layout(&bindings::block_name(block));
        let (packing, access) =
            if is_uniform { ("std140", "") } else { ("std430", check::buffer_access(block)) };
        let keyword = if is_uniform { "uniform" } else { "buffer" };
        // naga takes members of a block for globals even if there is an instance: a struct has none.
        let instance = block.instance.as_ref().filter(|_| !block.is_flattened());
        let head = match instance {
            Some(_) => "struct ".to_owned(),
            None => format!("layout({packing}, {layout}) {access} {keyword} "),
        };
        self.globals.push(&head, place);
        put(&mut self.globals, std::slice::from_ref(&block.name));
        self.globals.push("{\n", place);
        for member in &block.members {
            check::block_member(self.sources, self.stage, member, is_uniform);
            let mut member = member.clone();
            if block.is_flattened() {
                member.name.text = Rc::from(locations::member_name(&block.name, &member.name));
            }
            self.note_layout(block, &member);
            if scene::is_row_major(self.stage, block, &member) {
                member.ty.text = scene::turned(&member.ty.text).map_or(member.ty.text, Rc::from);
            }
            self.member(&member, is_uniform);
        }
        self.globals.push("};\n", place);
        if let Some(instance) = instance {
            self.globals.push(&format!("layout({layout}) {access} {keyword} "), instance.place);
            put(&mut self.globals, &[block.name.clone(), instance.clone()]);
            self.globals.push(";\n", instance.place);
        }
    }

    /// Notes where a member says that it lies. Push constants become a uniform that is filled by name: stages share one
    /// block by giving each its part, and where that lies does not matter.
    fn note_layout(&mut self, block: &Block, member: &Variable) {
        if block.qualifiers.layout("push_constant").is_some() {
            return;
        }
        let mut said = |name: &str, qualifiers: &Qualifiers| {
            let layout = qualifiers.layout(name)?;
            let value = texture_array::value(&layout.value, &self.scene.constants);
            let value = value.and_then(|value| u32::try_from(value).ok());
            if value.is_none() {
                let fault = self.sources.error(layout.name.place, format!("`{name}` is no constant"));
                self.sources
                    .diagnostics
                    .push(fault.with_help("write a literal, or a `const int` that is one"));
            }
            value
        };
        let offset = said("offset", &member.qualifiers);
        let align = said("align", &member.qualifiers).or_else(|| said("align", &block.qualifiers));
        if offset.is_some() || align.is_some() {
            let [block, member] = [&block.name, &member.name].map(|name| name.text.to_string());
            self.moved.push(Moved { block, member, offset, align });
        }
    }

    fn member(&mut self, member: &Variable, is_uniform: bool) {
        let ty = if is_uniform { scene::stored_type(member).0 } else { member.ty.text.to_string() };
        let ty = Token::new(Kind::Word, ty, member.ty.place);
        put(&mut self.globals, &[vec![ty, member.name.clone()], declare::reversed(&member.array)].concat());
        self.globals.push(";\n", member.name.place);
    }

    /// Blocks of loose uniforms.
    fn holders(&mut self, names: &BTreeMap<Group, String>) {
        for group in GROUPS {
            let Some(members) = self.members.remove(&group) else { continue };
            let place = members[0].place();
            let layout = self.layout(group.block());
            let name = names.get(&group).map_or(group.block(), String::as_str);
            self.globals.push(&format!("layout(std140, {layout}) uniform {name} {{\n"), place);
            for member in &members {
                self.member(member, true);
            }
            self.globals.push("};\n", place);
        }
    }

    fn interface(&mut self, interface: &Interface) {
        for (word, side) in [("in", &interface.inputs), ("out", &interface.outputs)] {
            for passed in side {
                self.passed(passed, word);
            }
        }
        let bodies = self.stage.items.iter().filter_map(|item| match item {
            Item::Function(function) => function.body.as_ref(),
            _ => None,
        });
        let size = bodies.flatten().find(|token| token.is("gl_PointSize"));
        if let Some(place) = size.map(|token| token.place).filter(|_| self.stage.stage == Stage::Vertex) {
            let warning = self.sources.warning(place, "`gl_PointSize` has no effect: points have one pixel");
            self.sources.diagnostics.push(warning.with_help("draw a quad for each point"));
            self.globals.push("float gl_PointSize;\n", place);
        }
    }

    fn passed(&mut self, passed: &Passed, word: &str) {
        let (place, location) = (passed.name.place, passed.location.unwrap_or(0));
        let interpolation: String =
            passed.interpolation.iter().map(|token| format!("{} ", token.text)).collect();
        let Some(columns) = builtin::columns(&passed.ty.text) else {
            self.globals.push(&format!("layout(location = {location}) {interpolation}{word} "), place);
            let declared = [vec![passed.ty.clone(), passed.name.clone()], passed.array.clone()].concat();
            put(&mut self.globals, &declared);
            return self.globals.push(";\n", place);
        };
        if let Some(bracket) = passed.array.first() {
            let message =
                format!("`{}` is an array of matrices that passes between stages", passed.name.text);
            return self.report(bracket.place, message, "pass each matrix by itself");
        }
        // WGSL passes vectors only: the matrix becomes a variable, and its columns pass.
        let (matrix, name) = (&passed.ty.text, &passed.name.text);
        let rows = matrix.rsplit(['t', 'x']).next().unwrap_or("4");
        let names: Vec<String> = (0..columns).map(|column| format!("{name}_column_{column}")).collect();
        self.globals.push(&format!("{matrix} {name};\n"), place);
        for (location, column) in (location..).zip(&names) {
            let text = format!("layout(location = {location}) {interpolation}{word} vec{rows} {column};\n");
            self.globals.push(&text, place);
        }
        if word == "in" {
            self.prologue.push(&format!("{name} = {matrix}({});\n", names.join(", ")), place);
        } else {
            for (index, column) in names.iter().enumerate() {
                self.epilogue.push(&format!("{column} = {name}[{index}];\n"), place);
            }
        }
    }

    fn function(&mut self, function: &Function) {
        let place = function.name.place;
        let result: Vec<Token> =
            function.result.iter().filter(|token| !check::is_dropped(token)).cloned().collect();
        result.iter().for_each(|token| check::type_name(self.sources, token));
        let returned = result.last().map(|token| Rc::clone(&token.text));
        let mut rewriter = Rewriter::new(self.sources, &mut self.scene, returned);
        let parameters: Vec<Vec<Token>> =
            function.parameters.iter().map(|parameter| rewriter.parameter(parameter)).collect();
        let body = function.body.as_ref().map(|body| index::lower(rewriter.sources, &self.effects, body));
        let body = body.map(|body| lazy::lower(&self.effects, &body));
        let body = body.map(|body| switch::without_fall_through(rewriter.sources, &body));
        let body = body.map(|body| rewriter.tokens(&body));
        put(&mut self.functions, &result);
        let is_wrapped = function.name.is("main") && self.wraps_main();
        self.functions.push(if is_wrapped { AUTHORS_MAIN } else { &function.name.text }, place);
        self.functions.push("(", place);
        for (index, parameter) in parameters.iter().enumerate() {
            if index > 0 {
                self.functions.push(", ", place);
            }
            parameter.iter().for_each(|token| check::type_name(self.sources, token));
            put(&mut self.functions, parameter);
        }
        self.functions.push(")", place);
        match body {
            None => self.functions.push(";\n", place),
            Some(body) => put(&mut self.functions, &body),
        }
    }

    /// Whether there is work before or after the author's `main`.
    fn wraps_main(&self) -> bool {
        !(self.prologue.text.is_empty() && self.epilogue.text.is_empty())
    }

    fn finish(self) -> Lowered {
        let start = Place { file: self.stage.root, start: 0, end: 0 };
        let mut text = Mapped::default();
        text.push(VERSION, start);
        let wraps_main = self.wraps_main();
        text.append(self.types);
        text.append(self.globals);
        for (name, place) in self.scene.polyfills {
            text.push(&builtin::polyfill(name).unwrap_or_default(), place);
        }
        for helper in &self.scene.helpers {
            text.push(&helper.text, helper.place);
        }
        text.append(self.functions);
        if wraps_main {
            text.push("void main() {\n", start);
            text.append(self.prologue);
            text.push(&format!("{AUTHORS_MAIN}();\n"), start);
            text.append(self.epilogue);
            text.push("}\n", start);
        }
        Lowered { text, moved: self.moved }
    }
}

/// Names for the structs of the blocks that hold loose uniforms, which no author uses.
pub fn holder_names(stages: &[Parsed]) -> BTreeMap<Group, String> {
    let names = [
        (Group::Frame, "Frame"),
        (Group::Material, "Material"),
        (Group::Draw, "Draw"),
        (Group::Params, "Params"),
    ];
    let unused = |mut name: String| {
        while stages.iter().any(|stage| stage.count(&name) > 0) {
            name.push_str("Uniforms");
        }
        name
    };
    names.into_iter().map(|(group, name)| (group, unused(format!("{name}Uniforms")))).collect()
}
