//! The bake passes on the device beside native twins of the same algorithm, and beside the exact maps.

use kiln_bake::{AnalysisRequest, Cancel, Masking, Table, TableAxes};
use kiln_brdf::sampling::orthonormal_basis;
use kiln_gpu::Gpu;
use kiln_image::{Cube, Image, Limits, Panorama, TexelPolicy};
use kiln_sphere::{panorama_direction, panorama_uv};

use crate::cubes::{
    Difference, Levels, cube_of, cube_texture, cube_view, difference, flat_texture, level_view, read_cube,
    read_image, upload_cube, upload_image,
};
use crate::passes::{Pass, Setting, sampler};
use crate::support::{gpu, say};
use crate::twins::{self, ALONG_X, Prefilter, tutorial_basis};

pub const WANTED: &str = "nobody cancels";

/// Lookups of mips of a few texels: drivers fill the corner where three faces meet in their own ways.
const CORNERS: f64 = 2e-2;
/// Lookups in a panorama: f32 places a direction to 1e-6 of its width, and lamps are steep.
const EQUIRECT: f64 = 1e-2;

/// A sky, a ground and three lamps, one of them on the wrap column.
pub fn made() -> Panorama {
    let (width, height) = (128, 64);
    let lamps = [([0.02, 0.3], 0.05, 40.0), ([0.6, 0.55], 0.08, 12.0), ([0.3, 0.05], 0.03, 90.0)];
    let lamps = lamps.map(|([u, v], radius, radiance)| (panorama_direction(u, v), radius, radiance));
    let texel = |index: usize| {
        let (u, v) = (
            (index % width) as f64 / width as f64 + 0.5 / width as f64,
            ((index / width) as f64 + 0.5) / height as f64,
        );
        let [x, y, z] = panorama_direction(u, v);
        let sky = 0.4 + 0.4 * y + 0.1 * (3.0 * x).sin() * (5.0 * z).cos();
        let lit = lamps.iter().map(|(lamp, radius, radiance)| {
            let cosine = lamp[0] * x + lamp[1] * y + lamp[2] * z;
            radiance * (-(1.0 - cosine) / (radius * radius)).exp()
        });
        let lit: f64 = lit.sum();
        [sky + lit, 0.9 * sky + 0.8 * lit, 1.3 * sky + 0.5 * lit].map(|value| value.max(0.0) as f32)
    };
    let rgb = (0..width * height).flat_map(texel).collect();
    Panorama::new(Image::new(width, height, rgb).unwrap()).unwrap()
}

/// A studio of the corpus, brought to 256 × 128 by means of rows and columns.
fn studio() -> Option<Panorama> {
    let Some(root) = std::env::var_os("KILN_CORPUS") else {
        say("SKIPPED: KILN_CORPUS is not set, the passes saw made panoramas only");
        return None;
    };
    let path = std::path::Path::new(&root).join("hdr/polyhaven-pmndrs/studio.hdr");
    let bytes = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut image = kiln_image::decode(&bytes, &Limits::default(), Cancel::NEVER).unwrap().image;
    TexelPolicy::Repair.apply(&mut image, Cancel::NEVER).unwrap();
    let factor = image.width / 256;
    let texel = |index: usize| {
        let (x, y) = (index % 256 * factor, index / 256 * factor);
        let mut sum = [0.0; 3];
        for (dx, dy) in (0..factor * factor).map(|i| (i % factor, i / factor)) {
            for (sum, value) in sum.iter_mut().zip(image.texel(x + dx, y + dy)) {
                *sum += f64::from(value) / (factor * factor) as f64;
            }
        }
        sum.map(|value| value as f32)
    };
    let rgb = (0..256 * 128).flat_map(texel).collect();
    Some(Panorama::new(Image::new(256, 128, rgb).unwrap()).unwrap())
}

pub fn panoramas() -> Vec<(&'static str, Panorama)> {
    let mut all = vec![("made", made())];
    all.extend(studio().map(|panorama| ("studio", panorama)));
    all
}

/// A pass's map beside its twin, a twin of something else, and the truth.
struct Found<'a> {
    what: String,
    map: &'a Cube,
    twin: &'a Cube,
    wrong: &'a Cube,
    truth: &'a Cube,
    /// Largest error of a texel against its twin, relative to the map's RMS.
    tolerance: f64,
}

impl Found<'_> {
    #[track_caller]
    fn check(&self) {
        let twin = difference(self.map, self.twin);
        let wrong = difference(self.map, self.wrong);
        let Difference { rms, worst } = difference(self.map, self.truth);
        say(&format!(
            "{:60} twin {:7.1e} (tolerance {:.0e}, another {:7.1e})  truth: RMS {rms:7.1e} worst {worst:7.1e}",
            self.what, twin.worst, self.tolerance, wrong.worst
        ));
        assert!(twin.worst <= self.tolerance, "{} is not its twin: {twin:?}", self.what);
        assert!(wrong.worst > self.tolerance, "{}: the check does not see another algorithm", self.what);
    }
}

/// An environment as passes read it, and its exact maps.
pub struct Environment {
    pub levels: Levels,
    pub texture: wgpu::Texture,
    pub analysis: kiln_bake::Analysis,
}

impl Environment {
    pub fn new(gpu: &Gpu, panorama: &Panorama, face_size: usize) -> Self {
        let levels = Levels(kiln_bake::skybox(panorama, face_size, Cancel::NEVER).expect(WANTED));
        let texture = upload_cube(gpu, &levels);
        let request = AnalysisRequest { alpha_min: 0.01, sheen_alpha_min: None, error: 1e-5 };
        let analysis = kiln_bake::analyse(panorama, &request, Cancel::NEVER).expect(WANTED);
        Self { levels, texture, analysis }
    }

    /// What a pass makes of it on faces of `face_size`.
    #[track_caller]
    fn run(&self, gpu: &Gpu, pass: &Pass, settings: &[(&str, Setting)], face_size: usize) -> Cube {
        let target = cube_texture(gpu, face_size, 1);
        let (faces, environment) = (level_view(&target, 0), cube_view(&self.texture));
        let resources = [
            ("faces", wgpu::BindingResource::TextureView(&faces)),
            ("environment", wgpu::BindingResource::TextureView(&environment)),
            ("environment_sampler", wgpu::BindingResource::Sampler(&sampler(gpu, false))),
        ];
        pass.run(gpu, &resources, settings, [face_size as u32, face_size as u32, 6]);
        read_cube(gpu, &target, 0)
    }
}

#[test]
fn equirect_to_cube_is_its_twin() {
    let Some(gpu) = gpu() else { return };
    let pass = Pass::new(gpu, "shaders/bake/equirect_to_cube.wgsl", "main", &[]);
    for (name, panorama) in panoramas() {
        let source = upload_image(gpu, panorama.width(), panorama.rgb());
        let truth = &kiln_bake::skybox(&panorama, 32, Cancel::NEVER).expect(WANTED)[0];
        for count in [1, 8] {
            let target = cube_texture(gpu, 32, 1);
            let resources = [
                ("faces", wgpu::BindingResource::TextureView(&level_view(&target, 0))),
                ("panorama", wgpu::BindingResource::TextureView(&source.create_view(&Default::default()))),
                ("panorama_sampler", wgpu::BindingResource::Sampler(&sampler(gpu, true))),
            ];
            pass.run(gpu, &resources, &[("samples_per_edge", Setting::U32(count))], [32, 32, 6]);
            Found {
                what: format!("{name}: equirect_to_cube, {count}² lookups"),
                map: &read_cube(gpu, &target, 0),
                twin: &twins::equirect_to_cube(&panorama, 32, count as usize),
                wrong: &twins::equirect_to_cube(&panorama, 32, if count == 1 { 8 } else { 1 }),
                truth,
                tolerance: EQUIRECT,
            }
            .check();
        }
    }
}

#[test]
fn cube_mips_are_their_twins() {
    let Some(gpu) = gpu() else { return };
    let pass = Pass::new(gpu, "shaders/bake/cube_mips.wgsl", "main", &[]);
    for (name, panorama) in panoramas() {
        let exact = kiln_bake::skybox(&panorama, 32, Cancel::NEVER).expect(WANTED);
        let target = upload_cube(gpu, &Levels(exact.clone()));
        let twin = twins::with_mips(exact[0].clone(), true);
        let plain = twins::with_mips(exact[0].clone(), false);
        for (level, truth) in exact.iter().enumerate().skip(1) {
            let size = (32 >> level) as u32;
            let resources = [
                ("faces", wgpu::BindingResource::TextureView(&level_view(&target, level))),
                ("level_above", wgpu::BindingResource::TextureView(&level_view(&target, level - 1))),
            ];
            pass.run(gpu, &resources, &[], [size, size, 6]);
            Found {
                what: format!("{name}: cube_mips, level {level}"),
                map: &read_cube(gpu, &target, level),
                twin: &twin.0[level],
                wrong: &plain.0[level],
                truth,
                tolerance: 1e-5,
            }
            .check();
        }
    }
}

#[test]
fn irradiance_is_its_twin() {
    let Some(gpu) = gpu() else { return };
    let path = "shaders/bake/irradiance.wgsl";
    let (grid, cosine) = (Pass::new(gpu, path, "grid", &[]), Pass::new(gpu, path, "cosine", &[]));
    for (name, panorama) in panoramas() {
        let environment = Environment::new(gpu, &panorama, 32);
        let source = &environment.levels;
        let truth = kiln_bake::irradiance(&environment.analysis, 8, Cancel::NEVER).expect(WANTED).cube;
        Found {
            what: format!("{name}: irradiance on a grid of 0.025"),
            map: &environment.run(gpu, &grid, &[("step", Setting::F32(0.025))], 8),
            twin: &cube_of(8, |n| twins::irradiance_grid(source, orthonormal_basis, n, f64::from(0.025_f32))),
            wrong: &cube_of(8, |n| twins::irradiance_grid(source, orthonormal_basis, n, 0.05)),
            truth: &truth,
            tolerance: 5e-4,
        }
        .check();
        for bias in [0.0, 1.0] {
            let settings = [("sample_count", Setting::U32(256)), ("level_bias", Setting::F32(bias))];
            Found {
                what: format!("{name}: irradiance by 256 cosine samples, bias {bias}"),
                map: &environment.run(gpu, &cosine, &settings, 8),
                twin: &cube_of(8, |n| twins::irradiance_cosine(source, n, 256, f64::from(bias))),
                wrong: &cube_of(8, |n| twins::irradiance_cosine(source, n, 128, f64::from(bias))),
                truth: &truth,
                tolerance: CORNERS,
            }
            .check();
        }
    }
}

#[test]
fn prefilter_is_its_twin() {
    let Some(gpu) = gpu() else { return };
    let pass = Pass::new(gpu, "shaders/bake/prefilter.wgsl", "main", &[]);
    for (name, panorama) in panoramas() {
        let environment = Environment::new(gpu, &panorama, 64);
        let source = &environment.levels;
        for (roughness, count, bias) in [
            (0.25, 1024, 0.0),
            (0.5, 1024, 0.0),
            (0.75, 1024, 0.0),
            (1.0, 1024, 0.0),
            (0.5, 32, 1.0),
            (0.5, 1024, 1.0),
        ] {
            let settings = [
                ("perceptual_roughness", Setting::F32(roughness)),
                ("sample_count", Setting::U32(count)),
                ("level_bias", Setting::F32(bias)),
            ];
            let roughness = f64::from(roughness);
            let how = Prefilter {
                roughness,
                count,
                bias: f64::from(bias),
                basis: orthonormal_basis,
                offsets: [0.0; 2],
            };
            let other = Prefilter { count: count / 2, ..how };
            let alpha = roughness * roughness;
            let truth =
                kiln_bake::specular_level(&environment.analysis, alpha, 16, Cancel::NEVER).expect(WANTED);
            Found {
                what: format!("{name}: prefilter, roughness {roughness}, {count} samples, bias {bias}"),
                map: &environment.run(gpu, &pass, &settings, 16),
                twin: &cube_of(16, |n| twins::prefilter(source, n, &how)),
                wrong: &cube_of(16, |n| twins::prefilter(source, n, &other)),
                truth: &truth.cube,
                tolerance: if count < 100 { CORNERS } else { 2e-4 },
            }
            .check();
        }
    }
}

#[test]
fn mirror_prefilter_is_the_environment() {
    let Some(gpu) = gpu() else { return };
    let pass = Pass::new(gpu, "shaders/bake/prefilter.wgsl", "main", &[]);
    let environment = Environment::new(gpu, &made(), 16);
    let settings = [
        ("perceptual_roughness", Setting::F32(0.0)),
        ("sample_count", Setting::U32(64)),
        ("level_bias", Setting::F32(0.0)),
    ];
    let map = environment.run(gpu, &pass, &settings, 16);
    assert!(difference(&map, &environment.levels.0[0]).worst <= 1e-5);
    let basis = cube_of(8, |n| tutorial_basis(n)[0]);
    assert!(basis.rgb.iter().all(|value| value.is_finite()), "even faces have no texel at a pole");
}

#[test]
fn brdf_table_is_its_twin() {
    let Some(gpu) = gpu() else { return };
    let size = 32;
    for (features, masking, other) in [
        (&[][..], Masking::SmithCorrelated, Masking::SmithSeparable),
        (&["schlick"][..], Masking::SchlickIbl, Masking::SmithCorrelated),
    ] {
        let pass = Pass::new(gpu, "shaders/bake/brdf_table.wgsl", "main", features);
        let target = flat_texture(gpu, size, size);
        let resources =
            [("table", wgpu::BindingResource::TextureView(&target.create_view(&Default::default())))];
        pass.run(gpu, &resources, &[("sample_count", Setting::U32(1024))], [size as u32, size as u32, 1]);
        let map = read_image(gpu, &target);
        let exact = kiln_bake::table(Table::GgxScaleBias(masking), TableAxes::Uniform, size, Cancel::NEVER)
            .expect(WANTED);
        let worst = |expected: &dyn Fn(usize) -> [f64; 2]| {
            let error = |index: usize| {
                let texel = [map.rgb[3 * index], map.rgb[3 * index + 1]].map(f64::from);
                let expected = expected(index);
                let off = (texel[0] - expected[0]).abs().max((texel[1] - expected[1]).abs());
                if off.is_nan() { f64::INFINITY } else { off }
            };
            (0..size * size).map(error).fold(0.0, f64::max)
        };
        let centre = |index: usize| (index as f64 + 0.5) / size as f64;
        let twin = worst(&|index| {
            twins::scale_bias(masking, centre(index % size), centre(index / size), 1024, ALONG_X)
        });
        let wrong = worst(&|index| {
            twins::scale_bias(other, centre(index % size), centre(index / size), 1024, ALONG_X)
        });
        let truth = worst(&|index| [exact[2 * index], exact[2 * index + 1]].map(f64::from));
        say(&format!(
            "brdf_table, {masking:?}, 1024 samples: twin {twin:.1e} (tolerance 2e-5, another {wrong:.1e})  truth: worst {truth:.1e}"
        ));
        assert!(twin <= 2e-5 && wrong > 2e-5, "{masking:?}");
    }
}

#[test]
fn background_looks_through_the_camera() {
    let Some(gpu) = gpu() else { return };
    let pass = Pass::new(gpu, "shaders/bake/background.wgsl", "main", &[]);
    let panorama = made();
    let environment = Environment::new(gpu, &panorama, 32);
    // Looks along +X, 90° wide: clip x is +Z, clip y is +Y, and the far plane is at 1.
    let world_from_clip = [[0.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0; 4], [1.0, 0.0, 0.0, 1.0]];
    let target = flat_texture(gpu, 24, 16);
    let resources = [
        ("picture", wgpu::BindingResource::TextureView(&target.create_view(&Default::default()))),
        ("environment", wgpu::BindingResource::TextureView(&cube_view(&environment.texture))),
        ("environment_sampler", wgpu::BindingResource::Sampler(&sampler(gpu, false))),
    ];
    let settings = [("world_from_clip", Setting::Matrix(world_from_clip)), ("level", Setting::F32(1.0))];
    pass.run(gpu, &resources, &settings, [24, 16, 1]);
    let picture = read_image(gpu, &target);
    let worst = |mirrored: f64| {
        let error = |index: usize| {
            let (x, y) = (index % 24, index / 24);
            let at = [2.0 * (x as f64 + 0.5) / 24.0 - 1.0, 1.0 - 2.0 * (y as f64 + 0.5) / 16.0];
            let expected = environment.levels.sample([1.0, at[1], mirrored * at[0]], 1.0);
            let texel = picture.texel(x, y).map(f64::from);
            (0..3).map(|i| (texel[i] - expected[i]).abs()).fold(0.0, f64::max)
        };
        (0..24 * 16).map(error).fold(0.0, f64::max)
    };
    say(&format!("background: twin {:.1e} (tolerance 1e-4), mirrored {:.1e}", worst(1.0), worst(-1.0)));
    assert!(worst(1.0) <= 1e-4 && worst(-1.0) > 1e-4);
    assert!(panorama_uv([1.0, 0.0, 0.0])[0] == 0.75, "the side that is seen");
}
