//! Suns taken out of panoramas: found where they are, and no flux lost.

use super::cancelled_step_ends_soon::check;
use super::environments::{check_within, panorama, random};
use crate::{Cancel, NoSun, Sun, SunExtraction, SunRequest, extract_sun};
use kiln_image::Panorama;
use kiln_sphere::{panorama_direction, panorama_uv};
use std::f64::consts::PI;

const WIDTH: usize = 512;
const HEIGHT: usize = 256;
/// The sun's, as seen from Earth.
const DIAMETER: f64 = 0.53 * PI / 180.0;
/// A texel's height.
const TEXEL: f64 = PI / HEIGHT as f64;
/// Patches are known by their radiance only: a disc that is little larger than a texel is placed to a part of it.
const OFF_MAX: f64 = 0.2 * TEXEL;

fn extract(map: &Panorama) -> Result<SunExtraction, NoSun> {
    extract_sun(map, &SunRequest::USUAL, Cancel::NEVER).expect("nobody cancels")
}

fn found(map: &Panorama) -> SunExtraction {
    extract(map).unwrap_or_else(|reason| panic!("there is a sun: {reason}"))
}

fn angle(a: [f64; 3], b: [f64; 3]) -> f64 {
    let chord: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
    2.0 * (0.5 * chord).min(1.0).asin()
}

/// Part of each texel's solid angle that a disc covers, from 32² points in the texels near its edge.
fn coverage(direction: [f64; 3], diameter: f64) -> Vec<f64> {
    let at = |index: usize, i: usize, j: usize| {
        let u = ((index % WIDTH) as f64 + (i as f64 + 0.5) / 32.0) / WIDTH as f64;
        let v = ((index / WIDTH) as f64 + (j as f64 + 0.5) / 32.0) / HEIGHT as f64;
        (angle(panorama_direction(u, v), direction), (PI * v).sin())
    };
    let covered = |index: usize| {
        if at(index, 16, 16).0 > 0.5 * diameter + 2.0 * TEXEL {
            return 0.0;
        }
        let (mut inside, mut whole) = (0.0, 0.0);
        for (away, weight) in (0..32 * 32).map(|point| at(index, point % 32, point / 32)) {
            whole += weight;
            inside += if away <= 0.5 * diameter { weight } else { 0.0 };
        }
        inside / whole
    };
    (0..WIDTH * HEIGHT).map(covered).collect()
}

/// A disc of (peak, 0.9 peak, 0.6 peak) over a floor.
fn disc(direction: [f64; 3], diameter: f64, peak: f64, floor: f64) -> Panorama {
    let coverage = coverage(direction, diameter);
    panorama(WIDTH, HEIGHT, |index| {
        [1.0, 0.9, 0.6].map(|hue| (floor + coverage[index] * (hue * peak - floor)) as f32)
    })
}

/// Σ over rows of solid angle times texels, written anew.
fn flux(map: &Panorama) -> [f64; 3] {
    let (width, height) = (map.width(), map.height());
    std::array::from_fn(|channel| {
        let row = |y: usize| {
            let theta = |y: usize| PI * y as f64 / height as f64;
            let solid_angle = 2.0 * PI / width as f64 * (theta(y).cos() - theta(y + 1).cos());
            solid_angle * (0..width).map(|x| f64::from(map.texel(x, y)[channel])).sum::<f64>()
        };
        (0..height).map(row).sum()
    })
}

#[track_caller]
fn check_account(what: &str, map: &Panorama, extraction: &SunExtraction) {
    let (original, remaining) = (flux(map), flux(&extraction.remaining));
    for channel in 0..3 {
        let account = extraction.flux;
        let sum = account.light[channel] + account.remaining[channel];
        check_within(what, sum, account.original[channel], 1e-12 * account.original[channel]);
        check_within(what, account.original[channel], original[channel], 1e-9 * original[channel]);
        check_within(what, account.remaining[channel], remaining[channel], 1e-9 * remaining[channel]);
        assert!(account.light[channel] >= 0.0, "{what}");
    }
    assert_eq!(extraction.sun.irradiance, extraction.flux.light);
    let is_no_brighter = |(after, before): (&f32, &f32)| after <= before && *after >= 0.0;
    assert!(
        extraction.remaining.rgb().iter().zip(map.rgb()).all(is_no_brighter),
        "{what}: nothing gets brighter"
    );
}

/// Irradiance, place, size and remaining floor of a disc's sun.
#[track_caller]
fn check_disc(what: &str, direction: [f64; 3], peak: f64, floor: f64) {
    let map = disc(direction, DIAMETER, peak, floor);
    let extraction = found(&map);
    check_account(what, &map, &extraction);
    let Sun { irradiance, angular_diameter, colour, .. } = extraction.sun;
    let expected = flux(&map)[0] - 4.0 * PI * floor;
    check_within(what, irradiance[0], expected, 1e-6 * expected);
    // 32² points leave some 1 % of the disc's area.
    let solid_angle = 2.0 * PI * (1.0 - (0.5 * DIAMETER).cos());
    check_within(what, irradiance[0], (peak - floor) * solid_angle, 2e-2 * peak * solid_angle);
    check_within(what, colour[2], (0.6 * peak - floor) / (peak - floor), 1e-6);
    let off = angle(extraction.sun.direction, direction);
    assert!(off <= OFF_MAX, "{what}: {} texels off", off / TEXEL);
    assert!((0.9 * DIAMETER..=2.5 * TEXEL).contains(&angular_diameter), "{what}: {angular_diameter}");
    let rest = extraction.remaining.rgb();
    assert!(rest.iter().all(|&value| f64::from(value) == floor), "{what}: the surroundings go on");
}

#[test]
fn sun_is_taken_whole_wherever_it_stands() {
    let up = [0.0, 1.0, 0.0];
    let places = [
        ("side", panorama_direction(0.3123, 0.4017)),
        ("high up", panorama_direction(0.7701, 0.0613)),
        ("wrap column", panorama_direction(0.0, 0.37)),
        ("beside the wrap column", panorama_direction(0.9995, 0.62)),
        ("zenith", up),
        ("nadir", up.map(|y: f64| -y)),
        ("beside the zenith", panorama_direction(0.21, 0.0013)),
        ("cube corner", [1.0, 1.0, 1.0].map(|x: f64| x / 3.0f64.sqrt())),
    ];
    for (name, direction) in places {
        for peak in [1e5, 1e7] {
            for floor in [0.0, 1.0] {
                check_disc(&format!("{name}, {peak:e} over {floor}"), direction, peak, floor);
            }
        }
    }
}

#[test]
#[should_panic(expected = "texels off")]
fn disc_check_rejects_a_sun_half_a_texel_away() {
    let direction = panorama_direction(0.3123, 0.4017);
    let mut map = disc(direction, DIAMETER, 1e5, 1.0).into_image();
    map.rgb.rotate_right(3);
    let off = angle(found(&Panorama::new(map).expect("2:1")).sun.direction, direction);
    assert!(off <= OFF_MAX, "{} texels off", off / TEXEL);
}

#[test]
#[should_panic(expected = "zenith account")]
fn account_check_rejects_a_ten_millionth_of_the_flux_lost() {
    let map = disc([0.0, 1.0, 0.0], DIAMETER, 1e5, 1.0);
    let mut extraction = found(&map);
    extraction.flux.remaining[1] *= 1.0 - 1e-7;
    check_account("zenith account", &map, &extraction);
}

#[test]
fn turned_columns_give_the_turned_result() {
    let map = disc(panorama_direction(0.411, 0.33), DIAMETER, 1e6, 0.5);
    let plain = found(&map);
    for turn in [1, 100, 210, 300] {
        let rotated = |map: &Panorama| {
            let mut image = map.image().clone();
            image.rgb.chunks_exact_mut(3 * WIDTH).for_each(|row| row.rotate_right(3 * turn));
            Panorama::new(image).expect("2:1")
        };
        let turned = found(&rotated(&map));
        assert!(turned.remaining == rotated(&plain.remaining), "turn {turn}");
        let [u, v] = panorama_uv(plain.sun.direction);
        let expected = panorama_direction(u + turn as f64 / WIDTH as f64, v);
        assert!(angle(turned.sun.direction, expected) <= 1e-9, "turn {turn}");
        check_within(
            "irradiance",
            turned.sun.irradiance[1],
            plain.sun.irradiance[1],
            1e-12 * plain.sun.irradiance[1],
        );
    }
}

#[test]
fn of_two_suns_the_brighter_goes_first_and_the_other_next() {
    let (a, b) = (panorama_direction(0.2, 0.3), panorama_direction(0.6, 0.45));
    let (bright, dim) = (coverage(a, DIAMETER), coverage(b, DIAMETER));
    let map = panorama(WIDTH, HEIGHT, |i| [(1.0 + 1e6 * bright[i] + 4e5 * dim[i]) as f32; 3]);
    let first = found(&map);
    check_within("first", angle(first.sun.direction, a), 0.0, OFF_MAX);
    let second = found(&first.remaining);
    check_within("second", angle(second.sun.direction, b), 0.0, OFF_MAX);
    check_account("second", &first.remaining, &second);
    assert!(extract(&second.remaining).is_err(), "there is no third");
}

#[test]
fn glare_around_a_sun_goes_with_it() {
    let direction = panorama_direction(0.35, 0.3);
    let covered = coverage(direction, DIAMETER);
    let map = panorama(WIDTH, HEIGHT, |i| {
        let [u, v] = [(i % WIDTH, WIDTH), (i / WIDTH, HEIGHT)].map(|(i, n)| (i as f64 + 0.5) / n as f64);
        let away = angle(panorama_direction(u, v), direction) / TEXEL;
        [(1.0 + 1e5 * covered[i] + 300.0 * (-away * away).exp()) as f32; 3]
    });
    let extraction = found(&map);
    check_account("glare", &map, &extraction);
    assert!(extraction.remaining.max_value() <= 2.5, "{}", extraction.remaining.max_value());
}

#[test]
fn lights_that_are_no_sun_are_left_alone_with_a_reason() {
    assert_eq!(extract(&panorama(64, 32, |_| [0.0; 3])), Err(NoSun::Black));
    assert!(matches!(extract(&panorama(64, 32, |_| [3.0; 3])), Err(NoSun::TooLarge { .. })), "a uniform sky");
    let soft_box = panorama(WIDTH, HEIGHT, |i| {
        let is_lit = (100..160).contains(&(i % WIDTH)) && (60..100).contains(&(i / WIDTH));
        if is_lit { [50.0; 3] } else { [0.3; 3] }
    });
    assert!(matches!(extract(&soft_box), Err(NoSun::TooLarge { .. })), "a studio's soft box");
    let horizon = panorama(WIDTH, HEIGHT, |i| if i / WIDTH == 128 { [1e4; 3] } else { [0.1; 3] });
    assert!(matches!(extract(&horizon), Err(NoSun::TooLarge { .. })), "a line round the horizon");
    let direction = panorama_direction(0.3, 0.4);
    assert!(
        matches!(extract(&disc(direction, DIAMETER, 10.0, 1.0)), Err(NoSun::Faint { .. })),
        "a pale disc"
    );
    assert!(matches!(extract(&disc(direction, DIAMETER, 200.0, 1.0)), Err(NoSun::Minor { .. })), "a lamp");
    let wide = SunRequest { angular_diameter_max: 0.5, ..SunRequest::USUAL };
    let moon = disc(direction, 0.2, 50.0, 0.1);
    assert!(matches!(extract(&moon), Err(NoSun::TooLarge { .. })));
    assert!(
        extract_sun(&moon, &wide, Cancel::NEVER).expect("nobody cancels").is_ok(),
        "the limit is the user's"
    );
}

#[test]
fn smallest_maps_do_not_panic() {
    for (width, height) in [(2, 1), (4, 2), (6, 3), (10, 5)] {
        for index in 0..width * height {
            let lit = panorama(width, height, |i| if i == index { [1e6; 3] } else { [0.0; 3] });
            if let Ok(extraction) = extract(&lit) {
                check_account("small", &lit, &extraction);
            }
        }
        let map = random(width, height, 5);
        if let Ok(extraction) = extract(&map) {
            check_account("small", &map, &extraction);
        }
    }
}

#[test]
fn extraction_ends_soon_after_it_is_cancelled() {
    let map = disc(panorama_direction(0.3, 0.4), DIAMETER, 1e5, 1.0);
    check(2 * HEIGHT as i64, |cancel| {
        let extraction = extract_sun(&map, &SunRequest::USUAL, cancel).ok()?.expect("a sun");
        Some(extraction.remaining.rgb().iter().flat_map(|value| value.to_le_bytes()).collect())
    });
}

/// Corpus files and whether the usual request finds a sun in them.
const REAL: [(&str, bool); 10] = [
    ("pmndrs/apartment", false),
    ("pmndrs/bridge", false),
    ("pmndrs/city", false),
    ("pmndrs/esplanade", true),
    ("pmndrs/forest", false),
    ("pmndrs/sky", true),
    ("pmndrs/studio", false),
    ("pmndrs/sunset", false),
    ("pmndrs/venice", false),
    ("bevy/spiaggia_di_mondello_1k", true),
];

#[test]
#[expect(clippy::print_stderr, reason = "a skipped test must say so")]
fn real_panoramas_keep_their_flux() {
    let Some(root) = std::env::var_os("KILN_CORPUS") else {
        eprintln!("SKIPPED: real_panoramas_keep_their_flux: KILN_CORPUS is not set");
        return;
    };
    for (name, has_sun) in REAL {
        let path = std::path::Path::new(&root).join(format!("hdr/polyhaven-{name}.hdr"));
        let bytes = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let decoded = kiln_image::decode(&bytes, &kiln_image::Limits::default(), Cancel::NEVER)
            .expect("a readable panorama");
        let map = Panorama::new(decoded.image).expect("2:1");
        let result = extract(&map);
        assert_eq!(result.is_ok(), has_sun, "{name}: {:?}", result.as_ref().err());
        if let Ok(extraction) = &result {
            check_account(name, &map, extraction);
        }
    }
}
