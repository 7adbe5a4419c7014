//! EXR files written here, each for one case the corpus lacks.

use super::{check_within, decode_default};
use crate::{Cancel, DecodeError, Limits, decode};
use exr::{
    image::{AnyChannel, AnyChannels, FlatSamples, Image, Layer, Layers},
    math::Vec2,
    meta::{
        attribute::{Chromaticities, IntegerBounds},
        header::{ImageAttributes, LayerAttributes},
    },
    prelude::{Encoding, SmallVec, WritableImage, f16},
};

/// A 2 × 1 layer with the given channels.
fn layer(name: &str, channels: &[(&str, FlatSamples)]) -> Layer<AnyChannels<FlatSamples>> {
    let list = channels.iter().map(|(name, samples)| AnyChannel::new(*name, samples.clone()));
    let list: SmallVec<[AnyChannel<FlatSamples>; 4]> = list.collect();
    Layer::new((2, 1), LayerAttributes::named(name), Encoding::UNCOMPRESSED, AnyChannels::sort(list))
}

fn file(layers: Layers<AnyChannels<FlatSamples>>, change: impl FnOnce(&mut ImageAttributes)) -> Vec<u8> {
    let mut attributes = ImageAttributes::with_size((2, 1));
    change(&mut attributes);
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = Image { attributes, layer_data: layers };
    image.write().non_parallel().to_buffered(&mut bytes).expect("written to memory");
    bytes.into_inner()
}

fn f32s(values: [f32; 2]) -> FlatSamples {
    FlatSamples::F32(values.to_vec())
}

fn rgb(values: [f32; 2]) -> [(&'static str, FlatSamples); 3] {
    [("R", f32s(values)), ("G", f32s(values)), ("B", f32s(values))]
}

#[test]
fn first_part_with_colour_is_taken_and_said_aloud() {
    let parts = [layer("depth", &[("Z", f32s([9.0; 2]))]), layer("beauty", &rgb([1.0, 2.0]))];
    let decoded = decode_default(&file(parts.into_iter().collect(), |_| ())).expect("two parts");
    assert_eq!(decoded.image.rgb, [1.0, 1.0, 1.0, 2.0, 2.0, 2.0]);
    assert!(decoded.notes[0].contains("part 1 (beauty) was taken, of 2"), "{:?}", decoded.notes);
}

#[test]
fn layered_channels_are_taken_where_there_are_no_plain_ones() {
    let channels =
        [("diffuse.R", f32s([1.0; 2])), ("diffuse.G", f32s([2.0; 2])), ("diffuse.B", f32s([3.0; 2]))];
    let parts = [layer("main", &channels)];
    let decoded = decode_default(&file(parts.into_iter().collect(), |_| ())).expect("a layer");
    assert_eq!(decoded.image.texel(1, 0), [1.0, 2.0, 3.0]);
    assert!(decoded.notes[0].contains("diffuse"), "{:?}", decoded.notes);
}

#[test]
fn half_and_luminance_samples_are_exact() {
    let values = [f16::from_f32(0.1), f16::from_f32(65504.0)];
    let parts = [layer("main", &[("Y", FlatSamples::F16(values.to_vec()))])];
    let decoded = decode_default(&file(parts.into_iter().collect(), |_| ())).expect("luminance");
    assert_eq!(
        decoded.image.rgb,
        [values[0].to_f32(), values[0].to_f32(), values[0].to_f32(), 65504.0, 65504.0, 65504.0]
    );
}

#[test]
fn chromaticities_convert_with_white_kept_and_zeros_mean_none() {
    let with = |xy: [f32; 8]| {
        let parts = [layer("main", &rgb([1.0, 0.5]))];
        let pair = |i: usize| Vec2(xy[2 * i], xy[2 * i + 1]);
        let found = Chromaticities { red: pair(0), green: pair(1), blue: pair(2), white: pair(3) };
        decode_default(&file(parts.into_iter().collect(), |a| a.chromaticities = Some(found)))
    };
    let ap1 = with([0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767]).expect("ACEScg");
    for value in ap1.image.texel(0, 0) {
        check_within("white", value.into(), 1.0, 1e-6);
    }
    assert_eq!(ap1.notes.len(), 1);
    assert!(with([0.0; 8]).expect("all zeros").notes.is_empty());
    assert!(matches!(with([0.3; 8]), Err(DecodeError::Invalid { .. })));
}

#[test]
fn data_window_is_placed_and_cropped_by_the_display_window() {
    let mut part = layer("main", &rgb([1.0, 2.0]));
    part.attributes.layer_position = Vec2(-1, 1);
    let window = IntegerBounds::new((0, 0), (3, 2));
    let bytes = file([part].into_iter().collect(), |attributes| attributes.display_window = window);
    let decoded = decode_default(&bytes).expect("windows overlap");
    let reds: Vec<f32> = decoded.image.rgb.iter().copied().step_by(3).collect();
    assert_eq!((decoded.image.width, reds), (3, vec![0.0, 0.0, 0.0, 2.0, 0.0, 0.0]));
    assert!(decoded.notes[0].contains("display window"), "{:?}", decoded.notes);
}

#[test]
fn huge_display_window_is_refused_before_it_is_allocated() {
    let window = IntegerBounds::new((0, 0), (30_000, 30_000));
    let parts = [layer("main", &rgb([1.0; 2]))];
    let bytes = file(parts.into_iter().collect(), |attributes| attributes.display_window = window);
    assert!(matches!(decode_default(&bytes), Err(DecodeError::TooLarge { .. })));
}

#[test]
fn limits_hold_for_size_and_channels_and_parts() {
    let part = || layer("main", &rgb([1.0; 2]));
    let one = file([part()].into_iter().collect(), |_| ());
    for limits in [
        Limits { width_max: 1, ..Limits::default() },
        Limits { texels_max: 1, ..Limits::default() },
        Limits { channels_max: 2, ..Limits::default() },
        Limits { parts_max: 0, ..Limits::default() },
    ] {
        assert!(
            matches!(decode(&one, &limits, Cancel::NEVER), Err(DecodeError::TooLarge { .. })),
            "{limits:?}"
        );
    }
    assert!(
        decode(
            &one,
            &Limits { width_max: 2, texels_max: 2, channels_max: 3, ..Limits::default() },
            Cancel::NEVER
        )
        .is_ok()
    );
}

#[test]
fn every_truncation_is_an_error() {
    let bytes = file([layer("main", &rgb([1.0, 2.0]))].into_iter().collect(), |_| ());
    assert!(decode_default(&bytes).is_ok());
    for end in 4..bytes.len() {
        let error = decode_default(&bytes[..end]).expect_err("a truncated file");
        assert!(!error.to_string().contains("gave up"), "{end} bytes made the decoder panic");
    }
}

/// An uncompressed EXR of 8 × 4 texels of luminance with chroma at half size, byte by byte: no writer makes one.
pub(super) fn half_size_chroma() -> Vec<u8> {
    let mut bytes = vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0];
    let mut attribute = |name: &str, kind: &str, value: &[u8]| {
        bytes.extend(format!("{name}\0{kind}\0").bytes());
        bytes.extend((value.len() as i32).to_le_bytes());
        bytes.extend_from_slice(value);
    };
    let numbers = |values: &[i32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let mut channels = Vec::new();
    for (name, rate) in [("BY", 2), ("RY", 2), ("Y", 1)] {
        channels.extend(format!("{name}\0").bytes());
        channels.extend(numbers(&[2, 0, rate, rate]));
    }
    channels.push(0);
    attribute("channels", "chlist", &channels);
    attribute("compression", "compression", &[0]);
    attribute("dataWindow", "box2i", &numbers(&[0, 0, 7, 3]));
    attribute("displayWindow", "box2i", &numbers(&[0, 0, 7, 3]));
    attribute("lineOrder", "lineOrder", &[0]);
    attribute("pixelAspectRatio", "float", &1.0_f32.to_le_bytes());
    attribute("screenWindowCenter", "v2f", &[0; 8]);
    attribute("screenWindowWidth", "float", &1.0_f32.to_le_bytes());
    bytes.push(0);
    let lines: Vec<Vec<f32>> = (0..4)
        .map(|row| {
            // Blue, then red chroma in even rows, rising from left to right; luminance 1 + row.
            let chroma: Vec<f32> =
                if row % 2 == 0 { vec![0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 1.0, 1.5] } else { Vec::new() };
            chroma.into_iter().chain([1.0 + row as f32; 8]).collect()
        })
        .collect();
    let mut offset = (bytes.len() + 4 * 8) as u64;
    for line in &lines {
        bytes.extend(offset.to_le_bytes());
        offset += 8 + 4 * line.len() as u64;
    }
    for (row, line) in lines.iter().enumerate() {
        bytes.extend(numbers(&[row as i32, 4 * line.len() as i32]));
        bytes.extend(line.iter().flat_map(|value| value.to_le_bytes()));
    }
    bytes
}

/// RY = (R − Y)/Y, between its samples the mean of both; the last column repeats.
#[test]
fn half_size_chroma_is_interpolated() {
    let image = decode_default(&half_size_chroma()).expect("a sound file").image;
    assert_eq!((image.width, image.height), (8, 4));
    for (x, red) in [1.0, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 2.5].into_iter().enumerate() {
        for y in 0..4 {
            let luminance = 1.0 + y as f32;
            assert_eq!(image.texel(x, y)[0], red * luminance, "{x}, {y}");
            assert_eq!(image.texel(x, y)[2], luminance);
        }
    }
}

#[test]
fn data_window_outside_the_display_window_is_taken_alone() {
    let outside = |attributes: &mut ImageAttributes| attributes.display_window.position = Vec2(50, 50);
    let decoded = decode_default(&file([layer("main", &rgb([1.0, 2.0]))].into_iter().collect(), outside));
    let decoded = decoded.expect("nothing of it would be displayed");
    assert_eq!((decoded.image.width, decoded.image.texel(1, 0)), (2, [2.0; 3]));
    assert!(decoded.notes[0].contains("lies outside the display window"), "{:?}", decoded.notes);
}
