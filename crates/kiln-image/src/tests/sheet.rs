//! Contact sheets: layout, orientation, tone.

use super::check_within;
use crate::{
    Cube, Image,
    sheet::{Picture, Tile, contact_sheet, exposure, khronos_neutral, tone_mapped},
};

/// A cube whose faces are functions of direction, as KTX2 orders and orients them.
fn cube_of(size: usize, colour: impl Fn([f64; 3]) -> [f32; 3]) -> Cube {
    let mut rgb = Vec::new();
    for face in 0..6 {
        for y in 0..size {
            for x in 0..size {
                let s = (2 * x + 1) as f64 / size as f64 - 1.0;
                let t = (2 * y + 1) as f64 / size as f64 - 1.0;
                let direction =
                    [[1.0, -t, -s], [-1.0, -t, s], [s, 1.0, t], [s, -1.0, -t], [s, -t, 1.0], [-s, -t, -1.0]]
                        [face];
                rgb.extend(colour(direction));
            }
        }
    }
    Cube::new(size, rgb).expect("six faces")
}

fn tile(title: &str, picture: Picture) -> Tile {
    Tile { title: title.to_owned(), picture }
}

/// Neighbouring pixels across every inner edge of the cross show neighbouring directions.
#[test]
fn cross_is_continuous_and_not_mirrored() {
    let cube = cube_of(32, |[x, y, z]| {
        let length = (x * x + y * y + z * z).sqrt();
        [(x / length + 1.5) as f32, (y / length + 1.5) as f32, (z / length + 1.5) as f32]
    });
    let (width, _, rgb) = contact_sheet(&[tile("CROSS", Picture::Cube(cube))], 128);
    let (left, top, cell) = (128 / 16, 128 / 16 + 12, 32);
    let pixel = |column: usize, row: usize| {
        let start = ((top + row) * width + left + column) * 3;
        [rgb[start], rgb[start + 1], rgb[start + 2]].map(i32::from)
    };
    let step = |a: [i32; 3], b: [i32; 3]| (0..3).map(|i| (a[i] - b[i]).abs()).max().unwrap_or(0);
    for i in 0..cell {
        for edge in [cell, 2 * cell, 3 * cell] {
            assert!(step(pixel(edge - 1, cell + i), pixel(edge, cell + i)) <= 8, "column {edge}, row {i}");
        }
        assert!(step(pixel(cell + i, cell - 1), pixel(cell + i, cell)) <= 8, "top, column {i}");
        assert!(step(pixel(cell + i, 2 * cell - 1), pixel(cell + i, 2 * cell)) <= 8, "bottom, column {i}");
        // The outer ends of the row meet behind the viewer.
        assert!(step(pixel(0, cell + i), pixel(4 * cell - 1, cell + i)) <= 8, "ends, row {i}");
    }
    // Looking along −Z, +X is on the right and +Y above.
    let [centre, right, above] = [pixel(48, 48), pixel(80, 48), pixel(48, 16)];
    assert!(right[0] > centre[0] && above[1] > centre[1] && centre[2] < right[2]);
}

#[test]
fn titles_are_drawn_and_cut_and_grid_is_even() {
    let picture = || Picture::Image(Image::new(2, 1, vec![1.0; 6]).expect("six values"));
    let tiles: Vec<Tile> =
        (0..5).map(|i| tile(&format!("LEVEL {i} {}", "x".repeat(99)), picture())).collect();
    let (width, height, rgb) = contact_sheet(&tiles, 64);
    assert_eq!((width, rgb.len()), (3 * 64 + 4 * 4, width * height * 3));
    let ink = rgb.chunks_exact(3).filter(|rgb| **rgb == [205; 3]).count();
    assert!(ink > 5 * 40, "{ink} pixels of ink");
    let edge = (0..height).flat_map(|y| [rgb[y * width * 3], rgb[(y * width + width - 1) * 3]]);
    assert!(edge.into_iter().all(|value| value == 22), "nothing is drawn over the margin");
}

#[test]
fn sheet_of_nothing_and_of_black_and_of_nan_is_drawn() {
    assert!(contact_sheet(&[], 100).2.iter().all(|&value| value == 22));
    let black = Image::new(1, 1, vec![0.0; 3]).expect("three values");
    assert_eq!(tone_mapped(&black), [0, 0, 0]);
    let nan = Image::new(2, 1, vec![f32::NAN, 0.0, 0.0, 1.0, 1.0, 1.0]).expect("six values");
    assert_eq!(tone_mapped(&nan)[..3], [255, 0, 255]);
}

#[test]
fn averaging_keeps_the_mean_of_a_large_map() {
    // A checkerboard of 0 and 2, shrunk to a quarter, is uniform: median and mean are 1.
    let texels = (0..256 * 128).flat_map(|i| [if (i + i / 256) % 2 == 0 { 2.0 } else { 0.0 }; 3]);
    let image = Image::new(256, 128, texels.collect()).expect("values fit");
    let (width, height, rgb) = contact_sheet(&[tile("", Picture::Image(image))], 64);
    let centre = rgb[(height / 2 * width + width / 2) * 3];
    let uniform = Image::new(1, 1, vec![1.0; 3]).expect("three values");
    assert_eq!(centre, tone_mapped(&uniform)[0]);
}

#[test]
fn exposure_puts_the_median_at_middle_grey_and_ignores_the_sun() {
    let texels = [[0.5; 3], [1.0; 3], [2.0; 3], [1e6; 3], [f32::NAN; 3], [0.0; 3], [0.25; 3]];
    check_within("exposure", exposure(texels.into_iter()), 0.18, 1e-12);
}

#[test]
fn neutral_tone_mapper_keeps_base_colours_and_never_reaches_one() {
    for value in [0.1, 0.3, 0.7] {
        check_within("grey", khronos_neutral([value; 3])[0], value - 0.04, 1e-12);
    }
    let mut last = 0.0;
    for exponent in -8..12 {
        let mapped = khronos_neutral([10.0_f64.powi(exponent); 3])[0];
        assert!(mapped > last && mapped <= 1.0, "10^{exponent} maps to {mapped}");
        last = mapped;
    }
    let [r, g, b] = khronos_neutral([1e4, 1.0, 1.0]);
    assert!(r <= 1.0 && g > 0.9 && b > 0.9, "a very bright red desaturates: {r} {g} {b}");
}
