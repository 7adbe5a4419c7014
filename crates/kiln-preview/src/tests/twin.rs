//! Spheres under real light beside twins on the CPU, the same split sum in `f64`. One looks up the baked maps as shaders do: what
//! differs is what the pipeline and the device do wrong. The other has the exact convolution of the panorama in place of maps, levels
//! and filters: what differs beside is what lookups between texels and levels leave.

use std::f64::consts::PI;

use glam::DVec3;
use kiln_bake::{Cancel, Lobe, Surface, reference_radiance, split_sum};
use kiln_image::{Image, Limits, Panorama};
use serde_json::json;

use super::corpus::{bake_panorama, corpus, find, say};
use super::fixture::{Build, gpu, sphere_glb};
use super::frames::FRONT;
use crate::HeadlessViewer;

const SIZE: [usize; 2] = [640, 360];
/// Every so many pixels along both sides.
const STRIDE: usize = 24;
/// Faces of the sharpest level, and levels: what `kiln bake` makes unless told otherwise.
const CHAIN: [usize; 2] = [256, 7];
/// Columns of the panorama as it is tested; the twin looks at each of its texels for each pixel.
const WIDTH: usize = 128;
/// Root of the mean squared difference, relative to that of the twin that reads the maps.
const RMS_MAX: f64 = 0.01;
/// The same with the exact twin on levels of faces of 8 texels and fewer, whatever these hold: bilinear reads between them.
const RMS_MAX_COARSE: f64 = 0.03;
const BETWEEN: f64 = 4.5 / 6.0;
/// The same half-way between two of seven levels, where a mean of two lobes stands for the one between them: what no exactness of
/// the levels buys.
const RMS_MAX_BETWEEN: f64 = 0.06;

/// A panorama averaged down in whole blocks.
fn averaged(panorama: &Panorama) -> Option<Panorama> {
    let block = panorama.width() / WIDTH;
    if block * WIDTH != panorama.width() || block * (WIDTH / 2) != panorama.height() {
        return None;
    }
    let mean = |x: usize, y: usize| {
        let texels =
            (0..block * block).map(|at| panorama.texel(x * block + at % block, y * block + at / block));
        let sum =
            texels.fold([0.0; 3], |sum: [f64; 3], texel| [0, 1, 2].map(|at| sum[at] + f64::from(texel[at])));
        sum.map(|value| (value / (block * block) as f64) as f32)
    };
    let rgb = (0..WIDTH / 2).flat_map(|y| (0..WIDTH).flat_map(move |x| mean(x, y))).collect();
    Panorama::new(Image::new(WIDTH, WIDTH / 2, rgb).ok()?).ok()
}

/// Where a pixel's middle, so many pixels aside, sees the unit sphere.
fn seen(x: f64, y: f64) -> Option<(DVec3, DVec3)> {
    let eye = FRONT.position().as_dvec3();
    let half_height = (f64::from(FRONT.field_of_view_rad) / 2.0).tan();
    let [width, height] = SIZE.map(|pixels| pixels as f64);
    let right = ((x + 0.5) / width * 2.0 - 1.0) * half_height * width / height;
    let up = (1.0 - (y + 0.5) / height * 2.0) * half_height;
    let ray = DVec3::new(right, up, -1.0).normalize();
    let (along, beside) = (ray.dot(-eye), eye.length_squared() - ray.dot(eye).powi(2));
    let half_chord = (1.0 - beside).sqrt();
    half_chord.is_finite().then(|| (eye + ray * (along - half_chord), -ray))
}

/// Perceptual roughness with the normal's turn within a pixel (Tokuyoshi and Kaplanyan 2019).
fn filtered(roughness: f64, x: f64, y: f64, normal: DVec3) -> Option<f64> {
    let turn = |x: f64, y: f64| Some((seen(x, y)?.0 - normal).length_squared());
    let variance = (turn(x + 1.0, y)? + turn(x, y + 1.0)?) / (2.0 * PI);
    Some((roughness.powi(4) + (2.0 * variance).min(0.18)).min(1.0).sqrt().sqrt())
}

/// What a convolved environment holds in a direction.
type Light<'a> = &'a dyn Fn(Lobe, [f64; 3]) -> [f64; 3];

/// Relative RMS difference of the drawn sphere and the twin's, whose surface may be another.
fn difference(radiance: &Image, light: Light<'_>, twin: Surface) -> f64 {
    let (mut squares, mut whole, mut count) = (0.0, 0.0, 0);
    for y in (0..SIZE[1]).step_by(STRIDE) {
        for x in (0..SIZE[0]).step_by(STRIDE) {
            // Pixels on the rim are partly sky, and their quads' derivatives leave the sphere.
            let Some((normal, view)) = seen(x as f64, y as f64) else { continue };
            if normal.dot(view) < 0.25 {
                continue;
            }
            let Some(roughness) = filtered(twin.roughness, x as f64, y as f64, normal) else { continue };
            let surface = Surface { roughness, ..twin };
            let expected = split_sum(surface, normal.to_array(), view.to_array(), light);
            let drawn = radiance.texel(x, y);
            for at in 0..3 {
                squares += (f64::from(drawn[at]) - expected[at]).powi(2);
                whole += expected[at].powi(2);
            }
            count += 1;
        }
    }
    assert!(count > 40, "{count} pixels were compared");
    (squares / whole).sqrt()
}

#[test]
fn spheres_under_real_panoramas_are_those_of_their_twin() {
    let (Some(corpus), Some(gpu)) = (corpus(), gpu()) else { return };
    let surfaces = [
        Surface { color: [0.9, 0.6, 0.3], metallic: 1.0, roughness: 2.0 / 6.0 },
        Surface { color: [0.9, 0.6, 0.3], metallic: 1.0, roughness: 5.0 / 6.0 },
        Surface { color: [0.2, 0.5, 0.8], metallic: 0.0, roughness: 0.5 },
        Surface { color: [0.7; 3], metallic: 0.5, roughness: 1.0 },
        Surface { color: [0.9, 0.6, 0.3], metallic: 1.0, roughness: BETWEEN },
    ];
    let limit = |roughness: f64| match roughness {
        BETWEEN => RMS_MAX_BETWEEN,
        coarse if coarse > 0.8 => RMS_MAX_COARSE,
        _ => RMS_MAX,
    };
    let mut worst: f64 = 0.0;
    for sky in ["venice", "studio", "sunset"] {
        let Some(path) = find(&corpus, &format!("{sky}.hdr")) else {
            say(&format!("SKIPPED: the corpus has no panorama {sky}"));
            continue;
        };
        let bytes = std::fs::read(path).expect("the corpus has it");
        let decoded = kiln_image::decode(&bytes, &Limits::default(), Cancel::NEVER).expect("it is sound");
        let whole = Panorama::new(decoded.image).expect("it is twice as wide as high");
        let Some(panorama) = averaged(&whole) else {
            say(&format!("SKIPPED: {sky} does not halve down to {WIDTH} columns"));
            continue;
        };
        let mut build = Build::new();
        build.exact_lut().shaders(&[&[]]);
        let maps = bake_panorama(&mut build, "sky", &panorama, CHAIN);
        let exact = |lobe, direction| reference_radiance(&panorama, lobe, direction);
        let looked_up = |lobe, direction| maps.light(lobe, direction);
        for surface in surfaces {
            let Surface { color: [r, g, b], metallic, roughness } = surface;
            let material = json!({ "pbrMetallicRoughness": {
                "baseColorFactor": [r, g, b, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness,
            } });
            build.scene("ball", "sky", sphere_glb(material));
            let mut viewer = HeadlessViewer::new(gpu.clone(), SIZE.map(|pixels| pixels as u32));
            assert_eq!(viewer.apply(&build.revision()).diagnostics, vec![]);
            viewer.view.camera = Some(FRONT);
            let radiance = viewer.render_radiance().expect("the device reads back");
            let drawn_wrong = difference(&radiance, &looked_up, surface);
            let found = difference(&radiance, &exact, surface);
            say(&format!(
                "{sky}, metallic {metallic}, roughness {roughness:.2}: {:.3} % RMS beside lookups of the maps, {:.3} % beside the exact convolution",
                100.0 * drawn_wrong,
                100.0 * found
            ));
            assert!(
                drawn_wrong <= RMS_MAX,
                "{sky}, metallic {metallic}, roughness {roughness}: {drawn_wrong}"
            );
            assert!(found <= limit(roughness), "{sky}, metallic {metallic}, roughness {roughness}: {found}");
            worst = worst.max(found / limit(roughness));
        }
        let [first, .., last] = surfaces;
        for unlike in [Surface { color: [0.85, 0.6, 0.3], ..last }, Surface { roughness: 0.4, ..last }, first]
        {
            let found = difference_of_last(&build, gpu.clone(), &looked_up, unlike);
            assert!(found > 0.02, "the check does not see another surface: {found}");
        }
    }
    say(&format!("worst: {worst:.2} of what is allowed"));
}

/// The last scene drawn again, beside a twin of another surface.
fn difference_of_last(build: &Build, gpu: kiln_gpu::Gpu, light: Light<'_>, twin: Surface) -> f64 {
    let mut viewer = HeadlessViewer::new(gpu, SIZE.map(|pixels| pixels as u32));
    viewer.apply(&build.revision());
    viewer.view.camera = Some(FRONT);
    difference(&viewer.render_radiance().expect("the device reads back"), light, twin)
}
