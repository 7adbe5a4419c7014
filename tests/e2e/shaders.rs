//! Shaders from files to engines and pictures: the command line, both languages, workers that die.

use std::path::Path;

use kiln_link::TargetState;
use serde_json::Value;

use crate::harness::{Project, actions_with, ran, text};

fn check(project: &Project, arguments: &[&str]) -> (i32, Value) {
    let arguments: Vec<&str> = [&["shader", "check"], arguments, &["--json"]].concat();
    let output = project.run(&arguments);
    let report = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", text(&output.stderr)));
    (output.status.code().unwrap(), report)
}

#[test]
fn check_of_a_project_names_the_byte_range_of_a_fault_and_the_variants_that_have_it() {
    let project = Project::sample();
    let (code, report) = check(&project, &["DIR"]);
    assert_eq!((code, &report["ok"], &report["diagnostics"]), (0, &true.into(), &Value::Array(Vec::new())));
    let names = |shader: &Value| shader["variants"].as_array().unwrap().len();
    let shaders = report["shaders"].as_array().unwrap();
    assert!(shaders.iter().any(|shader| shader["shader"] == "pbr" && names(shader) > 3), "{report:#}");
    project.edit("shaders/pbr/sheen.wgsl", "fn ", "fn broken() -> f32 { return oops; }\nfn ");
    let (code, report) = check(&project, &["DIR"]);
    assert_eq!(code, 1);
    let fault = &report["diagnostics"][0];
    let at = project.read("shaders/pbr/sheen.wgsl").find("oops").unwrap();
    assert_eq!(fault["file"], "shaders/pbr/sheen.wgsl");
    assert_eq!(fault["span"]["byte_range"], serde_json::json!([at, at + 4]));
    let notes = fault["notes"].to_string();
    assert!(notes.contains("in 1 of ") && notes.contains("imported by shaders/pbr/pbr.wgsl"), "{notes}");
}

#[test]
fn check_of_files_needs_no_project_and_refuses_what_is_no_shader() {
    let project = Project::sample();
    std::fs::remove_file(project.path("kiln.toml")).unwrap();
    let file = |name: &str| project.path(name).to_string_lossy().into_owned();
    let mut command = project.command(&["shader", "check", "--json"]);
    let files = [file("shaders/lib/brdf.wgsl"), file("shaders/pbr/tonemap.wgsl")];
    // Modules are looked for up to the folder where the user stands.
    let output = command.args(files).current_dir(project.dir()).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stdout));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["shaders"].as_array().unwrap().len(), 2, "{report:#}");
    let readme = project.path("README.md");
    std::fs::write(&readme, "# no shader").unwrap();
    for refused in [readme.to_str().unwrap(), "no/such/file.wgsl"] {
        let output = project.run(&["shader", "check", refused]);
        assert_eq!(output.status.code(), Some(1));
        assert!(text(&output.stderr).contains(refused), "{}", text(&output.stderr));
    }
}

#[test]
fn warnings_are_errors_for_who_asks_for_that() {
    let project = Project::sample();
    project.edit(
        "shaders/pbr/tonemap.wgsl",
        "frame.exposure, vec3f(0.0)",
        "sqrt(frame.exposure), vec3f(0.0)",
    );
    let (code, report) = check(&project, &["DIR"]);
    let warning = &report["diagnostics"][0];
    assert_eq!((code, &warning["severity"]), (0, &"warning".into()), "{report:#}");
    assert!(warning["message"].as_str().unwrap().contains("sqrt"), "{warning:#}");
    assert_eq!(check(&project, &["DIR", "--deny-warnings"]).0, 1);
    assert_eq!(check(&project, &["DIR", "--deny-warnings", "--no-lint"]).0, 0);
    project.edit(
        "shaders/pbr/tonemap.wgsl",
        "    let radiance",
        "    // kiln: allow(domain) exposure is a power of two\n    let radiance",
    );
    let (_, report) = check(&project, &["DIR"]);
    assert_eq!(
        report["diagnostics"].as_array().unwrap().len(),
        1,
        "an allowance holds for its line and the next"
    );
}

#[test]
fn shader_is_emitted_for_engines_by_command_and_by_bake() {
    let project = Project::sample();
    let out = project.beside("emitted");
    let file = project.path("shaders/pbr/tonemap.wgsl");
    let emit = |arguments: &[&str]| {
        let mut command = project.command(&["shader", "emit"]);
        command.arg(&file).args(arguments).output().unwrap()
    };
    let all = ["--to", "wgsl,spirv,glsl,glsl-es,hlsl,msl", "--source-map", "--out", out.to_str().unwrap()];
    let output = emit(&all);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let files = |folder: &Path| -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    };
    let texts: Vec<String> = files(&out).into_iter().filter(|name| !name.ends_with(".json")).collect();
    let expected = ["es.frag.glsl", "es.vert.glsl", "frag.glsl", "hlsl", "metal", "spv", "vert.glsl", "wgsl"];
    assert_eq!(texts, expected.map(|end| format!("tonemap.{end}")));
    let map: Value = serde_json::from_slice(&std::fs::read(out.join("tonemap.map.json")).unwrap()).unwrap();
    assert!(map["functions"].to_string().contains("shaders/lib/colour.wgsl"), "{map:#}");
    let printed = emit(&["--to", "wgsl"]);
    assert_eq!(printed.stdout, std::fs::read(out.join("tonemap.wgsl")).unwrap());
    assert_eq!(emit(&["--to", "wgsl,hlsl"]).status.code(), Some(1), "two texts need a folder");

    project.edit("kiln.toml", "[shader.tonemap]\n", "[shader.tonemap]\nemit = [\"spirv\", \"glsl\"]\n");
    let (code, _) = project.bake();
    assert_eq!(code, 0);
    let baked = project.path("baked/emit/tonemap");
    assert_eq!(
        files(&baked),
        ["base.frag.glsl", "base.glsl.json", "base.spirv.json", "base.spv", "base.vert.glsl"]
    );
    assert_eq!(
        std::fs::read(baked.join("base.spv")).unwrap(),
        std::fs::read(out.join("tonemap.spv")).unwrap()
    );
}

#[test]
fn comments_and_renamed_locals_recompile_and_change_nothing_further() {
    let project = Project::sample();
    project.edit("kiln.toml", "[shader.tonemap]\n", "[shader.tonemap]\nemit = [\"spirv\"]\n");
    project.bake();
    let manifest = project.read("baked/manifest.json");
    project.edit("shaders/pbr/tonemap.wgsl", "let texel", "// the picture\n    let texel");
    project.edit("shaders/pbr/tonemap.wgsl", "let radiance", "let light");
    project.edit("shaders/pbr/tonemap.wgsl", "(radiance *", "(light *");
    let (_, report) = project.bake();
    assert_eq!(actions_with(&report, "ran"), ["compile shader/tonemap/base"]);
    assert_eq!(project.read("baked/manifest.json"), manifest);
    project.edit("shaders/pbr/tonemap.wgsl", "(light *", "(2.0 * light *");
    let (_, report) = project.bake();
    assert_eq!(
        actions_with(&report, "ran"),
        ["compile shader/tonemap/base", "emit shader/tonemap/base as spirv"]
    );
    assert_ne!(project.read("baked/manifest.json"), manifest);
}

#[test]
fn listed_variants_that_cannot_differ_are_compiled_once() {
    let project = Project::sample();
    let variants = "variants = [\"base\", \"sheen\", \"sheen+clearcoat\", \"nonsense\"]\n";
    project.edit("kiln.toml", "[shader.tonemap]\n", &format!("[shader.tonemap]\n{variants}"));
    let (_, report) = project.bake();
    let compiled: Vec<String> = actions_with(&report, "ran");
    let of_tonemap = compiled.iter().filter(|name| name.starts_with("compile shader/tonemap/"));
    assert_eq!(of_tonemap.collect::<Vec<_>>(), ["compile shader/tonemap/base"]);
    for variant in ["base", "sheen", "clearcoat+sheen", "nonsense"] {
        assert!(project.path(&format!("baked/shader/tonemap/{variant}.wgsl")).is_file(), "{variant}");
    }
    let counts = &report["shader_variants"];
    let [asked, compiled] = ["asked", "compiled"].map(|key| counts[key].as_u64().unwrap());
    assert_eq!(asked - compiled, 3, "{counts}");
    let warnings = report["diagnostics"].to_string();
    assert!(warnings.contains("no condition names `nonsense`"), "{warnings}");
}

/// A tonemap that shows its own texture.
const TEXTURED: &str = "@group(3) @binding(0) var grade: texture_2d<f32>;
@group(3) @binding(1) var any_sampler: sampler;
@vertex fn vs_main(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}
@fragment fn fs_main() -> @location(0) vec4f {
    return textureSampleLevel(grade, any_sampler, vec2f(1.25, 0.5), 0.0);
}
";

#[cfg(feature = "preview")]
#[test]
fn texture_of_the_author_is_bound_by_name_and_followed() {
    let project = Project::sample();
    project.write("shaders/pbr/tonemap.wgsl", TEXTURED);
    let own = |text: &str| format!("[shader.tonemap]\ntextures = [\"{text}\"]\n");
    project.edit("kiln.toml", "[shader.tonemap]\n", &own("grade=grade.png"));
    let watch = project.watch();
    let missing = watch.published()["diagnostics"].to_string();
    assert!(
        missing.contains("the texture's file was not found") && missing.contains("grade.png"),
        "{missing}"
    );
    // The left half is what (1.25, 0.5) repeats into.
    let picture = |left: [u8; 4]| {
        let texel = |x, _| image::Rgba(if x < 8 { left } else { [9, 9, 9, 255] });
        let mut file = std::io::Cursor::new(Vec::new());
        image::RgbaImage::from_fn(16, 4, texel).write_to(&mut file, image::ImageFormat::Png).unwrap();
        file.into_inner()
    };
    let pixel = |name: &str| {
        let out = project.beside(name);
        let mut command = project.command(&["preview", "DIR", "--headless", "--size", "16x8", "--out"]);
        let output = command.arg(&out).output().unwrap();
        let said = text(&output.stderr);
        if said.contains("mesa-vulkan-drivers") {
            crate::harness::skip("a texture of the author's", "there is no graphics device");
            return None;
        }
        assert!(output.status.success() && !said.contains("error"), "{said}");
        Some(image::open(out.join("frame_0001.png")).unwrap().to_rgb8().get_pixel(8, 4).0)
    };
    project.write("grade.png", picture([188, 64, 0, 255]));
    assert_eq!(ran(&watch.published()), ["check texture grade.png"]);
    let Some(linear) = pixel("linear") else { return };
    assert_eq!(linear, [188, 64, 0]);
    project.write("grade.png", picture([20, 64, 255, 255]));
    assert_eq!(ran(&watch.published()), ["check texture grade.png"]);
    assert_eq!(pixel("edited"), Some([20, 64, 255]));
    project.edit("kiln.toml", "grade.png", "grade.png srgb");
    watch.published();
    let colour = pixel("colour").unwrap();
    assert!(colour[1] < 16 && colour[2] == 255, "read as colours: {colour:?}");
    project.edit("kiln.toml", "grade=", "other=");
    watch.published();
    let mut command = project.command(&["preview", "DIR", "--headless", "--size", "16x8", "--out"]);
    let said = text(&command.arg(project.beside("none")).output().unwrap().stderr);
    assert!(said.contains("declares the texture `grade`, which nobody gives"), "{said}");
}

#[test]
fn worker_that_is_killed_is_replaced() {
    let project = Project::sample();
    let watch = project.watch();
    watch.published();
    let workers = watch.worker_ids();
    assert!(!workers.is_empty(), "shaders are compiled by child processes");
    for worker in &workers {
        let killed = std::process::Command::new("kill").args(["-9", &worker.to_string()]).status().unwrap();
        assert!(killed.success());
    }
    project.edit("shaders/pbr/tonemap.wgsl", "vec3f(1.0, 1.0, 1.0)", "vec3f(1.0, 0.9, 0.8)");
    let published = watch.published();
    assert_eq!(ran(&published), ["compile shader/tonemap/base"]);
    assert_eq!(
        published["diagnostics"].as_array().unwrap().iter().filter(|d| d["severity"] == "error").count(),
        0
    );
    assert!(watch.worker_ids().iter().all(|worker| !workers.contains(worker)));
}

/// 18 000 branches take naga longer than anybody waits; the worker is ended, and the daemon goes on.
#[test]
fn shader_that_takes_the_compiler_too_long_is_named_and_the_last_good_one_stays() {
    let project = Project::sample();
    let watch = project.watch();
    let client = watch.client("viewer");
    let good = client.revision();
    let original = project.read("shaders/pbr/tonemap.wgsl");
    let branches = "    if radiance.x > 0.5 { grade *= 1.01; }\n".repeat(18_000);
    let slow = original.replace(
        "    return vec4f(to_srgb",
        &format!("    var grade = 1.0;\n{branches}    return vec4f(grade * to_srgb"),
    );
    project.write("shaders/pbr/tonemap.wgsl", slow);
    let broken = client.revision();
    let fault = broken.table.diagnostics.iter().find(|diagnostic| diagnostic.is_error()).unwrap();
    assert!(fault.message.contains("was ended after 2 s"), "{fault}");
    assert_eq!(fault.file.as_deref(), Some("shaders/pbr/tonemap.wgsl"));
    let target = &broken.table.targets["shader/tonemap/base"];
    assert_eq!(
        (target.state, &target.parts),
        (TargetState::Stale, &good.table.targets["shader/tonemap/base"].parts)
    );
    project.write("shaders/pbr/tonemap.wgsl", original);
    assert_eq!(client.revision().table.targets, good.table.targets);
}

const VERTEX: &str = "#version 330 core
#include \"common.glsl\"
in vec3 position;
in vec3 normal;
uniform mat4 clip_from_world;
uniform mat4 world_from_object;
uniform mat4 world_from_object_normal;
out vec3 v_normal;
void main() {
    v_normal = turned(world_from_object_normal, normal);
    gl_Position = clip_from_world * world_from_object * vec4(position, 1.0);
}
";
const FRAGMENT: &str = "#version 330 core
#include \"common.glsl\"
in vec3 v_normal;
out vec4 color;
uniform samplerCube env_irradiance;
uniform mat4 environment_from_world;
uniform float irradiance_scale, environment_intensity;
uniform vec4 base_color_factor;
uniform float gain; // @slider(0, 2, 1)
void main() {
    vec3 direction = turned(environment_from_world, normalize(v_normal));
    vec3 light = textureLod(env_irradiance, direction, 0.0).rgb * irradiance_scale * environment_intensity;
    color = vec4(light * base_color_factor.rgb * gain, 1.0);
}
";
const COMMON: &str = "#pragma once
vec3 turned(mat4 m, vec3 v) { return (m * vec4(v, 0.0)).xyz; }
";
/// The same in WGSL.
const TWIN: &str = "import lib::frame::{frame, env_irradiance, env_sampler};
struct Material { base_color_factor: vec4f }
struct Draw { world_from_object: mat4x4f, world_from_object_normal: mat4x4f }
@group(1) @binding(0) var<uniform> material: Material;
@group(2) @binding(0) var<uniform> draw: Draw;
struct Varying { @builtin(position) position: vec4f, @location(0) normal: vec3f }
@vertex fn vs_main(@location(0) position: vec3f, @location(1) normal: vec3f) -> Varying {
    let world = draw.world_from_object * vec4f(position, 1.0);
    return Varying(frame.clip_from_world * world, (draw.world_from_object_normal * vec4f(normal, 0.0)).xyz);
}
@fragment fn fs_main(in: Varying) -> @location(0) vec4f {
    let direction = (frame.environment_from_world * vec4f(normalize(in.normal), 0.0)).xyz;
    let light = textureSampleLevel(env_irradiance, env_sampler, direction, 0.0).rgb;
    let scale = frame.irradiance_scale * frame.environment_intensity;
    return vec4f(light * scale * material.base_color_factor.rgb, 1.0);
}
";

fn with_glsl() -> Project {
    let project = Project::sample();
    project.write("shaders/plain.vert", VERTEX);
    project.write("shaders/plain.frag", FRAGMENT);
    project.write("shaders/common.glsl", COMMON);
    project.write("shaders/plain.wgsl", TWIN);
    project.edit(
        "kiln.toml",
        "source = \"shaders/pbr/pbr.wgsl\"",
        "source = [\"shaders/plain.vert\", \"shaders/plain.frag\"]",
    );
    project
}

#[cfg(feature = "preview")]
#[test]
fn glsl_material_is_drawn_as_its_twin_in_wgsl() {
    let project = with_glsl();
    let frame = |name: &str| {
        let watch = project.watch();
        let published = watch.published();
        let errors = published["diagnostics"].as_array().unwrap().iter().filter(|d| d["severity"] == "error");
        assert_eq!(errors.count(), 0, "{published:#}");
        let out = project.beside(name);
        let mut command = project.command(&["preview", "DIR", "--headless", "--size", "160x90", "--out"]);
        let output = command.arg(&out).output().unwrap();
        let said = text(&output.stderr);
        if said.contains("mesa-vulkan-drivers") {
            crate::harness::skip("a GLSL material", "there is no graphics device");
            return None;
        }
        assert!(output.status.success() && !said.contains("error"), "{said}");
        Some(image::open(out.join("frame_0001.png")).unwrap().to_rgb8())
    };
    let Some(glsl) = frame("glsl") else { return };
    project.edit(
        "kiln.toml",
        "source = [\"shaders/plain.vert\", \"shaders/plain.frag\"]",
        "source = \"shaders/plain.wgsl\"",
    );
    let wgsl = frame("wgsl").unwrap();
    let largest = |a: &image::RgbImage, b: &image::RgbImage| {
        let values = a.as_raw().iter().zip(b.as_raw());
        values.map(|(a, b)| a.abs_diff(*b)).max().unwrap()
    };
    assert!(largest(&glsl, &wgsl) <= 1, "{}", largest(&glsl, &wgsl));
    // The comparison sees another shader: only the material changes.
    project.edit("shaders/plain.wgsl", "light * scale", "0.5 * light * scale");
    assert!(largest(&glsl, &frame("darker").unwrap()) > 20);
}

#[test]
fn edits_of_glsl_and_its_includes_are_followed() {
    let project = with_glsl();
    let watch = project.watch();
    let client = watch.client("viewer");
    let first = client.revision();
    let compiled = |name: &str| ran(&watch.wait_for(name));
    watch.published();
    project.edit("shaders/common.glsl", "v, 0.0", "v * 1.0001, 0.0");
    assert_eq!(compiled("published"), ["compile shader/pbr/base"]);
    project.edit("shaders/common.glsl", "#pragma once", "#pragma once // a comment");
    watch.wait_for("unchanged");
    project.edit("shaders/common.glsl", "m * vec4", "m * vec5");
    let broken = client_until(&client, |revision| !revision.table.diagnostics.is_empty());
    let fault = broken.table.diagnostics.iter().find(|diagnostic| diagnostic.is_error()).unwrap();
    assert_eq!(fault.file.as_deref(), Some("shaders/common.glsl"), "{fault}");
    assert!(fault.span.as_ref().unwrap().source_line.contains("vec5"), "{fault}");
    // Includes that are not there yet are waited for.
    project.edit("shaders/common.glsl", "vec5", "vec4");
    project.edit(
        "shaders/plain.frag",
        "#include \"common.glsl\"",
        "#include \"common.glsl\"\n#include \"later.glsl\"",
    );
    client_until(&client, |revision| {
        revision.table.diagnostics.iter().any(|d| d.message.contains("later.glsl"))
    });
    project.write("shaders/later.glsl", "// nothing\n");
    let mended = client_until(&client, |revision| revision.table.diagnostics.is_empty());
    assert_eq!(mended.table.targets["shader/pbr/base"].state, TargetState::Fresh);
    assert_ne!(mended.table.targets["shader/pbr/base"], first.table.targets["shader/pbr/base"]);
}

/// The next revision of which `is_wanted` holds; the harness limits each wait.
fn client_until(
    client: &crate::harness::Viewer,
    is_wanted: impl Fn(&kiln_link::Revision) -> bool,
) -> std::sync::Arc<kiln_link::Revision> {
    loop {
        let revision = client.revision();
        if is_wanted(&revision) {
            return revision;
        }
    }
}
