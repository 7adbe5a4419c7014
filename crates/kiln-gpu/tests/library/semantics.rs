//! What GLSL means: programs of `tests/shaders/semantics` through Kiln's front end, and through glslang's, whose SPIR-V goes
//! to the driver as it is. Both run on one device over the same numbers and textures and must write the same.
//!
//! WebGPU has no combined samplers: programs that sample declare theirs under `#ifdef KILN`, and beside it what they mean.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use kiln_gpu::Gpu;

use crate::pictures::{self, Picture};
use crate::support::{gpu, repository, say};

/// Integers, then floats, of the buffer that every program reads and writes.
const COUNT: usize = 128;

/// Both go to one driver, whose functions are the same; only how sums are fused may differ.
const RELATIVE_MAX: f32 = 1e-6;

/// A device that takes SPIR-V as it is; none, said loudly, where there is no such device or no glslang.
fn device() -> Option<Gpu> {
    let gpu = gpu()?;
    if Command::new("glslangValidator").arg("--version").output().is_err() {
        say("SKIPPED: glslangValidator is not installed, so nothing was compared with it");
        return None;
    }
    let descriptor = wgpu::DeviceDescriptor {
        required_features: wgpu::Features::PASSTHROUGH_SHADERS,
        required_limits: gpu.adapter.limits(),
        ..Default::default()
    };
    match pollster::block_on(gpu.adapter.request_device(&descriptor)) {
        Ok((device, queue)) => Some(Gpu::from_parts(gpu.adapter.clone(), device, queue)),
        Err(error) => {
            say(&format!("SKIPPED: nothing was compared, this device takes no SPIR-V: {error}"));
            None
        }
    }
}

fn folder() -> PathBuf {
    repository().join("tests/shaders/semantics")
}

/// A program with its name and the change that makes it another: its line `` // Another program: `a` => `b` ``.
struct Program {
    name: String,
    text: String,
    change: (String, String),
}

impl Program {
    fn read(path: &Path) -> Program {
        let text = std::fs::read_to_string(path).unwrap();
        let line = text.lines().find_map(|line| line.strip_prefix("// Another program: ")).unwrap();
        let parts: Vec<&str> = line.split('`').collect();
        let change = (parts[1].to_owned(), parts[3].to_owned());
        Program { name: path.file_stem().unwrap().to_string_lossy().into_owned(), text, change }
    }

    fn changed(&self) -> String {
        let (head, body) = self.text.split_once("// Another program: ").unwrap();
        let (_, body) = body.split_once('\n').unwrap();
        assert_eq!(body.matches(&self.change.0).count(), 1, "{}: the change is not at one place", self.name);
        format!("{head}{}", body.replace(&self.change.0, &self.change.1))
    }
}

fn programs() -> Vec<Program> {
    let mut paths: Vec<PathBuf> = folder().read_dir().unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths.iter().map(|path| Program::read(path)).collect()
}

/// A program as a device takes it.
struct Made {
    module: wgpu::ShaderModule,
    entry_point: &'static str,
    /// What it samples: bindings of group 1.
    pictures: Vec<(u32, String)>,
}

/// What Kiln makes of `text`.
#[track_caller]
fn kilns(gpu: &Gpu, name: &str, text: &str) -> Made {
    let root = format!("{name}.comp");
    let mut read = |path: &str| Some(Arc::from(text)).filter(|_| path == root);
    let outcome = kiln_shader::compile(&kiln_shader::Program::of(&root), &BTreeSet::new(), &mut read);
    let said: Vec<String> = outcome.diagnostics.iter().map(ToString::to_string).collect();
    let compiled = outcome.compiled.unwrap_or_else(|| panic!("{}", said.join("\n")));
    let bound = compiled.reflection.bindings.into_iter().filter(|bound| bound.group == 1);
    let pictures = bound.map(|bound| (bound.binding, bound.name)).collect();
    let source = wgpu::ShaderSource::Wgsl(compiled.wgsl.into());
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(name), source });
    Made { module, entry_point: "cs_main", pictures }
}

/// What glslang makes of `text`.
#[track_caller]
#[expect(unsafe_code, reason = "no other compiler may stand between glslang and the driver")]
fn glslangs(gpu: &Gpu, name: &str, text: &str) -> Made {
    // Tests run beside each other.
    static FILES: AtomicUsize = AtomicUsize::new(0);
    let file = format!("{}-{}", std::process::id(), FILES.fetch_add(1, Ordering::Relaxed));
    let [source, made] = ["comp", "spv"]
        .map(|end| Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{file}.{end}")));
    std::fs::write(&source, text).unwrap();
    let output =
        Command::new("glslangValidator").arg("-V").arg(&source).arg("-o").arg(&made).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(&std::fs::read(&made).unwrap());
    [source, made].iter().for_each(|path| std::fs::remove_file(path).unwrap());
    let entry = wgpu::PassthroughShaderEntryPoint { name: "main".into(), workgroup_size: (8, 1, 1) };
    let descriptor = wgpu::ShaderModuleDescriptorPassthrough {
        label: Some(name),
        entry_points: vec![entry].into(),
        spirv: Some(words.into()),
        ..Default::default()
    };
    // SAFETY: the reference compiler made this module, and its program keeps within the buffer that is bound.
    let module = unsafe { gpu.device.create_shader_module_passthrough(descriptor) };
    let pictures = (0..).zip(pictures::SLOTS.map(str::to_owned)).collect();
    Made { module, entry_point: "main", pictures }
}

/// The numbers that programs begin with: small integers of both signs, and floats that binary fractions hold.
fn seeds() -> Vec<u32> {
    let integer = |n: usize| (n * n * 7 + n * 3 + 5) as i32 % 41 - 17;
    let float = |n: usize| integer(n + 3) as f32 / 4.0 + 0.125;
    let integers = (0..COUNT).map(|n| u32::from_ne_bytes(integer(n).to_ne_bytes()));
    integers.chain((0..COUNT).map(|n| float(n).to_bits())).collect()
}

/// Runs a module's entry point in one workgroup over the seeds.
#[track_caller]
fn run(gpu: &Gpu, Made { module, entry_point, pictures }: &Made) -> Vec<u32> {
    use wgpu::{BufferUsages, ShaderStages};
    let buffer = gpu.buffer(bytemuck::cast_slice(&seeds()), BufferUsages::STORAGE | BufferUsages::COPY_SRC);
    let (_, error) = gpu.catch_errors(|| {
        let entry = wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only: false },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let sampled: Vec<_> = pictures.iter().map(|(at, name)| pictures::layout(*at, name)).collect();
        let [layout, sampled_layout] = [&[entry][..], &sampled].map(|entries| {
            let descriptor = wgpu::BindGroupLayoutDescriptor { label: None, entries };
            gpu.device.create_bind_group_layout(&descriptor)
        });
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            bind_group_layouts: &[Some(&layout), Some(&sampled_layout)],
            ..Default::default()
        });
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: Some(&pipeline_layout),
            module,
            entry_point: Some(entry_point),
            compilation_options: Default::default(),
            cache: None,
        });
        let entries = [wgpu::BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }];
        let made: Vec<_> = pictures.iter().map(|(at, name)| (*at, Picture::of(gpu, name))).collect();
        let sampled = made
            .iter()
            .map(|(at, picture)| wgpu::BindGroupEntry { binding: *at, resource: picture.resource() });
        let sampled: Vec<_> = sampled.collect();
        let [group, sampled_group] = [(&layout, &entries[..]), (&sampled_layout, &sampled)]
            .map(|(layout, entries)| wgpu::BindGroupDescriptor { label: None, layout, entries })
            .map(|descriptor| gpu.device.create_bind_group(&descriptor));
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        {
            let mut commands = encoder.begin_compute_pass(&Default::default());
            commands.set_pipeline(&pipeline);
            commands.set_bind_group(0, &group, &[]);
            commands.set_bind_group(1, &sampled_group, &[]);
            commands.dispatch_workgroups(1, 1, 1);
        }
        gpu.queue.submit([encoder.finish()]);
    });
    assert_eq!(error, None);
    bytemuck::pod_collect_to_vec(&gpu.read_buffer(&buffer).unwrap())
}

/// Where two runs differ; `<=`, so that a NaN does unless both have the same bits.
fn differences(ours: &[u32], theirs: &[u32]) -> Vec<String> {
    assert_eq!((ours.len(), theirs.len()), (2 * COUNT, 2 * COUNT));
    let differs = |at: usize| {
        let [a, b] = [ours[at], theirs[at]];
        let [x, y] = [a, b].map(f32::from_bits);
        let is_close = (x - y).abs() <= RELATIVE_MAX * x.abs().max(y.abs());
        a != b && (at < COUNT || !is_close)
    };
    let describe = |at: usize| match at.checked_sub(COUNT) {
        None => format!("ints[{at}]: {} here, {} there", ours[at] as i32, theirs[at] as i32),
        Some(float) => {
            format!(
                "floats[{float}]: {} here, {} there",
                f32::from_bits(ours[at]),
                f32::from_bits(theirs[at])
            )
        }
    };
    (0..2 * COUNT).filter(|at| differs(*at)).map(describe).collect()
}

#[test]
fn programs_mean_what_they_mean_to_glslang() {
    let Some(gpu) = device() else { return };
    let mut wrong = Vec::new();
    let programs = programs();
    for Program { name, text, .. } in &programs {
        let ours = run(&gpu, &kilns(&gpu, name, text));
        let theirs = run(&gpu, &glslangs(&gpu, name, text));
        let changed = ours.iter().zip(seeds()).filter(|(after, before)| **after != *before).count();
        assert!(changed > 20, "{name} writes {changed} numbers only");
        let found = differences(&ours, &theirs);
        say(&format!("{name:12} {changed:3} numbers written, {} differ", found.len()));
        wrong.extend(found.into_iter().map(|what| format!("{name}: {what}")));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(programs.len() >= 10);
}

#[test]
fn comparison_with_glslang_sees_a_program_changed_at_one_place() {
    let Some(gpu) = device() else { return };
    for program in programs() {
        let ours = run(&gpu, &kilns(&gpu, &program.name, &program.changed()));
        let theirs = run(&gpu, &glslangs(&gpu, &program.name, &program.text));
        let found = differences(&ours, &theirs);
        assert!(!found.is_empty(), "{}: {:?} changed nothing", program.name, program.change);
    }
}
