//! Contact sheets: tone-mapped pictures of maps with titles, made without a GPU.
//!
//! Start at [`contact_sheet`]. One exposure serves a whole sheet, so that levels of one chain can be
//! compared: it puts the median luminance at middle grey. What is not finite shows in magenta.

mod font;
mod resample;
mod tone;

use crate::{Cube, Image};
use resample::resample;

pub use tone::{exposure, khronos_neutral, tone_mapped};

/// Sheet background, sRGB: dark and neutral, so that it tints nothing.
const BACKGROUND: [u8; 3] = [22, 22, 22];
/// Title colour, sRGB.
const INK: [u8; 3] = [205, 205, 205];

/// What a tile shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Picture {
    /// Drawn as a horizontal cross seen from inside: −X −Z +X +Z in the middle row, +Y above −Z, −Y below.
    /// Up, left and right are as in a panorama, whose centre is −Z too.
    Cube(Cube),
    /// Drawn as it is.
    Image(Image),
}

/// One picture with its title.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// ASCII; letters are drawn as capitals, unknown characters as a box, what is too long is cut.
    pub title: String,
    /// What to draw.
    pub picture: Picture,
}

/// A finished picture with its title.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shot {
    /// As of a [`Tile`].
    pub title: String,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// sRGB, `width · height · 3` bytes.
    pub rgb: Vec<u8>,
}

/// Lays finished pictures out in rows of `columns`, pixel by pixel, as width, height and sRGB bytes. Cells are as wide as the
/// widest picture.
pub fn shot_sheet(shots: &[Shot], columns: usize) -> (usize, usize, Vec<u8>) {
    let cell = shots.iter().map(|shot| shot.width).max().unwrap_or(0).max(64);
    let heights = shots.iter().map(|shot| shot.height).collect();
    let grid = Grid::new(cell, heights, columns.clamp(1, shots.len().max(1)));
    let mut canvas = Canvas::new(grid.width(), grid.height());
    for (index, shot) in shots.iter().enumerate() {
        let (x, y) = grid.place(index);
        canvas.title(x, y, &shot.title, &grid);
        for (offset, pixel) in shot.rgb.chunks_exact(3).enumerate() {
            let position = (x + offset % shot.width, y + grid.title_height() + offset / shot.width);
            canvas.set(position, [pixel[0], pixel[1], pixel[2]]);
        }
    }
    (canvas.width, canvas.height, canvas.rgb)
}

/// Lays tiles out in a grid, `tile_width` pixels each (at least 64), as width, height and sRGB bytes.
///
/// Small maps are enlarged texel by texel, large ones averaged in linear light before tone mapping
/// (Khronos PBR Neutral), so what is seen is what is stored.
pub fn contact_sheet(tiles: &[Tile], tile_width: usize) -> (usize, usize, Vec<u8>) {
    let tile_width = tile_width.max(64) / 4 * 4;
    let drawn: Vec<Drawn> = tiles.iter().map(|tile| draw(&tile.picture, tile_width)).collect();
    let exposure = exposure(drawn.iter().flat_map(|picture| picture.pixels.iter().flatten().copied()));
    // As many columns as make the sheet a little wider than high: tiles are wider than high already.
    let columns = (1..).find(|columns| columns * columns >= drawn.len()).unwrap_or(1).max(1);
    let columns = columns.min(drawn.len().max(1));
    let grid = Grid::new(tile_width, drawn.iter().map(|picture| picture.height).collect(), columns);
    let mut canvas = Canvas::new(grid.width(), grid.height());
    for (index, (tile, picture)) in tiles.iter().zip(&drawn).enumerate() {
        let (x, y) = grid.place(index);
        canvas.title(x, y, &tile.title, &grid);
        for (offset, pixel) in picture.pixels.iter().enumerate() {
            if let Some(rgb) = pixel {
                let position = (x + offset % tile_width, y + grid.title_height() + offset / tile_width);
                canvas.set(position, tone::pixel(*rgb, exposure));
            }
        }
    }
    (canvas.width, canvas.height, canvas.rgb)
}

/// A picture at its size on the sheet, linear; `None` where the background shows.
struct Drawn {
    height: usize,
    pixels: Vec<Option<[f32; 3]>>,
}

fn draw(picture: &Picture, width: usize) -> Drawn {
    match picture {
        Picture::Image(image) => {
            let height = (image.height * width).div_ceil(image.width).clamp(1, 4 * width);
            let pixels = resample((image.width, image.height), (width, height), |x, y| image.texel(x, y));
            Drawn { height, pixels: pixels.into_iter().map(Some).collect() }
        }
        Picture::Cube(cube) => draw_cross(cube, width),
    }
}

/// Column and row of each face on the cross, and whether it is mirrored left–right and top–bottom.
///
/// KTX2 faces are seen from outside a right-handed world, hence the mirroring; the faces above and below
/// are turned by 180° besides, as the cross hangs on −Z instead of +Z.
const CROSS: [(usize, usize, bool, bool); 6] = [
    (2, 1, true, false),
    (0, 1, true, false),
    (1, 0, false, true),
    (1, 2, false, true),
    (3, 1, true, false),
    (1, 1, true, false),
];

fn draw_cross(cube: &Cube, width: usize) -> Drawn {
    let (cell, size) = (width / 4, cube.face_size);
    let mut pixels = vec![None; width * cell * 3];
    for (face, (column, row, mirror_x, mirror_y)) in CROSS.into_iter().enumerate() {
        let flip = |index: usize, is_mirrored: bool| if is_mirrored { size - 1 - index } else { index };
        let texel = |x, y| cube.texel(face, flip(x, mirror_x), flip(y, mirror_y));
        for (offset, rgb) in resample((size, size), (cell, cell), texel).into_iter().enumerate() {
            let (x, y) = (column * cell + offset % cell, row * cell + offset / cell);
            pixels[y * width + x] = Some(rgb);
        }
    }
    Drawn { height: cell * 3, pixels }
}

/// Where tiles stand.
struct Grid {
    tile_width: usize,
    columns: usize,
    text_scale: usize,
    /// Picture height of each row.
    rows: Vec<usize>,
}

impl Grid {
    fn new(tile_width: usize, heights: Vec<usize>, columns: usize) -> Grid {
        let rows = heights.chunks(columns).map(|row| row.iter().copied().max().unwrap_or(0)).collect();
        Grid { tile_width, columns, text_scale: (tile_width / 200).max(1), rows }
    }

    fn gap(&self) -> usize {
        self.tile_width / 16
    }

    fn title_height(&self) -> usize {
        (font::HEIGHT + 5) * self.text_scale
    }

    fn width(&self) -> usize {
        self.columns * (self.tile_width + self.gap()) + self.gap()
    }

    fn height(&self) -> usize {
        self.row_start(self.rows.len())
    }

    fn row_start(&self, row: usize) -> usize {
        let above = self.rows[..row].iter().map(|height| height + self.title_height() + self.gap());
        self.gap() + above.sum::<usize>()
    }

    fn place(&self, index: usize) -> (usize, usize) {
        let column = index % self.columns;
        (self.gap() + column * (self.tile_width + self.gap()), self.row_start(index / self.columns))
    }
}

struct Canvas {
    width: usize,
    height: usize,
    rgb: Vec<u8>,
}

impl Canvas {
    fn new(width: usize, height: usize) -> Canvas {
        Canvas { width, height, rgb: BACKGROUND.repeat(width * height) }
    }

    fn set(&mut self, (x, y): (usize, usize), rgb: [u8; 3]) {
        let start = (y * self.width + x) * 3;
        self.rgb[start..start + 3].copy_from_slice(&rgb);
    }

    fn title(&mut self, x: usize, y: usize, title: &str, grid: &Grid) {
        let columns = grid.tile_width / (font::ADVANCE * grid.text_scale);
        let title: String = title.chars().take(columns).collect();
        self.text(x, y, &title, grid.text_scale);
    }

    fn text(&mut self, x: usize, y: usize, text: &str, scale: usize) {
        for (index, character) in text.chars().enumerate() {
            for (column, row) in font::dots(character) {
                let left = x + (index * font::ADVANCE + column) * scale;
                for offset in 0..scale * scale {
                    self.set((left + offset % scale, y + row * scale + offset / scale), INK);
                }
            }
        }
    }
}
