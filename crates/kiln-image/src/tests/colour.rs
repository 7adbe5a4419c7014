//! Matrices and transfer functions.

use super::check_within;
use crate::colour::{
    CIE_XYZ, Chromaticities, LUMINANCE_REC_709, REC_709, linear_to_srgb, luminance_weights, srgb_to_linear,
    to_rec_709, transform, xyz_to_rec_709,
};

/// ACES AP0 (SMPTE ST 2065-1), with the D60-like ACES white.
const AP0: [f64; 8] = [0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.0770, 0.32168, 0.33767];

#[test]
fn white_stays_white_from_every_space() {
    for space in [REC_709, CIE_XYZ, Chromaticities::from_array(AP0)] {
        let matrix = to_rec_709(space).expect("a colour space");
        for value in transform(&matrix, [1.0; 3]) {
            check_within("white", value, 1.0, 1e-12);
        }
    }
}

#[test]
fn rec_709_to_itself_is_the_identity() {
    let matrix = to_rec_709(REC_709).expect("a colour space");
    for (row, values) in matrix.iter().enumerate() {
        for (column, &value) in values.iter().enumerate() {
            check_within("entry", value, f64::from(u8::from(row == column)), 1e-12);
        }
    }
}

/// IEC 61966-2-1 prints this matrix to four digits; its top left entry is 3.2406.
#[test]
fn xyz_to_rec_709_is_the_published_matrix() {
    let published = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];
    let matrix = xyz_to_rec_709().expect("a colour space");
    for (row, row_wanted) in matrix.iter().zip(published) {
        for (&value, wanted) in row.iter().zip(row_wanted) {
            check_within("entry", value, wanted, 5e-4);
        }
    }
}

#[test]
fn luminance_weights_of_rec_709_are_those_of_the_standard() {
    let weights = luminance_weights(REC_709).expect("a colour space");
    for (weight, wanted) in weights.into_iter().zip(LUMINANCE_REC_709) {
        check_within("weight", weight, wanted, 1e-4);
    }
}

#[test]
fn degenerate_primaries_span_no_space() {
    let collinear = Chromaticities::from_array([0.3, 0.3, 0.4, 0.4, 0.5, 0.5, 0.31, 0.33]);
    let no_white = Chromaticities { white: [0.3, 0.0], ..REC_709 };
    let not_a_number = Chromaticities { red: [f64::NAN, 0.3], ..REC_709 };
    for space in [collinear, no_white, not_a_number] {
        assert_eq!(to_rec_709(space), None, "{space:?}");
    }
}

#[test]
fn srgb_curve_and_its_inverse_meet_at_all_256_codes() {
    for code in 0..=255 {
        let encoded = f64::from(code) / 255.0;
        check_within("round trip", linear_to_srgb(srgb_to_linear(encoded)), encoded, 1e-7);
    }
    check_within("middle grey", srgb_to_linear(0.5), 0.214_041_140_482_232_55, 1e-15);
}
