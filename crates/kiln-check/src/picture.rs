//! False-colour maps: grey where all is well, a colour for each thing that is not.

use kiln_image::colour::luminance;
use kiln_image::{Environment, Image, png};

/// A picture of a report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// What it shows.
    pub title: String,
    /// Pixels.
    pub width: usize,
    /// Pixels.
    pub height: usize,
    /// PNG bytes.
    pub png: Vec<u8>,
    /// The colours in it and what they mean, for those that are there.
    pub legend: Vec<([u8; 3], String)>,
}

/// Widest picture.
const WIDTH_MAX: usize = 1024;

/// What is wrong with a texel; a later one is shown before an earlier one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Fault {
    None,
    Bright,
    Lost,
    Made,
    AboveF16,
    Negative,
    Infinite,
    NaN,
}

impl Fault {
    const ALL: [Fault; 8] = [
        Fault::None,
        Fault::Bright,
        Fault::Lost,
        Fault::Made,
        Fault::AboveF16,
        Fault::Negative,
        Fault::Infinite,
        Fault::NaN,
    ];

    /// The worst that is wrong with a texel; from `bright` on its luminance is worth showing.
    pub(crate) fn of(texel: [f32; 3], bright: f64) -> Fault {
        let any = |is_it: fn(&f32) -> bool| texel.iter().any(is_it);
        match () {
            () if any(|value| value.is_nan()) => Fault::NaN,
            () if any(|value| value.is_infinite()) => Fault::Infinite,
            () if any(|value| *value < 0.0) => Fault::Negative,
            () if any(|value| *value > 65504.0) => Fault::AboveF16,
            () if luminance(texel) >= bright => Fault::Bright,
            () => Fault::None,
        }
    }

    fn colour(self) -> Option<([u8; 3], &'static str)> {
        Some(match self {
            Fault::None => return None,
            Fault::Bright => ([255, 214, 0], "the brightest 0.01 % of texels"),
            Fault::Lost => ([40, 120, 255], "energy is lost"),
            Fault::Made => ([255, 60, 30], "energy is made"),
            Fault::AboveF16 => ([255, 60, 30], "above 65504"),
            Fault::Negative => ([40, 120, 255], "negative"),
            Fault::Infinite => ([0, 230, 230], "infinite"),
            Fault::NaN => ([255, 0, 255], "NaN"),
        })
    }
}

const SEAM: [u8; 3] = [255, 140, 0];

/// A map of an environment: a panorama as it is, a cube's faces in two rows of three. A pixel shows the worst of the texels
/// that it covers. `borders` that are seams are drawn along the picture's rim.
pub(crate) fn fault_map(
    title: &str,
    environment: &Environment,
    fault: impl Fn([f32; 3]) -> Fault,
    borders: &[&str],
) -> Picture {
    let (columns, rows) = match environment {
        Environment::Panorama(panorama) => (panorama.width(), panorama.height()),
        Environment::Cube(cube) => (3 * cube.face_size, 2 * cube.face_size),
    };
    let texel = |x: usize, y: usize| match environment {
        Environment::Panorama(panorama) => panorama.texel(x, y),
        Environment::Cube(cube) => {
            let size = cube.face_size;
            cube.texel(y / size * 3 + x / size, x % size, y % size)
        }
    };
    draw(title, [columns, rows], texel, fault, borders)
}

/// The same of a frame.
pub(crate) fn frame_map(title: &str, image: &Image, fault: impl Fn([f32; 3]) -> Fault) -> Picture {
    draw(title, [image.width, image.height], |x, y| image.texel(x, y), fault, &[])
}

fn draw(
    title: &str,
    [columns, rows]: [usize; 2],
    texel: impl Fn(usize, usize) -> [f32; 3],
    fault: impl Fn([f32; 3]) -> Fault,
    borders: &[&str],
) -> Picture {
    let step = columns.div_ceil(WIDTH_MAX).max(1);
    // What is tiny is enlarged texel by texel.
    let zoom = (256 / columns).max(1);
    let (cells_x, cells_y) = (columns.div_ceil(step), rows.div_ceil(step));
    let mut seen = [false; Fault::ALL.len()];
    let mut cells: Vec<[u8; 3]> = Vec::with_capacity(cells_x * cells_y);
    for cell_y in 0..cells_y {
        for cell_x in 0..cells_x {
            let (mut worst, mut sum, mut count) = (Fault::None, 0.0, 0.0);
            for y in cell_y * step..((cell_y + 1) * step).min(rows) {
                for x in cell_x * step..((cell_x + 1) * step).min(columns) {
                    let here = texel(x, y);
                    worst = worst.max(fault(here));
                    let light = luminance(here);
                    if light.is_finite() {
                        (sum, count) = (sum + light.max(0.0), count + 1.0);
                    }
                }
            }
            seen[worst as usize] = true;
            cells.push(
                worst
                    .colour()
                    .map_or_else(|| grey(if count > 0.0 { sum / count } else { 0.0 }), |(colour, _)| colour),
            );
        }
    }
    for border in borders {
        mark_border(&mut cells, [cells_x, cells_y], border);
    }
    let (width, height) = (cells_x * zoom, cells_y * zoom);
    let rgb: Vec<u8> =
        (0..width * height).flat_map(|i| cells[i / width / zoom * cells_x + i % width / zoom]).collect();
    let faults = Fault::ALL.into_iter().filter(|fault| seen[*fault as usize]).filter_map(Fault::colour);
    let mut legend: Vec<([u8; 3], String)> = faults.map(|(colour, text)| (colour, text.to_owned())).collect();
    if !borders.is_empty() {
        legend.push((SEAM, "a border that does not continue".to_owned()));
    }
    Picture { title: title.to_owned(), width, height, png: png::encode_rgb8(width, height, &rgb), legend }
}

/// Luminance in stops around 1, so that shade and sun are both told apart.
fn grey(luminance: f64) -> [u8; 3] {
    let stops = libm::log2(luminance.max(1e-9)).clamp(-10.0, 10.0);
    [(110.0 + 8.0 * stops) as u8; 3]
}

fn mark_border(cells: &mut [[u8; 3]], [columns, rows]: [usize; 2], border: &str) {
    let thickness = (columns / 200).max(1);
    for (index, cell) in cells.iter_mut().enumerate() {
        let (x, y) = (index % columns, index / columns);
        let is_on = match border {
            "wrap" => x < thickness || x + thickness >= columns,
            "top" => y < thickness,
            _ => y + thickness >= rows,
        };
        if is_on {
            *cell = SEAM;
        }
    }
}
