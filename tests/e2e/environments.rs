//! `kiln env` and `kiln export`: files in, maps out, without a project and with one.

use std::path::{Path, PathBuf};
use std::process::Output;

use kiln_image::{Cancel, Cube, Image, cube_layout, exr_write, hdr, ktx2};
use serde_json::Value;

use crate::harness::{Project, kiln, text};

/// A folder with a cache of its own.
struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    fn new() -> Desk {
        Desk { folder: tempfile::tempdir().unwrap() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        std::fs::write(self.path(name), bytes).unwrap();
        self.path(name)
    }

    fn env(&self, arguments: &[&str]) -> Output {
        let mut command = kiln();
        command.arg("env").args(arguments).current_dir(self.folder.path());
        command.env("KILN_CACHE", self.path("cache")).output().unwrap()
    }

    /// `kiln env … --json`, which must succeed.
    fn bake(&self, arguments: &[&str]) -> Value {
        let output = self.env(&[arguments, &["--json"]].concat());
        assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    }

    fn cube(&self, path: &str) -> Cube {
        read_cube(&self.path(path))
    }
}

/// Level 0 of a KTX2 cube.
fn read_cube(path: &Path) -> Cube {
    let texture = ktx2::read(&std::fs::read(path).unwrap()).unwrap();
    let values = texture.format.decode_image(texture.width, texture.width, &texture.levels[0]).unwrap();
    let channels = texture.format.channels();
    let rgb = values.chunks_exact(channels).flat_map(|texel| [texel[0], texel[1], texel[2]]);
    Cube::new(texture.width, rgb.collect()).unwrap()
}

/// A panorama with a gradient along either axis.
fn panorama(width: usize) -> Vec<u8> {
    let height = width / 2;
    let texel = |index: usize| {
        let (x, y) = (index % width, index / width);
        [1.0 + x as f32 / width as f32, 0.5 + y as f32 / height as f32, 0.25]
    };
    hdr::encode(&Image::new(width, height, (0..width * height).flat_map(texel).collect()).unwrap())
}

/// A cube whose texels all differ.
fn cube(face_size: usize) -> Cube {
    let values = (0..6 * face_size * face_size * 3).map(|index| 0.25 + index as f32 / 64.0);
    Cube::new(face_size, values.collect()).unwrap()
}

fn exr(image: &Image) -> Vec<u8> {
    exr_write::encode_image(image, Cancel::NEVER).unwrap()
}

#[test]
fn panorama_without_a_project_is_baked_once() {
    let desk = Desk::new();
    desk.write("sky.hdr", &panorama(64));
    let report = desk.bake(&["sky.hdr", "--out", "maps", "--size", "16"]);
    let maps = &report["environments"]["sky"]["maps"];
    for map in ["skybox", "specular", "irradiance", "sh"] {
        assert!(maps[map].is_object(), "{report:#}");
    }
    let measured = maps["specular"]["measured"].as_array().unwrap();
    assert_eq!(measured.len(), 2, "a measure for each prefiltered level: {measured:?}");
    assert!(measured.iter().all(|level| level["rms"].as_f64().unwrap() <= 1e-3), "{measured:?}");
    assert!(desk.path("maps/sky/manifest.json").is_file());
    let again = desk.env(&["sky.hdr", "--out", "maps", "--size", "16"]);
    assert!(text(&again.stdout).contains("0 actions ran"), "{}", text(&again.stdout));
    let other = desk.env(&["sky.hdr", "--out", "maps", "--size", "32"]);
    assert!(!text(&other.stdout).contains("0 actions ran"), "{}", text(&other.stdout));
}

#[test]
fn cube_in_every_layout_gives_the_same_skybox() {
    let desk = Desk::new();
    let cube = cube(16);
    let mut faces = vec!["--faces".to_owned(), "--name".to_owned(), "cube".to_owned()];
    for face in 0..6 {
        let name = format!("face{face}.exr");
        desk.write(&name, &exr(&cube_layout::face_image(&cube, face)));
        faces.push(name);
    }
    let layouts = [
        cube_layout::CubeLayout::HorizontalCross,
        cube_layout::CubeLayout::VerticalCross,
        cube_layout::CubeLayout::HorizontalStrip,
        cube_layout::CubeLayout::VerticalStrip,
    ];
    let mut wanted: Vec<Vec<String>> = vec![faces];
    for (index, layout) in layouts.into_iter().enumerate() {
        let name = format!("cube{index}.exr");
        desk.write(&name, &exr(&cube_layout::unfold(&cube, layout)));
        wanted.push(vec!["--name".to_owned(), "cube".to_owned(), name]);
    }
    let file = exr_write::encode_cube(&cube, Cancel::NEVER).unwrap();
    desk.write("declared.exr", &file);
    wanted.push(vec!["--name".to_owned(), "cube".to_owned(), "declared.exr".to_owned()]);
    for arguments in wanted {
        let mut arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        arguments.extend(["--out", "maps", "--size", "16", "--format", "rgba32f"]);
        desk.bake(&arguments);
        assert!(desk.cube("maps/cube/skybox.ktx2") == cube, "{arguments:?}");
    }
    // The check itself: one face mirrored is another cube.
    let mirrored = cube_layout::mirror(&cube, cube_layout::Mirror::X);
    assert!(mirrored != cube);
}

#[test]
fn square_picture_needs_a_layout_and_bakes_with_one() {
    let desk = Desk::new();
    let map = cube_layout::octahedral(&cube(8), 32, Cancel::NEVER).unwrap();
    desk.write("map.exr", &exr(&map));
    let refused = desk.env(&["map.exr", "--out", "maps", "--size", "8"]);
    let said = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(said.contains("octahedral") && said.contains("--layout") && said.contains("map.exr"), "{said}");
    let report = desk.bake(&["map.exr", "--out", "maps", "--size", "8", "--layout", "octahedral"]);
    assert!(report["failed"].as_array().unwrap().is_empty());
    let wrong = desk.env(&["map.exr", "--out", "maps", "--layout", "octahedron"]);
    assert_eq!(wrong.status.code(), Some(1));
    assert!(text(&wrong.stderr).contains("octahedral"), "{}", text(&wrong.stderr));
}

#[test]
fn one_bad_file_among_good_ones_keeps_its_earlier_maps() {
    let desk = Desk::new();
    desk.write("a.hdr", &panorama(32));
    desk.write("b.hdr", &panorama(64));
    desk.bake(&["a.hdr", "b.hdr", "--out", "maps", "--size", "8"]);
    let before = std::fs::read(desk.path("maps/a/specular.ktx2")).unwrap();
    let good = std::fs::read(desk.path("b.hdr")).unwrap();
    desk.write("a.hdr", &good[..good.len() / 2]);
    desk.write("b.hdr", &panorama(32));
    let output = desk.env(&["a.hdr", "b.hdr", "--out", "maps", "--size", "8"]);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("a.hdr") && said.contains("ends in"), "{said}");
    assert_eq!(std::fs::read(desk.path("maps/a/specular.ktx2")).unwrap(), before);
    assert!(text(&output.stdout).contains("b: "), "{}", text(&output.stdout));
}

#[test]
fn texel_policies_and_limits_say_what_they_did() {
    let desk = Desk::new();
    let mut rgb = vec![1.0; 32 * 16 * 3];
    (rgb[300], rgb[600], rgb[900]) = (f32::NAN, -2.0, 5000.0);
    desk.write("bad.exr", &exr(&Image::new(32, 16, rgb).unwrap()));
    let said = |arguments: &[&str]| {
        let output = desk.env(&[&["bad.exr", "--out", "maps", "--size", "8"], arguments].concat());
        (output.status.code(), text(&output.stderr))
    };
    let (code, repaired) = said(&[]);
    assert_eq!(code, Some(0), "{repaired}");
    assert!(repaired.contains("repaired 1 non-finite and 1 negative"), "{repaired}");
    assert!(repaired.contains("texel ("), "the worst has a place: {repaired}");
    let (code, refused) = said(&["--texels", "error"]);
    assert_eq!(code, Some(1), "{refused}");
    let (code, limited) = said(&["--max-radiance", "10"]);
    assert_eq!(code, Some(0), "{limited}");
    assert!(limited.contains("cut 1 texels") && limited.contains('%'), "{limited}");
    let (code, kept) = said(&["--texels", "keep", "--format", "rgba32f"]);
    assert_eq!(code, Some(0), "{kept}");
    let is_finite = |map: &str| desk.cube(map).rgb.iter().all(|value| value.is_finite());
    assert!(!is_finite("maps/bad/skybox.ktx2") && is_finite("maps/bad/irradiance.ktx2"), "{kept}");
    assert!(is_finite("maps/bad/specular.ktx2"), "the mirror level is no place for NaN");
    let (code, both) = said(&["--texels", "keep", "--sun", "extract"]);
    assert_eq!(code, Some(1), "{both}");
    let report = desk.bake(&["bad.exr", "--out", "maps", "--size", "8"]);
    let texels = &report["environments"]["bad"]["maps"]["skybox"]["source"]["texels"];
    assert_eq!((&texels["nan"], &texels["negative"]), (&Value::from(1), &Value::from(1)), "{texels}");
}

#[test]
fn sun_leaves_as_a_light_and_the_flux_adds_up() {
    let desk = Desk::new();
    let (width, height) = (256, 128);
    let sun = 40 * width + 77;
    let texel = |index: usize| if index == sun { [1e5, 9e4, 8e4] } else { [1.0; 3] };
    let image = Image::new(width, height, (0..width * height).flat_map(texel).collect()).unwrap();
    desk.write("day.exr", &exr(&image));
    let bake = |sun: &str| {
        desk.bake(&["day.exr", "--out", "maps", "--size", "8", "--format", "rgba32f", "--sun", sun]);
        desk.cube("maps/day/skybox.ktx2").rgb.iter().copied().fold(0.0, f32::max)
    };
    assert!(bake("keep") > 1e3);
    assert!(bake("extract") < 2.0);
    let facts: Value =
        serde_json::from_slice(&std::fs::read(desk.path("maps/day/sun.json")).unwrap()).unwrap();
    for channel in 0..3 {
        let flux = |part: &str| facts["flux"][part][channel].as_f64().unwrap();
        let error = (flux("light") + flux("remaining")) / flux("original") - 1.0;
        assert!(error.abs() <= 1e-12, "channel {channel}: {error}");
    }
}

/// Σ L dω of a panorama file's first channel.
fn flux(path: &Path) -> f64 {
    let bytes = std::fs::read(path).unwrap();
    let image = kiln_image::decode(&bytes, &kiln_image::Limits::default(), Cancel::NEVER).unwrap().image;
    let polar = |row: usize| (std::f64::consts::PI * row as f64 / image.height as f64).cos();
    let row = |row: usize| image.row(row).iter().step_by(3).map(|value| f64::from(*value)).sum::<f64>();
    (0..image.height).map(|y| row(y) * (polar(y) - polar(y + 1))).sum::<f64>() / image.width as f64
}

#[test]
fn engines_get_the_sun_and_all_of_the_light() {
    let desk = Desk::new();
    let (width, height) = (256, 128);
    let texel = |index: usize| if index == 20 * width + 3 { [9e4; 3] } else { [0.5, 1.0, 2.0] };
    let image = Image::new(width, height, (0..width * height).flat_map(texel).collect()).unwrap();
    let source = desk.write("day.exr", &exr(&image));
    desk.bake(&["day.exr", "--out", "three", "--for", "three", "--size", "32"]);
    let error = flux(&desk.path("three/day/day.exr")) / flux(&source) - 1.0;
    assert!(error.abs() <= 1e-5, "the panorama for three.js lost {error} of the flux");
    let output = desk.env(&["day.exr", "--out", "bevy", "--for", "bevy", "--size", "32", "--sun", "extract"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let sun = std::fs::read(desk.path("bevy/day/day_sun.json")).unwrap();
    let sun: Value = serde_json::from_slice(&sun).unwrap();
    assert!(sun["light"]["irradiance"][0].as_f64().unwrap() > 1.0, "{sun:#}");
    // A peak above the format's range is scaled, and said.
    let output = desk.env(&["day.exr", "--out", "bevy", "--for", "bevy", "--size", "256"]);
    assert!(text(&output.stderr).contains("stored divided by 2"), "{}", text(&output.stderr));
}

#[test]
fn another_engine_s_files_do_not_stay_behind() {
    let desk = Desk::new();
    desk.write("sky.hdr", &panorama(32));
    desk.bake(&["sky.hdr", "--out", "maps", "--for", "three", "--size", "16"]);
    desk.write("maps/sky/mine.txt", b"not Kiln's");
    desk.bake(&["sky.hdr", "--out", "maps", "--for", "filament", "--size", "16"]);
    assert!(!desk.path("maps/sky/sky.hdr").exists() && desk.path("maps/sky/sky_ibl.ktx").exists());
    assert!(desk.path("maps/sky/mine.txt").exists());
}

#[test]
fn skybox_pictures_are_read_back_as_the_same_cube() {
    let desk = Desk::new();
    let cube = cube(16);
    desk.write("cube.exr", &exr_write::encode_cube(&cube, Cancel::NEVER).unwrap());
    for (picture, file) in [("cross.exr", "skybox_cross.exr"), ("strip-tall.exr", "skybox_strip-tall.exr")] {
        let exact = ["--size", "16", "--format", "rgba32f", "--out", "maps"];
        desk.bake(&[&["cube.exr", "--picture", picture], &exact[..]].concat());
        let written = format!("maps/cube/{file}");
        desk.bake(&[&[written.as_str(), "--name", "again"], &exact[..]].concat());
        assert!(desk.cube("maps/again/skybox.ktx2") == cube, "{picture}");
    }
    for picture in ["faces.hdr", "octahedral.exr", "equirect.png"] {
        desk.bake(&["cube.exr", "--picture", picture, "--out", "maps", "--size", "16"]);
    }
    assert!(
        ["px.hdr", "nz.hdr", "octahedral.exr", "equirect.png"]
            .iter()
            .all(|name| desk.path(&format!("maps/cube/skybox_{name}")).is_file())
    );
}

#[test]
fn requests_that_make_no_sense_are_refused_before_anything_is_written() {
    let desk = Desk::new();
    desk.write("sky.hdr", &panorama(32));
    for wrong in [
        &["--skybox-size", "0"][..],
        &["--skybox-size", "100000"],
        &["--name", "../evil"],
        &["--name", ""],
        &["--max-radiance", "1e-60"],
        &["--max-radiance", "inf"],
        &["--irradiance-size", "0"],
        &["--law", "0,1", "--levels", "5"],
        &["--for", "bevy", "--law", "eevee"],
        &["--for", "filament", "--dering"],
        &["--for", "unity"],
        &["--picture", "ball.exr"],
        &["--faces"],
        &["missing.hdr"],
    ] {
        let output = desk.env(&[&["sky.hdr", "--out", "x", "--size", "16"], wrong].concat());
        assert_eq!(output.status.code(), Some(1), "{wrong:?}: {}", text(&output.stderr));
        assert!(!desk.path("x").exists() && !desk.path("../evil").exists(), "{wrong:?}");
    }
}

#[test]
fn laws_formats_and_harmonics_are_the_user_s_choice() {
    let desk = Desk::new();
    desk.write("sky.hdr", &panorama(64));
    for format in ["rgba16f", "rgba32f", "rgb9e5", "r11g11b10f", "bc6h"] {
        let report = desk.bake(&["sky.hdr", "--out", format, "--size", "16", "--format", format]);
        assert_eq!(report["environments"]["sky"]["maps"]["specular"]["format"], format);
        let file = std::fs::read(desk.path(&format!("{format}/sky/specular.ktx2"))).unwrap();
        let second = ::ktx2::Reader::new(&*file).expect("a second reader takes it");
        assert_eq!((second.header().face_count, second.levels().count()), (6, 3), "{format}");
    }
    let list = ["--law", "0,0.3,1", "--sheen", "--sh-order", "8", "--dering"];
    let report = desk.bake(&[&["sky.hdr", "--out", "laws", "--size", "16"], &list[..]].concat());
    let maps = &report["environments"]["sky"]["maps"];
    assert_eq!(maps["specular"]["roughness"], serde_json::json!([0.0, 0.3, 1.0]));
    assert_eq!(maps["sheen"]["levels"], 3);
    let sh: Value = serde_json::from_slice(&std::fs::read(desk.path("laws/sky/sh.json")).unwrap()).unwrap();
    assert_eq!(sh["radiance"].as_array().unwrap().len(), 81);
    let one = desk.bake(&["sky.hdr", "--out", "one", "--size", "16", "--levels", "1"]);
    assert_eq!(one["environments"]["sky"]["maps"]["specular"]["levels"], 1);
    for wrong in
        [["--law", "1,0"], ["--levels", "6"], ["--size", "17"], ["--error", "0"], ["--format", "jpg"]]
    {
        let output = desk.env(&[&["sky.hdr", "--out", "x", "--size", "16"], &wrong[..]].concat());
        // A second --size is refused by the command line itself.
        assert_eq!(output.status.code(), Some(1), "{wrong:?}: {}", text(&output.stderr));
    }
}

#[test]
fn every_engine_gets_its_files_from_a_file_and_from_a_project_alike() {
    let project = Project::sample();
    let source = project.path("environments/sky.hdr");
    let source = source.to_str().unwrap();
    for (preset, file) in [
        ("bevy", "sky_specular.ktx2"),
        ("three", "sky_lightprobe.json"),
        ("filament", "sky_ibl.ktx"),
        ("khronos", "sky_ggx.ktx2"),
        ("raw", "sky_sheen.ktx2"),
    ] {
        let [direct, exported] =
            ["direct", "exported"].map(|name| project.beside(&format!("{preset}-{name}")));
        let run = |arguments: &[&str], out: &Path| {
            let output = project.command(arguments).arg("--out").arg(out).output().unwrap();
            assert!(output.status.success(), "{preset}: {}", text(&output.stderr));
        };
        run(&["env", source, "--for", preset], &direct);
        run(&["export", "DIR", "--env", "sky", "--for", preset], &exported);
        let read = |folder: &Path, file: &str| std::fs::read(folder.join("sky").join(file)).unwrap();
        assert!(read(&direct, file) == read(&exported, file), "{preset}: {file} differs");
        let conventions: Value = serde_json::from_slice(&read(&exported, "conventions.json")).unwrap();
        assert!(conventions.as_object().is_some_and(|facts| facts.len() > 3), "{conventions:#}");
    }
    let output = project.run(&["export", "DIR", "--for", "unity", "--out", "x"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("bevy"), "{}", text(&output.stderr));
    let before = std::fs::read_dir(project.dir()).unwrap().count();
    let (_, report) = project.bake();
    assert!(report["actions"].as_array().unwrap().iter().any(|action| action["status"] == "ran"));
    assert!(std::fs::read_dir(project.dir()).unwrap().count() > before, "an export published nothing");
}
