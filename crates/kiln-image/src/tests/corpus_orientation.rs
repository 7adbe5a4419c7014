//! The same picture in eleven forms, and colour spaces against each other.

use super::{corpus, decode_default};
use crate::Image;
use std::path::Path;

fn load(folder: &Path, name: &str) -> Image {
    let bytes = std::fs::read(folder.join(name)).expect("a file of the corpus");
    decode_default(&bytes).unwrap_or_else(|error| panic!("{name}: {error}")).image
}

/// Root mean square of the difference over root mean square of `wanted`.
fn relative_rms(actual: &Image, wanted: &Image) -> f64 {
    assert_eq!((actual.width, actual.height), (wanted.width, wanted.height));
    let pairs = || actual.rgb.iter().zip(&wanted.rgb).map(|(&a, &w)| (f64::from(a), f64::from(w)));
    let difference: f64 = pairs().map(|(a, w)| (a - w) * (a - w)).sum();
    (difference / pairs().map(|(_, w)| w * w).sum::<f64>()).sqrt()
}

/// Radiance's tools turned the pixels and the axes in the resolution line alike, so every file shows the
/// same scene, bit for bit, once it is upright; so do those whose exposure is undone.
#[test]
fn five_orientations_and_two_exposures_show_the_same_picture() {
    let Some(folder) = corpus("five_orientations_and_two_exposures_show_the_same_picture") else { return };
    let wanted = load(&folder, "hdr/loadersgl/venice_sunset_256.hdr");
    for name in
        ["flip_h", "flip_v", "flip_hv", "rotate", "rotate_ccw", "exposure_plus2", "exposure_two_lines"]
    {
        let image = load(&folder, &format!("hdr/edge-radiance-tools/{name}.hdr"));
        assert!(image == wanted, "{name}: relative RMS {}", relative_rms(&image, &wanted));
    }
}

#[test]
fn xyze_agrees_with_rgbe_of_the_same_picture() {
    let Some(folder) = corpus("xyze_agrees_with_rgbe_of_the_same_picture") else { return };
    let rgbe = load(&folder, "hdr/edge-radiance-tools/rgbe_flat.hdr");
    for name in ["xyze", "xyze_flat", "xyze_o"] {
        let error = relative_rms(&load(&folder, &format!("hdr/edge-radiance-tools/{name}.hdr")), &rgbe);
        // Two encodings with eight bits of mantissa each, and Radiance truncates: half a percent.
        assert!(error <= 0.01, "{name}: relative RMS {error}");
    }
    // Reading the file's primaries as Rec. 709 is what this must tell apart.
    let unconverted = load(&folder, "hdr/loadersgl/venice_sunset_256.hdr");
    assert!(relative_rms(&unconverted, &rgbe) > 0.02);
}

#[test]
fn exr_in_xyz_agrees_with_exr_in_rec_709() {
    let Some(folder) = corpus("exr_in_xyz_agrees_with_exr_in_rec_709") else { return };
    let wanted = load(&folder, "exr/openexr-images/Chromaticities/Rec709.exr");
    let error = relative_rms(&load(&folder, "exr/openexr-images/Chromaticities/XYZ.exr"), &wanted);
    assert!(error <= 1e-3, "half floats leave 5e-4, this is {error}");
}

/// The data window of the one is a crop of the other.
#[test]
fn cropped_exr_is_the_whole_picture_again() {
    let Some(folder) = corpus("cropped_exr_is_the_whole_picture_again") else { return };
    let whole = load(&folder, "exr/imagers/cropping - uncropped original.exr");
    let cropped = load(&folder, "exr/imagers/cropping - data window differs display window.exr");
    assert!(cropped == whole, "relative RMS {}", relative_rms(&cropped, &whole));
}

/// The same picture with luminance and half-size chroma: flowers, which lose 7 % of their colour by it (11 % with chroma taken
/// from the nearest sample).
#[test]
fn half_size_chroma_shows_the_picture() {
    let Some(folder) = corpus("half_size_chroma_shows_the_picture") else { return };
    let load = |name: &str| load(&folder, &format!("exr/openexr-images/Chromaticities/{name}.exr"));
    let wanted = load("Rec709");
    for name in ["Rec709_YC", "XYZ_YC"] {
        let error = relative_rms(&load(name), &wanted);
        assert!(error <= 0.08, "{name}: {error}");
    }
    let between = relative_rms(&load("XYZ_YC"), &load("Rec709_YC"));
    assert!(between <= 0.01, "one picture in two colour spaces: {between}");
    let mut grey = wanted.clone();
    grey.rgb
        .chunks_exact_mut(3)
        .for_each(|texel| texel.fill(crate::colour::luminance([texel[0], texel[1], texel[2]]) as f32));
    assert!(relative_rms(&grey, &wanted) > 0.15, "{}", relative_rms(&grey, &wanted));
}
