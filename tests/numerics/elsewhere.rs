//! What other engines had as bugs, and is not also a case of another file.

use std::collections::BTreeSet;
use std::sync::Arc;

use kiln_bake::{
    AnalysisRequest, Lobe, Masking, SheenVisibility, Table, TableAxes, dering, irradiance_sh, table,
    table_error,
};
use kiln_image::{Cancel, Environment, Limits, decode_environment, hdr, limit_radiance};
use kiln_shader::{Outcome, Program};

use crate::maps::{baked, check_radiance, flattened, panorama, sky, with_sun};
use crate::record::{hold, relative, worst};
use crate::support::{first_infinite, gpu, grid};

#[test]
fn limit_keeps_hue_and_says_what_light_it_took() {
    // A fixed clamp of each channel turns an orange sun yellow, and silently.
    let mut sun = panorama(16, |_| [0.1; 3]);
    sun.rgb_mut()[300..303].copy_from_slice(&[4000.0, 2000.0, 500.0]);
    let report = limit_radiance(&mut sun, 100.0, Cancel::NEVER).unwrap();
    assert_eq!(&sun.rgb()[300..303], &[100.0, 50.0, 12.5]);
    assert!(report.limited.count == 1 && report.fraction_lost() > 0.5, "{report:?}");
}

#[test]
fn dark_side_of_a_sun_is_not_negative_after_the_window() {
    let sun = with_sun(32, 1e5, |_| [0.1; 3]);
    let request = AnalysisRequest { alpha_min: 1.0, sheen_alpha_min: None, error: 1e-3 };
    let harmonics = irradiance_sh(&kiln_bake::analyse(&sun, &request, Cancel::NEVER).unwrap());
    let windowed = dering(&harmonics, Cancel::NEVER).unwrap();
    let finding = |harmonics| kiln_check::check_harmonics("sh", "irradiance", harmonics).findings.len();
    assert_eq!((finding(&harmonics), finding(&windowed.sh)), (1, 0), "{:?}", windowed.minimum_after);
}

#[test]
fn light_from_above_does_not_bleed_below() {
    // A white upper half: E/π on a surface that faces down is 0, not 1/2.
    let half = panorama(64, |[_, y, _]| if y > 0.0 { [1.0; 3] } else { [0.0; 3] });
    let map = baked(&half, Lobe::Lambert, 17, 1e-4);
    let [above, below, side] = [2, 3, 4].map(|face| f64::from(map.cube.texel(face, 8, 8)[0]));
    hold(
        "light_from_above_does_not_bleed_below",
        "f64",
        worst([above - 1.0, below, side - 0.5, map.accuracy.clamped_flux].map(f64::abs)),
    );
}

#[test]
fn maps_do_not_depend_on_the_resolution_of_a_smooth_source() {
    let map = |height| baked(&panorama(height, sky), Lobe::Ggx { alpha: 0.2 }, 8, 1e-5).cube;
    let [coarse, fine] = [map(64), map(192)];
    let error = worst(flattened(&coarse).zip(flattened(&fine)).map(|(a, b)| relative(a, b, 1.0)));
    hold("maps_do_not_depend_on_the_resolution_of_a_smooth_source", "f64", error);
}

#[test]
fn second_environment_of_another_size_is_as_bright() {
    let mean = |height: usize| {
        let map = baked(&panorama(height, |_| [0.7; 3]), Lobe::Lambert, 8, 1e-4);
        check_radiance(&map.cube);
        kiln_check::mean_radiance(&map.cube, Cancel::NEVER).unwrap().mean[0]
    };
    let means = [16, 64, 20].map(mean);
    assert!(means.iter().all(|it| relative(*it, f64::from(0.7f32), 0.0) <= 1e-5), "{means:?}");
}

#[test]
fn coat_seen_at_grazing_angles_divides_by_nothing() {
    let Some(gpu) = gpu() else { return };
    let cosines = [0.0, 1e-38, 1e-20, 1e-7, 1e-3, 1.0];
    let arguments = grid(&[&cosines, &cosines, &[0.0, 1e-4, 0.3, 1.0]]);
    for function in [
        "v_smith_height_correlated(a.x, a.y, a.z)",
        "v_smith_separable(a.x, a.y, a.z)",
        "v_ashikhmin(a.x, a.y)",
    ] {
        let names = "lib::brdf::{v_ashikhmin, v_smith_height_correlated, v_smith_separable}";
        assert_eq!(first_infinite(gpu, names, &format!("vec4f({function})"), &arguments), None);
    }
    let albedo =
        "vec4f(ggx_albedo(vec3f(0.04), 1.0, a.xy).single, ggx_albedo(vec3f(1.0), 1.0, a.xy).multiple.x)";
    assert_eq!(first_infinite(gpu, "lib::environment::ggx_albedo", albedo, &arguments), None);
}

#[test]
fn tables_are_floats_and_do_not_band() {
    // 8 bits step by 4e-3; a table's own interpolation is far below, and its texels are floats.
    for kind in [Table::GgxScaleBias(Masking::SmithCorrelated), Table::SheenAlbedo(SheenVisibility::Clamped)]
    {
        let values = table(kind, TableAxes::Graded, 64, Cancel::NEVER).unwrap();
        assert!(values.iter().all(|value| value.is_finite()));
        let error = table_error(kind, TableAxes::Graded, 64, &values, 0.1, Cancel::NEVER).unwrap();
        let levels: BTreeSet<u32> = values.iter().map(|value| value.to_bits()).collect();
        assert!(levels.len() > 2000, "{} levels", levels.len());
        let name = if kind == Table::SheenAlbedo(SheenVisibility::Clamped) { "f64 sheen" } else { "f64" };
        hold("tables_are_floats_and_do_not_band", name, error.worst);
    }
}

#[test]
fn files_in_the_old_form_and_of_any_size_are_read() {
    // Flat RGBE without runs, three texels high.
    let mut flat = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 3 +X 6\n".to_vec();
    flat.extend([128, 64, 32, 129].repeat(18));
    let decoded = decode_environment(&flat, None, &Limits::default(), Cancel::NEVER).unwrap();
    let Environment::Panorama(old) = &decoded.environment else { panic!("{:?}", decoded.layout) };
    assert_eq!(old.texel(5, 2), [1.0, 0.5, 0.25]);
    let odd = panorama(37, sky);
    let exr = kiln_image::exr_write::encode_panorama(&odd, Cancel::NEVER).unwrap();
    for bytes in [exr, hdr::encode(odd.image())] {
        let decoded = decode_environment(&bytes, None, &Limits::default(), Cancel::NEVER).unwrap();
        assert_eq!(decoded.environment.size_text(), "74 × 37");
        let Environment::Panorama(read) = decoded.environment else { panic!("{:?}", decoded.layout) };
        check_radiance(&baked(&read, Lobe::Ggx { alpha: 0.3 }, 4, 1e-3).cube);
    }
}

fn compiled(files: &[(&str, &str)], features: &[&str]) -> Outcome {
    let features = features.iter().map(|&feature| feature.to_owned()).collect();
    let mut read =
        |path: &str| files.iter().find(|(name, _)| *name == path).map(|(_, text)| Arc::from(*text));
    kiln_shader::compile(&Program::of("root.wgsl"), &features, &mut read)
}

const ROOT: &str = "import part::half;\n@if(red) const TINT: f32 = 1.0;\n@if(!red) const TINT: f32 = 0.5;\n\
                    @fragment fn fs_main() -> @location(0) vec4f { return vec4f(half(TINT)); }\n";

#[test]
fn constant_that_no_half_holds_is_a_message_and_no_panic() {
    for text in [
        "enable f16;\n@compute @workgroup_size(1) fn main() { let x = f16(65520i); }",
        "enable f16;\nconst X: f16 = f16(1e9);",
    ] {
        let outcome = compiled(&[("root.wgsl", text)], &[]);
        assert!(outcome.compiled.is_none() && !outcome.diagnostics.is_empty(), "{text}");
    }
}

#[test]
fn missing_file_and_edited_include_are_looked_at_again() {
    let without = compiled(&[("root.wgsl", ROOT)], &[]);
    let missing = without.dependencies.iter().find(|it| it.path == "part.wgsl").expect("it was looked for");
    assert!(without.compiled.is_none() && !missing.found, "its appearance is a change");
    let with = |part: &str| compiled(&[("root.wgsl", ROOT), ("part.wgsl", part)], &[]);
    let [a, b] = ["fn half(x: f32) -> f32 { return 0.5 * x; }", "fn half(x: f32) -> f32 { return 0.4 * x; }"]
        .map(with);
    assert!(a.dependencies.iter().any(|it| it.path == "part.wgsl" && it.found));
    assert_ne!(a.compiled.unwrap().wgsl, b.compiled.unwrap().wgsl);
}

#[test]
fn error_in_an_included_file_is_placed_in_it() {
    let part = "// A line.\nfn half(x: f32) -> f32 { return 0.5 * y; }\n";
    let outcome = compiled(&[("root.wgsl", ROOT), ("part.wgsl", part)], &[]);
    let error = outcome.diagnostics.iter().find(|it| it.is_error()).unwrap();
    let span = error.span.as_ref().unwrap();
    assert_eq!((error.file.as_deref(), span.line, span.column), (Some("part.wgsl"), 2, 39), "{error}");
}

#[test]
fn features_that_no_condition_names_make_no_permutation() {
    let files = [("root.wgsl", ROOT), ("part.wgsl", "fn half(x: f32) -> f32 { return 0.5 * x; }")];
    let wgsl = |features: &[&str]| compiled(&files, features).compiled.unwrap().wgsl;
    assert_eq!(compiled(&files, &["red", "skin", "fog"]).features, BTreeSet::from(["red".to_owned()]));
    assert_eq!(wgsl(&["red", "skin", "fog"]), wgsl(&["red"]));
    assert_ne!(wgsl(&["red"]), wgsl(&[]));
}
