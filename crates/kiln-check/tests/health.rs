//! Each check on something sound, and on the same with one thing wrong.

use kiln_bake::{ShCoefficients, TexelFormat};
use kiln_diagnostic::Severity;
use kiln_image::{Cancel, Cube, DecodedEnvironment, Environment, Image, Layout, Panorama};
use kiln_sphere::{cube_direction, panorama_direction};

use kiln_check::{
    Allowance, ChainKind, ChainSubject, Check, Finding, LevelFacts, Subject, allow, check_chain,
    check_environment, check_furnace, check_harmonics, html, mean_radiance,
};

/// A smooth sky: continuous over the sphere.
fn sky([x, y, z]: [f64; 3]) -> [f32; 3] {
    [1.5 + 0.4 * x + 0.3 * y, 1.2 + 0.3 * y * z, 1.8 - 0.5 * z].map(|value| value as f32)
}

fn panorama(height: usize, light: impl Fn([f64; 3]) -> [f32; 3]) -> DecodedEnvironment {
    let texel = |index: usize| {
        let (x, y) = (index % (2 * height), index / (2 * height));
        let (u, v) = ((x as f64 + 0.5) / (2 * height) as f64, (y as f64 + 0.5) / height as f64);
        light(panorama_direction(u, v))
    };
    let rgb = (0..2 * height * height).flat_map(texel).collect();
    let image = Image::new(2 * height, height, rgb).unwrap();
    let environment = Environment::Panorama(Panorama::new(image).unwrap());
    DecodedEnvironment {
        environment,
        layout: Layout::Equirect,
        format: "test",
        notes: Vec::new(),
        gamut: None,
    }
}

fn cube(size: usize, light: impl Fn([f64; 3]) -> [f32; 3]) -> Cube {
    let texel = |index: usize| {
        let (face, rest) = (index / (size * size), index % (size * size));
        let position = |index: usize| (2 * index + 1) as f64 / size as f64 - 1.0;
        light(cube_direction(face, position(rest % size), position(rest / size)))
    };
    Cube::new(size, (0..6 * size * size).flat_map(texel).collect()).unwrap()
}

fn checked(decoded: &DecodedEnvironment) -> Subject {
    check_environment("env/test", decoded, true, Cancel::NEVER).unwrap()
}

#[track_caller]
fn found(subject: &Subject, check: Check) -> &Finding {
    let found = subject.findings.iter().find(|finding| finding.check == check);
    found.unwrap_or_else(|| panic!("{} is not among {:?}", check.name(), subject.findings))
}

fn names(subject: &Subject) -> Vec<&'static str> {
    subject.findings.iter().map(|finding| finding.check.name()).collect()
}

fn with_texel(mut decoded: DecodedEnvironment, index: usize, value: f32) -> DecodedEnvironment {
    let Environment::Panorama(panorama) = &mut decoded.environment else { unreachable!() };
    panorama.rgb_mut()[index] = value;
    decoded
}

#[test]
fn sound_panorama_and_sound_cube_have_no_findings() {
    assert_eq!(names(&checked(&panorama(64, sky))), [""; 0]);
    let cube = DecodedEnvironment { environment: Environment::Cube(cube(32, sky)), ..panorama(2, sky) };
    assert_eq!(names(&checked(&cube)), [""; 0]);
}

#[test]
fn each_wrong_value_is_found_at_its_place() {
    let sound = || panorama(64, sky);
    let at = (5 * 128 + 7) * 3 + 1;
    for (value, check, severity) in [
        (f32::NAN, Check::NonFinite, Severity::Error),
        (f32::INFINITY, Check::NonFinite, Severity::Error),
        (-1e-6, Check::Negative, Severity::Warning),
        (-1e6, Check::Negative, Severity::Error),
        (70_000.0, Check::AboveF16, Severity::Warning),
    ] {
        let subject = checked(&with_texel(sound(), at, value));
        let finding = found(&subject, check);
        assert_eq!(finding.severity, severity, "{value}: {finding:?}");
        assert!(finding.places[0].contains("texel (7, 5)"), "{:?}", finding.places);
    }
    let largest_half = checked(&with_texel(sound(), at, 65504.0));
    assert!(!names(&largest_half).contains(&"above-f16"), "{:?}", largest_half.findings);
}

#[test]
fn sun_is_told_by_its_flux_and_what_formats_lose_beside_it() {
    let mut sun = panorama(128, |direction| sky(direction).map(|value| value * 1e-6));
    for channel in 0..3 {
        sun = with_texel(sun, (40 * 256 + 100) * 3 + channel, 1e7);
    }
    let subject = checked(&sun);
    assert_eq!(found(&subject, Check::SunFlux).severity, Severity::Note);
    assert_eq!(found(&subject, Check::F16Loss).severity, Severity::Note);
    assert!(subject.facts.iter().any(|fact| fact.name == "dynamic range"), "{:?}", subject.facts);
    assert_eq!(names(&checked(&panorama(128, |_| [0.0; 3]))), ["black"]);
}

#[test]
fn picture_that_does_not_wrap_and_poles_of_many_values_are_found() {
    let height = 64;
    let ramp = |index: usize| (1.0 + (index % (2 * height)) as f32 / height as f32).powi(2);
    let rgb = (0..2 * height * height).flat_map(|index| [ramp(index); 3]).collect();
    let cropped = Panorama::new(Image::new(2 * height, height, rgb).unwrap()).unwrap();
    let decoded = DecodedEnvironment { environment: Environment::Panorama(cropped), ..panorama(2, sky) };
    let subject = checked(&decoded);
    assert_eq!(found(&subject, Check::WrapColumn).severity, Severity::Warning);
    assert_eq!(subject.findings.iter().filter(|finding| finding.check == Check::Poles).count(), 2);
}

#[test]
fn turned_face_of_a_cube_is_found_by_its_edges() {
    let mut turned = cube(32, sky);
    let face: Vec<f32> = turned.face(2).chunks_exact(3).rev().flatten().copied().collect();
    let stride = 32 * 32 * 3;
    turned.rgb[2 * stride..3 * stride].copy_from_slice(&face);
    let decoded = DecodedEnvironment { environment: Environment::Cube(turned), ..panorama(2, sky) };
    let subject = checked(&decoded);
    assert!(found(&subject, Check::CubeEdges).message.contains("+Y"), "{:?}", subject.findings);
}

#[test]
fn edge_of_what_a_cube_shows_is_no_seam() {
    // Six colours meet at the cube's edges, in the source as well.
    let six = |[x, y, z]: [f64; 3]| {
        let (face, _) = kiln_sphere::cube_face_st([x, y, z]);
        [[1.0, 0.2, 0.1], [0.1, 3.0, 0.2], [0.1, 0.1, 9.0], [4.0; 3], [0.2; 3], [0.02; 3]][face]
    };
    let levels = [cube(32, six)];
    let of =
        |lookup| check_chain(&ChainSubject { lookup, ..chain(&levels, None) }, false, Cancel::NEVER).unwrap();
    found(&of(None), Check::CubeEdges);
    assert_eq!(names(&of(Some(&six))), [""; 0]);
    // … and a smooth source explains nothing.
    found(&of(Some(&sky)), Check::CubeEdges);
}

fn chain<'a>(levels: &'a [Cube], source: Option<LevelFacts>) -> ChainSubject<'a> {
    ChainSubject {
        name: "env/test/specular",
        kind: ChainKind::Radiance,
        levels,
        format: Some(TexelFormat::Rgba16Float.ktx2()),
        scale_log2: 0,
        source,
        lookup: None,
        asked: Some(1e-3),
        measured: None,
    }
}

/// A chain as lobes make it of [`sky`], whose harmonics of degree 1 and 2 shrink.
fn levels() -> Vec<Cube> {
    let level = |index: usize| {
        let left = 0.7f64.powi(index as i32) as f32;
        let mean = [1.5f32, 1.2, 1.8];
        cube(32 >> index, |direction| {
            let value = sky(direction);
            [0, 1, 2].map(|i| mean[i] + (value[i] - mean[i]) * left)
        })
    };
    (0..4).map(level).collect()
}

#[test]
fn sound_chain_has_no_findings_and_each_flaw_is_found() {
    let check = |levels: &[Cube], source| check_chain(&chain(levels, source), true, Cancel::NEVER).unwrap();
    let source = mean_radiance(&panorama(64, sky), Cancel::NEVER).unwrap();
    assert_eq!(names(&check(&levels(), Some(source))), [""; 0]);
    assert_eq!(names(&check(&levels(), None)), [""; 0]);

    let mut darker = levels();
    darker[2].rgb.iter_mut().for_each(|value| *value *= 0.97);
    assert_eq!(found(&check(&darker, Some(source)), Check::MipEnergy).severity, Severity::Warning);
    darker[2].rgb.iter_mut().for_each(|value| *value *= 0.8);
    assert_eq!(found(&check(&darker, Some(source)), Check::MipEnergy).severity, Severity::Error);

    let mut noisy = levels();
    let flip =
        |(index, value): (usize, &mut f32)| *value *= if (index / 3).is_multiple_of(2) { 1.5 } else { 0.5 };
    noisy[3].rgb.iter_mut().enumerate().for_each(flip);
    let subject = check(&noisy, Some(source));
    found(&subject, Check::MipContrast);
    found(&subject, Check::Overshoot);

    let mut broken = levels();
    broken[1].rgb[100] = f32::NAN;
    assert_eq!(found(&check(&broken, Some(source)), Check::NonFinite).severity, Severity::Error);
}

#[test]
fn rounding_is_judged_by_the_format_and_blocks_are_named_as_unchecked() {
    let levels = levels();
    let of = |format: TexelFormat, asked: f64| {
        let chain = ChainSubject { format: Some(format.ktx2()), asked: Some(asked), ..chain(&levels, None) };
        check_chain(&chain, false, Cancel::NEVER).unwrap()
    };
    assert_eq!(names(&of(TexelFormat::Rgba16Float, 1e-3)), [""; 0]);
    found(&of(TexelFormat::Rgba16Float, 1e-5), Check::EncodingError);
    found(&of(TexelFormat::R11g11b10Ufloat, 1e-3), Check::EncodingError);
    let blocks = of(TexelFormat::Bc6hUfloat, 1e-9);
    assert_eq!(blocks.unchecked[0].what, "encoding-error");
    let measured = ChainSubject { measured: Some(2e-3), ..chain(&levels, None) };
    found(&check_chain(&measured, false, Cancel::NEVER).unwrap(), Check::EncodingError);
}

#[test]
fn rounding_that_is_estimated_is_what_encoding_measures() {
    for format in [TexelFormat::Rgba16Float, TexelFormat::R11g11b10Ufloat, TexelFormat::Rgb9e5Ufloat] {
        let level = cube(32, sky);
        let encoded = kiln_bake::encode_level(&level, format, 0, Cancel::NEVER).unwrap();
        let levels = [kiln_bake::decode_level(&encoded.bytes, 32, format, 0).unwrap()];
        let subject = ChainSubject { format: Some(format.ktx2()), ..chain(&levels, None) };
        let subject = check_chain(&subject, false, Cancel::NEVER).unwrap();
        let rounding = subject.facts.iter().find(|fact| fact.name == "rounding").unwrap();
        let estimated: f64 = rounding.value.split(' ').next().unwrap().parse().unwrap();
        let ratio = estimated / encoded.rounding_rms;
        assert!((0.7..=1.4).contains(&ratio), "{format:?}: {estimated} for {}", encoded.rounding_rms);
    }
}

#[test]
fn negative_lobe_of_harmonics_is_found_and_a_mild_one_is_not() {
    let harmonics = |strength: f64| {
        let mut coefficients = vec![[0.0; 3]; 9];
        coefficients[0] = [3.5; 3];
        coefficients[1] = [strength; 3];
        ShCoefficients { order: 2, coefficients }
    };
    assert_eq!(names(&check_harmonics("env/test/sh", "irradiance", &harmonics(1.0))), [""; 0]);
    found(&check_harmonics("env/test/sh", "irradiance", &harmonics(3.0)), Check::ShNegative);
    found(&check_harmonics("env/test/sh", "irradiance", &harmonics(f64::NAN)), Check::NonFinite);
}

#[test]
fn furnace_tells_gained_from_lost_energy() {
    let frame =
        |values: [f32; 3]| Image::new(3, 1, values.iter().flat_map(|&value| [value; 3]).collect()).unwrap();
    let check = |values| check_furnace("furnace/pbr", &frame(values), true);
    assert_eq!(names(&check([1.0, 0.995, 1.004])), [""; 0]);
    let made = check([1.0, 1.02, 1.0]);
    assert_eq!((found(&made, Check::Furnace).severity, names(&made).len()), (Severity::Error, 1));
    assert!(found(&made, Check::Furnace).places[0].contains("(1, 0)"));
    assert_eq!(found(&check([1.0, 1.0, 0.9]), Check::Furnace).severity, Severity::Warning);
    found(&check([1.0, f32::NAN, 1.0]), Check::NonFinite);
}

#[test]
fn allowance_excuses_its_finding_alone_and_an_unused_one_is_told() {
    let mut subjects = vec![check_furnace("furnace/pbr", &Image::new(1, 1, vec![2.0; 3]).unwrap(), false)];
    let allowance =
        |check, target: &str| Allowance { check, target: target.to_owned(), reason: "known".to_owned() };
    assert!(subjects[0].is_bad(Severity::Error));
    let others = [allowance(Check::Furnace, "furnace/cloth"), allowance(Check::Poles, "furnace/pbr")];
    let mut unexcused = subjects.clone();
    allow(&mut unexcused, &others, "kiln.toml");
    assert!(unexcused[0].is_bad(Severity::Error));
    assert_eq!(unexcused[1].findings.len(), 2, "{:?}", unexcused[1]);
    allow(&mut subjects, &[allowance(Check::Furnace, "furnace/*")], "kiln.toml");
    assert!(!subjects[0].is_bad(Severity::Error) && subjects.len() == 1);
}

#[test]
fn names_of_checks_are_read_back() {
    for check in Check::ALL {
        assert_eq!(Check::from_name(check.name()), Some(check));
    }
    assert_eq!(Check::from_name("nonsense"), None);
}

#[test]
fn page_holds_every_finding_and_picture_and_no_markup_of_names() {
    let mut subject = checked(&with_texel(panorama(64, sky), 300, f32::NAN));
    subject.name = "<b>sky</b>".to_owned();
    let page = html("report", &[subject]);
    assert!(page.contains("&lt;b&gt;sky") && !page.contains("<b>sky"), "{page}");
    assert!(page.contains("data:image/png;base64,iVBORw0KGgo") && page.contains("NaN"), "{page}");
    assert!(!page.contains("<script") && !page.contains("http"), "it reads nothing else");
}

#[test]
fn smallest_environments_say_what_they_are_too_small_for() {
    let subject = checked(&panorama(1, sky));
    assert_eq!(subject.unchecked.len(), 2, "{:?}", subject.unchecked);
    let one = DecodedEnvironment { environment: Environment::Cube(cube(1, sky)), ..panorama(1, sky) };
    assert_eq!(checked(&one).unchecked.len(), 1);
}
