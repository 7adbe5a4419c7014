//! Which layout an image has: asked for, stated by its file, or told from its shape.

use crate::{DecodeError, Image};
use std::{fmt, str::FromStr};
use thiserror::Error;

/// How a file holds an environment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Layout {
    /// Longitude and latitude, 2:1; the centre looks along −Z.
    Equirect,
    /// Six faces in a row (6:1) or a column (1:6), in the order and orientation of KTX2.
    CubeStrip,
    /// Six faces as an unfolded cube, 4:3 or 3:4, oriented as in KTX2: −X +Z +X −Z in the middle row, +Y above and −Y
    /// below +Z. The tall one has −Z below −Y, turned by 180°.
    CubeCross,
    /// Octahedral, 1:1: +Y in the centre, −Y in the corners, +X at the right, −Z at the top. Resampled to a panorama as
    /// high as the map, each of whose texels is the mean of 16 samples that share it equally by solid angle (4096 at lamps).
    Octahedral,
    /// OpenEXR's cube: a column of six faces (1:6) in that format's own orientation.
    ///
    /// OpenEXR's latitude-longitude maps have +Z in the centre, Kiln's panoramas −Z. Both kinds are turned alike, so that
    /// a cube and a panorama of one scene look the same way: OpenEXR's +Z is Kiln's −Z, its +X is −X.
    /// Its outermost texel centres lie on the cube's edges; here they lie half a texel inside, as everywhere else.
    ExrCube,
    /// Six faces of a container (KTX2, KTX1, DDS) or six files.
    Cube,
}

/// A name that is no layout.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0:?} is no layout; known are auto, {known}", known = Layout::ALL.map(Layout::name).join(", "))]
pub struct UnknownLayoutName(pub String);

/// A layout with the sentence that says where it was found.
pub(super) struct Found {
    pub layout: Layout,
    pub note: String,
}

impl Layout {
    /// Every layout.
    pub const ALL: [Layout; 6] = [
        Layout::Equirect,
        Layout::CubeStrip,
        Layout::CubeCross,
        Layout::Octahedral,
        Layout::ExrCube,
        Layout::Cube,
    ];

    /// The name in kiln.toml and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Layout::Equirect => "equirect",
            Layout::CubeStrip => "cube-strip",
            Layout::CubeCross => "cube-cross",
            Layout::Octahedral => "octahedral",
            Layout::ExrCube => "exr-cube",
            Layout::Cube => "cube",
        }
    }

    /// What a user wrote: `None` for `auto`.
    ///
    /// # Errors
    /// [`UnknownLayoutName`], which lists the names there are.
    pub fn parse_choice(name: &str) -> Result<Option<Layout>, UnknownLayoutName> {
        if name == "auto" { Ok(None) } else { name.parse().map(Some) }
    }

    /// What its shape must be, to go after its name.
    fn wanted(self) -> &'static str {
        match self {
            Layout::Equirect => {
                "is twice as wide as high (anything else would cover a part of the sphere, or stretch it)"
            }
            Layout::CubeStrip => "is six squares in a row or a column (6:1 or 1:6)",
            Layout::CubeCross => "is an unfolded cube (4:3 or 3:4)",
            Layout::Octahedral => "is a square",
            Layout::ExrCube => "is a column of six squares (1:6)",
            Layout::Cube => "needs a container with six faces (KTX2, KTX1, DDS) or six files",
        }
    }

    fn fits(self, width: usize, height: usize) -> bool {
        let is = |columns: usize, rows: usize| {
            width.is_multiple_of(columns) && height.is_multiple_of(rows) && width / columns == height / rows
        };
        match self {
            Layout::Equirect => is(2, 1),
            Layout::CubeStrip => is(6, 1) || is(1, 6),
            Layout::CubeCross => is(4, 3) || is(3, 4),
            Layout::Octahedral => is(1, 1),
            Layout::ExrCube => is(1, 6),
            Layout::Cube => false,
        }
    }
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Layout {
    type Err = UnknownLayoutName;

    fn from_str(name: &str) -> Result<Layout, UnknownLayoutName> {
        let found = Layout::ALL.into_iter().find(|layout| layout.name() == name);
        found.ok_or_else(|| UnknownLayoutName(name.to_owned()))
    }
}

/// The layout of a flat image.
pub(super) fn of_image(
    asked: Option<Layout>,
    declared: Option<Layout>,
    image: &Image,
) -> Result<Found, DecodeError> {
    let (width, height) = (image.width, image.height);
    // A square may be octahedral, but also a light probe, a fish-eye or a texture: nobody is guessed at.
    let by_shape = || {
        let shapes = [Layout::Equirect, Layout::CubeStrip, Layout::CubeCross];
        let found = shapes.into_iter().find(|layout| layout.fits(width, height));
        found.ok_or(DecodeError::UnknownLayout { width, height })
    };
    let (layout, origin) = match (asked, declared) {
        (Some(layout), _) => (layout, "as asked for"),
        (None, Some(layout)) => (layout, "as the file says"),
        (None, None) => (by_shape()?, "told from its shape"),
    };
    if !layout.fits(width, height) {
        return Err(wrong(layout, width, height));
    }
    let hint = if asked.is_some() {
        ""
    } else {
        "; `layout = \"…\"` (or --layout) reads it otherwise: equirect, cube-strip, cube-cross, octahedral, exr-cube"
    };
    Ok(Found { layout, note: format!("layout: {layout}, {origin}, {width} × {height}{hint}") })
}

/// The layout of six faces from a container.
pub(super) fn of_cube(asked: Option<Layout>, face_size: usize) -> Result<Layout, DecodeError> {
    match asked {
        None | Some(Layout::Cube) => Ok(Layout::Cube),
        Some(layout) => {
            let actual = format!("a container with six faces of {face_size} × {face_size}");
            Err(DecodeError::WrongLayout { layout, wanted: layout.wanted(), actual })
        }
    }
}

/// The refusal of an image that has not the shape of `layout`.
pub(super) fn wrong(layout: Layout, width: usize, height: usize) -> DecodeError {
    let actual = format!("a flat picture of {width} × {height}");
    DecodeError::WrongLayout { layout, wanted: layout.wanted(), actual }
}
