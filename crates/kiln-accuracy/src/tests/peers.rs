//! Estimators beside the tools they are named after.

use kiln_bake::{BruteForce, RoughnessLaw};
use kiln_image::{Cancel, Limits, Panorama, TexelPolicy};

use crate::{Bench, Estimator, LobeKind, Source, Stopwatch, Truth, chain};

/// Time decides nothing here.
struct NoWatch;

impl Stopwatch for NoWatch {
    fn seconds(&self, work: &mut (dyn FnMut() + Send)) -> f64 {
        work();
        1.0
    }
}

fn corpus(name: &str) -> Option<Panorama> {
    let root = std::env::var_os("KILN_CORPUS")?;
    let bytes = std::fs::read(std::path::Path::new(&root).join(name)).unwrap();
    let mut image = kiln_image::decode(&bytes, &Limits::default(), Cancel::NEVER).unwrap().image;
    TexelPolicy::Repair.apply(&mut image, Cancel::NEVER).unwrap();
    Some(Panorama::new(image).unwrap())
}

/// RMS errors in per cent of the first and the last rough mip, as the tools themselves were measured: 1024 samples, a chain from
/// faces of 256 texels out of a panorama of 1024 × 512. Khronos' chain has five mips.
const KHRONOS: [(&str, [f64; 2]); 2] =
    [("hdr/polyhaven-pmndrs/venice.hdr", [0.52, 3.0]), ("hdr/polyhaven-pmndrs/studio.hdr", [2.0, 24.0])];

/// How far an estimator is from such a figure, as a factor of at least 1.
fn factors(estimator: Estimator, bench: &Bench, measured: [f64; 2]) -> [f64; 2] {
    let curve = bench.curve(estimator, &[1024.0], Cancel::NEVER).unwrap();
    let levels = &curve.points[0].levels;
    let found = [levels[0].rms, levels[levels.len() - 1].rms];
    std::array::from_fn(|i| (100.0 * found[i] / measured[i]).max(measured[i] / (100.0 * found[i])))
}

#[test]
#[expect(clippy::print_stderr, reason = "a skipped test says so, a measured one what it measured")]
fn khronos_estimator_is_as_wrong_as_khronos_tool_within_a_factor_of_two() {
    let law = RoughnessLaw::custom(vec![0.0, 0.25, 0.5, 0.75, 1.0]).unwrap();
    for (name, measured) in KHRONOS {
        let Some(panorama) = corpus(name) else {
            eprintln!("SKIPPED: KILN_CORPUS is not set, {name} was not looked at");
            continue;
        };
        let force = BruteForce::new(&panorama, Cancel::NEVER).unwrap();
        let source = Source::new(&panorama, 256, Cancel::NEVER).unwrap();
        let levels = chain(LobeKind::Ggx, 256, &law);
        let truths: Vec<Truth> = [levels[0], levels[levels.len() - 1]]
            .map(|level| Truth::new(&force, level, 64, Cancel::NEVER).unwrap())
            .into();
        let bench = Bench { panorama: &panorama, source: &source, truths: &truths, watch: &NoWatch };
        let own = factors(Estimator::Khronos, &bench, measured);
        let other = factors(Estimator::ImportanceMips, &bench, measured);
        eprintln!("{name}: khronos {own:?}, importance-mips {other:?}");
        assert!(own.iter().all(|factor| *factor <= 2.0), "{name}: {own:?}");
        assert!(
            other.iter().any(|factor| *factor > 2.0),
            "{name}: the check sees no other sampler, {other:?}"
        );
    }
}

#[test]
fn probes_find_the_error_that_all_texels_have() {
    let Some(panorama) = corpus(KHRONOS[1].0) else { return };
    let force = BruteForce::new(&panorama, Cancel::NEVER).unwrap();
    let source = Source::new(&panorama, 64, Cancel::NEVER).unwrap();
    let level = chain(LobeKind::Ggx, 64, &RoughnessLaw::Linear)[1];
    let rms = |count: usize| {
        let truths = [Truth::new(&force, level, count, Cancel::NEVER).unwrap()];
        let bench = Bench { panorama: &panorama, source: &source, truths: &truths, watch: &NoWatch };
        let curve = bench.curve(Estimator::Khronos, &[64.0, 1024.0], Cancel::NEVER).unwrap();
        [curve.points[0].error.rms, curve.points[1].error.rms]
    };
    // The second asks for as many probes as there are texels, and gets all of them with their solid angles.
    let (some, all) = (rms(96), rms(level.texels()));
    for (some, all) in some.iter().zip(all) {
        assert!((some / all - 1.0).abs() <= 0.25, "{some} of some, {all} of all");
    }
    assert!(some[0] > 1.25 * some[1], "the check tells knobs apart");
}
