//! The project that `kiln init` writes: environments, a scene and shaders, all made here or by hand for it.
//!
//! Start at [`files`]: options in, paths and bytes out. [`sky_hdr`] is the sky alone, for a sun that moves.
//!
//! Conventions: paths are relative to the new project and use `/`; panoramas as in `kiln-image`; the scene in
//! units of a ball's radius, +Y up. Equal options give equal bytes on every machine.
//!
//! Not here: files on disk (`kiln`), reading any of it (`kiln-image`, `kiln-scene`, `kiln-shader`).

use kiln_image::{hdr, png};

pub mod orientation;
pub mod sky;
pub mod studio;

mod ball;
mod material_balls;
mod panorama;
mod profile;
mod shaders;
#[cfg(test)]
mod tests;
mod tiles;

/// What a new project is made with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleOptions {
    /// Columns of each environment; 2048 is a good start.
    pub panorama_width: usize,
    /// Where the sky's sun stands.
    pub sun: sky::SunPosition,
}

/// Haze of the sample's sky: 2 is very clear, 10 is hazy.
const TURBIDITY: f64 = 2.8;
/// Baked output and pictures are made from the rest.
const GITIGNORE: &str = "# Made by Kiln from the files beside it.\n/baked/\n/frames/\n";

/// Every file of the sample project, sorted by path.
pub fn files(options: &SampleOptions) -> Vec<(String, Vec<u8>)> {
    let width = options.panorama_width;
    let (gltf, bin) = material_balls::material_balls();
    let mut files = vec![
        (".gitignore".to_owned(), GITIGNORE.as_bytes().to_vec()),
        ("kiln.toml".to_owned(), include_bytes!("../../../config/project_template.toml").to_vec()),
        (SKY_PATH.to_owned(), sky_hdr(width, options.sun)),
        ("environments/studio.hdr".to_owned(), hdr::encode(studio::soft_boxes(width).image())),
        ("environments/orientation.hdr".to_owned(), hdr::encode(orientation::six_colours(width).image())),
        ("scenes/material_balls.gltf".to_owned(), gltf.into_bytes()),
        ("scenes/material_balls.bin".to_owned(), bin),
    ];
    let tiles = tiles::tiles();
    let images = [&tiles.base_color, &tiles.normal, &tiles.occlusion_roughness_metallic];
    for (name, rgb) in material_balls::TEXTURES.iter().zip(images) {
        files.push((format!("scenes/textures/{name}"), png::encode_rgb8(tiles::SIZE, tiles::SIZE, rgb)));
    }
    files.extend(shaders::SHADERS.iter().map(|(path, text)| ((*path).to_owned(), text.as_bytes().to_vec())));
    files.sort();
    files
}

/// Path of the file that [`sky_hdr`] makes.
pub const SKY_PATH: &str = "environments/sky.hdr";

/// The sky as a Radiance .hdr file of `width` columns.
pub fn sky_hdr(width: usize, sun: sky::SunPosition) -> Vec<u8> {
    hdr::encode(sky::sun_and_sky(width, sun, TURBIDITY).image())
}
