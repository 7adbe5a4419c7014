//! Sample points and densities at the ends of their ranges.

use kiln_brdf::sampling::{
    hammersley, pdf_cosine, radical_inverse, sample_charlie, sample_cosine, sample_ggx,
};

use crate::maps::Random;
use crate::record::hold_wgsl;
use crate::support::{Comparison, first_infinite, gpu, grid};

#[test]
fn first_and_last_points_lie_in_the_square() {
    let mut random = Random(5);
    for count in [1, 2, 3, 1024, 1 << 20, u32::MAX, 1 + random.bits() as u32 / 2] {
        assert_eq!(hammersley(0, count), [0.0, 0.0]);
        let [x, y] = hammersley(count - 1, count);
        assert!((0.0..1.0).contains(&x) && (0.0..1.0).contains(&y), "{count}: {x} {y}");
        for sample in [sample_cosine([x, y]), sample_ggx([x, y], 1e-8), sample_charlie([x, y], 1e-8)] {
            assert!(sample.iter().all(|value| value.is_finite()), "{count} {sample:?}");
        }
    }
    let points = Comparison {
        function: "lib::sampling::hammersley",
        call: "vec4f(hammersley(u32(a.x), u32(a.y)), 0.0, 0.0)",
        arguments: vec![
            [0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 1024.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [1023.0, 1024.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [1_048_575.0, 1_048_576.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        ],
        truth: |a| {
            let [x, y] = hammersley(a[0] as u32, a[1] as u32);
            [x, y, 0.0, 0.0]
        },
        wrong: |a| {
            let [x, y] = hammersley(a[0] as u32 + 1, a[1] as u32);
            [x, y, 0.0, 0.0]
        },
        tolerance: 1e-7,
        least: 1.0,
    };
    hold_wgsl("first_and_last_points_lie_in_the_square", &[points]);
}

#[test]
fn radical_inverse_of_the_largest_index_is_below_one() {
    let mut random = Random(6);
    assert_eq!(radical_inverse(u32::MAX), 1.0 - 1.0 / f64::from(1 << 24));
    for _ in 0..1000 {
        let index = random.bits() as u32 | 0xffff_ff00;
        assert!(radical_inverse(index) < 1.0 && (radical_inverse(index) as f32) < 1.0, "{index}");
    }
    assert_eq!(u32::MAX.reverse_bits() as f32 * 2.328_306_4e-10, 1.0, "all 32 bits round up to it");
    let inverse = Comparison {
        function: "lib::sampling::radical_inverse",
        call: "vec4f(radical_inverse(0xffffffffu - u32(a.x)), 0.0, 0.0, 0.0)",
        arguments: grid(&[&[0.0, 1.0, 255.0]]),
        truth: |a| [radical_inverse(u32::MAX - a[0] as u32), 0.0, 0.0, 0.0],
        wrong: |_| [1.0, 0.0, 0.0, 0.0],
        tolerance: 0.0,
        least: 1.0,
    };
    hold_wgsl("radical_inverse_of_the_largest_index_is_below_one", &[inverse]);
}

/// The level formula as `shaders/bake/source.wgsl` has it, with the size of its map in place of the texture.
fn filter_level_text() -> String {
    let source =
        std::fs::read_to_string(crate::support::repository().join("shaders/bake/source.wgsl")).unwrap();
    let from = source.find("fn filter_level").expect("the pass has it");
    let end = from + source[from..].find("\n}").unwrap() + 2;
    let text = source[from..end].replace("f32(textureDimensions(environment).x)", "source_size");
    assert!(
        text.contains("source_size"),
        "the level follows the width of what is read, not of what is written"
    );
    text.replace("pdf: f32,", "source_size: f32, pdf: f32,")
}

/// Levels for sizes `a.x`, densities `a.y` and counts `a.z`.
fn levels(arguments: &[[f32; 8]]) -> Option<Vec<f32>> {
    let gpu = gpu()?;
    let text = format!(
        "import lib::constants::PI;
        struct Case {{ a: vec4f, b: vec4f }}
        @group(0) @binding(0) var<storage, read> cases: array<Case>;
        @group(0) @binding(1) var<storage, read_write> results: array<f32>;
        {}
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3u) {{
            if id.x < arrayLength(&results) {{
                let a = cases[id.x].a;
                results[id.x] = filter_level(a.x, a.y, u32(a.z), 0.0);
            }}
        }}",
        filter_level_text()
    );
    let compiled = crate::support::compile("shaders/test/level.wgsl", Some(&text), &[]);
    let pass = gpu.compute_pass(&compiled.wgsl, "main", &[]).unwrap();
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
    let cases = gpu.buffer(bytemuck::cast_slice(arguments), usage);
    let results = gpu.buffer(&vec![0xff; arguments.len() * 4], usage);
    let bindings = [(0, &cases), (1, &results)]
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() });
    gpu.run_pass(&pass, &bindings, [arguments.len().div_ceil(64) as u32, 1, 1]).unwrap();
    Some(bytemuck::pod_collect_to_vec(&gpu.read_buffer(&results).unwrap()))
}

#[test]
fn density_of_zero_reads_a_level_that_exists() {
    let arguments =
        grid(&[&[1.0, 256.0, 4096.0], &[0.0, 1e-38, 1e-12, 1.0, 1e12, 3e38], &[0.0, 1.0, 1024.0]]);
    let Some(levels) = levels(&arguments) else { return };
    for (level, a) in levels.iter().zip(&arguments) {
        // 1e12 texels' worth is level 20 above the sphere's own.
        assert!(
            level.is_finite() && (0.0..40.0).contains(level),
            "{level} for size, density, count {:?}",
            &a[..3]
        );
    }
}

#[test]
fn level_follows_the_width_of_the_source() {
    let arguments = grid(&[&[256.0, 512.0], &[1.0], &[64.0]]);
    let Some(levels) = levels(&arguments) else { return };
    // A source of twice the width has texels of a quarter: one level more.
    assert!((levels[1] - levels[0] - 1.0).abs() <= 1e-5, "{levels:?}");
}

#[test]
fn counts_of_zero_and_one_are_counts() {
    assert_eq!((hammersley(0, 0), hammersley(0, 1)), ([0.0, 0.0], [0.0, 0.0]));
    assert!(pdf_cosine(sample_cosine(hammersley(0, 1))[2]) > 0.0);
    let Some(gpu) = gpu() else { return };
    let points = grid(&[&[0.0, 1.0], &[0.0, 1.0]]);
    let call = "vec4f(hammersley(u32(a.x), u32(a.y)), sample_cosine(hammersley(u32(a.x), u32(a.y))).xy)";
    assert_eq!(first_infinite(gpu, "lib::sampling::{hammersley, sample_cosine}", call, &points), None);
}
