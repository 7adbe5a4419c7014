//! Runs naga over linked text, on a thread of its own.

use naga::front::wgsl::ParseError;
use naga::valid::{Capabilities, ModuleInfo, ValidationError, ValidationFlags, Validator};
use naga::{Module, WithSpan};

use crate::explain::Finding;
use crate::lint::{self, Warning};
use crate::source_map::{self, LinkedFunction};
use crate::{Compiled, canonical, describe, interface, limits, writable};

/// Stack of the thread that naga runs on. Its front end, validator and writer recurse over expressions and
/// blocks, whose depth `limits` bounds; `tests::deepest_allowed_*` runs the worst case on this stack.
const STACK_BYTES: usize = 64 << 20;

/// Why linked text has no compiled form.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Fault {
    /// The linked text is longer than the limit.
    #[error("linked shader has {actual} bytes, the limit is {limit}")]
    TooLong {
        /// Bytes allowed.
        limit: usize,
        /// Bytes there are.
        actual: usize,
    },
    /// It breaks a rule of WGSL, or needs what wgpu does not offer by default.
    #[error("{}", .0.message)]
    Source(Finding),
    /// Nothing in it can be drawn or dispatched.
    #[error("this shader has no entry point")]
    NoEntryPoint,
    /// naga's writer puts parentheses around each operation, and its parser refuses what nests too deep.
    #[error("an expression or `else if` chain is too long to be written out")]
    TooDeep,
    /// naga's own fault.
    #[error("the shader compiler failed: {0}")]
    Internal(String),
}

/// A valid linked text.
#[derive(Clone, Debug)]
pub struct LinkedShader {
    /// The shader.
    pub compiled: Compiled,
    /// Where its functions stand in the linked text.
    pub functions: Vec<LinkedFunction>,
    /// What is doubtful, if that was asked for.
    pub warnings: Vec<Warning>,
}

/// Parses, validates, compacts, emits and reflects; with `lints`, also says what is doubtful.
pub fn compile_linked(text: &str, lints: bool) -> Result<LinkedShader, Fault> {
    check_length(text)?;
    on_deep_stack(Fault::Internal, || compile(text, lints))
}

/// Parses and validates only; a text without entry points is fine.
pub fn check_linked(text: &str) -> Result<(), Fault> {
    check_length(text)?;
    on_deep_stack(Fault::Internal, || parse(text).map(drop))
}

fn check_length(text: &str) -> Result<(), Fault> {
    if text.len() > limits::LINKED_BYTES_MAX {
        return Err(Fault::TooLong { limit: limits::LINKED_BYTES_MAX, actual: text.len() });
    }
    Ok(())
}

/// Compiles stages that were joined: each is canonical by itself, which leaves the order of their declarations open.
/// `name_locals` may name arguments and variables, which changes no text.
pub fn compile_joined(
    text: &str,
    name_locals: impl FnOnce(&mut Module) + Send,
) -> Result<(Compiled, Vec<LinkedFunction>), Fault> {
    on_deep_stack(Fault::Internal, || {
        let mut module = naga::front::wgsl::parse_str(text).map_err(|error| reparse_fault(&error, text))?;
        validate(&module).map_err(|error| Fault::Source(validation_finding(&module, &error)))?;
        name_locals(&mut module);
        let Canonical { compiled, reparsed, .. } = canonical(&mut module)?;
        Ok((compiled, source_map::functions(&module, &reparsed)))
    })
}

/// Runs `work` with a stack that naga's recursion fits in. A panic in it becomes the error `internal`.
pub fn on_deep_stack<T: Send, E: Send>(
    internal: fn(String) -> E,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> Result<T, E> {
    std::thread::scope(|scope| {
        let builder = std::thread::Builder::new().name("kiln-shader".to_owned()).stack_size(STACK_BYTES);
        let worker =
            builder.spawn_scoped(scope, work).map_err(|error| internal(format!("no thread: {error}")))?;
        // naga panics on some hostile input (gfx-rs/wgpu #9499, #7687): that ends this thread only.
        worker.join().unwrap_or_else(|panic| Err(internal(panic_text(panic.as_ref()))))
    })
}

fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "panic".to_owned())
}

fn parse(text: &str) -> Result<Module, Fault> {
    let module = naga::front::wgsl::parse_str(text).map_err(|error| Fault::Source(parse_finding(&error)))?;
    validate(&module).map_err(|error| Fault::Source(validation_finding(&module, &error)))?;
    Ok(module)
}

fn compile(text: &str, lints: bool) -> Result<LinkedShader, Fault> {
    let mut module = parse(text)?;
    if module.entry_points.is_empty() {
        return Err(Fault::NoEntryPoint);
    }
    let Canonical { compiled, reparsed, info } = canonical(&mut module)?;
    let functions = source_map::functions(&module, &reparsed);
    let warnings = if lints { lint::check(&module, &info) } else { Vec::new() };
    Ok(LinkedShader { compiled, functions, warnings })
}

/// A shader in its canonical form.
struct Canonical {
    compiled: Compiled,
    /// Its text, read back.
    reparsed: Module,
    /// Of the module that was written.
    info: ModuleInfo,
}

/// Strips, emits and reflects a valid module.
fn canonical(module: &mut Module) -> Result<Canonical, Fault> {
    let info = strip(module)?;
    writable::check(module).map_err(Fault::Source)?;
    let wgsl = canonical::emit(module, &info).map_err(Fault::Internal)?;
    let reparsed = naga::front::wgsl::parse_str(&wgsl).map_err(|error| reparse_fault(&error, &wgsl))?;
    let reflection = interface::reflect(module, &info, &reparsed).map_err(Fault::Internal)?;
    Ok(Canonical { compiled: Compiled { wgsl, reflection }, reparsed, info })
}

/// Strips a valid module of what no entry point uses; returns what naga knows of the rest.
pub fn strip(module: &mut Module) -> Result<ModuleInfo, Fault> {
    canonical::strip_unused(module);
    // It was valid before, and checking it takes as long as all the rest of this.
    let info = Validator::new(ValidationFlags::empty(), capabilities()).validate(module);
    info.map_err(|error| Fault::Internal(format!("after compaction: {error:?}")))
}

fn reparse_fault(error: &ParseError, wgsl: &str) -> Fault {
    let text = error.emit_to_string(wgsl);
    if ["recursion limit", "nesting limit"].iter().any(|limit| text.contains(limit)) {
        return Fault::TooDeep;
    }
    Fault::Internal(format!("canonical text does not parse: {text}"))
}

/// Validates as a wgpu device without optional features does.
pub fn validate(module: &Module) -> Result<ModuleInfo, Box<WithSpan<ValidationError>>> {
    Validator::new(ValidationFlags::all(), capabilities()).validate(module).map_err(Box::new)
}

/// naga's default capabilities are those of a wgpu device without optional features.
fn capabilities() -> Capabilities {
    // Packing halves is no optional feature of WGSL, and devices without it are older than wgpu asks for by default.
    Capabilities::default() | Capabilities::SHADER_FLOAT16_IN_FLOAT32
}

fn parse_finding(error: &ParseError) -> Finding {
    let labels = error.labels().filter_map(|(span, label)| Some((span.to_range()?, label.to_owned())));
    let notes = error.notes().map(str::to_owned).collect();
    Finding { message: describe::parse_error(error.message()), notes, labels: labels.collect() }
}

/// What `error` says, in the words of the module.
pub fn validation_finding(module: &Module, error: &WithSpan<ValidationError>) -> Finding {
    let labels = error.spans().filter_map(|(span, label)| Some((span.to_range()?, label.clone())));
    let mut labels: Vec<_> = labels.collect();
    // naga lists the function before the expression in it.
    labels.sort_by_key(|(range, _)| range.len());
    let (message, notes) = describe::validation_error(module, error.as_inner());
    Finding { message, notes, labels }
}
