//! `kiln accuracy`: the report, other tools' maps, and what CI holds on to.

use std::path::PathBuf;
use std::process::Output;

use kiln_image::{Image, hdr};
use serde_json::Value;

use crate::harness::{Project, kiln, text};

/// A folder with a small sky that has a lamp.
struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    fn new() -> Desk {
        let desk = Desk { folder: tempfile::tempdir().unwrap() };
        let texel = |index: usize| {
            let (x, y) = (index % 64, index / 64);
            let lamp = if (20..23).contains(&x) && (9..11).contains(&y) { 40.0 } else { 0.0 };
            [0.5 + lamp, 0.25 + y as f32 / 64.0 + lamp, 1.0 + x as f32 / 64.0 + 0.5 * lamp]
        };
        let image = Image::new(64, 32, (0..64 * 32).flat_map(texel).collect()).unwrap();
        std::fs::write(desk.path("sky.hdr"), hdr::encode(&image)).unwrap();
        desk
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self, arguments: &[&str]) -> Output {
        let mut command = kiln();
        command.args(arguments).current_dir(self.folder.path());
        command.env("KILN_CACHE", self.path("cache")).output().unwrap()
    }

    /// `kiln accuracy sky.hdr` on small faces.
    fn accuracy(&self, arguments: &[&str]) -> Output {
        self.run(&[&["accuracy", "sky.hdr", "--size", "16", "--probes", "16"], arguments].concat())
    }

    fn report(&self, arguments: &[&str]) -> Value {
        let output = self.accuracy(&[arguments, &["--json"]].concat());
        assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    }
}

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} is no number"))
}

#[test]
fn report_has_curves_ladder_choice_and_a_page_that_needs_nothing_else() {
    let desk = Desk::new();
    let report = desk.report(&["--estimators", "convolution,khronos,cosine"]);
    let written: Value =
        serde_json::from_slice(&std::fs::read(desk.path("accuracy/accuracy.json")).unwrap()).unwrap();
    assert_eq!(report, written);
    let lobes = report.pointer("/environments/0/lobes").and_then(Value::as_array).unwrap();
    assert_eq!(lobes.len(), 2, "GGX and Lambert");
    for lobe in lobes {
        for curve in lobe["curves"].as_array().unwrap() {
            assert!(curve["points"].as_array().unwrap().len() >= 6, "{curve}");
        }
    }
    let best = |curve: usize| number(&lobes[0], &format!("/curves/{curve}/points/5/error/rms"));
    assert!(best(0) < 0.1 * best(1), "the convolution {} beside Khronos' {}", best(0), best(1));
    let rungs = report.pointer("/environments/0/ladder/rungs").and_then(Value::as_array).unwrap();
    let names: Vec<&str> = rungs.iter().map(|rung| rung["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["estimator", "encoding", "reconstruction", "texel model", "split sum"]);
    assert_eq!(report.pointer("/environments/0/tables").and_then(Value::as_array).unwrap().len(), 4);
    let page = std::fs::read_to_string(desk.path("accuracy/accuracy.html")).unwrap();
    assert!(
        page.contains("<svg")
            && page.contains("data:image/png;base64,")
            && page.contains("prefers-color-scheme")
    );
    for outside in ["<script", "http://", "https://", "src=\"/", "@import"] {
        assert!(!page.contains(outside), "the page refers to {outside}");
    }
}

#[test]
fn table_is_for_people_and_names_the_largest_rung() {
    let output = Desk::new().accuracy(&["--estimators", "convolution", "--lobes", "ggx"]);
    let table = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(table.contains("the ladder of errors") && table.contains("<- largest"), "{table}");
    assert!(table.contains("Kiln bakes: convolution") && !table.contains("lambert"), "{table}");
}

#[test]
fn baseline_holds_until_an_error_or_the_work_grows() {
    let desk = Desk::new();
    let quick: &[&str] = &["--estimators", "convolution", "--lobes", "ggx"];
    desk.report(quick);
    std::fs::rename(desk.path("accuracy/accuracy.json"), desk.path("baseline.json")).unwrap();
    let against = [quick, &["--baseline", "baseline.json", "--max-error", "0.1"]].concat();
    let same = desk.accuracy(&against);
    assert_eq!(same.status.code(), Some(0), "{}", text(&same.stderr));
    // An earlier report with less error and less work.
    let mut baseline: Value =
        serde_json::from_slice(&std::fs::read(desk.path("baseline.json")).unwrap()).unwrap();
    let chain = baseline.pointer_mut("/environments/0/choice/chains/0").unwrap();
    chain["worst_rms"] = (0.5 * chain["worst_rms"].as_f64().unwrap()).into();
    chain["work"]["flops"] = (chain["work"]["flops"].as_u64().unwrap() / 2).into();
    std::fs::write(desk.path("baseline.json"), baseline.to_string()).unwrap();
    let worse = desk.accuracy(&against);
    let complaint = text(&worse.stderr);
    assert_eq!(worse.status.code(), Some(1), "{complaint}");
    assert!(complaint.contains("error: env/sky/specular: its error grew"), "{complaint}");
    assert!(complaint.contains("error: env/sky/specular: its counted work grew"), "{complaint}");
    let limit = desk.accuracy(&[quick, &["--max-error", "1e-9"]].concat());
    assert_eq!(limit.status.code(), Some(1));
    assert!(text(&limit.stderr).contains("is above --max-error"), "{}", text(&limit.stderr));
}

#[test]
fn bad_requests_say_what_would_be_right() {
    let desk = Desk::new();
    std::fs::write(desk.path("broken.json"), "{\"schema\": 1}").unwrap();
    for (arguments, said) in [
        (&["--estimators", "kronos"][..], "did you mean `khronos`; there are: convolution, importance,"),
        (&["--lobes", "phong"], "there are: ggx, lambert, charlie"),
        (&["--size", "100"], "is no power of two from 8 to 1024"),
        (&["--law", "cubic"], "--law is linear, filament, eevee or a list"),
        (&["--baseline", "broken.json"], "must be an accuracy.json"),
        (&["--baseline", "absent.json"], "cannot read the baseline"),
        (&["--max-error", "0"], "--max-error is an error above 0"),
        (&["--against", "sky.hdr"], "is a panorama; a map to rate is a cube"),
    ] {
        // The last size wins in no command line: each request brings its own.
        let start: &[&str] = if arguments[0] == "--size" {
            &["accuracy", "sky.hdr"]
        } else {
            &["accuracy", "sky.hdr", "--size", "16"]
        };
        let output = desk.run(&[start, arguments].concat());
        let complaint = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {complaint}");
        assert!(complaint.contains(said), "{arguments:?}: {complaint}");
    }
}

#[test]
fn maps_of_other_tools_are_rated_by_their_law() {
    let desk = Desk::new();
    let baked = desk.run(&[
        "env", "sky.hdr", "--out", "maps", "--size", "32", "--law", "filament", "--format", "rgba32f",
    ]);
    assert!(baked.status.success(), "{}", text(&baked.stderr));
    let rate = |map: &str, law: &[&str]| -> Value {
        let output = desk.accuracy(&[&["--against", map, "--json"], law].concat());
        assert!(output.status.success(), "{map}: {}", text(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let right = number(&rate("maps/sky/specular.ktx2", &["--law", "filament"]), "/chain/rms");
    let wrong = number(&rate("maps/sky/specular.ktx2", &["--law", "linear"]), "/chain/rms");
    assert!(right <= 1e-3 && wrong > 1e-2, "{right} by its own law, {wrong} by another");
    let irradiance = number(&rate("maps/sky/irradiance.ktx2", &["--lobes", "lambert"]), "/chain/rms");
    let as_chain = number(&rate("maps/sky/irradiance.ktx2", &["--law", "0.5"]), "/chain/rms");
    assert!(irradiance <= 1e-3 && as_chain > 1e-2, "{irradiance} as irradiance, {as_chain} as roughness 0.5");
}

#[test]
fn project_has_a_report_of_each_environment_at_its_own_error() {
    let project = Project::sample();
    let out = project.beside("report");
    let arguments = [
        "accuracy",
        ".",
        "--estimators",
        "convolution",
        "--lobes",
        "ggx",
        "--size",
        "16",
        "--probes",
        "8",
        "--json",
    ];
    let mut command = project.command(&[]);
    let output = command.args(arguments).arg("--out").arg(&out).current_dir(project.dir()).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let environments = report["environments"].as_array().unwrap();
    assert!(environments.len() >= 2 && out.join("accuracy.html").is_file(), "{}", environments.len());
    for environment in environments {
        assert!(
            number(environment, "/choice/error") > 0.0
                && number(environment, "/choice/chains/0/worst_rms") > 0.0
        );
    }
}
