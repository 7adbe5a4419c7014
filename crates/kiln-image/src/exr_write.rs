//! Writes OpenEXR: binary32 RGB, losslessly compressed (ZIP), chromaticities of Rec. 709 stated.
//!
//! Source: "OpenEXR Technical Introduction", section "Environment Maps". Its axes put a panorama's centre at +Z and the
//! left half at +X; here the same picture has −Z in its centre: Kiln's world is OpenEXR's turned by 180° about Y.

use crate::{Cancel, Cancelled, Cube, CubePlacement, Image, Layout, Panorama};
use exr::meta::attribute::{Chromaticities, EnvironmentMap};
use exr::prelude::{Encoding, Layer, LayerAttributes, SpecificChannels, Vec2, WritableImage};

/// Any image, without saying what it is.
///
/// # Errors
/// [`Cancelled`] before it begins; writing takes some 50 ns a texel.
pub fn encode_image(image: &Image, cancel: Cancel) -> Result<Vec<u8>, Cancelled> {
    encode(image, None, cancel)
}

/// A panorama, `envmap` = latitude-longitude.
///
/// # Errors
/// As [`encode_image`].
pub fn encode_panorama(panorama: &Panorama, cancel: Cancel) -> Result<Vec<u8>, Cancelled> {
    encode(panorama.image(), Some(EnvironmentMap::LatitudeLongitude), cancel)
}

/// A cube, `envmap` = cube: OpenEXR's six faces from the top, each seen unmirrored from inside. They show Kiln's world turned
/// by 180° about Y, as panoramas do, so that a reader who knows OpenEXR's axes sees both kinds alike ([`Layout::ExrCube`]).
///
/// OpenEXR's own library takes the outermost texels' centres for the cube's edges; here, as nearly everywhere, texels
/// are cells and their centres lie half a texel inside.
///
/// # Errors
/// As [`encode_image`].
pub fn encode_cube(cube: &Cube, cancel: Cancel) -> Result<Vec<u8>, Cancelled> {
    let size = cube.face_size;
    let placement = CubePlacement::of(Layout::ExrCube, size, 6 * size).expect("a column of six");
    encode(&placement.unfold(cube), Some(EnvironmentMap::Cube), cancel)
}

fn encode(image: &Image, kind: Option<EnvironmentMap>, cancel: Cancel) -> Result<Vec<u8>, Cancelled> {
    cancel.check()?;
    let channels = SpecificChannels::rgb(|at: Vec2<usize>| {
        let [r, g, b] = image.texel(at.0, at.1);
        (r, g, b)
    });
    let attributes = LayerAttributes { environment_map: kind, ..LayerAttributes::default() };
    let layer = Layer::new((image.width, image.height), attributes, Encoding::SMALL_LOSSLESS, channels);
    let mut file = exr::prelude::Image::from_layer(layer);
    file.attributes.chromaticities = Some(Chromaticities {
        red: Vec2(0.64, 0.33),
        green: Vec2(0.3, 0.6),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.329),
    });
    let mut bytes = std::io::Cursor::new(Vec::new());
    file.write().non_parallel().to_buffered(&mut bytes).expect("writing to memory succeeds");
    Ok(bytes.into_inner())
}
