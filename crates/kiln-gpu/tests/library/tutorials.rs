//! The algorithms that tutorials teach: what they are off by, and how the fragment passes that draw them are run.
//!
//! `tests/shaders/tutorials` has them in GLSL, which `glsl` runs; the numbers here are those of native twins with the same
//! constants, bases and offsets, so that each error is the algorithm's.

use kiln_bake::{Cancel, Masking};
use kiln_brdf::{Precision, dfg};
use kiln_gpu::Gpu;
use kiln_image::{Cube, Image, Panorama};

use crate::bakes::{Environment, WANTED, made, panoramas};
use crate::cubes::{cube_of, cube_view, difference, flat_texture, read_image, upload_image};
use crate::fragment::{Program, Scene, screen};
use crate::passes::{Setting, sampler};
use crate::support::{compile, gpu, say, unit};
use crate::twins::{self, ALONG_Y, Prefilter, Surface, tutorial_basis, z_up_basis};

/// The same sky seen with the tutorials' convention: their centre column looks along +X.
pub fn turned(panorama: &Panorama) -> Panorama {
    let (width, height) = (panorama.width(), panorama.height());
    let texel = |index: usize| {
        let (x, y) = (index % width, index / width);
        let at = (y * width + (x + width - width / 4) % width) * 3;
        [0, 1, 2].map(|i| panorama.rgb()[at + i])
    };
    Panorama::new(Image::new(width, height, (0..width * height).flat_map(texel).collect()).unwrap()).unwrap()
}

/// Says an algorithm's error and that it is where it is known to be.
#[track_caller]
fn report(what: &str, map: &Cube, truth: &Cube, rms_max: f64) {
    let error = difference(map, truth);
    say(&format!("{what:70} error: RMS {:7.1e}  worst {:7.1e}", error.rms, error.worst));
    assert!(error.rms <= rms_max, "{what}: {error:?} over {rms_max}");
    assert!(error.rms > 1e-5, "{what}: the comparison sees nothing");
}

/// LearnOpenGL's prefilter: 1024 samples.
pub fn open_gl(roughness: f64) -> Prefilter {
    Prefilter { roughness, count: 1024, bias: 0.0, basis: z_up_basis, offsets: [1e-4, 1e-4] }
}

/// The Vulkan samples': 32 samples, a level more.
pub fn vulkan(roughness: f64) -> Prefilter {
    Prefilter { roughness, count: 32, bias: 1.0, basis: z_up_basis, offsets: [1e-4, 0.0] }
}

#[test]
fn tutorials_are_off_by_what_is_stated() {
    for (name, panorama) in panoramas() {
        let skybox = kiln_bake::skybox(&panorama, 64, Cancel::NEVER).expect(WANTED);
        let request = kiln_bake::AnalysisRequest { alpha_min: 0.01, sheen_alpha_min: None, error: 1e-5 };
        let analysis = kiln_bake::analyse(&panorama, &request, Cancel::NEVER).expect(WANTED);
        let exact = &kiln_bake::skybox(&turned(&panorama), 64, Cancel::NEVER).expect(WANTED)[0];
        let drawn = twins::tutorial_equirect(&panorama, 64);
        report(&format!("{name}: tutorial's equirectangular_to_cubemap"), &drawn, exact, 0.3);
        let levels = twins::with_mips(skybox[0].clone(), false);
        let truth = kiln_bake::irradiance(&analysis, 8, Cancel::NEVER).expect(WANTED).cube;
        let drawn = cube_of(8, |normal| twins::irradiance_grid(&levels, tutorial_basis, normal, 0.025));
        report(&format!("{name}: tutorial's irradiance_convolution"), &drawn, &truth, 0.05);
        for roughness in [0.25, 0.5, 0.75, 1.0] {
            let alpha = roughness * roughness;
            let truth = kiln_bake::specular_level(&analysis, alpha, 16, Cancel::NEVER).expect(WANTED).cube;
            for (whose, how) in [("tutorial's", open_gl(roughness)), ("Vulkan samples'", vulkan(roughness))] {
                let drawn = cube_of(16, |normal| twins::prefilter(&levels, normal, &how));
                let what = format!("{name}: {whose} prefilter, roughness {roughness}, {} samples", how.count);
                report(&what, &drawn, &truth, 1.0);
            }
        }
    }
}

/// Largest error and root mean square over n·v and roughness of a function beside another.
fn over_the_table(f: impl Fn(f64, f64) -> f64) -> [f64; 2] {
    let centre = |i: usize| (i as f64 + 0.5) / 32.0;
    let errors: Vec<f64> = (0..32 * 32).map(|i| f(centre(i % 32), centre(i / 32)).abs()).collect();
    let squares: f64 = errors.iter().map(|error| error * error).sum();
    [errors.iter().copied().fold(0.0, f64::max), (squares / errors.len() as f64).sqrt()]
}

#[test]
fn tutorial_table_and_shading_are_off_by_what_is_stated() {
    let table =
        |n_dot_v, roughness| twins::scale_bias(Masking::SchlickIbl, n_dot_v, roughness, 1024, ALONG_Y);
    let own = |n_dot_v, roughness| dfg(Masking::SchlickIbl, n_dot_v, roughness, Precision::Table);
    let exact = |n_dot_v, roughness| dfg(Masking::SmithCorrelated, n_dot_v, roughness, Precision::Table);
    // What a dielectric reflects of uniform light.
    let reflected = |[scale, bias]: [f64; 2], f0: f64| f0 * scale + bias;
    let sampled = over_the_table(|v, r| reflected(table(v, r), 0.04) - reflected(own(v, r), 0.04));
    let masked = over_the_table(|v, r| reflected(own(v, r), 0.04) - reflected(exact(v, r), 0.04));
    // The tutorial's shader multiplies the scale by Schlick's term, which the table has integrated already.
    let shaded = over_the_table(|v, r| {
        let f = 0.04 + ((1.0 - r).max(0.04) - 0.04) * (1.0 - v).powi(5);
        reflected(table(v, r), f) - reflected(exact(v, r), 0.04)
    });
    for (what, [worst, rms], least) in [
        ("tutorial's brdf: 1024 samples instead of the integral", sampled, 1e-3),
        ("tutorial's brdf: Schlick's masking instead of Smith's, height-correlated", masked, 1e-2),
        ("tutorial's pbr: Fresnel counted twice, and both of these", shaded, 1e-2),
    ] {
        say(&format!("{what:76} error of reflectance: RMS {rms:.1e}  worst {worst:.1e}"));
        assert!(worst > least && worst < 1.0, "{what}: {worst}");
    }
}

/// A vertex and a fragment stage of WGSL around one expression of a direction.
fn direction_program(gpu: &Gpu, imports: &str, radiance: &str) -> Program {
    let root = format!(
        "{imports}
        struct Camera {{ projection: mat4x4f, view: mat4x4f }}
        @group(1) @binding(0) var<uniform> camera: Camera;
        struct Varying {{ @builtin(position) position: vec4f, @location(0) direction: vec3f }}
        @vertex
        fn vs_main(@location(0) position: vec3f) -> Varying {{
            return Varying(camera.projection * camera.view * vec4f(position, 1.0), position);
        }}
        @fragment
        fn fs_main(in: Varying) -> @location(0) vec4f {{
            let direction = normalize(in.direction);
            return vec4f({radiance}, 1.0);
        }}"
    );
    Program::new(gpu, compile("shaders/test/root.wgsl", Some(&root), &[]))
}

pub fn empty_scene(gpu: &Gpu) -> Scene<'static> {
    Scene { attributes: Vec::new(), textures: Vec::new(), sampler: sampler(gpu, false), values: Vec::new() }
}

#[test]
fn faces_are_drawn_where_their_texels_look() {
    let Some(gpu) = gpu() else { return };
    let drawn = direction_program(gpu, "", "direction").draw_faces(gpu, empty_scene(gpu), "position", 8);
    let [right, mirrored] =
        [1.0, -1.0].map(|sign| difference(&drawn, &cube_of(8, |[x, y, z]| [sign * x, y, z])));
    assert!(right.worst <= 1e-6 && mirrored.worst > 0.1, "{right:?} {mirrored:?}");
}

#[test]
fn fragment_pass_draws_what_the_compute_pass_writes() {
    let Some(gpu) = gpu() else { return };
    let environment = Environment::new(gpu, &made(), 32);
    let program = direction_program(
        gpu,
        "import package::shaders::bake::irradiance::irradiance_cosine;",
        "irradiance_cosine(direction)",
    );
    let mut scene = empty_scene(gpu);
    scene.textures = vec![("environment", cube_view(&environment.texture))];
    scene.values = vec![
        ("step", Setting::F32(0.0)),
        ("sample_count", Setting::U32(64)),
        ("level_bias", Setting::F32(0.0)),
    ];
    let drawn = program.draw_faces(gpu, scene, "position", 8);
    let twin = |count| cube_of(8, |normal| twins::irradiance_cosine(&environment.levels, normal, count, 0.0));
    let [right, wrong] = [twin(64), twin(32)].map(|twin| difference(&drawn, &twin));
    assert!(right.worst <= 5e-4 && wrong.worst > 5e-4, "{right:?} {wrong:?}");
}

/// `pbr.frag` with the library's functions: textures and uniforms have its names.
const PBR: &str = "
import lib::brdf::{d_ggx, diffuse_lambert, f_schlick, f_schlick_roughness, schlick_k_light, v_schlick_ggx};
import lib::colour::tone_map_reinhard;
struct Surface {
    lightPositions: array<vec3f, 4>,
    lightColors: array<vec3f, 4>,
    camPos: vec3f,
    albedo: vec3f,
    normal: vec3f,
    metallic: f32,
    roughness: f32,
    occlusion: f32,
}
@group(0) @binding(0) var<uniform> surface: Surface;
@group(0) @binding(1) var irradianceMap: texture_cube<f32>;
@group(0) @binding(2) var prefilterMap: texture_cube<f32>;
@group(0) @binding(3) var brdfLUT: texture_2d<f32>;
@group(0) @binding(4) var linear: sampler;
struct Varying { @builtin(position) position: vec4f, @location(0) world: vec3f }
@vertex
fn vs_main(@location(0) aPos: vec3f) -> Varying {
    return Varying(vec4f(aPos, 1.0), aPos);
}
fn lit(view: vec3f, f0: vec3f, to_light: vec3f, color: vec3f) -> vec3f {
    let n = surface.normal;
    let light = normalize(to_light);
    let h = normalize(view + light);
    let n_dot_l = saturate(dot(n, light));
    let n_cross_h = cross(n, h);
    let d = d_ggx(saturate(dot(n, h)), dot(n_cross_h, n_cross_h), surface.roughness * surface.roughness);
    let v = v_schlick_ggx(n_dot_l, saturate(dot(n, view)), schlick_k_light(surface.roughness));
    let f = f_schlick(f0, 1.0, dot(h, view));
    let diffuse = (1.0 - f) * (1.0 - surface.metallic) * surface.albedo * diffuse_lambert();
    return (diffuse + d * v * f) * color * (n_dot_l / dot(to_light, to_light));
}
@fragment
fn fs_main(in: Varying) -> @location(0) vec4f {
    let n = surface.normal;
    let view = normalize(surface.camPos - in.world);
    let n_dot_v = saturate(dot(n, view));
    let f0 = mix(vec3f(0.04), surface.albedo, surface.metallic);
    let f = f_schlick_roughness(f0, n_dot_v, surface.roughness);
    let irradiance = textureSampleLevel(irradianceMap, linear, n, 0.0).rgb;
    let prefiltered = textureSampleLevel(prefilterMap, linear, reflect(-view, n), 4.0 * surface.roughness).rgb;
    let table = textureSampleLevel(brdfLUT, linear, vec2f(n_dot_v, surface.roughness), 0.0);
    let diffuse = (1.0 - f) * (1.0 - surface.metallic) * irradiance * surface.albedo;
    var sum = (diffuse + prefiltered * (f * table.x + table.y)) * surface.occlusion;
    for (var i = 0u; i < 4u; i++) {
        sum += lit(view, f0, surface.lightPositions[i] - in.world, surface.lightColors[i]);
    }
    return vec4f(pow(max(tone_map_reinhard(sum), vec3f(1e-6)), vec3f(1.0 / 2.2)), 1.0);
}";

pub const LIGHTS: [([f64; 3], [f64; 3]); 4] = [
    ([-1.0, 1.0, 1.5], [9.0, 7.0, 5.0]),
    ([1.0, 1.0, 0.5], [3.0, 3.0, 3.0]),
    ([-1.5, -1.0, 0.75], [0.5, 2.0, 4.0]),
    ([2.0, -1.0, 3.0], [30.0, 30.0, 30.0]),
];

pub fn padded([x, y, z]: [f64; 3]) -> [f32; 4] {
    [x as f32, y as f32, z as f32, 0.0]
}

/// The table of the tutorials, exact.
pub fn tutorial_table() -> Vec<f32> {
    let kind = kiln_bake::Table::GgxScaleBias(Masking::SchlickIbl);
    let values = kiln_bake::table(kind, kiln_bake::TableAxes::Uniform, 32, Cancel::NEVER).expect(WANTED);
    values.chunks_exact(2).flat_map(|entry| [entry[0], entry[1], 0.0]).collect()
}

#[test]
fn tutorial_shading_in_the_library_functions_is_its_twin() {
    let Some(gpu) = gpu() else { return };
    let environment = Environment::new(gpu, &made(), 32);
    let table = tutorial_table();
    let program = Program::new(gpu, compile("shaders/test/root.wgsl", Some(PBR), &[]));
    for (metallic, roughness) in [(0.0, 0.25), (0.0, 0.5), (1.0, 0.25), (0.5, 1.0)] {
        let surface = |offset: f64| Surface {
            albedo: [0.5, 0.25, 0.75],
            metallic,
            roughness,
            occlusion: 0.75,
            normal: unit([0.1, -0.2, 1.0]).map(|x| f64::from(x as f32)),
            // Close above the surface, so that most of it is seen under grazing angles.
            camera: [0.0, 0.0, 0.4],
            lights: LIGHTS,
            irradiance: &environment.levels,
            prefiltered: &environment.levels,
            table: (32, &table),
            offset,
        };
        // As good as none, but for lights behind the surface: 0/0.
        let bound = surface(1e-300);
        let number = |value: f64| Setting::F32(value as f32);
        let scene = Scene {
            attributes: vec![("aPos", 3, screen().0), ("aTexCoords", 2, screen().1)],
            textures: vec![
                ("irradianceMap", cube_view(&environment.texture)),
                ("prefilterMap", cube_view(&environment.texture)),
                ("brdfLUT", upload_image(gpu, 32, &table).create_view(&Default::default())),
            ],
            sampler: sampler(gpu, false),
            values: vec![
                ("lightPositions", Setting::Vectors(LIGHTS.map(|(at, _)| padded(at)).to_vec())),
                ("lightColors", Setting::Vectors(LIGHTS.map(|(_, color)| padded(color)).to_vec())),
                ("camPos", Setting::Vectors(vec![padded(bound.camera)])),
                ("albedo", Setting::Vectors(vec![padded(bound.albedo)])),
                ("normal", Setting::Vectors(vec![padded(bound.normal)])),
                ("metallic", number(metallic)),
                ("roughness", number(roughness)),
                ("occlusion", number(bound.occlusion)),
            ],
        };
        let target = flat_texture(gpu, 24, 24);
        program.draw(gpu, &scene, &target.create_view(&Default::default()), target.format());
        let picture = read_image(gpu, &target);
        let worst = |surface: &Surface<'_>| {
            let error = |index: usize| {
                let (x, y) = (index % 24, index / 24);
                let at = [(2 * x + 1) as f64 / 24.0 - 1.0, 1.0 - (2 * y + 1) as f64 / 24.0, 0.0];
                let expected = surface.display(at);
                let off =
                    picture.texel(x, y).into_iter().zip(expected).map(|(a, e)| (f64::from(a) - e).abs());
                off.fold(0.0, |worst: f64, off| if off.is_nan() { f64::INFINITY } else { worst.max(off) })
            };
            (0..24 * 24).map(error).fold(0.0, f64::max)
        };
        let (twin, offset) = (worst(&bound), worst(&surface(1e-4)));
        let another = worst(&Surface { roughness: roughness * 0.99, ..surface(1e-300) });
        say(&format!(
            "tutorial's pbr, metallic {metallic}, roughness {roughness}: display values, twin {twin:.1e} (tolerance 1e-3, \
             another {another:.1e}); 0.0001 in the denominator moves them by {offset:.1e}"
        ));
        // Mips of a few texels: drivers fill the corner where three faces meet in their own ways.
        assert!(twin <= 1e-3 && another > 1e-3, "metallic {metallic}, roughness {roughness}");
    }
}
