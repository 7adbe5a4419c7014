//! What changes canonical text, what does not, and which names it keeps.

use std::collections::BTreeSet;

use super::cases::cases;
use super::shaders::shipped;
use super::{Files, compiled};
use crate::{BindingKind, Compiled, Program, Stage};

#[track_caller]
fn compile_one(text: &str) -> Compiled {
    compiled(Files::new(&[("a.wgsl", text)]).compile("a.wgsl", &[]))
}

const PLAIN: &str = "const GAIN: f32 = 2.0;
    @group(0) @binding(0) var<uniform> tint: vec4f;
    @fragment fn fs_main() -> @location(0) vec4f { let x = GAIN * 2.0; return tint * x; }";

#[test]
fn comments_space_and_unused_items_do_not_change_it() {
    let other =
        "// new\r\nconst GAIN : f32 = 2.0; const UNUSED: vec3f = vec3f(OTHER); const OTHER: f32 = 1.0;
    struct Unused { a: f32 } override unused: f32 = 1.0;
    fn unused_function() -> f32 { return GAIN; } /* also new */
    @group(0) @binding(0) var<uniform> tint: vec4f;
    @group(0) @binding(1) var<uniform> unused_variable: Unused;
    @fragment
    fn fs_main() -> @location(0) vec4f {
        let x = GAIN*2.0;
        return tint*x; // end";
    let other = format!("\u{feff}{other}\n}}");
    assert_eq!(compile_one(PLAIN), compile_one(&other));
}

#[test]
fn renamed_locals_do_not_change_it() {
    let text = "fn scaled(gain: f32) -> f32 { var sum = gain; let twice = sum * 2.0; sum += twice; return sum; }
        @fragment fn fs_main(@location(0) x: f32) -> @location(0) vec4f { let y = scaled(x); return vec4f(y); }";
    let mut other = text.to_owned();
    for (name, renamed) in [("gain", "g0"), ("sum", "scaled_"), ("twice", "value"), ("y", "variable_1")] {
        other = other.replace(name, renamed);
    }
    assert_eq!(compile_one(text), compile_one(&other));
    assert_ne!(compile_one(text).wgsl, compile_one(&text.replace("sum += twice", "sum -= twice")).wgsl);
}

#[test]
fn a_changed_constant_changes_it() {
    assert_ne!(compile_one(PLAIN).wgsl, compile_one(&PLAIN.replace("2.0;\n", "2.5;\n")).wgsl);
}

#[test]
fn compiling_canonical_text_again_keeps_the_interface() {
    let first = compile_one(PLAIN);
    assert_eq!(first.reflection, compile_one(&first.wgsl).reflection);
}

/// naga's writer puts constants where their names stood: its parser then computes, and refuses some of it.
#[test]
fn let_that_names_a_constant_stays() {
    let shader = |statements: &str| {
        format!(
            "const LEVEL: f32 = 0.76; @group(0) @binding(0) var<storage, read_write> out: array<f32>;
            @compute @workgroup_size(1) fn main() {{ {statements} out[0] = x; }}"
        )
    };
    for statements in [
        "let s = 0.8 - 0.04; let x = 1.0 - s;",
        "let s = LEVEL; let x = 1.0 - s * s;",
        "let zero = 0.0; let x = 1.0 / zero;",
        "let zero = vec2i(); let x = f32((vec2i(4) / zero).x);",
        "let n = 4u; let x = f32(out[n]) + f32(2u << n);",
        "var x = 1.0; for (var i = 0; i < 3; i++) { let s = 2.0; x *= 1.0 - s; let t = 3.0; x += t; }",
        "let s = -2147483647 - 1; let x = f32(s + 1);",
    ] {
        let first = compile_one(&shader(statements)).wgsl;
        assert_eq!(first, compile_one(&first).wgsl, "{statements}");
    }
    let with = |value: &str| compile_one(&shader(&format!("let s = {value}; let x = 1.0 - s;"))).wgsl;
    assert_ne!(with("0.5"), with("0.25"));
}

#[test]
fn every_program_of_the_tests_compiles_again_to_the_same_text() {
    let cases = cases().into_iter().map(|(name, case)| (name, case.compile()));
    let all = shipped().0.into_keys().map(|path| {
        let outcome = shipped().compile(&path, &[]);
        (path, outcome)
    });
    let texts: Vec<(String, String)> =
        cases.chain(all).filter_map(|(name, outcome)| Some((name, outcome.compiled?.wgsl))).collect();
    assert!(texts.len() > 40, "{} texts", texts.len());
    for (name, text) in texts {
        let again = compile_one(&text).wgsl;
        let differs = text.lines().zip(again.lines()).find(|(first, again)| first != again);
        assert!(differs.is_none() && text == again, "{name}: {differs:?}");
    }
}

/// Names that naga would change: they end in digits or `_`, or locals of functions written earlier have them.
const HARD_NAMES: &str = "
    struct In { @location(1) uv1: vec2f, @location(0) uv0: vec2f, @location(2) x__y: f32, }
    struct Params { m0: vec4f, lights: array<vec4f, 3>, level_: f32 }
    @group(1) @binding(2) var<uniform> params0: Params;
    @group(0) @binding(1) var map2: texture_2d<f32>;
    @group(0) @binding(0) var sampler_: sampler;
    @group(0) @binding(3) var<storage, read_write> position: array<u32>;
    @id(7) override gain2: f32 = 1.0;
    fn helper(params0: f32) -> f32 { var map2 = params0 * 2.0; map2 += 1.0; var params0_v = map2; return map2 * params0_v; }
    @vertex fn main2(in: In) -> @builtin(position) vec4f {
        var main3 = helper(in.uv0.x);
        return params0.m0 * (in.x__y + in.uv1.y) * main3 + params0.lights[1] * params0.level_;
    }
    @fragment fn main3(@builtin(position) at: vec4f) -> @location(0) vec4f {
        position[0] = 1u;
        return gain2 * textureSample(map2, sampler_, at.xy);
    }
    @compute @workgroup_size(8, 4) fn main4() { position[1] = 2u; }";

#[test]
fn author_names_survive_in_text_and_reflection() {
    let Compiled { wgsl, reflection } = compile_one(HARD_NAMES);
    for part in [
        "uv0: vec2<f32>",
        "x__y: f32",
        "level_: f32",
        "var<uniform> params0: Params",
        "var map2: texture_2d<f32>",
        "var sampler_: sampler",
        "override gain2: f32",
        "@builtin(position)",
        "fn main2(",
    ] {
        assert!(wgsl.contains(part), "no {part:?} in:\n{wgsl}");
    }
    let names: Vec<&str> = reflection.entry_points.iter().map(|entry| entry.name.as_str()).collect();
    assert_eq!(names, ["main2", "main3", "main4"]);
    let inputs: Vec<_> = reflection.entry_points[0]
        .inputs
        .iter()
        .map(|input| (input.location, input.name.as_str(), input.ty.as_str()))
        .collect();
    assert_eq!(inputs, [(0, "uv0", "vec2<f32>"), (1, "uv1", "vec2<f32>"), (2, "x__y", "f32")]);
    assert_eq!(reflection.entry_points[2].workgroup_size, [8, 4, 1]);
    let bindings: Vec<_> = reflection
        .bindings
        .iter()
        .map(|binding| (binding.group, binding.binding, binding.name.as_str()))
        .collect();
    assert_eq!(bindings, [(0, 0, "sampler_"), (0, 1, "map2"), (0, 3, "position"), (1, 2, "params0")]);
    assert_eq!(reflection.bindings[2].stages, [Stage::Fragment, Stage::Compute]);
    assert_eq!(reflection.bindings[2].kind, BindingKind::Storage { read_only: false, size_bytes: 4 });
}

#[test]
fn reflected_offsets_follow_wgsl_layout() {
    let reflection = compile_one(HARD_NAMES).reflection;
    let BindingKind::Uniform { size_bytes, members } = &reflection.bindings[3].kind else {
        panic!("params0 is a uniform: {:?}", reflection.bindings[3])
    };
    let layout: Vec<_> = members
        .iter()
        .map(|member| (member.name.as_str(), member.ty.as_str(), member.offset_bytes, member.size_bytes))
        .collect();
    assert_eq!(
        layout,
        [("m0", "vec4<f32>", 0, 16), ("lights", "array<vec4<f32>, 3>", 16, 48), ("level_", "f32", 64, 4)]
    );
    assert_eq!(*size_bytes, 80);
}

/// naga's writer drops `@align` and `@size`, and a host that fills the block as the author laid it out would miss.
#[test]
fn layout_that_the_author_chose_is_kept_in_the_text() {
    const SHADER: &str = "
        struct Inner { @size(24) a: vec2f, @size(8) b: f32 }
        struct Block {
            a: f32,
            @align(16) b: f32,
            @size(24) c: vec2f,
            d: vec3f,
            @align(32) e: Inner,
            list: array<Inner, 2>,
            @size(64) last: f32,
        }
        @group(0) @binding(0) var<uniform> block: Block;
        @fragment fn fs_main() -> @location(0) vec4f {
            return vec4f(block.a + block.b + block.c.x + block.e.b, block.d) * block.last * block.list[1].b;
        }";
    let layout = |shader: &str| -> (u32, Vec<(String, u32)>) {
        let reflection = compile_one(shader).reflection;
        let BindingKind::Uniform { size_bytes, members } = &reflection.bindings[0].kind else {
            panic!("a uniform: {:?}", reflection.bindings[0])
        };
        (*size_bytes, members.iter().map(|member| (member.name.clone(), member.offset_bytes)).collect())
    };
    let (size, members) = layout(SHADER);
    let offsets: Vec<u32> = members.iter().map(|(_, offset)| *offset).collect();
    assert_eq!(offsets, [0, 16, 24, 48, 64, 96, 160]);
    // What a pipeline is made of has the same layout as what was reflected of the author's text.
    let text = compile_one(SHADER).wgsl;
    assert_eq!(layout(&text), (size, members));
    assert_ne!(layout(&text.replace("@size(16) a", "a")).1[1].1, 16, "the check sees a lost attribute");
    assert_eq!(text.matches("@size").count(), 4, "only where WGSL would do otherwise:\n{text}");
}

#[test]
fn words_of_attributes_are_no_names() {
    let text = "var<private> centroid: f32 = 1.0; var<private> position: f32 = 2.0;
        struct In { @location(0) @interpolate(perspective, centroid) uv: vec2f, @builtin(position) at: vec4f }
        @fragment fn fs_main(in: In) -> @location(0) vec4f { return vec4f(in.uv, in.at.x * position, centroid); }";
    let wgsl = compile_one(text).wgsl;
    assert!(wgsl.contains("@interpolate(perspective, centroid)"), "{wgsl}");
}

#[test]
fn halves_are_packed_without_optional_features() {
    compile_one(
        "@fragment fn fs_main(@location(0) x: vec2f) -> @location(0) vec4f {
        return vec4f(unpack2x16float(pack2x16float(x)), quantizeToF16(x)); }",
    );
}

#[test]
fn arithmetic_of_halves_is_refused_as_optional() {
    let text = "enable f16;
        @fragment fn fs_main(@location(0) x: f32) -> @location(0) vec4f { return vec4f(f32(f16(x))); }";
    let outcome = Files::new(&[("a.wgsl", text)]).compile("a.wgsl", &[]);
    assert!(outcome.compiled.is_none());
    assert!(
        format!("{:?}", outcome.diagnostics[0].help).contains("optional features"),
        "{:?}",
        outcome.diagnostics
    );
}

#[test]
fn storage_textures_and_depth_are_reflected() {
    let reflection = compile_one(
        "@group(0) @binding(0) var out: texture_storage_2d_array<rgba16float, write>;
        @group(0) @binding(1) var shadow: texture_depth_2d;
        @group(0) @binding(2) var compare: sampler_comparison;
        @group(0) @binding(3) var samples: texture_multisampled_2d<u32>;
        @compute @workgroup_size(1) fn main() {
            let d = textureSampleCompareLevel(shadow, compare, vec2f(0.5), 0.5);
            textureStore(out, vec2u(0), 0u, vec4f(d) + vec4f(textureLoad(samples, vec2u(0), 0)));
        }",
    )
    .reflection;
    let kinds: Vec<BindingKind> = reflection.bindings.into_iter().map(|binding| binding.kind).collect();
    let texture = |dimension: &str, sample: &str, multisampled| BindingKind::Texture {
        dimension: dimension.into(),
        sample: sample.into(),
        multisampled,
    };
    let storage = BindingKind::StorageTexture {
        dimension: "2d_array".into(),
        format: "rgba16float".into(),
        access: "write".into(),
    };
    assert_eq!(
        kinds,
        [
            storage,
            texture("2d", "depth", false),
            BindingKind::Sampler { comparison: true },
            texture("2d", "uint", true)
        ]
    );
}

#[test]
fn directives_of_modules_are_hoisted_once() {
    let module = "diagnostic(off, derivative_uniformity);\nfn f() -> f32 { return 1.0; }";
    let root = "import b::f;\ndiagnostic(off, derivative_uniformity);\n@fragment fn fs_main() { _ = f(); }";
    compiled(Files::new(&[("a.wgsl", root), ("b.wgsl", module)]).compile("a.wgsl", &[]));
}

#[test]
fn modules_imported_twice_are_joined_once() {
    let files = Files::new(&[
        ("a.wgsl", "import b::f;\nimport c::g;\n@fragment fn fs_main() { _ = f() + g(); }"),
        ("b.wgsl", "import super::d::h;\nfn f() -> f32 { return h(); }"),
        ("c.wgsl", "import package::d::h;\nfn g() -> f32 { return h(); }"),
        ("d.wgsl", "fn h() -> f32 { return 1.0; } // no line end"),
    ]);
    let outcome = files.compile("a.wgsl", &[]);
    let paths: Vec<&str> = outcome.dependencies.iter().map(|dependency| dependency.path.as_str()).collect();
    assert_eq!(paths, ["a.wgsl", "b.wgsl", "d.wgsl", "c.wgsl"]);
    assert_eq!(compiled(outcome).wgsl.matches("fn h()").count(), 1);
}

#[test]
fn each_file_is_read_once_and_missing_candidates_are_dependencies() {
    let files = Files::new(&[
        ("s/pbr/a.wgsl", "import lib::b::f;\nimport lib::c::g;\n@fragment fn fs_main() { _ = f() + g(); }"),
        ("s/lib/b.wgsl", "import lib::c::g;\nfn f() -> f32 { return g(); }"),
        ("lib/c.wgsl", "fn g() -> f32 { return 1.0; }"),
    ]);
    let mut read = Vec::new();
    let outcome = crate::compile(&Program::of("s/pbr/a.wgsl"), &BTreeSet::new(), &mut |path| {
        read.push(path.to_owned());
        files.0.get(path).cloned()
    });
    let looked: Vec<(&str, bool)> =
        outcome.dependencies.iter().map(|dependency| (dependency.path.as_str(), dependency.found)).collect();
    assert_eq!(
        looked,
        [
            ("s/pbr/a.wgsl", true),
            ("s/pbr/lib/b.wgsl", false),
            ("s/lib/b.wgsl", true),
            ("s/lib/lib/c.wgsl", false),
            ("s/lib/c.wgsl", false),
            ("lib/c.wgsl", true),
            ("s/pbr/lib/c.wgsl", false),
        ]
    );
    assert_eq!(read, looked.iter().map(|(path, _)| *path).collect::<Vec<_>>());
    compiled(outcome);
}
