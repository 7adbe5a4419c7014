//! Expressions: each has the type that is asked for.

use super::Scalar::{Bool, Float, Int, Uint};
use super::Type::{Array, Matrix, One, Struct, Vector};
use super::{Scalar, Type, Writer};

impl Writer<'_> {
    /// An expression of type `ty`, of at most `depth` levels.
    pub(super) fn value(&mut self, ty: Type, depth: usize) -> String {
        if let Some(place) = self.variable(ty).filter(|_| depth == 0 || self.random.one_in(3)) {
            return place;
        }
        if depth > 0
            && self.random.one_in(6)
            && let Some(call) = self.call(ty, depth)
        {
            return call;
        }
        if depth > 0 && self.random.one_in(8) {
            return self.choice(ty, depth);
        }
        match ty {
            One(Bool) => self.truth(depth),
            One(scalar) => self.number(scalar, depth),
            Vector(scalar, size) => self.vector(scalar, size, depth),
            Matrix(size) => self.matrix(size, depth),
            Struct(index) => {
                let members: Vec<String> = self.structs[index]
                    .clone()
                    .into_iter()
                    .map(|ty| self.value(ty, depth.saturating_sub(2)))
                    .collect();
                format!("S{index}({})", members.join(", "))
            }
            Array(scalar, size) => {
                let elements: Vec<String> =
                    (0..size).map(|_| self.value(One(scalar), depth.saturating_sub(2))).collect();
                format!("{}({})", self.type_name(ty), elements.join(", "))
            }
        }
    }

    /// Something in scope that has the type, or a part that has it.
    fn variable(&mut self, ty: Type) -> Option<String> {
        let known: Vec<(String, Type)> =
            self.scope.iter().map(|variable| (variable.name.clone(), variable.ty)).collect();
        if known.is_empty() {
            return None;
        }
        for _ in 0..4 {
            let (mut place, mut found) = self.random.pick(&known).clone();
            if found != ty {
                (place, found) = self.shallow_part(place, found);
            }
            if found == ty {
                return Some(place);
            }
        }
        None
    }

    /// A part whose index needs no value.
    fn shallow_part(&mut self, place: String, ty: Type) -> (String, Type) {
        match ty {
            Array(scalar, size) => (format!("{place}[{}]", self.random.below(size)), One(scalar)),
            other => self.part(place, other),
        }
    }

    fn call(&mut self, ty: Type, depth: usize) -> Option<String> {
        let index = self.functions.iter().position(|function| function.result == ty)?;
        let mut arguments: Vec<String> =
            [One(Float), One(Int), One(Uint)].map(|ty| self.value(ty, 1)).to_vec();
        for ty in self.functions[index].arguments.clone() {
            arguments.push(self.value(ty, depth - 1));
        }
        Some(format!("f{index}({})", arguments.join(", ")))
    }

    fn choice(&mut self, ty: Type, depth: usize) -> String {
        let (one, other) = (self.value(ty, depth - 1), self.value(ty, depth - 1));
        let condition = self.value(One(Bool), depth - 1);
        match ty {
            // WGSL chooses between scalars and vectors only, GLSL as naga reads it too.
            Matrix(_) | Struct(_) | Array(..) => one,
            _ if self.is_wgsl() => format!("select({one}, {other}, {condition})"),
            _ => format!("({condition} ? {one} : {other})"),
        }
    }

    fn truth(&mut self, depth: usize) -> String {
        let less = depth.saturating_sub(1);
        if depth == 0 {
            return "(x > 0.5)".to_owned();
        }
        match self.random.below(5) {
            0 => format!("(!{})", self.value(One(Bool), less)),
            1 => {
                let operator = *self.random.pick(&["&&", "||"]);
                format!("({} {operator} {})", self.value(One(Bool), less), self.value(One(Bool), less))
            }
            2 => {
                let (size, function) = (2 + self.random.below(3), *self.random.pick(&["all", "any"]));
                format!("{function}({})", self.value(Vector(Bool, size), less))
            }
            _ => {
                let scalar = *self.random.pick(&[Float, Int, Uint]);
                let operator = *self.random.pick(&["<", "<=", ">", ">=", "==", "!="]);
                format!("({} {operator} {})", self.value(One(scalar), less), self.value(One(scalar), less))
            }
        }
    }

    fn literal(&mut self, scalar: Scalar) -> String {
        let number = 1 + self.random.below(9);
        match scalar {
            Bool => "true".to_owned(),
            Int => number.to_string(),
            Uint => format!("{number}u"),
            Float => format!("{number}.{}", self.random.below(100)),
        }
    }

    fn number(&mut self, scalar: Scalar, depth: usize) -> String {
        if depth == 0 {
            let name = match scalar {
                Int => "i",
                Uint => "u",
                _ => "x",
            };
            return name.to_owned();
        }
        let one = self.value(One(scalar), depth - 1);
        let other =
            if self.random.one_in(3) { self.literal(scalar) } else { self.value(One(scalar), depth - 1) };
        match (self.random.below(8), scalar) {
            (0, Float) => format!(
                "{}({one})",
                self.random.pick(&["sin", "cos", "abs", "floor", "fract", "sqrt", "exp2"])
            ),
            (1, Float) => {
                let size = 2 + self.random.below(3);
                format!(
                    "dot({}, {})",
                    self.value(Vector(Float, size), depth - 1),
                    self.value(Vector(Float, size), depth - 1)
                )
            }
            (2, Float) => format!("mix({one}, {other}, {})", self.value(One(Float), depth - 1)),
            (3, Float) => {
                let from = *self.random.pick(&[Int, Uint]);
                format!("{}({})", self.scalar_name(Float), self.value(One(from), depth - 1))
            }
            (4, Float) => "block.scale".to_owned(),
            (0, _) => format!(
                "({one} {} ({} & 31u))",
                self.random.pick(&["<<", ">>"]),
                self.value(One(Uint), depth - 1)
            ),
            (1, _) => format!("({one} {} {other})", self.random.pick(&["&", "|", "^", "%"])),
            (2, _) => format!("(~{one})"),
            (3, _) => format!("{}({})", self.scalar_name(scalar), self.value(One(Float), depth - 1)),
            (4, Int) => format!("(-{one})"),
            (5, _) => format!("{}({one}, {other})", self.random.pick(&["min", "max"])),
            (6, Float) => format!("(-{one})"),
            _ => format!("({one} {} {other})", self.random.pick(&["+", "-", "*", "/"])),
        }
    }

    fn vector(&mut self, scalar: Scalar, size: usize, depth: usize) -> String {
        let ty = Vector(scalar, size);
        let name = self.type_name(ty);
        if depth == 0 {
            let one = if scalar == Bool { "(x > 0.5)".to_owned() } else { self.number(scalar, 0) };
            return format!("{name}({one})");
        }
        if scalar == Bool {
            let (one, other) =
                (self.value(Vector(Float, size), depth - 1), self.value(Vector(Float, size), depth - 1));
            return if self.is_wgsl() {
                format!("({one} < {other})")
            } else {
                format!("lessThan({one}, {other})")
            };
        }
        let one = self.value(ty, depth - 1);
        match (self.random.below(9), scalar, size) {
            (0, Float, 4) if self.is_wgsl() => {
                format!(
                    "textureSampleLevel(picture, picture_sampler, {}, 0.0)",
                    self.value(Vector(Float, 2), depth - 1)
                )
            }
            (0, Float, 4) => format!("textureLod(picture, {}, 0.0)", self.value(Vector(Float, 2), depth - 1)),
            (1, Float, 4) => "(block.turn * block.tint)".to_owned(),
            (2, Float, 3) => format!("cross({one}, {})", self.value(ty, depth - 1)),
            (3, Float, _) => format!("({} * {one})", self.value(Matrix(size), depth - 1)),
            (4, Float, _) => format!("normalize({one})"),
            (5, Float, _) => format!("({one} * {})", self.value(One(Float), depth - 1)),
            (6, ..) => {
                let parts: Vec<String> = (0..size).map(|_| self.value(One(scalar), depth - 1)).collect();
                format!("{name}({})", parts.join(", "))
            }
            (7, ..) => {
                let wide = self.value(Vector(scalar, 4), depth - 1);
                let swizzle: String = (0..size).map(|_| *self.random.pick(&['x', 'y', 'z', 'w'])).collect();
                format!("({wide}).{swizzle}")
            }
            _ => format!("({one} {} {})", self.random.pick(&["+", "-", "*"]), self.value(ty, depth - 1)),
        }
    }

    fn matrix(&mut self, size: usize, depth: usize) -> String {
        let less = depth.saturating_sub(1);
        let ty = Matrix(size);
        match self.random.below(if depth == 0 { 1 } else { 5 }) {
            1 => format!("({} * {})", self.value(ty, less), self.value(ty, less)),
            2 => format!("transpose({})", self.value(ty, less)),
            3 => format!("({} * {})", self.value(ty, less), self.value(One(Float), less)),
            4 => format!(
                "({} {} {})",
                self.value(ty, less),
                self.random.pick(&["+", "-"]).to_owned(),
                self.value(ty, less)
            ),
            _ => {
                let columns: Vec<String> = (0..size).map(|_| self.value(Vector(Float, size), less)).collect();
                format!("{}({})", self.type_name(ty), columns.join(", "))
            }
        }
    }
}
