//! Numbers about two pictures: what is known of them without another program.

use crate::compare::{Picture, SizesDiffer, compare, flip, heat_map};

const WIDTH: usize = 48;
const HEIGHT: usize = 32;

fn plain(color: [u8; 3]) -> Vec<u8> {
    color.repeat(WIDTH * HEIGHT)
}

fn picture(rgb: &[u8]) -> Picture<'_> {
    Picture { width: WIDTH, height: HEIGHT, rgb }
}

fn mean_flip(a: &[u8], b: &[u8]) -> f64 {
    compare(picture(a), picture(b)).expect("one size").flip_mean
}

#[test]
fn equal_pictures_differ_in_nothing() {
    let grey = plain([90, 120, 7]);
    let same = compare(picture(&grey), picture(&grey)).expect("one size");
    assert_eq!((same.rmse, same.difference_max, same.differing, same.flip_max), (0.0, 0, 0, 0.0));
    assert!(same.psnr_db.is_infinite());
}

#[test]
fn one_texel_is_found_where_it_is() {
    let grey = plain([128; 3]);
    let mut other = grey.clone();
    other[(7 * WIDTH + 31) * 3 + 1] += 51;
    let found = compare(picture(&grey), picture(&other)).expect("one size");
    assert_eq!((found.difference_max, found.place_of_max, found.differing), (51, [31, 7], 1));
    let rmse = (0.2f64.powi(2) / (3 * WIDTH * HEIGHT) as f64).sqrt();
    assert!((found.rmse - rmse).abs() < 1e-12 && (found.psnr_db + 20.0 * rmse.log10()).abs() < 1e-9);
    let (at, _) = found.flip_map.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).expect("not empty");
    assert_eq!([at % WIDTH, at / WIDTH], [31, 7]);
}

#[test]
fn green_and_blue_are_as_far_apart_as_the_measure_goes() {
    // The paper's largest colour difference, and plain pictures have no features.
    let error = mean_flip(&plain([0, 255, 0]), &plain([0, 0, 255]));
    assert!((error - 1.0).abs() < 1e-6, "{error}");
    let milder = mean_flip(&plain([0, 255, 0]), &plain([0, 250, 0]));
    assert!(milder > 0.0 && milder < 0.3, "{milder}");
}

#[test]
fn order_of_pictures_does_not_matter_and_worse_is_more() {
    let [dark, grey, light] = [plain([40; 3]), plain([90; 3]), plain([200; 3])];
    assert_eq!(mean_flip(&dark, &grey), mean_flip(&grey, &dark));
    assert!(mean_flip(&dark, &light) > mean_flip(&dark, &grey));
}

#[test]
fn chequers_too_fine_to_see_are_grey() {
    // Encoded so that the mean of the two in linear light is the grey's.
    let chequers: Vec<u8> = (0..WIDTH * HEIGHT)
        .flat_map(|at| [if (at % WIDTH + at / WIDTH).is_multiple_of(2) { 188 } else { 0 }; 3])
        .collect();
    let grey = plain([137; 3]);
    let by = |pixels_per_degree| -> f32 {
        let errors = flip(picture(&chequers), picture(&grey), pixels_per_degree);
        // Without the border, where a chequer repeats.
        errors[HEIGHT / 2 * WIDTH + WIDTH / 2]
    };
    let (far, near) = (by(150.0), by(8.0));
    assert!(far < 0.5 * near, "{far} from afar, {near} from nearby");
}

#[test]
fn edge_that_is_lost_counts_more_than_its_colour() {
    let edge: Vec<u8> =
        (0..WIDTH * HEIGHT).flat_map(|at| [if at % WIDTH < WIDTH / 2 { 100 } else { 140 }; 3]).collect();
    let errors = flip(picture(&edge), picture(&plain([120; 3])), 20.0);
    let row = &errors[HEIGHT / 2 * WIDTH..][..WIDTH];
    assert!(row[WIDTH / 2] > row[4], "{row:?}");
}

#[test]
fn tiny_pictures_have_numbers_too() {
    for (width, height) in [(1, 1), (1, 5), (3, 1)] {
        let (black, white) = (vec![0; width * height * 3], vec![255; width * height * 3]);
        let picture = |rgb| Picture { width, height, rgb };
        let found = compare(picture(&black), picture(&white)).expect("one size");
        assert!(found.rmse == 1.0 && found.flip_mean > 0.5 && found.flip_mean <= 1.0);
    }
    let nothing = Picture { width: 0, height: 0, rgb: &[] };
    assert_eq!(compare(nothing, nothing).expect("one size").rmse, 0.0);
}

#[test]
fn pictures_of_two_sizes_are_refused() {
    let (a, b) = (plain([0; 3]), vec![0; 3]);
    let one = Picture { width: 1, height: 1, rgb: &b };
    assert_eq!(compare(picture(&a), one), Err(SizesDiffer([WIDTH, HEIGHT], [1, 1])));
}

#[test]
fn heat_map_grows_lighter() {
    let colors = heat_map(&[0.0, 0.2, 0.4, 0.6, 0.8, 1.0, f32::NAN]);
    let light: Vec<u32> =
        colors.chunks_exact(3).map(|rgb| rgb.iter().map(|it| u32::from(*it)).sum()).collect();
    assert!(light[..6].windows(2).all(|pair| pair[0] < pair[1]), "{light:?}");
}
