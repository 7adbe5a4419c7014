//! Every step ends at the first check after its result is unwanted, and a result that is wanted does not change.

use super::environments::{analyse, bytes_of, random, skybox};
use crate::{Analysis, AnalysisRequest, Cancel, TexelFormat};
use kiln_image::{Limits, Panorama, hdr};
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering::Relaxed};

const REQUEST: AnalysisRequest =
    AnalysisRequest { alpha_min: 1.0 / 100.0, sheen_alpha_min: None, error: 1e-4 };

/// A countdown that no step reaches the end of.
const FOREVER: i64 = 1 << 60;

/// `step` gives its result's bytes, or `None` once it is cancelled. It must look at its [`Cancel`] at least `checks_min`
/// times: that, and not a clock, says that the looks are close to each other.
pub(super) fn check(checks_min: i64, step: impl Fn(Cancel) -> Option<Vec<u8>> + Sync) {
    let wanted = step(Cancel::NEVER).expect("nobody cancels");
    let unset = step(Cancel::when(&AtomicBool::new(false)));
    assert!(unset.as_ref() == Some(&wanted), "a flag that stays unset changed the result");
    assert_eq!(step(Cancel::when(&AtomicBool::new(true))), None, "the flag was set before the start");

    let left = AtomicI64::new(FOREVER);
    assert!(step(Cancel::countdown(&left)) == Some(wanted), "checking changed the result");
    let total = FOREVER - left.into_inner();
    assert!(total >= checks_min, "{total} checks, expected at least {checks_min}");

    for at in [0, 1, total / 4, total / 2, total - 1] {
        let left = AtomicI64::new(at);
        assert_eq!(step(Cancel::countdown(&left)), None, "cancelled at check {at} of {total}");
        // Each thread may be on the way to one more check.
        let late = -left.into_inner();
        assert!((1..=2 * rayon::current_num_threads() as i64).contains(&late), "{late} checks after {at}");
    }
    for after in [total / 8, total / 2] {
        let seen = cancel_from_another_thread(after, &step);
        assert!(seen.is_none_or(|seen| seen >= total), "finished although cancelled at {seen:?} of {total}");
    }
}

/// Sets the flag once `after` checks are done. `None` if the step ended early, else the checks done when it was set.
fn cancel_from_another_thread(after: i64, step: &(impl Fn(Cancel) -> Option<Vec<u8>> + Sync)) -> Option<i64> {
    let left = AtomicI64::new(FOREVER);
    std::thread::scope(|scope| {
        let running = scope.spawn(|| step(Cancel::countdown(&left)));
        while FOREVER - left.load(Relaxed) < after && !running.is_finished() {
            std::thread::yield_now();
        }
        let seen = FOREVER - left.swap(0, Relaxed);
        running.join().expect("it does not panic").map(|_| seen)
    })
}

#[test]
#[should_panic(expected = "expected at least 10")]
fn check_rejects_a_step_that_seldom_looks() {
    check(10, |cancel| (0..9).try_for_each(|_| cancel.check()).map(|()| Vec::new()).ok());
}

#[test]
#[should_panic(expected = "checks after")]
fn check_rejects_a_step_that_goes_on() {
    check(10, |cancel| {
        let results: Vec<_> = (0..1000).map(|_| cancel.check()).collect();
        results.into_iter().collect::<Result<(), _>>().map(|()| Vec::new()).ok()
    });
}

fn panorama() -> Panorama {
    random(2048, 1024, 5)
}

/// Small, but of many degrees.
fn analysis() -> Analysis {
    let analysis = analyse(&random(512, 256, 6), &REQUEST);
    assert!(analysis.band_limit() > 300, "{}", analysis.band_limit());
    analysis
}

fn bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

#[test]
fn decode() {
    let file = hdr::encode(panorama().image());
    check(1024, |cancel| Some(bytes(&kiln_image::decode(&file, &Limits::default(), cancel).ok()?.image.rgb)));
}

#[test]
fn repair() {
    let mut broken = panorama().into_image();
    broken.rgb.iter_mut().step_by(7).for_each(|value| *value = f32::NAN);
    broken.rgb.iter_mut().step_by(11).for_each(|value| *value = -1.0);
    check(1000, |cancel| {
        let mut image = broken.clone();
        let repair = kiln_image::repair_texels(&mut image, cancel).ok()?;
        kiln_image::check_texels(&image, cancel).ok()?;
        Some([bytes(&image.rgb), repair.flux_moved.to_le_bytes().to_vec()].concat())
    });
}

#[test]
fn analyse_panorama() {
    let map = panorama();
    // Rows thrice (two transforms, the energy), orders, nodes of the kernel.
    check(3 * 1024 + 300, |cancel| Some(bytes_of(&crate::analyse(&map, &REQUEST, cancel).ok()?)));
}

#[test]
fn write_and_read_analysis() {
    let analysis = analysis();
    check(16, |cancel| {
        let bytes = analysis.to_bytes(cancel).ok()?;
        Some(bytes_of(&Analysis::from_bytes(&bytes, cancel).ok()?))
    });
}

#[test]
fn specular_level() {
    let analysis = analysis();
    check(64 * 64 * 6 / 8, |cancel| {
        Some(bytes(&crate::specular_level(&analysis, REQUEST.alpha_min, 64, cancel).ok()?.cube.rgb))
    });
}

#[test]
fn irradiance() {
    let analysis = analysis();
    check(32 * 32 * 6 / 8, |cancel| Some(bytes(&crate::irradiance(&analysis, 32, cancel).ok()?.cube.rgb)));
}

#[test]
fn skybox_levels() {
    let map = panorama();
    // Pieces between meridians of the four side faces together; texels and columns of a cap's quadrant.
    check(2048 + 32 * 512, |cancel| {
        Some(crate::skybox(&map, 64, cancel).ok()?.iter().flat_map(|level| bytes(&level.rgb)).collect())
    });
}

#[test]
fn panorama_of_cube() {
    let cube = skybox(&random(64, 32, 4), 128).remove(0);
    // Columns and pieces of the side faces, columns and rows of a cap's quadrant, rows.
    check(512 + 128 * 64 + 256, |cancel| Some(bytes(crate::panorama_of_cube(&cube, cancel).ok()?.rgb())));
}

#[test]
fn skybox_of_cube_levels() {
    let cube = skybox(&random(64, 32, 4), 128).remove(0);
    for (face_size, checks) in [(128, 2 * 6 * 63), (48, 512 + 128 * 64)] {
        check(checks, |cancel| {
            let levels = crate::skybox_of_cube(&cube, face_size, cancel).ok()?;
            Some(levels.iter().flat_map(|level| bytes(&level.rgb)).collect())
        });
    }
}

#[test]
fn encode_level() {
    let cube = skybox(&random(64, 32, 4), 128).remove(0);
    for format in TexelFormat::ALL {
        let checks = if format == TexelFormat::Bc6hUfloat { 6 * 32 } else { 6 * 128 };
        check(checks, |cancel| Some(crate::encode_level(&cube, format, 0, cancel).ok()?.bytes));
    }
}

#[test]
fn dfg_table() {
    check(32 * 32, |cancel| Some(bytes(crate::dfg_table(32, cancel).ok()?.as_flattened())));
}
