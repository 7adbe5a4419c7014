//! Diffuse light from harmonics beside that from the map.

use kiln_diagnostic::Diagnostic;
use serde_json::json;

use super::fixture::{Build, gpu};
use crate::{DiffuseSource, HeadlessViewer, Selection};

/// Even light of radiance `value`: its irradiance over π is that, and Y_00 = 1 / √(4π).
fn even(value: f64) -> serde_json::Value {
    let mut coefficients = vec![[0.0; 3]; 9];
    coefficients[0] = [value * (4.0 * std::f64::consts::PI).sqrt(); 3];
    json!({ "order": 2, "irradiance_over_pi": coefficients })
}

/// A rough white ball in even light of 0.5, with harmonics that say so or something else.
fn picture(
    harmonics: Option<serde_json::Value>,
    diffuse: DiffuseSource,
) -> Option<(Vec<u8>, Vec<Diagnostic>)> {
    let mut build =
        Build::ball(json!({ "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 } }));
    build.env("sky", [[0.5; 3]; 6]);
    if let Some(facts) = harmonics {
        build.target("env/sky/sh", "sh", json!({ "order": 2 }), &[("json", facts.to_string().into_bytes())]);
    }
    let mut viewer = HeadlessViewer::new(gpu()?, [64, 64]);
    viewer.select(Selection { diffuse, ..Selection::default() });
    let report = viewer.apply(&build.revision());
    assert_eq!(report.shown.diffuse, diffuse);
    Some((viewer.render().expect("the device reads back").into_raw(), report.diagnostics))
}

fn largest_difference(a: &[u8], b: &[u8]) -> u8 {
    a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0)
}

#[test]
fn even_light_is_the_same_from_map_and_harmonics_and_other_harmonics_show() {
    let Some((map, _)) = picture(None, DiffuseSource::Map) else { return };
    let with = |facts| picture(Some(facts), DiffuseSource::Harmonics).expect("there is a device");
    let (same, diagnostics) = with(even(0.5));
    assert_eq!(diagnostics, vec![]);
    assert!(largest_difference(&map, &same) <= 1);
    assert!(largest_difference(&map, &with(even(0.25)).0) > 20, "the check sees half the light");
    // Far above binary16: divided by a power of two, and back.
    let (bright, diagnostics) = with(even(1e7));
    assert_eq!(diagnostics, vec![]);
    assert!(bright.contains(&255));
}

#[test]
fn absent_or_damaged_harmonics_leave_the_map_and_say_so() {
    let Some((map, _)) = picture(None, DiffuseSource::Map) else { return };
    let (absent, diagnostics) = picture(None, DiffuseSource::Harmonics).expect("there is a device");
    assert_eq!((absent == map, diagnostics), (true, vec![]));
    let too_few = json!({ "order": 4, "irradiance_over_pi": [[1.0, 1.0, 1.0]] });
    let too_large = json!({ "order": 0, "irradiance_over_pi": [[1e300, 1.0, 1.0]] });
    for (facts, expected) in
        [(too_few, "has 1 coefficients of order 4"), (too_large, "too large"), (json!([]), "malformed")]
    {
        let (picture, diagnostics) =
            picture(Some(facts), DiffuseSource::Harmonics).expect("there is a device");
        assert!(picture == map);
        assert_eq!(diagnostics.len(), 1);
        assert!(diagnostics[0].to_string().contains(expected), "{}", diagnostics[0]);
    }
}

#[test]
fn harmonics_that_ring_below_zero_are_black_there() {
    let facts = json!({ "order": 1, "irradiance_over_pi": [[0.1, 0.1, 0.1], [0.0, 0.0, 0.0], [5.0, 5.0, 5.0], [0.0, 0.0, 0.0]] });
    let (texels, scale_log2) =
        crate::harmonics::irradiance_cube("sky", facts.to_string().as_bytes()).expect("it is sound");
    let value = |at: usize| half::f16::from_le_bytes([texels[2 * at], texels[2 * at + 1]]).to_f32();
    assert_eq!(scale_log2, 0);
    let size = crate::harmonics::FACE_SIZE;
    let middle = |face: usize| 4 * (face * size * size + size / 2 * size + size / 2);
    // +Z, which is l = 1, m = 0 here, and −Z.
    assert!(value(middle(4)) > 2.0);
    assert_eq!(value(middle(5)), 0.0);
}
