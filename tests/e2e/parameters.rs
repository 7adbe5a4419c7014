//! Parameters of the user's own shader, set on the command line.

use std::process::Output;

use crate::harness::{Project, skip, text};

/// What the sample's tonemap has of its own after [`project`].
const PARAMETERS: &str = "override contrast: f32 = 1.0; // @slider(0.5, 2)
struct Params {
    white_balance: vec3f, // @color(1, 1, 1) of the light
    is_grey: u32,         // @toggle(false)
}
@group(3) @binding(0) var<uniform> params: Params;";

/// The sample with a tonemap that offers three parameters more.
fn project() -> Project {
    let project = Project::sample();
    let tonemap = "shaders/pbr/tonemap.wgsl";
    project.edit(tonemap, "const WHITE_BALANCE = vec3f(1.0, 1.0, 1.0);", PARAMETERS);
    let graded = "select(radiance * params.white_balance, radiance.ggg, params.is_grey != 0u) * contrast";
    project.edit(tonemap, "radiance * WHITE_BALANCE", graded);
    project
}

fn frame(project: &Project, name: &str, parameters: &[&str]) -> (Output, Option<image::RgbImage>) {
    let out = project.beside(name);
    let mut command = project.command(&["preview", "DIR", "--headless", "--size", "64x36", "--out"]);
    command.arg(&out);
    parameters.iter().for_each(|parameter| {
        command.args(["--param", parameter]);
    });
    let output = command.output().unwrap();
    let frame = image::open(out.join("frame_0001.png")).ok().map(|picture| picture.to_rgb8());
    (output, frame)
}

#[test]
fn parameters_of_the_command_line_reach_the_picture_and_wrong_ones_are_refused() {
    let project = project();
    let watch = project.watch();
    watch.published();
    let (output, first) = frame(&project, "first", &[]);
    let said = text(&output.stderr);
    if said.contains("mesa-vulkan-drivers") {
        return skip("parameters", "there is no graphics device");
    }
    let first = first.unwrap_or_else(|| panic!("{said}"));
    let (_, same) = frame(&project, "same", &["white_balance=1,1,1", "contrast=1"]);
    assert!(same.as_ref() == Some(&first), "the values of the source change nothing");

    let (output, grey) = frame(&project, "grey", &["is_grey=true"]);
    let grey = grey.unwrap_or_else(|| panic!("{}", text(&output.stderr)));
    let is_grey = |picture: &image::RgbImage| picture.pixels().all(|pixel| pixel[0] == pixel[2]);
    assert!(is_grey(&grey) && !is_grey(&first));

    let brightness =
        |picture: &image::RgbImage| picture.as_raw().iter().map(|&code| u64::from(code)).sum::<u64>();
    let (_, dim) = frame(&project, "dim", &["tonemap.contrast=0.5"]);
    assert!(brightness(&dim.expect("it was written")) < brightness(&first));

    for (parameter, expected) in [
        ("white_ballance=1,1,1", "no shader that is shown has a parameter `white_ballance`"),
        ("white_balance=1", "takes 3 numbers; 1 are given"),
        ("contrast=9", "is a f32 from 0.5 to 2; 9 is none"),
        ("contrast", "write it as name=0.5"),
    ] {
        let (output, none) = frame(&project, "refused", &[parameter]);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{parameter}: {said}");
        assert!(said.contains(expected) && none.is_none(), "{parameter}: {said}");
    }
}
