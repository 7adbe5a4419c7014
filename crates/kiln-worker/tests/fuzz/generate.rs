//! Random programs that are valid by construction: every expression has the type that is asked for.
//!
//! Values are never constant expressions: a compiler works those out and refuses, rightly, an overflow or a division by
//! zero in them. So literals stand only on the right of an operator whose left is not one.

use std::fmt::Write as _;

use crate::corpus::Input;
use crate::random::Random;

mod values;

/// What a program is written in.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Dialect {
    Wgsl,
    Glsl,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Scalar {
    Bool,
    Int,
    Uint,
    Float,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Type {
    One(Scalar),
    Vector(Scalar, usize),
    Matrix(usize),
    Struct(usize),
    Array(Scalar, usize),
}

use Scalar::{Bool, Float, Int, Uint};
use Type::{Array, Matrix, One, Struct, Vector};

struct Variable {
    name: String,
    ty: Type,
    is_mutable: bool,
}

struct Function {
    arguments: Vec<Type>,
    result: Type,
}

struct Writer<'a> {
    dialect: Dialect,
    random: &'a mut Random,
    text: String,
    /// Members of each struct.
    structs: Vec<Vec<Type>>,
    functions: Vec<Function>,
    scope: Vec<Variable>,
    names: usize,
    /// Statements that the function may still have.
    budget: usize,
    loops: usize,
}

/// A fragment shader, sometimes with a compute shader beside it.
pub fn program(dialect: Dialect, random: &mut Random) -> Input {
    let mut writer = Writer {
        dialect,
        random,
        text: String::new(),
        structs: Vec::new(),
        functions: Vec::new(),
        scope: Vec::new(),
        names: 0,
        budget: 0,
        loops: 0,
    };
    writer.program();
    let root = if dialect == Dialect::Wgsl { "random.wgsl" } else { "random.frag" };
    Input { is_valid: true, ..Input::of(root, writer.text) }
}

const WGSL_HEAD: &str = "\
struct Block { tint: vec4<f32>, turn: mat4x4<f32>, counts: vec4<i32>, scale: f32 }
@group(0) @binding(0) var<uniform> block: Block;
@group(0) @binding(1) var picture: texture_2d<f32>;
@group(0) @binding(2) var picture_sampler: sampler;
@group(0) @binding(3) var<storage, read_write> buffer: array<vec4<f32>>;
var<private> state: f32;
";
const GLSL_HEAD: &str = "\
#version 450
layout(location = 0) in vec2 uv;
layout(location = 1) flat in int id;
layout(location = 0) out vec4 colour;
layout(set = 0, binding = 0) uniform Block { vec4 tint; mat4 turn; ivec4 counts; float scale; } block;
layout(set = 0, binding = 1) uniform sampler2D picture;
float state;
";

impl Writer<'_> {
    fn is_wgsl(&self) -> bool {
        self.dialect == Dialect::Wgsl
    }

    fn program(&mut self) {
        self.text += if self.is_wgsl() { WGSL_HEAD } else { GLSL_HEAD };
        for index in 0..self.random.below(4) {
            self.declare_struct(index);
        }
        for index in 0..1 + self.random.below(5) {
            self.function(index);
        }
        self.entry_point();
    }

    fn declare_struct(&mut self, index: usize) {
        let members: Vec<Type> = (0..1 + self.random.below(4)).map(|_| self.member_type()).collect();
        _ = writeln!(self.text, "struct S{index} {{");
        for (at, ty) in members.iter().enumerate() {
            let declared = self.declared(&format!("m{at}"), *ty);
            let end = if self.is_wgsl() { "," } else { ";" };
            _ = writeln!(self.text, "    {declared}{end}");
        }
        self.text += if self.is_wgsl() { "}\n" } else { "};\n" };
        self.structs.push(members);
    }

    /// In GLSL, naga cannot construct structs that hold arrays or `bool`, and Kiln refuses those with a `mat2`.
    fn member_type(&mut self) -> Type {
        loop {
            let ty = self.any_type();
            if self.is_wgsl() || !matches!(ty, One(Bool) | Array(..) | Matrix(2)) {
                return ty;
            }
        }
    }

    fn any_type(&mut self) -> Type {
        let scalar = *self.random.pick(&[Float, Float, Int, Uint]);
        match self.random.below(8) {
            0 => One(Bool),
            1 | 2 => One(scalar),
            3 | 4 => Vector(scalar, 2 + self.random.below(3)),
            5 => Matrix(2 + self.random.below(3)),
            6 if !self.structs.is_empty() => Struct(self.random.below(self.structs.len())),
            _ => Array(scalar, 1 + self.random.below(6)),
        }
    }

    fn scalar_name(&self, scalar: Scalar) -> &'static str {
        match (scalar, self.is_wgsl()) {
            (Bool, _) => "bool",
            (Int, true) => "i32",
            (Int, false) => "int",
            (Uint, true) => "u32",
            (Uint, false) => "uint",
            (Float, true) => "f32",
            (Float, false) => "float",
        }
    }

    fn type_name(&self, ty: Type) -> String {
        match (ty, self.is_wgsl()) {
            (One(scalar), _) => self.scalar_name(scalar).to_owned(),
            (Vector(scalar, size), true) => format!("vec{size}<{}>", self.scalar_name(scalar)),
            (Vector(scalar, size), false) => {
                let prefix = match scalar {
                    Bool => "b",
                    Int => "i",
                    Uint => "u",
                    Float => "",
                };
                format!("{prefix}vec{size}")
            }
            (Matrix(size), true) => format!("mat{size}x{size}<f32>"),
            (Matrix(size), false) => format!("mat{size}"),
            (Struct(index), _) => format!("S{index}"),
            (Array(scalar, size), true) => format!("array<{}, {size}>", self.scalar_name(scalar)),
            (Array(scalar, size), false) => format!("{}[{size}]", self.scalar_name(scalar)),
        }
    }

    /// `name: type` or `type name`.
    fn declared(&self, name: &str, ty: Type) -> String {
        let ty = self.type_name(ty);
        if self.is_wgsl() { format!("{name}: {ty}") } else { format!("{ty} {name}") }
    }

    fn name(&mut self) -> String {
        self.names += 1;
        format!("v{}", self.names)
    }

    fn function(&mut self, index: usize) {
        let arguments: Vec<Type> = (0..self.random.below(4)).map(|_| self.any_type()).collect();
        let result = self.any_type();
        // Every function has one value of each scalar type to begin with.
        let mut declared: Vec<String> = [("x", One(Float)), ("i", One(Int)), ("u", One(Uint))]
            .map(|(name, ty)| self.declared(name, ty))
            .to_vec();
        self.scope.clear();
        for ty in &arguments {
            let name = self.name();
            declared.push(self.declared(&name, *ty));
            self.scope.push(Variable { name, ty: *ty, is_mutable: !self.is_wgsl() });
        }
        let (declared, result_name) = (declared.join(", "), self.type_name(result));
        _ = match self.dialect {
            Dialect::Wgsl => writeln!(self.text, "fn f{index}({declared}) -> {result_name} {{"),
            Dialect::Glsl => writeln!(self.text, "{result_name} f{index}({declared}) {{"),
        };
        self.body(result);
        let value = self.value(result, 3);
        _ = writeln!(self.text, "return {value};\n}}");
        self.functions.push(Function { arguments, result });
    }

    fn body(&mut self, result: Type) {
        self.budget = 4 + self.random.below(20);
        self.loops = 0;
        self.statements(result, 0);
    }

    fn entry_point(&mut self) {
        self.scope.clear();
        let ty = Vector(Float, 4);
        if self.is_wgsl() {
            self.text += "@fragment fn fs_main(@location(0) uv: vec2<f32>, @location(1) @interpolate(flat) id: i32) -> @location(0) vec4<f32> {\n";
            self.text += "let x = uv.x; let i = id; let u = u32(id);\nlet sampled = textureSample(picture, picture_sampler, uv);\n";
            self.scope.push(Variable { name: "sampled".to_owned(), ty, is_mutable: false });
            self.body(ty);
            let value = self.value(ty, 4);
            _ = writeln!(self.text, "return {value};\n}}");
            if self.random.one_in(3) {
                self.compute();
            }
        } else {
            self.text += "void main() {\nfloat x = uv.x; int i = id; uint u = uint(id);\n";
            let value = self.value(ty, 4);
            _ = writeln!(self.text, "colour = {value};\n}}");
        }
    }

    fn compute(&mut self) {
        self.scope.clear();
        self.text += "@compute @workgroup_size(8, 4) fn cs_main(@builtin(global_invocation_id) place: vec3<u32>) {\n\
                      let x = f32(place.x); let i = i32(place.y); let u = place.z;\n";
        let value = self.value(Vector(Float, 4), 4);
        _ = writeln!(self.text, "buffer[u % arrayLength(&buffer)] = {value};\n}}");
    }

    fn statements(&mut self, result: Type, depth: usize) {
        let outer = self.scope.len();
        for _ in 0..1 + self.random.below(5) {
            if self.budget == 0 {
                break;
            }
            self.budget -= 1;
            self.statement(result, depth);
        }
        self.scope.truncate(outer);
    }

    fn block(&mut self, result: Type, depth: usize) {
        self.text += "{\n";
        self.statements(result, depth + 1);
        self.text += "}\n";
    }

    fn statement(&mut self, result: Type, depth: usize) {
        let kind = if depth > 3 { self.random.below(5) } else { self.random.below(12) };
        match kind {
            0..=2 => self.declaration(),
            3 | 4 => self.assignment(),
            5 | 6 => {
                let condition = self.value(One(Bool), 2);
                _ = write!(self.text, "if ({condition}) ");
                self.block(result, depth);
                if self.random.one_in(2) {
                    self.text += "else ";
                    self.block(result, depth);
                }
            }
            7 => self.counted_loop(result, depth),
            8 => self.open_loop(result, depth),
            9 => self.switch(result, depth),
            10 => {
                let (condition, value) = (self.value(One(Bool), 1), self.value(result, 2));
                _ = writeln!(self.text, "if ({condition}) {{ return {value}; }}");
            }
            _ if self.loops > 0 => {
                let (condition, way) = (self.value(One(Bool), 1), *self.random.pick(&["break", "continue"]));
                _ = writeln!(self.text, "if ({condition}) {{ {way}; }}");
            }
            _ => {
                let value = self.value(One(Float), 2);
                _ = writeln!(self.text, "state = {value};");
            }
        }
    }

    fn declaration(&mut self) {
        let ty = self.any_type();
        let (name, value) = (self.name(), self.value(ty, 3));
        let is_mutable = !self.random.one_in(3);
        let declared = self.declared(&name, ty);
        _ = match (self.dialect, is_mutable) {
            (Dialect::Wgsl, true) => writeln!(self.text, "var {declared} = {value};"),
            (Dialect::Wgsl, false) => writeln!(self.text, "let {name} = {value};"),
            (Dialect::Glsl, _) => writeln!(self.text, "{declared} = {value};"),
        };
        self.scope.push(Variable { name, ty, is_mutable });
    }

    fn assignment(&mut self) {
        let mutable: Vec<(String, Type)> = self
            .scope
            .iter()
            .filter(|variable| variable.is_mutable)
            .map(|variable| (variable.name.clone(), variable.ty))
            .collect();
        if mutable.is_empty() {
            return self.declaration();
        }
        let (mut place, mut ty) = self.random.pick(&mutable).clone();
        for _ in 0..self.random.below(3) {
            // naga's GLSL cannot assign to one component of a matrix.
            if self.is_wgsl() || !matches!(ty, Matrix(_)) {
                (place, ty) = self.part(place, ty);
            }
        }
        let value = self.value(ty, 3);
        let operator = match ty {
            One(Int | Uint | Float) | Vector(Int | Uint | Float, _) => {
                *self.random.pick(&["=", "+=", "-=", "*="])
            }
            _ => "=",
        };
        _ = writeln!(self.text, "{place} {operator} {value};");
    }

    /// A member, element or component of a value, or the value where it has none.
    fn part(&mut self, place: String, ty: Type) -> (String, Type) {
        match ty {
            One(_) => (place, ty),
            Vector(scalar, size) => {
                (format!("{place}.{}", ["x", "y", "z", "w"][self.random.below(size)]), One(scalar))
            }
            Matrix(size) => (format!("{place}[{}]", self.random.below(size)), Vector(Float, size)),
            Struct(index) => {
                let at = self.random.below(self.structs[index].len());
                (format!("{place}.m{at}"), self.structs[index][at])
            }
            Array(scalar, size) => (format!("{place}[{}]", self.index(size)), One(scalar)),
        }
    }

    fn index(&mut self, size: usize) -> String {
        match self.random.below(3) {
            0 => self.random.below(size).to_string(),
            _ => format!("({}) % {size}u", self.value(One(Uint), 1)),
        }
    }

    fn counted_loop(&mut self, result: Type, depth: usize) {
        let (name, limit) = (self.name(), 1 + self.random.below(9));
        let (start, step) = match self.dialect {
            Dialect::Wgsl => (format!("var {name}: i32 = 0"), format!("{name} = {name} + 1")),
            Dialect::Glsl => (format!("int {name} = 0"), format!("{name}++")),
        };
        _ = write!(self.text, "for ({start}; {name} < {limit}; {step}) ");
        self.scope.push(Variable { name, ty: One(Int), is_mutable: false });
        self.loops += 1;
        self.block(result, depth);
        self.loops -= 1;
        self.scope.pop();
    }

    fn open_loop(&mut self, result: Type, depth: usize) {
        let condition = self.value(One(Bool), 2);
        self.loops += 1;
        if self.is_wgsl() && self.random.one_in(2) {
            // The end stands where neither `continue` nor `break` gets past it.
            let loops = std::mem::take(&mut self.loops);
            self.text += "loop {\n";
            self.statements(result, depth + 1);
            _ = writeln!(self.text, "continuing {{ break if {condition}; }}\n}}");
            self.loops = loops;
        } else {
            _ = write!(self.text, "while ({condition}) ");
            self.block(result, depth);
        }
        self.loops -= 1;
    }

    fn switch(&mut self, result: Type, depth: usize) {
        let selector = self.value(One(Int), 2);
        _ = writeln!(self.text, "switch ({selector}) {{");
        // `break` belongs to the switch here, and `continue` to the loop around it: neither is tried.
        let loops = std::mem::take(&mut self.loops);
        for case in 0..1 + self.random.below(4) {
            _ = write!(self.text, "case {case}: ");
            self.case(result, depth);
        }
        self.text += "default: ";
        self.case(result, depth);
        self.text += "}\n";
        self.loops = loops;
    }

    fn case(&mut self, result: Type, depth: usize) {
        self.block(result, depth);
        if !self.is_wgsl() {
            self.text += "break;\n";
        }
    }
}
