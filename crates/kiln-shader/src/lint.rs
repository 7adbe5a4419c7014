//! Finds what is valid WGSL but may not do what its author thinks: NaN at the edge of a function's domain,
//! derivatives where neighbouring pixels have parted, and what is slow for no reason.
//!
//! Start at [`check`]. The method is abstract interpretation over naga's representation: each expression has a
//! [`range::Range`] that holds its values whatever the inputs are. Functions are followed statement by statement
//! ([`flow`]), conditions narrow what is known ([`facts`]), arguments are joined over all calls, and small
//! functions are followed anew for each call. Uniforms, textures and vertex inputs can be anything.
//!
//! Sound but for NaN, infinity and integer counters that run over, which are not followed: a division that is not
//! reported does not divide by zero, as long as its operands are numbers. Not complete: a guard that a range cannot express, as `a > b`
//! before `sqrt(a - b)`, is not seen. Work is bounded: a shader that takes too much is checked in part.
//!
//! An author allows a finding with a comment on its line or the line above: `// kiln: allow(domain) why`.

use std::collections::{BTreeMap, BTreeSet};

use naga::valid::ModuleInfo;
use naga::{
    AddressSpace, BuiltIn, Expression, Function, FunctionArgument, GlobalVariable, Handle, Module,
    ShaderStage, Span, StorageAccess, TypeInner,
};

use crate::explain::Finding;
use range::Range;
use value::{Types, Value};
use walk::Walk;

pub use allow::Allowances;

mod allow;
mod cost;
mod domain;
mod evaluate;
mod facts;
mod flow;
mod number;
mod range;
mod value;
mod variables;
mod walk;

/// Expressions, statements and variables to follow before the lint gives up, which takes about a second; Kiln's
/// largest shader takes 15 000.
const WORK_MAX: usize = 4_000_000;
/// The part of it for following functions anew for a call.
const CALL_WORK_MAX: usize = 1_000_000;
/// Functions with more expressions are followed once for all their calls.
const CALL_EXPRESSIONS_MAX: usize = 64;
/// How deep calls are followed in calls.
const CALL_DEPTH_MAX: usize = 4;
/// Rounds over the module: the first learns from callees, the next with the arguments that it found.
const ROUNDS: usize = 2;

/// What a warning is about: the name that an author allows it by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rule {
    /// An argument outside a function's domain.
    Domain,
    /// A derivative in control flow that is not uniform.
    Uniformity,
    /// What is slow.
    Cost,
}

impl Rule {
    /// All rules.
    pub const ALL: [Rule; 3] = [Rule::Domain, Rule::Uniformity, Rule::Cost];

    /// Its name in `// kiln: allow(name)`.
    pub fn name(self) -> &'static str {
        match self {
            Rule::Domain => "domain",
            Rule::Uniformity => "uniformity",
            Rule::Cost => "cost",
        }
    }
}

/// Something that the lint found.
#[derive(Clone, Debug)]
pub struct Warning {
    /// The rule it breaks.
    pub rule: Rule,
    /// What, and where in the linked text.
    pub finding: Finding,
    /// What to do.
    pub help: String,
}

/// Findings in a valid module that holds nothing unused, in the order of its text.
pub fn check(module: &Module, info: &ModuleInfo) -> Vec<Warning> {
    let mut lint = Lint::new(module, info);
    lint.check_uniforms();
    for round in 0..ROUNDS {
        lint.learn_results();
        lint.reports = round + 1 == ROUNDS;
        lint.learn_arguments();
    }
    lint.finish()
}

/// Least and greatest of what the first entry point of a valid module returns.
#[cfg(test)]
pub fn returned_range(text: &str) -> Option<(f64, f64)> {
    let module = naga::front::wgsl::parse_str(text).ok()?;
    let info = crate::front::validate(&module).ok()?;
    let mut lint = Lint::new(&module, &info);
    let entry = &module.entry_points.first()?.function;
    let arguments = entry.arguments.iter().map(|argument| lint.input(argument)).collect();
    let range = Walk::new(&mut lint, entry, info.get_entry_point(0), arguments).run()?.range();
    Some((range.lo, range.hi))
}

/// What is known of a module.
pub struct Lint<'m> {
    pub module: &'m Module,
    info: &'m ModuleInfo,
    pub types: Types<'m>,
    /// Values of constants.
    pub constants: Vec<Value>,
    /// Whether findings count: in the last round.
    pub reports: bool,
    results: Vec<Option<Value>>,
    calls: Vec<Option<Calls>>,
    work: usize,
    call_work: usize,
    warnings: Vec<Warning>,
    /// Where and what of them, so that none is there twice.
    seen: BTreeSet<(usize, String)>,
}

/// All calls of a function.
#[derive(Clone, Debug)]
struct Calls {
    arguments: Vec<Value>,
    /// A call by some of the invocations.
    divergence: Option<Span>,
    in_fragment: bool,
}

impl<'m> Lint<'m> {
    fn new(module: &'m Module, info: &'m ModuleInfo) -> Lint<'m> {
        let types = Types::new(module);
        let constants = constants(module, &types);
        let none = vec![None; module.functions.len()];
        Lint {
            module,
            info,
            types,
            constants,
            reports: false,
            results: none,
            calls: vec![None; module.functions.len()],
            work: 0,
            call_work: 0,
            warnings: Vec::new(),
            seen: BTreeSet::new(),
        }
    }

    /// Counts work.
    pub fn spend(&mut self, work: usize) {
        self.work += work;
    }

    pub fn is_exhausted(&self) -> bool {
        self.work > WORK_MAX
    }

    /// Results of all functions, callees first, for any arguments or those of the round before.
    fn learn_results(&mut self) {
        let module = self.module;
        for (handle, function) in module.functions.iter() {
            let arguments = self.arguments(handle, function);
            self.results[handle.index()] = Walk::new(self, function, &self.info[handle], arguments).run();
        }
    }

    /// Arguments of all functions, callers first: naga has a callee before its callers.
    fn learn_arguments(&mut self) {
        let module = self.module;
        self.calls = vec![None; module.functions.len()];
        for (index, entry) in module.entry_points.iter().enumerate() {
            let arguments = entry.function.arguments.iter().map(|argument| self.input(argument)).collect();
            let mut walk = Walk::new(self, &entry.function, self.info.get_entry_point(index), arguments);
            walk.records = true;
            walk.in_fragment = entry.stage == ShaderStage::Fragment;
            walk.run();
        }
        for (handle, function) in module.functions.iter().rev() {
            // Without a call, nothing reaches it.
            let Some(calls) = self.calls[handle.index()].clone() else { continue };
            let mut walk = Walk::new(self, function, &self.info[handle], calls.arguments);
            walk.records = true;
            walk.in_fragment = calls.in_fragment;
            walk.divergence = calls.divergence;
            walk.run();
        }
    }

    fn arguments(&self, handle: Handle<Function>, function: &Function) -> Vec<Value> {
        match &self.calls[handle.index()] {
            Some(calls) => calls.arguments.clone(),
            None => function.arguments.iter().map(|argument| self.types.any(argument.ty, false)).collect(),
        }
    }

    /// What a stage can get.
    fn input(&self, argument: &FunctionArgument) -> Value {
        let Value::Struct(members) = self.types.any(argument.ty, false) else {
            return built_in(argument.binding.as_ref(), self.types.any(argument.ty, false));
        };
        let TypeInner::Struct { members: types, .. } = &self.module.types[argument.ty].inner else {
            return Value::Struct(members);
        };
        let members = types.iter().zip(members.iter());
        Value::Struct(members.map(|(ty, value)| built_in(ty.binding.as_ref(), value.clone())).collect())
    }

    /// Whether nothing writes to a variable while a draw runs, and all invocations see the same.
    pub fn is_constant(&self, global: Handle<GlobalVariable>) -> bool {
        match self.module.global_variables[global].space {
            AddressSpace::Uniform | AddressSpace::Immediate => true,
            AddressSpace::Storage { access } => !access.contains(StorageAccess::STORE),
            _ => false,
        }
    }

    /// Adds a call to what is known of a function's arguments.
    pub fn note_call(
        &mut self,
        callee: Handle<Function>,
        arguments: &[Value],
        divergence: Option<Span>,
        in_fragment: bool,
    ) {
        let known = &mut self.calls[callee.index()];
        *known = Some(match known.take() {
            None => Calls { arguments: arguments.to_vec(), divergence, in_fragment },
            Some(calls) => Calls {
                arguments: calls.arguments.iter().zip(arguments).map(|(a, b)| a.join(b)).collect(),
                divergence: calls.divergence.or(divergence),
                in_fragment: calls.in_fragment || in_fragment,
            },
        });
    }

    /// What a call with `arguments` returns.
    pub fn result_of(
        &mut self,
        callee: Handle<Function>,
        arguments: Vec<Value>,
        depth: usize,
    ) -> Option<Value> {
        let (module, info) = (self.module, self.info);
        let function = &module.functions[callee];
        let work = function.expressions.len();
        if work > CALL_EXPRESSIONS_MAX || depth >= CALL_DEPTH_MAX || self.call_work + work > CALL_WORK_MAX {
            return self.results[callee.index()].clone();
        }
        self.call_work += work;
        let mut walk = Walk::new(self, function, &info[callee], arguments);
        walk.call_depth = depth + 1;
        walk.run()
    }

    /// Adds a finding once.
    pub fn warn(&mut self, rule: Rule, span: Span, message: String, help: &str, cause: Option<(Span, &str)>) {
        let range = span.to_range();
        let start = range.as_ref().map_or(0, |range| range.start);
        if !self.seen.insert((start, message.clone())) {
            return;
        }
        let cause = cause.and_then(|(span, label)| Some((span.to_range()?, label.to_owned())));
        let labels = range.map(|range| (range, String::new())).into_iter().chain(cause).collect();
        let finding = Finding { message, notes: Vec::new(), labels };
        self.warnings.push(Warning { rule, finding, help: help.to_owned() });
    }

    fn finish(mut self) -> Vec<Warning> {
        if self.is_exhausted() {
            let finding = Finding {
                message: "this shader is too large to be checked in full".to_owned(),
                notes: Vec::new(),
                labels: Vec::new(),
            };
            self.warnings.push(Warning { rule: Rule::Cost, finding, help: "split it".to_owned() });
        }
        self.warnings.sort_by_key(|warning| warning.finding.labels.first().map(|(range, _)| range.start));
        self.warnings
    }
}

/// Values of constants. Their expressions have been evaluated by naga's front end.
fn constants(module: &Module, types: &Types<'_>) -> Vec<Value> {
    let mut expressions: Vec<Value> = Vec::new();
    let mut constants: BTreeMap<usize, Value> = BTreeMap::new();
    for (_, expression) in module.global_expressions.iter() {
        expressions.push(match expression {
            Expression::Literal(literal) => Value::Number(evaluate::literal_range(*literal)),
            Expression::ZeroValue(ty) => types.zero(*ty),
            Expression::Constant(constant) => {
                let init = module.constants[*constant].init;
                expressions.get(init.index()).cloned().unwrap_or_else(Value::any)
            }
            Expression::Compose { ty, components } => {
                let values = components.iter().map(|handle| expressions[handle.index()].clone());
                evaluate::compose(module, *ty, values)
            }
            Expression::Splat { value, .. } => {
                let range = expressions[value.index()].range();
                Value::Number(Range { far: 2.0 * range.far, ..range })
            }
            _ => Value::any(),
        });
    }
    for (handle, constant) in module.constants.iter() {
        let value = expressions.get(constant.init.index()).cloned().unwrap_or_else(Value::any);
        constants.insert(handle.index(), value);
    }
    constants.into_values().collect()
}

/// What a built-in input can be.
fn built_in(binding: Option<&naga::Binding>, any: Value) -> Value {
    match binding {
        // In pixels, depth and 1 / w of what is in front of the eye.
        Some(naga::Binding::BuiltIn(BuiltIn::Position { .. })) => {
            Value::Number(Range { lo: 0.0, ..any.range() })
        }
        Some(naga::Binding::BuiltIn(
            BuiltIn::WorkGroupId | BuiltIn::NumWorkGroups | BuiltIn::WorkGroupSize,
        )) => Value::Number(any.range().with_uniform(true)),
        _ => any,
    }
}
