//! The estimators of `kiln-accuracy` beside their WGSL passes of the same stem.

use kiln_accuracy::passes::brdf_table::{TABLES, scale_bias};
use kiln_accuracy::passes::prefilter_jittered::jitter;
use kiln_accuracy::{Estimator, Level, LobeKind, Source};
use kiln_bake::{Cancel, Masking};
use kiln_gpu::Gpu;
use kiln_image::Cube;

use crate::bakes::{Environment, WANTED, panoramas};
use crate::cubes::Levels;
use crate::cubes::{
    cube_of, cube_texture, cube_view, difference, flat_texture, level_view, read_cube, read_image,
    upload_cube,
};
use crate::passes::{Pass, Setting, sampler};
use crate::support::{gpu, say};

/// Largest difference of a texel from the native twin, relative to the map's RMS: sums of a thousand lookups in `f32`.
const TWIN: f64 = 1e-4;
/// Sums of sixteen thousand, beside lamps that are steep for a lookup placed to 1e-6 of the sphere.
const TWIN_OF_MANY: f64 = 1e-3;

const SIZE: usize = 8;

struct Case {
    estimator: Estimator,
    kind: LobeKind,
    path: &'static str,
    entry: &'static str,
    mip: usize,
    count: u32,
    /// As `level_bias`; passes that have none leave it out.
    bias: Option<f32>,
    tolerance: f64,
}

fn cases() -> Vec<Case> {
    use Estimator::{Cosine, Eevee, Filtered, Grid, Importance, ImportanceMips, Khronos, Visible, Vulkan};
    use LobeKind::{Charlie, Ggx, Lambert};
    let case = |estimator, kind, path, entry, mip, count, bias, tolerance| Case {
        estimator,
        kind,
        path,
        entry,
        mip,
        count,
        bias,
        tolerance,
    };
    let (plain, khronos) = ("shaders/bake/prefilter.wgsl", "shaders/bake/prefilter_khronos.wgsl");
    vec![
        case(Importance, Ggx, plain, "main", 2, 1024, Some(-64.0), TWIN),
        case(ImportanceMips, Ggx, plain, "main", 2, 1024, Some(0.0), TWIN),
        case(Filtered, Ggx, plain, "main", 2, 1024, Some(1.0), TWIN),
        case(Visible, Ggx, "shaders/bake/prefilter_visible.wgsl", "main", 2, 1024, Some(0.0), TWIN),
        case(Eevee, Ggx, "shaders/bake/prefilter_eevee.wgsl", "main", 2, 32, Some(1.0), TWIN),
        case(Vulkan, Ggx, "shaders/bake/prefilter_jittered.wgsl", "main", 2, 32, None, TWIN),
        case(Khronos, Ggx, khronos, "ggx", 2, 1024, None, TWIN),
        case(Khronos, Lambert, khronos, "lambert", 0, 1024, None, TWIN),
        case(Khronos, Charlie, khronos, "charlie", 2, 1024, None, TWIN),
        case(Cosine, Lambert, "shaders/bake/irradiance.wgsl", "cosine", 0, 256, Some(0.0), TWIN),
        case(Grid, Lambert, "shaders/bake/irradiance.wgsl", "grid", 0, 0, None, TWIN_OF_MANY),
    ]
}

/// The pass's map.
fn drawn(gpu: &Gpu, case: &Case, level: &Level, texture: &wgpu::Texture) -> Cube {
    let pass = Pass::new(gpu, case.path, case.entry, &[]);
    let target = cube_texture(gpu, SIZE, 1);
    let numbers = Levels(vec![cube_of(SIZE, |normal| [jitter(normal); 3])]);
    let numbers = upload_cube(gpu, &numbers);
    let (faces, environment) = (level_view(&target, 0), cube_view(texture));
    let (numbers, linear) = (level_view(&numbers, 0), sampler(gpu, false));
    let mut resources = vec![
        ("faces", wgpu::BindingResource::TextureView(&faces)),
        ("environment", wgpu::BindingResource::TextureView(&environment)),
        ("environment_sampler", wgpu::BindingResource::Sampler(&linear)),
    ];
    if case.estimator == Estimator::Vulkan {
        resources.push(("jitter", wgpu::BindingResource::TextureView(&numbers)));
    }
    let mut settings = Vec::new();
    if case.estimator == Estimator::Grid {
        settings.push(("step", Setting::F32(0.025)));
    } else {
        settings.push(("sample_count", Setting::U32(case.count)));
        settings.extend(case.bias.map(|bias| ("level_bias", Setting::F32(bias))));
        if case.kind != LobeKind::Lambert {
            settings.push(("perceptual_roughness", Setting::F32(level.roughness as f32)));
        }
    }
    pass.run(gpu, &resources, &settings, [SIZE as u32, SIZE as u32, 6]);
    read_cube(gpu, &target, 0)
}

/// The twin's map.
fn native(case: &Case, level: &Level, source: &Source, knob: f64) -> Cube {
    let taps = case.estimator.taps(level, source.face_size(), knob).expect("it estimates the lobe");
    cube_of(SIZE, |normal| taps.radiance(source, normal, case.estimator.jitter(normal)))
}

#[test]
fn estimators_are_their_passes() {
    let Some(gpu) = gpu() else { return };
    for (name, panorama) in panoramas() {
        let environment = Environment::new(gpu, &panorama, 64);
        let source = Source::of_levels(&environment.levels.0, Cancel::NEVER).expect(WANTED);
        for case in cases() {
            let roughness = 0.5;
            let lobe = case.kind.of_roughness(roughness);
            let level = Level { mip: case.mip, mip_count: 5, roughness, lobe, face_size: SIZE };
            let knob = match case.estimator {
                Estimator::Eevee => 1.0,
                Estimator::Grid => f64::from(0.025_f32),
                _ => f64::from(case.count),
            };
            let map = drawn(gpu, &case, &level, &environment.texture);
            let twin = difference(&map, &native(&case, &level, &source, knob));
            let other = if case.estimator == Estimator::Grid { 2.0 * knob } else { 0.5 * knob };
            let another = difference(&map, &native(&case, &level, &source, other));
            let label = format!("{name}: {} of {}", case.estimator.name(), case.kind.name());
            say(&format!(
                "{label:40} twin {:7.1e} (tolerance {:.0e}, another knob {:7.1e})",
                twin.worst, case.tolerance, another.worst
            ));
            assert!(twin.worst <= case.tolerance, "{label} is not its pass: {twin:?}");
            assert!(another.worst > case.tolerance, "{label}: the check does not see another knob");
        }
    }
}

#[test]
fn every_masking_and_turn_of_tables_is_its_pass() {
    let Some(gpu) = gpu() else { return };
    let size = 16;
    for table in TABLES.iter().filter(|table| table.sample_count.is_some()) {
        let features: &[&str] = match table.masking {
            Masking::SmithSeparable => &["separable"],
            Masking::SchlickIbl => &["schlick"],
            _ => &[],
        };
        let pass = Pass::new(gpu, "shaders/bake/brdf_table.wgsl", "main", features);
        let target = flat_texture(gpu, size, size);
        let view = target.create_view(&Default::default());
        let resources = [("table", wgpu::BindingResource::TextureView(&view))];
        let count = table.sample_count.expect("it is sampled");
        let turn = table.view_turn();
        let settings = [("sample_count", Setting::U32(count)), ("view_turn", Setting::F32(turn as f32))];
        pass.run(gpu, &resources, &settings, [size as u32, size as u32, 1]);
        let map = read_image(gpu, &target);
        let centre = |index: usize| (index as f64 + 0.5) / size as f64;
        let worst = |turn: f64| {
            let off = |index: usize| {
                let expected =
                    scale_bias(table.masking, centre(index % size), centre(index / size), count, turn);
                let found = [map.rgb[3 * index], map.rgb[3 * index + 1]].map(f64::from);
                let off = (found[0] - expected[0]).abs().max((found[1] - expected[1]).abs());
                if off.is_nan() { f64::INFINITY } else { off }
            };
            (0..size * size).map(off).fold(0.0, f64::max)
        };
        let (twin, another) = (worst(turn), worst(turn + 0.1));
        say(&format!(
            "table of {}: twin {twin:.1e} (tolerance 1e-4, another turn {another:.1e})",
            table.name
        ));
        assert!(twin <= 1e-4 && another > 1e-4, "{}", table.name);
    }
}
