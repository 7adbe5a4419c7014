use super::{SIDES, six_colours};
use crate::panorama::{cross, texel_of};
use kiln_image::Panorama;

/// The texel at position (`right`, `up`) on a side's plane.
fn at(panorama: &Panorama, side: usize, right: f64, up: f64) -> [f32; 3] {
    let side = &SIDES[side];
    let axis = cross(side.forward, side.up);
    let direction: [f64; 3] = std::array::from_fn(|i| side.forward[i] + right * axis[i] + up * side.up[i]);
    let (x, y) = texel_of(crate::panorama::normalize(direction), panorama.width(), panorama.height());
    panorama.texel(x, y)
}

fn is_ink(rgb: [f32; 3]) -> bool {
    rgb.iter().all(|value| *value > 0.9)
}

#[test]
fn axes_have_their_colours_in_the_panorama_of_the_conventions() {
    let panorama = six_colours(512);
    // Away from the marks: centre column is −Z, three quarters across is +X, top row is +Y.
    let below = 170;
    let brightest = |x: usize, y: usize| panorama.texel(x, y).map(|value| value > 0.3);
    assert_eq!(brightest(256, below), [true, true, false], "−Z is yellow");
    assert_eq!(brightest(384, below), [true, false, false], "+X is red");
    assert_eq!(brightest(128, below), [false, true, true], "−X is cyan");
    assert_eq!(brightest(2, below), [false, false, true], "+Z is blue");
    assert_eq!(brightest(60, 50), [false, true, false], "+Y is green");
    assert_eq!(brightest(60, 206), [true, false, true], "−Y is magenta");
}

#[test]
fn marks_are_readable_from_inside_sign_left_of_the_letter() {
    let panorama = six_colours(1024);
    for (index, side) in SIDES.iter().enumerate() {
        assert!(is_ink(at(&panorama, index, -0.34, 0.0)), "side {index}: the sign's bar is on the left");
        assert_eq!(
            is_ink(at(&panorama, index, -0.34, 0.13)),
            side.is_positive,
            "side {index}: plus or minus"
        );
        assert!(!is_ink(at(&panorama, index, 0.75, 0.0)), "side {index}: nothing right of the letter");
    }
    // Z is no mirror image of itself: its diagonal rises to the right.
    assert!(is_ink(at(&panorama, 5, 0.37, 0.13)) && !is_ink(at(&panorama, 5, 0.19, 0.13)));
    // Y has its fork above.
    assert!(is_ink(at(&panorama, 2, 0.16, 0.18)) && !is_ink(at(&panorama, 2, 0.16, -0.18)));
}

#[test]
fn smallest_panorama_has_colours_too() {
    assert!(six_colours(2).rgb().iter().all(|value| value.is_finite() && *value >= 0.0));
}
