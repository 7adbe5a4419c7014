//! Compiling, dispatching and saying what came of it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use kiln_gpu::Gpu;
use kiln_shader::{Binding, Compiled};

#[expect(clippy::print_stderr, reason = "tables of errors are what these tests are for")]
pub fn say(line: &str) {
    eprintln!("{line}");
}

/// The device, or `None` with a loud line; with `KILN_REQUIRE_GPU=1` a missing device fails.
pub fn gpu() -> Option<&'static Gpu> {
    static GPU: OnceLock<Option<Gpu>> = OnceLock::new();
    let open = || match Gpu::headless() {
        Ok(gpu) => {
            say(&format!("device: {}", gpu.description()));
            Some(gpu)
        }
        Err(error) if std::env::var_os("KILN_REQUIRE_GPU").is_some() => panic!("{error}"),
        Err(error) => {
            say(&format!("SKIPPED: nothing was compared on a device: {error}"));
            None
        }
    };
    GPU.get_or_init(open).as_ref()
}

pub fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Compiles a shader of the repository; `root_text` stands in for a root that is no file.
#[track_caller]
pub fn compile(root: &str, root_text: Option<&str>, features: &[&str]) -> Compiled {
    let features: BTreeSet<String> = features.iter().map(|&feature| feature.to_owned()).collect();
    let mut read = |path: &str| match root_text.filter(|_| path == root) {
        Some(text) => Some(Arc::from(text)),
        None => std::fs::read_to_string(repository().join(path)).ok().map(Arc::from),
    };
    let outcome = kiln_shader::compile(&kiln_shader::Program::of(root), &features, &mut read);
    let said: Vec<String> = outcome.diagnostics.iter().map(ToString::to_string).collect();
    outcome.compiled.unwrap_or_else(|| panic!("{root} does not compile:\n{}", said.join("\n")))
}

/// Compiles a GLSL program of `tests/shaders/tutorials`.
#[track_caller]
pub fn compile_tutorial(files: &[&str]) -> Compiled {
    let roots: Vec<String> = files.iter().map(|file| format!("tests/shaders/tutorials/{file}")).collect();
    let program = kiln_shader::Program { roots, ..Default::default() };
    let mut read = |path: &str| std::fs::read_to_string(repository().join(path)).ok().map(Arc::from);
    let outcome = kiln_shader::compile(&program, &BTreeSet::new(), &mut read);
    let said: Vec<String> = outcome.diagnostics.iter().map(ToString::to_string).collect();
    outcome.compiled.unwrap_or_else(|| panic!("{files:?} does not compile:\n{}", said.join("\n")))
}

/// The binding of a shader that has this name.
#[track_caller]
pub fn binding<'a>(compiled: &'a Compiled, name: &str) -> &'a Binding {
    let found = compiled.reflection.bindings.iter().find(|binding| binding.name == name);
    found.unwrap_or_else(|| panic!("no binding is called {name}"))
}

/// Arguments of one call: `a` and `b` of the shader, two vec4f.
pub type Arguments = [f64; 8];

/// A library function beside its twin in f64.
pub struct Comparison {
    /// Path as in an import.
    pub function: &'static str,
    /// WGSL of type vec4f, of `a` and `b`.
    pub call: &'static str,
    pub arguments: Vec<[f32; 8]>,
    /// Takes the arguments as the shader got them, rounded to f32.
    pub truth: fn(Arguments) -> [f64; 4],
    /// Something else, which the comparison must tell apart from the truth.
    pub wrong: fn(Arguments) -> [f64; 4],
    /// Largest error allowed, relative to the larger of |truth| and `least`.
    pub tolerance: f64,
    pub least: f64,
}

/// Worst error of a comparison's results and the arguments of it.
pub struct Worst {
    pub error: f64,
    pub at: [f32; 8],
}

impl Comparison {
    fn worst(&self, results: &[[f32; 4]], truth: fn(Arguments) -> [f64; 4]) -> Worst {
        let mut worst = Worst { error: 0.0, at: [0.0; 8] };
        for (&arguments, result) in self.arguments.iter().zip(results) {
            for (&actual, expected) in result.iter().zip(truth(arguments.map(f64::from))) {
                let error = (f64::from(actual) - expected).abs() / expected.abs().max(self.least);
                // A NaN on either side is the worst there is.
                let error = if error.is_nan() { f64::INFINITY } else { error };
                if error > worst.error {
                    worst = Worst { error, at: arguments };
                }
            }
        }
        worst
    }

    /// The worst errors on the device: against the truth, and against what is wrong.
    pub fn measure(&self, gpu: &Gpu) -> [Worst; 2] {
        let results = evaluate(gpu, self.function, self.call, &self.arguments);
        [self.worst(&results, self.truth), self.worst(&results, self.wrong)]
    }

    /// Compares on the device; says the worst error.
    fn check(&self, gpu: &Gpu) -> Result<(), String> {
        let [worst, wrong] = self.measure(gpu);
        let line = format!(
            "{:44} {:6} calls  worst {:8.1e}  tolerance {:7.0e}  wrong formula {:8.1e}  at {:?}",
            self.function,
            self.arguments.len(),
            worst.error,
            self.tolerance,
            wrong.error,
            worst.at
        );
        say(&line);
        let is_right = worst.error <= self.tolerance;
        let sees_wrong = wrong.error > self.tolerance;
        if is_right && sees_wrong { Ok(()) } else { Err(line) }
    }
}

/// What the device makes of a WGSL expression of `a` and `b` that uses one function of the library.
pub fn evaluate(gpu: &Gpu, function: &str, call: &str, arguments: &[[f32; 8]]) -> Vec<[f32; 4]> {
    let root = format!(
        "import {function};
            struct Case {{ a: vec4f, b: vec4f }}
            @group(0) @binding(0) var<storage, read> cases: array<Case>;
            @group(0) @binding(1) var<storage, read_write> results: array<vec4f>;
            @compute @workgroup_size(64)
            fn main(@builtin(global_invocation_id) id: vec3u) {{
                if id.x < arrayLength(&results) {{
                    let a = cases[id.x].a;
                    let b = cases[id.x].b;
                    results[id.x] = {call};
                }}
            }}"
    );
    let compiled = compile("shaders/test/root.wgsl", Some(&root), &[]);
    let pass = gpu.compute_pass(&compiled.wgsl, "main", &[]).unwrap();
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
    let cases = gpu.buffer(bytemuck::cast_slice(arguments), usage);
    let results = gpu.buffer(&vec![0xff; arguments.len() * 16], usage);
    let bindings = [(0, &cases), (1, &results)]
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() });
    let groups = arguments.len().div_ceil(64) as u32;
    gpu.run_pass(&pass, &bindings, [groups, 1, 1]).unwrap();
    bytemuck::pod_collect_to_vec(&gpu.read_buffer(&results).unwrap())
}

/// Runs all of them and fails with all that are wrong.
#[track_caller]
pub fn check_all(comparisons: &[Comparison]) {
    let Some(gpu) = gpu() else { return };
    let wrong: Vec<String> = comparisons.iter().filter_map(|one| one.check(gpu).err()).collect();
    assert!(wrong.is_empty(), "over the tolerance, or a wrong formula within it:\n{}", wrong.join("\n"));
}

/// The first arguments for which a call gives an infinity or NaN, and what it gives.
pub fn first_infinite(gpu: &Gpu, function: &str, call: &str, arguments: &[[f32; 8]]) -> Option<String> {
    let results = evaluate(gpu, function, call, arguments);
    let at = results.iter().position(|result| !result.iter().all(|value| value.is_finite()))?;
    Some(format!("{function} of {:?} is {:?}", arguments[at], results[at]))
}

/// All combinations of up to eight lists of values; what is missing is 0.
pub fn grid(axes: &[&[f32]]) -> Vec<[f32; 8]> {
    let mut found = vec![[0.0; 8]];
    for (index, axis) in axes.iter().enumerate() {
        let with = |before: [f32; 8]| {
            axis.iter().map(move |&value| {
                let mut arguments = before;
                arguments[index] = value;
                arguments
            })
        };
        found = found.into_iter().flat_map(with).collect();
    }
    found
}

/// Cosines with their edges; the last is what a dot product of unit vectors may round to.
pub const COSINES: [f32; 14] =
    [0.0, 1e-7, 1e-5, 1e-3, 0.01, 0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 0.999, 1.0, 1.000_000_2];
/// Perceptual roughnesses with their edges.
pub const ROUGHNESSES: [f32; 10] = [0.0, 1e-4, 1e-3, 0.02, 0.045, 0.1, 0.3, 0.5, 0.8, 1.0];

/// α of [`ROUGHNESSES`].
pub fn alphas() -> Vec<f32> {
    ROUGHNESSES.iter().map(|roughness| roughness * roughness).collect()
}

pub fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| x / length)
}

/// Unit directions: axes, edges, corners, and close to the poles.
pub fn directions() -> Vec<[f32; 3]> {
    let mut found = Vec::new();
    let steps = [-1.0, -0.37, 0.0, 0.41, 1.0];
    for x in steps {
        for y in steps {
            found.extend(steps.iter().filter(|&&z| (x, y, z) != (0.0, 0.0, 0.0)).map(|&z| [x, y, z]));
        }
    }
    for tiny in [1e-7, 1e-4, -1e-3] {
        found.extend([[tiny, 1.0, 0.0], [0.0, -1.0, tiny], [tiny, tiny, 1.0], [tiny, 0.0, -1.0]]);
    }
    found.into_iter().map(|v| unit(v).map(|x| x as f32)).collect()
}

/// Eight arguments that begin with a direction.
pub fn with_directions(rest: &[[f32; 5]]) -> Vec<[f32; 8]> {
    let join = |[x, y, z]: [f32; 3]| rest.iter().map(move |&[a, b, c, d, e]| [x, y, z, a, b, c, d, e]);
    directions().into_iter().flat_map(join).collect()
}
