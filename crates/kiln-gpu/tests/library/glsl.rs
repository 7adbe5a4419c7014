//! The tutorials' GLSL programs, through Kiln's front end and the device, beside their native twins and the exact maps.

use kiln_bake::{Cancel, Masking, Table, TableAxes};
use kiln_image::Cube;

use crate::bakes::{Environment, WANTED, panoramas};
use crate::cubes::{
    Levels, cube_of, cube_view, difference, flat_texture, pair_texture, read_image, upload_cube, upload_image,
};
use crate::fragment::{Program, Scene, screen};
use crate::passes::{Setting, sampler};
use crate::support::{compile_tutorial, gpu, say, unit};
use crate::tutorials::{LIGHTS, empty_scene, open_gl, padded, turned, tutorial_table, vulkan};
use crate::twins::{self, ALONG_Y, Prefilter, Surface, tutorial_basis};

/// What a program drew beside its twin, another algorithm and the truth.
#[track_caller]
fn check(what: &str, drawn: &Cube, twin: &Cube, another: &Cube, truth: &Cube, tolerance: f64) {
    let (twin, another, error) =
        (difference(drawn, twin), difference(drawn, another), difference(drawn, truth));
    say(&format!(
        "{what:66} twin {:7.1e} (tolerance {tolerance:.0e}, another {:7.1e})  truth: RMS {:7.1e} worst {:7.1e}",
        twin.worst, another.worst, error.rms, error.worst
    ));
    assert!(twin.worst <= tolerance, "{what} is not its twin: {twin:?}");
    assert!(another.worst > tolerance, "{what}: the check does not see another algorithm");
}

#[test]
fn equirectangular_to_cubemap_is_its_twin() {
    let Some(gpu) = gpu() else { return };
    let program = Program::new(gpu, compile_tutorial(&["cubemap.vert", "equirectangular_to_cubemap.frag"]));
    for (name, panorama) in panoramas() {
        // OpenGL's images begin at the bottom.
        let rows = panorama.rgb().chunks_exact(3 * panorama.width()).rev();
        let upside_down: Vec<f32> = rows.flatten().copied().collect();
        let mut scene = empty_scene(gpu);
        let texture = upload_image(gpu, panorama.width(), &upside_down);
        scene.textures = vec![("equirectangularMap", texture.create_view(&Default::default()))];
        check(
            &format!("{name}: equirectangular_to_cubemap.frag"),
            &program.draw_faces(gpu, scene, "aPos", 32),
            &twins::tutorial_equirect(&panorama, 32),
            &twins::tutorial_equirect(&turned(&panorama), 32),
            &kiln_bake::skybox(&turned(&panorama), 32, Cancel::NEVER).expect(WANTED)[0],
            // Mesa's asin is off by up to 3.3e-4 radians (WGSL allows 2e-3), and lamps are steep; lib::sphere has no asin.
            0.5,
        );
    }
}

#[test]
fn irradiance_convolution_is_its_twin() {
    let Some(gpu) = gpu() else { return };
    let program = Program::new(gpu, compile_tutorial(&["cubemap.vert", "irradiance_convolution.frag"]));
    for (name, panorama) in panoramas() {
        let environment = Environment::new(gpu, &panorama, 32);
        let mut scene = empty_scene(gpu);
        scene.textures = vec![("environmentMap", cube_view(&environment.texture))];
        let twin =
            |step| cube_of(8, |n| twins::irradiance_grid(&environment.levels, tutorial_basis, n, step));
        let truth = kiln_bake::irradiance(&environment.analysis, 8, Cancel::NEVER).expect(WANTED).cube;
        let what = format!("{name}: irradiance_convolution.frag");
        // The angles are sums of f32 steps.
        check(&what, &program.draw_faces(gpu, scene, "aPos", 8), &twin(0.025), &twin(0.05), &truth, 2e-3);
    }
}

#[test]
fn prefilters_are_their_twins() {
    let Some(gpu) = gpu() else { return };
    let programs = [
        (["cubemap.vert", "prefilter.frag"], "aPos", "environmentMap", open_gl as fn(f64) -> Prefilter),
        (["vulkan_filtercube.vert", "vulkan_prefilter.frag"], "inPos", "samplerEnv", vulkan),
    ];
    for (name, panorama) in panoramas() {
        let environment = Environment::new(gpu, &panorama, 64);
        for (files, position, texture, how) in &programs {
            let program = Program::new(gpu, compile_tutorial(files));
            for roughness in [0.25, 0.5, 1.0] {
                let how = how(roughness);
                let mut scene = empty_scene(gpu);
                scene.textures = vec![(texture, cube_view(&environment.texture))];
                scene.values = vec![
                    ("roughness", Setting::F32(roughness as f32)),
                    ("numSamples", Setting::U32(how.count)),
                ];
                let twin = |how: Prefilter| cube_of(16, |n| twins::prefilter(&environment.levels, n, &how));
                let alpha = roughness * roughness;
                let truth =
                    kiln_bake::specular_level(&environment.analysis, alpha, 16, Cancel::NEVER).expect(WANTED);
                let what = format!("{name}: {}, roughness {roughness}, {} samples", files[1], how.count);
                check(
                    &what,
                    &program.draw_faces(gpu, scene, position, 16),
                    &twin(how),
                    &twin(Prefilter { count: how.count / 2, ..how }),
                    &truth.cube,
                    // Lookups of mips of a few texels: drivers fill the corner where three faces meet in their own ways.
                    if how.count < 100 { 2e-2 } else { 2e-3 },
                );
            }
        }
    }
}

#[test]
fn brdf_is_its_twin() {
    let Some(gpu) = gpu() else { return };
    let size = 32;
    let program = Program::new(gpu, compile_tutorial(&["brdf.vert", "brdf.frag"]));
    let mut scene = empty_scene(gpu);
    scene.attributes = vec![("aPos", 3, screen().0), ("aTexCoords", 2, screen().1)];
    let target = pair_texture(gpu, size);
    program.draw(gpu, &scene, &target.create_view(&Default::default()), target.format());
    let drawn: Vec<f32> = bytemuck::pod_collect_to_vec(&gpu.read_texture(&target, 0).unwrap());
    let kind = |masking| Table::GgxScaleBias(masking);
    let exact =
        |masking| kiln_bake::table(kind(masking), TableAxes::Uniform, size, Cancel::NEVER).expect(WANTED);
    let centre = |index: usize| (index as f64 + 0.5) / size as f64;
    let twin = |masking| -> Vec<f32> {
        let entry = |i: usize| twins::scale_bias(masking, centre(i % size), centre(i / size), 1024, ALONG_Y);
        (0..size * size).flat_map(entry).map(|value| value as f32).collect()
    };
    let worst = |other: &[f32]| {
        let off = drawn.iter().zip(other).map(|(a, b)| f64::from(a - b).abs());
        off.fold(0.0, |worst: f64, off| if off.is_nan() { f64::INFINITY } else { worst.max(off) })
    };
    let (right, another) = (worst(&twin(Masking::SchlickIbl)), worst(&twin(Masking::SmithSeparable)));
    say(&format!(
        "brdf.frag: twin {right:.1e} (tolerance 1e-3, another {another:.1e})  truth of its masking: worst {:.1e}, of Smith's: {:.1e}",
        worst(&exact(Masking::SchlickIbl)),
        worst(&exact(Masking::SmithCorrelated))
    ));
    assert!(right <= 1e-3 && another > 1e-3);
}

#[test]
fn background_is_its_twin() {
    let Some(gpu) = gpu() else { return };
    let program = Program::new(gpu, compile_tutorial(&["background.vert", "background.frag"]));
    let (name, panorama) = panoramas().remove(0);
    let environment = Environment::new(gpu, &panorama, 16);
    let mut scene = empty_scene(gpu);
    scene.textures = vec![("environmentMap", cube_view(&environment.texture))];
    let drawn = program.draw_faces(gpu, scene, "aPos", 16);
    let display = |gamma: f64| {
        let texel = |value: f64| (value / (value + 1.0)).powf(1.0 / gamma);
        cube_of(16, |n| environment.levels.sample(n, 0.0).map(texel))
    };
    let [right, another] = [2.2, 2.4].map(|gamma| difference(&drawn, &display(gamma)));
    say(&format!(
        "{name}: background.frag: twin {:.1e} (tolerance 1e-4, another {:.1e})",
        right.worst, another.worst
    ));
    assert!(right.worst <= 1e-4 && another.worst > 1e-4);
}

#[test]
fn pbr_is_its_twin() {
    let Some(gpu) = gpu() else { return };
    let program = Program::new(gpu, compile_tutorial(&["pbr.vert", "pbr.frag"]));
    let (_, panorama) = panoramas().remove(0);
    let environment = Environment::new(gpu, &panorama, 32);
    let table = tutorial_table();
    let sharp = Levels(vec![environment.levels.0[0].clone()]);
    let sharp_texture = upload_cube(gpu, &sharp);
    let constant = |texel: [f64; 3]| {
        let texel = texel.map(|value| value as f32);
        upload_image(gpu, 1, &texel).create_view(&Default::default())
    };
    for (metallic, roughness) in [(0.0, 0.25), (0.0, 0.5), (1.0, 0.25), (0.5, 0.75)] {
        let surface = |roughness: f64| Surface {
            albedo: [0.5_f64, 0.25, 0.75].map(|value| value.powf(2.2)),
            metallic,
            roughness,
            occlusion: 0.75,
            // The normal map's (0.2, 0.1, 0.9) with T = +X and B = -N × T = -Y.
            normal: unit([0.2, -0.1, 0.9]),
            camera: [0.0, 0.0, 0.4],
            lights: LIGHTS,
            irradiance: &sharp,
            prefiltered: &environment.levels,
            table: (32, &table),
            offset: 1e-4,
        };
        let identity: [[f32; 4]; 4] =
            std::array::from_fn(|i| std::array::from_fn(|j| f32::from(u8::from(i == j))));
        let normals = std::iter::repeat_n([0.0, 0.0, 1.0], 6).flatten().collect();
        let scene = Scene {
            attributes: vec![("aPos", 3, screen().0), ("aNormal", 3, normals), ("aTexCoords", 2, screen().1)],
            textures: vec![
                ("albedoMap", constant([0.5, 0.25, 0.75])),
                ("normalMap", constant([0.6, 0.55, 0.95])),
                ("metallicMap", constant([metallic; 3])),
                ("roughnessMap", constant([roughness; 3])),
                ("aoMap", constant([0.75; 3])),
                ("irradianceMap", cube_view(&sharp_texture)),
                ("prefilterMap", cube_view(&environment.texture)),
                ("brdfLUT", upload_image(gpu, 32, &table).create_view(&Default::default())),
            ],
            sampler: sampler(gpu, false),
            values: vec![
                ("projection", Setting::Matrix(identity)),
                ("view", Setting::Matrix(identity)),
                ("model", Setting::Matrix(identity)),
                ("normalMatrix", Setting::Vectors(identity[..3].to_vec())),
                ("lightPositions", Setting::Vectors(LIGHTS.map(|(at, _)| padded(at)).to_vec())),
                ("lightColors", Setting::Vectors(LIGHTS.map(|(_, color)| padded(color)).to_vec())),
                ("camPos", Setting::Vectors(vec![padded([0.0, 0.0, 0.4])])),
            ],
        };
        let target = flat_texture(gpu, 24, 24);
        program.draw(gpu, &scene, &target.create_view(&Default::default()), target.format());
        let picture = read_image(gpu, &target);
        let worst = |surface: &Surface<'_>| {
            let error = |index: usize| {
                let (x, y) = (index % 24, index / 24);
                let at = [(2 * x + 1) as f64 / 24.0 - 1.0, 1.0 - (2 * y + 1) as f64 / 24.0, 0.0];
                let off = picture.texel(x, y).into_iter().zip(surface.display(at));
                off.fold(0.0, |worst: f64, (a, e)| {
                    let off = (f64::from(a) - e).abs();
                    if off.is_nan() { f64::INFINITY } else { worst.max(off) }
                })
            };
            (0..24 * 24).map(error).fold(0.0, f64::max)
        };
        let (twin, another) = (worst(&surface(roughness)), worst(&surface(roughness * 0.99)));
        say(&format!(
            "pbr.frag, metallic {metallic}, roughness {roughness}: display values, twin {twin:.1e} (tolerance 1e-3, another {another:.1e})"
        ));
        assert!(twin <= 1e-3 && another > 1e-3, "metallic {metallic}, roughness {roughness}");
    }
}
