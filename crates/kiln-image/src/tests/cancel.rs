//! A file that is not wanted any more is not read to its end.

use super::decode_default;
use crate::{Cancel, DecodeError, Image, Limits, TexelError, TexelPolicy, decode, hdr, png};
use exr::prelude::{Encoding, Layer, LayerAttributes, SpecificChannels, Vec2, WritableImage};
use std::sync::atomic::{AtomicBool, AtomicI64};

const SIZE: (usize, usize) = (300, 400);

fn gradient() -> Image {
    let rgb = (0..SIZE.0 * SIZE.1 * 3).map(|index| 1.0 + (index % 251) as f32).collect();
    Image::new(SIZE.0, SIZE.1, rgb).expect("values fit")
}

/// `.hdr` as written, `.hdr` whose lines are columns and whose colours need conversion, EXR, PNG; with the checks that each
/// takes at least.
fn files() -> Vec<(&'static str, Vec<u8>, i64)> {
    let plain = hdr::encode(&gradient());
    let pixels = plain.windows(4).position(|bytes| bytes == b"300\n").expect("the end of its header") + 4;
    let mut turned = b"#?RADIANCE\nEXPOSURE=2\nPRIMARIES=0.7 0.3 0.2 0.7 0.15 0.05 0.33 0.33\n\n".to_vec();
    turned.extend_from_slice(b"+X 400 +Y 300\n");
    turned.extend_from_slice(&plain[pixels..]);

    let image = gradient();
    let channels = SpecificChannels::rgb(|at: Vec2<usize>| {
        let [r, g, b] = image.texel(at.0, at.1);
        (r, g, b)
    });
    let layer = Layer::new(SIZE, LayerAttributes::named("main"), Encoding::FAST_LOSSLESS, channels);
    let mut bytes = std::io::Cursor::new(Vec::new());
    exr::prelude::Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).expect("to memory");

    let display: Vec<u8> = image.rgb.iter().map(|&value| value as u8).collect();
    vec![
        ("hdr", plain, 400),
        ("turned hdr", turned, 400 + 300),
        ("exr", bytes.into_inner(), 3 * 400),
        ("png", png::encode_rgb8(SIZE.0, SIZE.1, &display), 20),
    ]
}

#[test]
fn cancelled_decoding_ends_at_the_next_check() {
    for (name, bytes, checks_min) in files() {
        let wanted = decode_default(&bytes).expect("a sound file");
        let unset = AtomicBool::new(false);
        let read = |cancel: Cancel| decode(&bytes, &Limits::default(), cancel);
        assert_eq!(read(Cancel::when(&unset)).as_ref(), Ok(&wanted), "{name}: an unset flag");
        let left = AtomicI64::new(i64::MAX);
        assert_eq!(read(Cancel::countdown(&left)), Ok(wanted), "{name}");
        let total = i64::MAX - left.into_inner();
        assert!(total >= checks_min, "{name}: {total} checks, expected at least {checks_min}");
        for at in (0..total).step_by(7) {
            let left = AtomicI64::new(at);
            assert!(matches!(read(Cancel::countdown(&left)), Err(DecodeError::Cancelled(_))), "{name}: {at}");
            assert_eq!(left.into_inner(), -1, "{name}: nothing is looked at after check {at}");
        }
    }
}

#[test]
fn cancelled_policy_says_so_and_keeping_cannot_be_cancelled() {
    let flag = AtomicBool::new(true);
    for policy in [TexelPolicy::Repair, TexelPolicy::Error] {
        let result = policy.apply(&mut gradient(), Cancel::when(&flag));
        assert!(matches!(result, Err(TexelError::Cancelled(_))), "{result:?}");
    }
    assert!(TexelPolicy::Keep.apply(&mut gradient(), Cancel::when(&flag)).is_ok());
}
