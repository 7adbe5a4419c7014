//! What surrounds a scene, from any file that can hold it: panoramas, cubes in every arrangement, octahedral maps.

mod detect;
mod faces;
mod octahedral;

pub use detect::{Layout, UnknownLayoutName};
pub use faces::{CubePlacement, FACE_NAMES, FacePlacement};
pub use octahedral::{octahedral_direction, octahedral_uv};

use crate::{
    Bulk, Cancel, Cube, DecodeError, Image, Limits, Panorama, Shape, Texels,
    colour::Gamut,
    decode::{CHECK_TEXELS, Source, Stored, decode_source},
};

/// The two forms that the baker reads.
#[derive(Clone, Debug, PartialEq)]
pub enum Environment {
    /// Equirectangular.
    Panorama(Panorama),
    /// Six faces.
    Cube(Cube),
}

/// An environment, and what is worth saying about how it was found in its file.
#[derive(Clone, Debug, PartialEq)]
pub struct DecodedEnvironment {
    /// Linear Rec. 709 D65, relative radiance.
    pub environment: Environment,
    /// How the file holds it.
    pub layout: Layout,
    /// As [`Decoded::format`](crate::Decoded::format).
    pub format: &'static str,
    /// What a person should know; the first one names the layout and how to choose another.
    pub notes: Vec<String>,
    /// The colour space it was converted from, `None` where that was Rec. 709. [`check_texels`](crate::check_texels())
    /// and the texel policy tell colours outside Rec. 709 from ringing by it.
    pub gamut: Option<Gamut>,
}

/// Decodes an environment by its content, with the layout given or detected.
///
/// | detected | from |
/// |---|---|
/// | [`Layout::Cube`] | six faces in KTX2, KTX1 or DDS (level 0 is read) |
/// | [`Layout::Equirect`], [`Layout::ExrCube`] | an OpenEXR `envmap` attribute |
/// | [`Layout::Equirect`] | 2:1 |
/// | [`Layout::CubeStrip`] | 6:1, 1:6 |
/// | [`Layout::CubeCross`] | 4:3, 3:4 |
///
/// Shapes are those of the texels, unless the file says that texels are some whole number of times higher than wide or wider
/// than high (PIXASPECT, pixelAspectRatio): rows or columns are then repeated, which changes no radiance, as a texel is
/// a constant patch. An octahedral map is resampled to a panorama (see [`Layout::Octahedral`]).
///
/// # Errors
/// As [`decode`](crate::decode()); [`DecodeError::UnknownLayout`] where nothing tells the layout,
/// [`DecodeError::WrongLayout`] where the texels do not have the layout asked for.
pub fn decode_environment(
    bytes: &[u8],
    layout: Option<Layout>,
    limits: &Limits,
    cancel: Cancel,
) -> Result<DecodedEnvironment, DecodeError> {
    let Source { format, texels, mut notes, gamut, texel_aspect, declared } =
        decode_source(bytes, limits, cancel)?;
    let (environment, layout) = match texels {
        Stored::Cube(cube) => {
            let layout = detect::of_cube(layout, cube.face_size)?;
            notes.insert(0, format!("layout: cube, six faces of {0} × {0}", cube.face_size));
            (Environment::Cube(cube), layout)
        }
        Stored::Flat(image) => {
            let image = faces::square_texels(Bulk::new(image), texel_aspect, limits, &mut notes, cancel)?;
            let found = detect::of_image(layout, declared, &image)?;
            notes.insert(0, found.note);
            (arrange(found.layout, image, limits, &mut notes, cancel)?, found.layout)
        }
    };
    Ok(DecodedEnvironment { environment, layout, format, notes, gamut })
}

/// Puts six square images together; order +X −X +Y −Y +Z −Z, each as KTX2 and Vulkan have it.
///
/// # Errors
/// [`DecodeError::Face`] with the face whose file is wrong: unreadable, not square, of another size than the first.
pub fn environment_from_faces(
    files: [&[u8]; 6],
    limits: &Limits,
    cancel: Cancel,
) -> Result<DecodedEnvironment, DecodeError> {
    // Six of them are within the limits together.
    let limits = Limits { texels_max: limits.texels_max / 6, ..*limits };
    let mut rgb: Bulk<Vec<f32>> = Bulk::new(Vec::new());
    let mut notes: Vec<String> = Vec::new();
    let mut first: Option<(usize, &'static str, Option<Gamut>)> = None;
    for (file, face) in files.into_iter().zip(FACE_NAMES) {
        let wrong = |source: DecodeError| match source {
            DecodeError::Cancelled(_) => source,
            source => DecodeError::Face { face, source: Box::new(source) },
        };
        let source = decode_source(file, &limits, cancel).map_err(wrong)?;
        let Stored::Flat(image) = source.texels else {
            let actual = "a cube already".to_owned();
            let wanted = "takes six flat pictures";
            return Err(wrong(DecodeError::WrongLayout { layout: Layout::Cube, wanted, actual }));
        };
        let image = Bulk::new(image);
        let &mut (size, _, gamut) = first.get_or_insert((image.width, source.format, source.gamut));
        if (image.width, image.height) != (size, size) {
            let actual = format!("{} × {}, where {size} × {size} is due", image.width, image.height);
            let wanted = "takes six square pictures of equal size";
            return Err(wrong(DecodeError::WrongLayout { layout: Layout::Cube, wanted, actual }));
        }
        if source.gamut != gamut {
            let reason = "its colour space differs from that of face +X".to_owned();
            return Err(wrong(DecodeError::Unsupported { format: source.format, reason }));
        }
        for note in source.notes.into_iter().filter(|note| !notes.contains(note)).collect::<Vec<_>>() {
            notes.push(note);
        }
        // Of the right size at once: growing means copying, which cannot be interrupted.
        if rgb.is_empty() {
            rgb.reserve_exact(6 * image.rgb.len());
        }
        for values in image.rgb.chunks(CHECK_TEXELS) {
            cancel.check()?;
            rgb.extend_from_slice(values);
        }
    }
    let (size, format, gamut) = first.unwrap_or((0, "", None));
    notes.insert(0, format!("layout: cube, six files of {size} × {size} in the order +X -X +Y -Y +Z -Z"));
    let environment = Environment::Cube(Cube::new(size, rgb.into_inner())?);
    Ok(DecodedEnvironment { environment, layout: Layout::Cube, format, notes, gamut })
}

/// Takes an image of the right shape apart.
fn arrange(
    layout: Layout,
    image: Bulk<Image>,
    limits: &Limits,
    notes: &mut Vec<String>,
    cancel: Cancel,
) -> Result<Environment, DecodeError> {
    Ok(match layout {
        Layout::Equirect => Environment::Panorama(Panorama::new(image.into_inner())?),
        Layout::Octahedral => {
            let panorama = octahedral::resample(&image, limits, cancel)?;
            notes.push(format!(
                "the octahedral map of {0} × {0} was resampled to a panorama of {1} × {2}",
                image.width,
                panorama.width(),
                panorama.height()
            ));
            Environment::Panorama(panorama)
        }
        Layout::CubeStrip | Layout::CubeCross | Layout::ExrCube | Layout::Cube => {
            let placement = CubePlacement::of(layout, image.width, image.height)
                .ok_or_else(|| detect::wrong(layout, image.width, image.height))?;
            Environment::Cube(placement.cut(&image, cancel)?)
        }
    })
}

impl Environment {
    /// What to call its size: `1024 × 512`, or `6 × 256 × 256`.
    pub fn size_text(&self) -> String {
        match self {
            Environment::Panorama(panorama) => format!("{} × {}", panorama.width(), panorama.height()),
            Environment::Cube(cube) => format!("6 × {0} × {0}", cube.face_size),
        }
    }
}

impl Texels for Environment {
    fn shape(&self) -> Shape {
        match self {
            Environment::Panorama(panorama) => panorama.shape(),
            Environment::Cube(cube) => cube.shape(),
        }
    }

    fn rgb(&self) -> &[f32] {
        match self {
            Environment::Panorama(panorama) => panorama.rgb(),
            Environment::Cube(cube) => &cube.rgb,
        }
    }

    fn rgb_mut(&mut self) -> &mut [f32] {
        match self {
            Environment::Panorama(panorama) => panorama.rgb_mut(),
            Environment::Cube(cube) => &mut cube.rgb,
        }
    }
}

impl Texels for DecodedEnvironment {
    fn shape(&self) -> Shape {
        self.environment.shape()
    }

    fn rgb(&self) -> &[f32] {
        self.environment.rgb()
    }

    fn rgb_mut(&mut self) -> &mut [f32] {
        self.environment.rgb_mut()
    }

    fn gamut(&self) -> Option<&Gamut> {
        self.gamut.as_ref()
    }
}
