//! OpenEXR and PNG files written here, read by the crates.

use super::decode_default;
use crate::colour::linear_to_srgb;
use crate::{Cancel, Cancelled, Cube, Image, Panorama, exr_write, png};
use exr::meta::attribute::EnvironmentMap;
use std::sync::atomic::AtomicI64;

fn image(width: usize, height: usize) -> Image {
    let rgb = (0..width * height * 3).map(|index| (index as f32 * 1.37).sin().abs() * 1e5).collect();
    Image::new(width, height, rgb).expect("it fits")
}

fn environment(bytes: &[u8]) -> Option<EnvironmentMap> {
    let meta = exr::meta::MetaData::read_from_buffered(std::io::Cursor::new(bytes), false).expect("headers");
    meta.headers[0].own_attributes.environment_map
}

#[test]
fn exr_comes_back_bit_for_bit_and_says_what_it_is() {
    let picture = image(16, 8);
    let plain = exr_write::encode_image(&picture, Cancel::NEVER).expect("nobody cancels");
    assert_eq!(environment(&plain), None);
    assert_eq!(decode_default(&plain).expect("our own file").image, picture);
    let panorama = Panorama::new(picture.clone()).expect("twice as wide");
    let bytes = exr_write::encode_panorama(&panorama, Cancel::NEVER).expect("nobody cancels");
    assert_eq!(environment(&bytes), Some(EnvironmentMap::LatitudeLongitude));
    assert_eq!(decode_default(&bytes).expect("our own file").image, picture);
    assert_eq!(
        bytes,
        exr_write::encode_panorama(&panorama, Cancel::NEVER).expect("nobody cancels"),
        "no time in it"
    );
    assert_eq!(exr_write::encode_image(&picture, Cancel::countdown(&AtomicI64::new(0))), Err(Cancelled));
}

/// Size and texels, by the crate alone.
fn read_exr(bytes: Vec<u8>) -> ([usize; 2], Vec<[f32; 3]>) {
    use exr::prelude::{ReadChannels, ReadLayers, read};
    let pixels = read().no_deep_data().largest_resolution_level();
    let create = |size: exr::prelude::Vec2<usize>, _: &_| (size.0, vec![[0.0; 3]; size.0 * size.1]);
    let set = |(width, texels): &mut (usize, Vec<[f32; 3]>),
               at: exr::prelude::Vec2<usize>,
               (r, g, b): (f32, f32, f32)| {
        texels[at.1 * *width + at.0] = [r, g, b];
    };
    let reader = pixels.rgb_channels(create, set).first_valid_layer().all_attributes().non_parallel();
    let (width, texels) =
        reader.from_buffered(std::io::Cursor::new(bytes)).expect("a file").layer_data.channel_data.pixels;
    ([width, texels.len() / width], texels)
}

#[test]
fn exr_cube_holds_six_faces_below_each_other() {
    let cube = Cube { face_size: 4, rgb: image(4, 24).rgb };
    let bytes = exr_write::encode_cube(&cube, Cancel::NEVER).expect("nobody cancels");
    assert_eq!(environment(&bytes), Some(EnvironmentMap::Cube));
    let (size, texels) = read_exr(bytes);
    assert_eq!(size, [4, 24]);
    // OpenEXR's +X is our -X; side faces and, after half a turn, caps are mirrored left to right.
    assert_eq!(texels[0], cube.texel(1, 3, 0));
    assert_eq!(texels[2 * 16], cube.texel(2, 3, 0));
}

#[test]
fn png_holds_the_exposed_and_clamped_picture_and_says_how_much_is_lost() {
    let picture = Image::new(2, 2, vec![0.1, 0.2, 0.5, 4.0, 0.0, 0.0, -1.0, 0.25, 0.25, f32::NAN, 0.3, 0.3])
        .expect("it fits");
    let (bytes, clamped) = png::encode_radiance(&picture, 0.5, Cancel::NEVER).expect("nobody cancels");
    assert_eq!(clamped, 0.75, "2.0, -0.5 and NaN");
    let back = ::image::load_from_memory(&bytes).expect("a PNG").to_rgb8();
    let srgb = |linear: f64| (linear_to_srgb(linear) * 255.0).round() as u8;
    assert_eq!(back.get_pixel(0, 0).0, [srgb(0.05), srgb(0.1), srgb(0.25)]);
    assert_eq!(back.get_pixel(1, 0).0, [255, 0, 0]);
    assert_eq!(back.get_pixel(0, 1).0, [0, srgb(0.125), srgb(0.125)]);
    let (brighter, _) = png::encode_radiance(&picture, 1.0, Cancel::NEVER).expect("nobody cancels");
    assert_ne!(bytes, brighter, "the check itself: exposure matters");
}
