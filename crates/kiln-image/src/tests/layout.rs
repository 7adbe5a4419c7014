//! Sizes that are images and sizes that are not; sniffing.

use super::decode_default;
use crate::{Cancel, Cube, DecodeError, Image, LayoutError, Limits, Panorama, decode, hdr, png};

#[test]
fn panorama_accepts_two_to_one_only() {
    for (width, height) in [(2, 1), (4, 2), (1024, 512)] {
        let image = Image::new(width, height, vec![0.0; width * height * 3]).expect("values fit");
        assert!(Panorama::new(image).is_ok(), "{width} × {height}");
    }
    for (width, height) in [(1, 1), (3, 2), (1, 2), (4, 1), (3, 1)] {
        let image = Image::new(width, height, vec![0.0; width * height * 3]).expect("values fit");
        assert_eq!(Panorama::new(image), Err(LayoutError::Aspect { width, height }));
    }
}

#[test]
fn lengths_must_fit_and_products_may_not_overflow() {
    assert_eq!(Image::new(0, 1, vec![]), Err(LayoutError::Empty { width: 0, height: 1 }));
    assert!(matches!(
        Image::new(2, 1, vec![0.0; 5]),
        Err(LayoutError::Length { expected: 6, actual: 5, .. })
    ));
    assert!(matches!(Image::new(usize::MAX, 2, vec![]), Err(LayoutError::Length { .. })));
    assert!(matches!(Cube::new(usize::MAX / 2, vec![]), Err(LayoutError::Length { .. })));
    assert!(Cube::new(1, vec![0.0; 18]).is_ok());
}

#[test]
fn panorama_refuses_fields_that_disagree() {
    let image = Image { width: 4, height: 2, rgb: vec![0.0; 3] };
    assert!(matches!(Panorama::new(image), Err(LayoutError::Length { .. })));
}

#[test]
fn max_value_ignores_nan() {
    let image = Image::new(2, 1, vec![1.0, f32::NAN, 7.0, 2.0, 3.0, f32::NAN]).expect("values fit");
    assert_eq!(Panorama::new(image).expect("2:1").max_value(), 7.0);
}

#[test]
fn unknown_bytes_are_named() {
    let error = decode_default(b"GIF89a....").expect_err("no format that is read");
    assert!(matches!(&error, DecodeError::UnknownFormat { start } if start.starts_with("GIF89a")), "{error}");
    assert!(matches!(decode_default(b""), Err(DecodeError::UnknownFormat { .. })));
}

#[test]
fn limits_hold_for_every_format() {
    let image = Image::new(40, 20, vec![0.5; 2400]).expect("values fit");
    let files = [hdr::encode(&image), png::encode_rgb8(40, 20, &[99; 2400])];
    for bytes in files {
        for limits in [
            Limits { width_max: 39, ..Limits::default() },
            Limits { height_max: 19, ..Limits::default() },
            Limits { texels_max: 799, ..Limits::default() },
        ] {
            assert!(
                matches!(decode(&bytes, &limits, Cancel::NEVER), Err(DecodeError::TooLarge { .. })),
                "{limits:?}"
            );
        }
        let exact = Limits { width_max: 40, height_max: 20, texels_max: 800, ..Limits::default() };
        assert!(decode(&bytes, &exact, Cancel::NEVER).is_ok());
    }
}

#[test]
fn png_is_read_as_srgb_with_a_warning() {
    let bytes = png::encode_rgba8(2, 1, &[255, 0, 188, 255, 0, 0, 0, 0]);
    let decoded = decode_default(&bytes).expect("a picture just written");
    assert_eq!((decoded.format, decoded.image.width, decoded.image.height), ("PNG", 2, 1));
    assert_eq!(decoded.image.texel(0, 0)[..2], [1.0, 0.0]);
    super::check_within("code 188", decoded.image.texel(0, 0)[2].into(), 0.502_886_46, 1e-7);
    assert!(decoded.notes[0].contains("display values") && decoded.notes[1].contains("alpha"));
}
