//! Files in all languages, read by reference compilers where those are installed.

use std::io::Write;
use std::process::{Command, Stdio};

use super::shaders::{FEATURES, shipped};
use super::{Files, compiled};
use crate::{
    BoundResource, EmitError, Emitted, GlslNamespace, Language, MslNamespace, Slot, Stage, compile, emit,
};

#[expect(clippy::print_stderr, reason = "a skipped test says so")]
fn say_skipped(program: &str) {
    eprintln!("SKIPPED: {program} is not installed, so nothing reads what was written");
}

/// Whether `program` takes `input`, with what it says; nothing where it is not installed.
fn run(program: &str, arguments: &[&str], input: &[u8]) -> Option<Result<(), String>> {
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let Ok(mut child) = command.spawn() else {
        say_skipped(program);
        return None;
    };
    // A program that has seen enough closes the pipe; what counts is its verdict.
    let _ = child.stdin.take().unwrap().write_all(input);
    let output = child.wait_with_output().unwrap();
    let text =
        [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    Some(if output.status.success() { Ok(()) } else { Err(text) })
}

/// Whether the reference compiler of `language` takes `file`. HLSL is read by glslang's front end, which is not
/// the compiler that Direct3D uses; for MSL there is none here, so only its shape is looked at.
fn check(language: Language, file: &Emitted) -> Result<(), String> {
    let entry = file.bindings.entry_points.iter();
    let mut results = entry.filter_map(|entry| {
        let stage = match entry.stage {
            Stage::Vertex => "vert",
            Stage::Fragment => "frag",
            Stage::Compute => "comp",
        };
        match language {
            Language::Wgsl => {
                Some(naga::front::wgsl::parse_str(text(file)).map(drop).map_err(|e| e.to_string()))
            }
            Language::SpirV => run("spirv-val", &["--target-env", "vulkan1.1", "-"], &file.bytes),
            Language::Glsl | Language::GlslEs => {
                run("glslangValidator", &["--stdin", "-S", stage], &file.bytes)
            }
            Language::Hlsl => {
                let name = &entry.emitted_name;
                let arguments = ["--stdin", "-D", "-V", "-S", stage, "-e", name, "-o", "/dev/null"];
                run("glslangValidator", &arguments, &file.bytes).map(|result| result.and(check_shape(file)))
            }
            Language::Msl => Some(check_shape(file)),
        }
    });
    results.try_for_each(|result| result)
}

/// Brackets pair up and each entry point is there.
fn check_shape(file: &Emitted) -> Result<(), String> {
    let text = text(file);
    for (open, close) in [('(', ')'), ('{', '}'), ('[', ']')] {
        let count = |wanted| text.chars().filter(|character| *character == wanted).count();
        if count(open) != count(close) {
            return Err(format!("`{open}` and `{close}` do not pair up"));
        }
    }
    let missing =
        file.bindings.entry_points.iter().find(|entry| !text.contains(&format!(" {}(", entry.emitted_name)));
    missing.map_or(Ok(()), |entry| Err(format!("there is no {}", entry.emitted_name)))
}

fn text(file: &Emitted) -> &str {
    std::str::from_utf8(&file.bytes).unwrap()
}

fn canonical(source: &str) -> String {
    compiled(Files::new(&[("a.wgsl", source)]).compile("a.wgsl", &[])).wgsl
}

#[track_caller]
fn emitted(wgsl: &str, language: Language) -> Vec<Emitted> {
    emit(wgsl, language).unwrap_or_else(|error| panic!("{language}: {error}"))
}

#[track_caller]
fn check_all(what: &str, wgsl: &str, languages: &[Language]) {
    for &language in languages {
        let files = emitted(wgsl, language);
        assert_eq!(files, emitted(wgsl, language), "{what} in {language} twice");
        for file in files {
            if let Err(error) = check(language, &file) {
                panic!("{what} in {language} is refused: {error}\n{}", String::from_utf8_lossy(&file.bytes));
            }
        }
    }
}

/// A compute shader over buffers and a storage texture.
const COMPUTE: &str = "
    struct Parameters { scale: f32, count: u32 }
    @group(0) @binding(0) var<uniform> parameters: Parameters;
    @group(0) @binding(1) var<storage> input: array<vec4f>;
    @group(1) @binding(0) var<storage, read_write> output: array<vec4f>;
    @group(1) @binding(3) var image: texture_storage_2d<rgba16float, write>;
    override factor: f32 = 2.0;
    var<workgroup> shared_sum: array<vec4f, 64>;
    @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) index: u32) {
        shared_sum[index] = input[id.x] * parameters.scale * factor;
        workgroupBarrier();
        if id.x < parameters.count { output[id.x] = shared_sum[63u - index]; }
        textureStore(image, vec2i(id.xy), shared_sum[0]);
    }";

/// Vertex and fragment stages with what is special in them.
const DRAWN: &str = "
    struct Varying { @builtin(position) position: vec4f, @location(0) uv: vec2f, @location(1) @interpolate(flat, either) id: u32 }
    struct Out { @location(0) color: vec4f, @builtin(frag_depth) depth: f32 }
    @group(0) @binding(0) var<uniform> offsets: array<vec4f, 4>;
    @group(0) @binding(4) var color: texture_2d<f32>;
    @group(1) @binding(2) var layers: texture_depth_2d_array;
    @group(1) @binding(3) var linear: sampler;
    @group(1) @binding(7) var shadow: sampler_comparison;
    @vertex fn vs_main(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32, @location(0) at: vec3f) -> Varying {
        return Varying(vec4f(at, 1.0) + offsets[instance], vec2f(f32(vertex)), instance);
    }
    @fragment fn fs_main(in: Varying) -> Out {
        var sum = textureSample(color, linear, in.uv) + textureLoad(color, vec2i(in.position.xy), 0);
        for (var i = 0; i < 4; i++) { sum[i] += textureSampleCompareLevel(layers, shadow, in.uv, i, 0.5); }
        return Out(sum, f32(in.id) * dpdy(in.uv.y));
    }
    @fragment fn fs_other() -> @location(0) vec4f { return vec4f(1.0); }";

#[test]
fn shipped_shaders_are_written_in_all_languages() {
    let files = shipped();
    let all: Vec<&str> = FEATURES.iter().copied().filter(|name| *name != "unlit").collect();
    let mut shaders = vec![("background", vec![]), ("tonemap", vec![]), ("pbr", vec![]), ("pbr", all)];
    shaders.extend(FEATURES.iter().map(|feature| ("pbr", vec![*feature])));
    for (name, features) in shaders {
        let wgsl = compiled(files.compile(&format!("shaders/pbr/{name}.wgsl"), &features)).wgsl;
        let what = format!("{name} with {features:?}");
        if !features.iter().any(|feature| STORED.contains(feature)) {
            check_all(&what, &wgsl, &Language::ALL);
            continue;
        }
        check_all(
            &what,
            &wgsl,
            &Language::ALL.into_iter().filter(|it| *it != Language::GlslEs).collect::<Vec<_>>(),
        );
        let refused =
            emit(&wgsl, Language::GlslEs).expect_err("OpenGL ES 3.0 has no such buffers").to_string();
        assert!(
            refused.contains("cannot express storage buffers") && refused.contains("`vs_main`"),
            "{refused}"
        );
    }
}

/// Features that read storage buffers.
const STORED: [&str; 3] = ["instancing", "morph", "skin"];

#[test]
fn synthetic_shaders_are_written_where_they_can_be() {
    check_all("drawn", &canonical(DRAWN), &Language::ALL);
    let compute = canonical(COMPUTE);
    check_all("compute", &compute, &[Language::Wgsl, Language::SpirV, Language::Glsl, Language::Msl]);
    // glslang's front end for HLSL does not know `(float4[64])0`, as workgroup memory is cleared.
    check_shape(&emitted(&compute, Language::Hlsl)[0]).unwrap();
}

#[test]
fn checker_refuses_damaged_files() {
    let wgsl = canonical(DRAWN);
    for language in Language::ALL {
        for mut file in emitted(&wgsl, language) {
            match language {
                // Word 3 is the bound of ids.
                Language::SpirV => file.bytes[12..16].fill(0),
                _ => file.bytes.extend(b"{ x"),
            }
            let installed = match language {
                Language::SpirV => run("spirv-val", &["--version"], &[]).is_some(),
                Language::Glsl | Language::GlslEs => run("glslangValidator", &["--version"], &[]).is_some(),
                _ => true,
            };
            assert!(!installed || check(language, &file).is_err(), "{language}");
        }
    }
}

#[track_caller]
fn check_refused(source: &str, languages: &[Language], entry: &str, expected: &str) {
    let wgsl = canonical(source);
    for &language in languages {
        match emit(&wgsl, language) {
            Err(EmitError::Unsupported { entry_point, what, help, language: named }) => {
                assert_eq!((entry_point.as_str(), what.as_str(), named), (entry, expected, language));
                assert!(!help.is_empty());
            }
            other => panic!("{language}: {other:?}"),
        }
    }
}

#[test]
fn what_glsl_lacks_is_an_error_that_names_the_entry_point() {
    let (es, both) = ([Language::GlslEs], [Language::Glsl, Language::GlslEs]);
    let compute = "@compute @workgroup_size(1) fn main() {}";
    check_refused(compute, &es, "main", "compute shaders");
    let storage = "@group(0) @binding(0) var<storage> b: array<vec4f>; @fragment fn fs() -> @location(0) vec4f { return b[0]; }";
    check_refused(storage, &es, "fs", "storage buffers and arrays without a size");
    let image = "@group(0) @binding(0) var i: texture_storage_2d<rgba8unorm, write>; @fragment fn fs() { textureStore(i, vec2i(0), vec4f(1.0)); }";
    check_refused(image, &es, "fs", "storage textures");
    let two = "@group(0) @binding(0) var t: texture_2d<f32>; @group(0) @binding(1) var a: sampler; @group(0) @binding(2) var b: sampler;
        @fragment fn fs(@location(0) x: vec2f) -> @location(0) vec4f { return textureSample(t, a, x) + textureSample(t, b, x); }";
    check_refused(two, &both, "fs", "a texture that is read with two samplers");
    let first = "@fragment fn fs(@location(0) @interpolate(flat, first) x: u32) -> @location(0) vec4f { return vec4f(f32(x)); }";
    check_refused(first, &both, "fs", "`@interpolate(flat, first)`");
}

#[test]
fn entry_point_is_not_refused_for_what_another_needs() {
    let source = "@group(0) @binding(0) var t: texture_cube_array<f32>; @group(0) @binding(1) var s: sampler;
        @vertex fn vs() -> @builtin(position) vec4f { return vec4f(0.0); }
        @fragment fn fs() -> @location(0) vec4f { return textureSample(t, s, vec3f(1.0), 0); }";
    check_refused(source, &[Language::GlslEs], "fs", "cube arrays");
}

#[test]
fn overrides_become_their_defaults_and_open_ones_are_named() {
    let source =
        "override scale: f32 = 0.375; @fragment fn fs() -> @location(0) vec4f { return vec4f(scale); }";
    let file = &emitted(&canonical(source), Language::Glsl)[0];
    assert!(text(file).contains("0.375"), "{}", text(file));
    let wgsl = canonical(&source.replace(" = 0.375", ""));
    let missing = |language| EmitError::OverrideWithoutDefault { language, name: "scale".to_owned() };
    for language in [Language::SpirV, Language::Glsl, Language::GlslEs, Language::Hlsl, Language::Msl] {
        assert_eq!(emit(&wgsl, language), Err(missing(language)));
    }
    assert!(emit(&wgsl, Language::Wgsl).is_ok());
}

#[test]
fn invalid_text_is_an_error() {
    assert!(matches!(emit("fn f( {", Language::SpirV), Err(EmitError::Invalid(_))));
    assert!(matches!(emit("fn f() -> f32 {}", Language::SpirV), Err(EmitError::Invalid(_))));
}

/// The slot of `name` in the file that has it first.
#[track_caller]
fn slot(files: &[Emitted], name: &str) -> Slot {
    let mut resources = files.iter().flat_map(|file| &file.bindings.resources);
    let found: Option<&BoundResource> = resources.find(|resource| resource.name == name);
    found.unwrap_or_else(|| panic!("no {name}")).slot.clone()
}

#[test]
fn bindings_say_what_the_text_says() {
    let wgsl = canonical(DRAWN);
    let slot_in = |language, name| slot(&emitted(&wgsl, language), name);
    assert_eq!(slot_in(Language::SpirV, "shadow"), Slot::Descriptor { set: 1, binding: 7 });

    let hlsl = emitted(&wgsl, Language::Hlsl);
    assert_eq!(slot(&hlsl, "shadow"), Slot::Register { register: "s7".to_owned(), space: 1 });
    assert!(text(&hlsl[0]).contains("SamplerComparisonState shadow : register(s7, space1);"));
    assert_eq!(slot(&hlsl, "color"), Slot::Register { register: "t4".to_owned(), space: 0 });
    assert!(text(&hlsl[0]).contains("Texture2D<float4> color : register(t4);"), "{}", text(&hlsl[0]));

    let index = |namespace, index| Slot::Index { namespace, index };
    let msl = emitted(&wgsl, Language::Msl);
    assert_eq!(slot(&msl, "offsets"), index(MslNamespace::Buffer, 0));
    assert_eq!(slot(&msl, "layers"), index(MslNamespace::Texture, 1));
    assert_eq!(slot(&msl, "shadow"), index(MslNamespace::Sampler, 1));
    assert!(text(&msl[0]).contains("shadow [[sampler(1)]]"));

    for language in [Language::Glsl, Language::GlslEs] {
        let files = emitted(&wgsl, language);
        let Slot::Uniform { namespace, symbol, index, sampler } = slot(&files, "layers") else { panic!() };
        assert_eq!((namespace, index, sampler.as_deref()), (GlslNamespace::Texture, 1, Some("shadow")));
        assert!(text(&files[1]).contains(&format!("sampler2DArrayShadow {symbol};")));
        let declared =
            text(&files[1]).contains(&format!("layout(binding = 1) uniform sampler2DArrayShadow {symbol};"));
        assert_eq!(declared, language == Language::Glsl);
        let Slot::Uniform { namespace, symbol, .. } = slot(&files, "offsets") else { panic!() };
        assert_eq!(namespace, GlslNamespace::UniformBlock);
        assert!(text(&files[0]).contains(&format!("uniform {symbol} {{")), "{}", text(&files[0]));
    }
    let sizes = emitted(&canonical(COMPUTE), Language::Msl)[0].bindings.buffer_sizes;
    assert_eq!(sizes, Some(3));
}

#[test]
fn files_have_names_of_their_own() {
    let suffixes = |source, language| -> Vec<String> {
        emitted(&canonical(source), language).into_iter().map(|file| file.file_suffix).collect()
    };
    assert_eq!(suffixes(DRAWN, Language::Glsl), [".vert.glsl", ".fs_main.frag.glsl", ".fs_other.frag.glsl"]);
    assert_eq!(suffixes(COMPUTE, Language::Glsl), [".comp.glsl"]);
    assert_eq!(suffixes(DRAWN, Language::GlslEs)[0], ".es.vert.glsl");
    assert_eq!(suffixes(DRAWN, Language::Msl), [".metal"]);
    // `main` is a name of MSL's own.
    let entry = &emitted(&canonical(COMPUTE), Language::Msl)[0].bindings.entry_points[0];
    assert_eq!((entry.name.as_str(), entry.emitted_name.as_str()), ("main", "main_"));
}

#[test]
fn clip_space_is_converted_in_glsl_only() {
    let adjusted = "gl_Position.yz = vec2(-gl_Position.y, gl_Position.z * 2.0 - gl_Position.w);";
    let wgsl = canonical(DRAWN);
    assert!(text(&emitted(&wgsl, Language::Glsl)[0]).contains(adjusted));
    assert!(text(&emitted(&wgsl, Language::GlslEs)[0]).contains(adjusted));
    let notes = |language: Language| emitted(&wgsl, language)[0].notes.join("; ");
    assert!(notes(Language::SpirV).contains("negative height"));
    assert!(notes(Language::Glsl).contains("`GL_CW`") && notes(Language::Glsl).contains("first instance"));
    assert!(
        notes(Language::Hlsl).contains("`SV_VertexID`") && notes(Language::Hlsl).contains("`SV_InstanceID`")
    );
}

#[test]
fn more_resources_than_places_are_refused() {
    let group = "@group(300) @binding(0) var<uniform> u: vec4f; @fragment fn fs() -> @location(0) vec4f { return u; }";
    let many = |language, what, limit| Err(EmitError::TooMany { language, what, limit });
    let wgsl = canonical(group);
    assert_eq!(emit(&wgsl, Language::Hlsl), many(Language::Hlsl, "bind groups", 255));
    let declared: String =
        (0..31).map(|index| format!("@group(0) @binding({index}) var<uniform> u{index}x: f32;")).collect();
    let sum: Vec<String> = (0..31).map(|index| format!("u{index}x")).collect();
    let source =
        format!("{declared} @fragment fn fs() -> @location(0) vec4f {{ return vec4f({}); }}", sum.join("+"));
    assert_eq!(emit(&canonical(&source), Language::Msl), many(Language::Msl, "buffers", 30));
}

#[test]
fn languages_are_known_by_their_names() {
    for language in Language::ALL {
        assert_eq!(Language::parse(language.name()), Some(language));
    }
    assert_eq!(Language::parse("glsl-es"), Some(Language::GlslEs));
    assert_eq!(Language::parse("GLSL"), None);
}

/// The worst that limits allow, on the real stack.
#[test]
fn deepest_allowed_shaders_are_written() {
    let nested = |open: &str, inner: &str, close: &str, count| {
        format!("{}{inner}{}", open.repeat(count), close.repeat(count))
    };
    let returning = |value: String| {
        format!("@fragment fn fs(@location(0) x: f32) -> @location(0) vec4f {{ return vec4f({value}); }}")
    };
    let texts = [
        returning(format!("{}x", "x+".repeat(190))),
        returning(nested("sin(", "x", ")", 90)),
        format!("@fragment fn fs() {}", nested("{", "", "}", 90)),
        format!("@fragment fn fs() {{ {} }}", nested("loop {", "break;", "}", 90)),
    ];
    for source in texts {
        let outcome = compile(&crate::Program::of("a.wgsl"), &Default::default(), &mut |_| {
            Some(source.as_str().into())
        });
        let wgsl = compiled(outcome).wgsl;
        Language::ALL.into_iter().for_each(|language| drop(emitted(&wgsl, language)));
    }
}

/// WGSL's functions, as expressions of a scalar `x: f32`, integers `i: i32` and `u: u32`, and textures.
pub(super) const EXPRESSIONS: &[&str] = &[
    "abs(x)",
    "acos(x)",
    "acosh(x)",
    "asin(x)",
    "asinh(x)",
    "atan(x)",
    "atanh(x)",
    "atan2(x, x)",
    "ceil(x)",
    "clamp(x, x, x)",
    "cos(x)",
    "cosh(x)",
    "degrees(x)",
    "exp(x)",
    "exp2(x)",
    "floor(x)",
    "fma(x, x, x)",
    "fract(x)",
    "frexp(x).fract",
    "inverseSqrt(x)",
    "ldexp(x, i)",
    "log(x)",
    "log2(x)",
    "max(x, x)",
    "min(x, x)",
    "mix(x, x, x)",
    "modf(x).fract",
    "pow(x, x)",
    "radians(x)",
    "round(x)",
    "saturate(x)",
    "sign(x)",
    "sin(x)",
    "sinh(x)",
    "smoothstep(x, x, x)",
    "sqrt(x)",
    "step(x, x)",
    "tan(x)",
    "tanh(x)",
    "trunc(x)",
    "x % 2.0",
    "bitcast<f32>(i)",
    "f32(countLeadingZeros(i))",
    "f32(countOneBits(i))",
    "f32(countTrailingZeros(i))",
    "f32(extractBits(i, 1u, 2u))",
    "f32(firstLeadingBit(i))",
    "f32(firstLeadingBit(u))",
    "f32(firstTrailingBit(u))",
    "f32(reverseBits(i))",
    "f32(insertBits(i, i, 1u, 2u))",
    "f32(i / i)",
    "f32(i % i)",
    "f32(u % u)",
    "f32(u / u)",
    "f32(i << u)",
    "f32(dot(vec2i(i), vec2i(i)))",
    "f32(sign(i))",
    "f32(abs(i))",
    "f32(clamp(i, i, i))",
    "f32(pack4x8snorm(vec4f(x)))",
    "f32(pack4x8unorm(vec4f(x)))",
    "f32(pack2x16snorm(vec2f(x)))",
    "f32(pack2x16unorm(vec2f(x)))",
    "f32(pack4xI8(vec4i(i)))",
    "f32(pack4xU8(vec4u(u)))",
    "f32(pack4xI8Clamp(vec4i(i)))",
    "f32(dot4I8Packed(u, u))",
    "f32(dot4U8Packed(u, u))",
    "unpack4x8snorm(u).x",
    "unpack4x8unorm(u).x",
    "unpack2x16snorm(u).x",
    "unpack2x16unorm(u).x",
    "f32(unpack4xI8(u).x)",
    "f32(unpack4xU8(u).x)",
    "dpdx(x)",
    "dpdxCoarse(x)",
    "dpdxFine(x)",
    "fwidth(x)",
    "fwidthFine(x)",
    "determinant(mat2x2f(x, x, x, x))",
    "transpose(mat2x3f(x, x, x, x, x, x))[0].x",
    "refract(vec3f(x), vec3f(x), x).x",
    "reflect(vec3f(x), vec3f(x)).x",
    "faceForward(vec3f(x), vec3f(x), vec3f(x)).x",
    "distance(vec3f(x), vec3f(x))",
    "select(x, 0.0, all(vec2f(x) > vec2f(0.0)))",
    "textureSample(t2, s, vec2f(x)).x",
    "textureSampleBias(t2, s, vec2f(x), x).x",
    "textureSampleGrad(t2, s, vec2f(x), vec2f(x), vec2f(x)).x",
    "textureSample(t2, s, vec2f(x), vec2i(1, 2)).x",
    "textureLoad(t2, vec2i(i), i).x",
    "f32(textureDimensions(t2).x)",
    "f32(textureNumLevels(t2))",
    "textureGather(0, t2, s, vec2f(x)).x",
    "textureSample(ta, s, vec2f(x), i).x",
    "f32(textureNumLayers(ta))",
    "textureSample(t3, s, vec3f(x)).x",
    "textureSample(tc, s, vec3f(x)).x",
    "textureSample(tca, s, vec3f(x), i).x",
    "textureLoad(tm, vec2i(i), i).x",
    "f32(textureNumSamples(tm))",
    "textureSampleCompare(td, sc, vec2f(x), x)",
    "textureSampleCompareLevel(td, sc, vec2f(x), x)",
    "textureSampleCompare(tda, sc, vec2f(x), i, x)",
    "textureSampleCompareLevel(tda, sc, vec2f(x), i, x)",
    "textureSampleCompare(tdc, sc, vec3f(x), x)",
    "textureSampleCompareLevel(tdc, sc, vec3f(x), x)",
    "textureSampleCompare(tdca, sc, vec3f(x), i, x)",
    "textureSampleCompareLevel(tdca, sc, vec3f(x), i, x)",
    "textureGatherCompare(td, sc, vec2f(x), x).x",
    "textureSample(tdp, s, vec2f(x))",
    "textureLoad(tdp, vec2i(i), 0)",
    "textureSample(t1, s, x).x",
    "f32(textureLoad(tu, vec2i(i), i).x)",
    "textureLoad(tdm, vec2i(i), i)",
];

const RESOURCES: &str = "
    @group(0) @binding(0) var t2: texture_2d<f32>;
    @group(0) @binding(1) var s: sampler;
    @group(0) @binding(2) var sc: sampler_comparison;
    @group(0) @binding(3) var ta: texture_2d_array<f32>;
    @group(0) @binding(4) var t3: texture_3d<f32>;
    @group(0) @binding(5) var tc: texture_cube<f32>;
    @group(0) @binding(6) var tca: texture_cube_array<f32>;
    @group(0) @binding(7) var tm: texture_multisampled_2d<f32>;
    @group(0) @binding(8) var td: texture_depth_2d;
    @group(0) @binding(9) var tda: texture_depth_2d_array;
    @group(0) @binding(10) var tdc: texture_depth_cube;
    @group(0) @binding(11) var tdca: texture_depth_cube_array;
    @group(0) @binding(12) var tdm: texture_depth_multisampled_2d;
    @group(0) @binding(13) var tdp: texture_depth_2d;
    @group(0) @binding(14) var t1: texture_1d<f32>;
    @group(0) @binding(15) var tu: texture_2d<u32>;";

/// A shader that adds up `expressions`.
pub(super) fn sum(expressions: &[&str]) -> String {
    let terms: String = expressions.iter().map(|expression| format!("sum += {expression};")).collect();
    canonical(&format!(
        "{RESOURCES} @fragment fn fs(@location(0) x: f32, @location(1) @interpolate(flat, either) i: i32, @location(2) @interpolate(flat, either) u: u32) -> @location(0) vec4f {{ var sum = 0.0; {terms} return vec4f(sum); }}"
    ))
}

/// What is written compiles, and the rest is a typed error: nothing is left to be found by a driver.
#[test]
fn every_function_is_written_or_refused_with_a_reason() {
    for language in Language::ALL {
        let (mut written, mut refused) = (Vec::new(), Vec::new());
        for expression in EXPRESSIONS {
            match emit(&sum(&[expression]), language) {
                Ok(_) => written.push(*expression),
                Err(EmitError::Unsupported { what, .. }) => refused.push(what),
                Err(error) => panic!("{expression} in {language}: {error}"),
            }
        }
        let expected: &[&str] = match language {
            Language::Glsl => &GLSL_REFUSES,
            Language::GlslEs => &GLSL_ES_REFUSES,
            _ => &[],
        };
        assert_eq!(refused, expected, "{language}");
        check_all("the sum of what is written", &sum(&written), &[language]);
    }
}

const GLSL_REFUSES: [&str; 4] = [
    "`textureSampleCompareLevel` of a cube array",
    "a depth texture that is read without a comparison",
    "`textureLoad` of a depth texture",
    "`textureLoad` of a depth texture",
];

const GLSL_ES_REFUSES: [&str; 26] = [
    "`ldexp`",
    "`countOneBits`",
    "`countTrailingZeros`",
    "`extractBits`",
    "`firstLeadingBit`",
    "`firstLeadingBit`",
    "`firstTrailingBit`",
    "`reverseBits`",
    "`insertBits`",
    "`pack4x8snorm`",
    "`pack4x8unorm`",
    "`dot4I8Packed`",
    "`dot4U8Packed`",
    "`unpack4xI8`",
    "`unpack4xU8`",
    "`textureNumLevels`",
    "`textureGather`",
    "cube arrays",
    "multisampled textures",
    "multisampled textures",
    "cube arrays",
    "cube arrays",
    "`textureGather`",
    "a depth texture that is read without a comparison",
    "`textureLoad` of a depth texture",
    "multisampled textures",
];
