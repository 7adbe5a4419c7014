//! Cubes as sources: what they become as a panorama and as a sky box.

use super::environments::{
    analyse, check_within, panorama, random, skybox, specular_level, texel_direction, texel_solid_angle_sr,
};
use crate::overlap::{Overlaps, SIDES};
use crate::{AnalysisRequest, Cancel, panorama_of_cube, skybox_of_cube};
use kiln_image::{Cube, Panorama};
use kiln_sphere::{cube_face_st, cube_texel_solid_angle_sr, panorama_direction};
use std::f64::consts::PI;

const WANTED: &str = "nobody cancels";

fn to_panorama(cube: &Cube) -> Panorama {
    panorama_of_cube(cube, Cancel::NEVER).expect(WANTED)
}

fn to_skybox(cube: &Cube, face_size: usize) -> Vec<Cube> {
    skybox_of_cube(cube, face_size, Cancel::NEVER).expect(WANTED)
}

fn random_cube(face_size: usize, seed: u64) -> Cube {
    // Any source of numbers: two panoramas hold more than enough.
    let rgb = random(4 * face_size, 2 * face_size, seed).into_image().rgb;
    Cube { face_size, rgb: rgb[..18 * face_size * face_size].to_vec() }
}

fn row_solid_angle_sr(row: usize, height: usize) -> f64 {
    let cos = |row: usize| libm::cos(PI * row as f64 / height as f64);
    PI * (cos(row) - cos(row + 1)) / height as f64
}

fn flux_of_panorama(map: &Panorama) -> [f64; 3] {
    let mut flux = [0.0; 3];
    for (index, texel) in map.rgb().chunks_exact(3).enumerate() {
        let solid_angle = row_solid_angle_sr(index / map.width(), map.height());
        flux.iter_mut().zip(texel).for_each(|(flux, &value)| *flux += solid_angle * f64::from(value));
    }
    flux
}

fn flux_of_cube(cube: &Cube) -> [f64; 3] {
    let mut flux = [0.0; 3];
    for (index, texel) in cube.rgb.chunks_exact(3).enumerate() {
        let solid_angle = texel_solid_angle_sr(cube.face_size, index);
        flux.iter_mut().zip(texel).for_each(|(flux, &value)| *flux += solid_angle * f64::from(value));
    }
    flux
}

/// The largest relative difference of two fluxes in a channel.
fn flux_error(actual: [f64; 3], wanted: [f64; 3]) -> f64 {
    actual.iter().zip(wanted).map(|(actual, wanted)| (actual / wanted - 1.0).abs()).fold(0.0, f64::max)
}

/// What texels of both maps have in common, all of it: (cube texel, panorama texel, solid angle).
fn all_overlaps(height: usize, face_size: usize) -> Vec<(usize, usize, f64)> {
    let (overlaps, width) = (Overlaps::new(height, face_size), 2 * height);
    let cube_texel = |face: usize, y: usize, x: usize| (face * face_size + y) * face_size + x;
    let mut all = Vec::new();
    let mut at_edges = vec![0.0; face_size + 1];
    for (face, x) in SIDES.into_iter().flat_map(|face| (0..face_size).map(move |x| (face, x))) {
        for piece in overlaps.pieces_of_texels(face, x) {
            overlaps.side(&piece, &mut at_edges, |y, row, solid_angle| {
                all.push((cube_texel(face, y, x), row * width + piece.column, solid_angle));
            });
        }
    }
    let size = overlaps.quadrant_size();
    for (y, x) in (0..size).flat_map(|y| (0..size).map(move |x| (y, x))) {
        for column in overlaps.columns_of_texel(x, y) {
            overlaps.cap(x, y, column, |row, solid_angle| {
                for image in overlaps.cap_images(x, y, column) {
                    let top = row * width + image.column;
                    let bottom = overlaps.mirrored_row(row) * width + image.column;
                    all.push((cube_texel(2, image.y, image.x), top, solid_angle));
                    all.push((cube_texel(3, face_size - 1 - image.y, image.x), bottom, solid_angle));
                }
            });
        }
    }
    all
}

/// The largest relative difference between a texel's solid angle and the sum of its shares, of either map.
fn partition_error(overlaps: &[(usize, usize, f64)], height: usize, face_size: usize) -> f64 {
    let mut of_cube = vec![0.0; 6 * face_size * face_size];
    let mut of_panorama = vec![0.0; 2 * height * height];
    for &(cube, panorama, solid_angle) in overlaps {
        of_cube[cube] += solid_angle;
        of_panorama[panorama] += solid_angle;
    }
    let cube = of_cube.iter().enumerate().map(|(i, sum)| sum / texel_solid_angle_sr(face_size, i) - 1.0);
    let panorama = of_panorama.iter().enumerate();
    let panorama = panorama.map(|(i, sum)| sum / row_solid_angle_sr(i / (2 * height), height) - 1.0);
    cube.chain(panorama).fold(0.0, |worst, error| worst.max(error.abs()))
}

#[test]
fn shares_of_every_texel_of_either_map_add_up_to_it() {
    for (height, face_size) in
        [(1, 1), (2, 1), (4, 2), (6, 3), (5, 7), (9, 4), (33, 5), (3, 40), (64, 33), (128, 64), (7, 70)]
    {
        let mut overlaps = all_overlaps(height, face_size);
        assert!(overlaps.iter().all(|(.., solid_angle)| *solid_angle >= 0.0));
        check_within(
            &format!("{height}, {face_size}"),
            partition_error(&overlaps, height, face_size),
            0.0,
            1e-7,
        );
        overlaps.pop();
        overlaps.pop();
        assert!(partition_error(&overlaps, height, face_size) > 1e-6, "the check itself");
    }
}

#[test]
fn shares_lie_where_directions_say() {
    // Counted: fine panorama positions by the texels that they fall into.
    let (height, face_size, steps) = (6, 5, 160);
    let width = 2 * height;
    let mut counted = std::collections::BTreeMap::new();
    for (row, column) in (0..height * steps).flat_map(|r| (0..width * steps).map(move |c| (r, c))) {
        let at = |index: usize, count: usize| (index as f64 + 0.5) / (count * steps) as f64;
        let (face, st) = cube_face_st(panorama_direction(at(column, width), at(row, height)));
        let [x, y] = st.map(|st| (((st + 1.0) * 0.5 * face_size as f64) as usize).min(face_size - 1));
        let cell = ((face * face_size + y) * face_size + x, row / steps * width + column / steps);
        let solid_angle = row_solid_angle_sr(row, height * steps);
        *counted.entry(cell).or_insert(0.0) += solid_angle;
    }
    for (cube, panorama, solid_angle) in all_overlaps(height, face_size) {
        *counted.entry((cube, panorama)).or_insert(0.0) -= solid_angle;
    }
    let texel = cube_texel_solid_angle_sr(face_size, 2, 2);
    let worst = counted.values().fold(0.0_f64, |worst, error| worst.max(error.abs()));
    assert!(worst < 0.02 * texel, "{worst} of {texel}");
}

#[test]
fn panorama_of_a_constant_cube_is_constant_down_to_one_texel() {
    for face_size in [1, 2, 3, 4, 17, 64] {
        let cube = Cube { face_size, rgb: [0.1, 3.0, 1e5].repeat(6 * face_size * face_size) };
        let map = to_panorama(&cube);
        assert_eq!((map.width(), map.height()), (4 * face_size, 2 * face_size));
        assert!(map.rgb().chunks_exact(3).all(|texel| texel == [0.1, 3.0, 1e5]), "{face_size}");
    }
}

#[test]
fn panorama_keeps_the_cubes_flux_and_a_brighter_texel_is_seen() {
    for face_size in [1, 2, 3, 16, 31, 64] {
        let cube = random_cube(face_size, 7);
        let mut map = to_panorama(&cube);
        let error = flux_error(flux_of_panorama(&map), flux_of_cube(&cube));
        check_within(&format!("flux at {face_size}"), error, 0.0, 1e-6);
        let texel = map.width() * face_size + 1;
        map.rgb_mut()[3 * texel] *= 2.0;
        assert!(flux_error(flux_of_panorama(&map), flux_of_cube(&cube)) > 1e-6, "the check itself");
    }
}

#[test]
fn panorama_keeps_the_flux_of_a_lamp_of_one_texel_anywhere() {
    let face_size = 12;
    for lamp in (0..6 * 144).step_by(5) {
        let rgb = (0..6 * 144).flat_map(|index| if index == lamp { [1e6; 3] } else { [0.0; 3] }).collect();
        let cube = Cube { face_size, rgb };
        let error = flux_error(flux_of_panorama(&to_panorama(&cube)), flux_of_cube(&cube));
        check_within(&format!("lamp {lamp}"), error, 0.0, 1e-6);
    }
}

/// A colour for each face, and where the panorama should show it.
#[test]
fn panorama_shows_each_face_where_ktx2_has_it_and_mirrored_faces_are_seen() {
    let colour_of = |face: usize, x: usize, y: usize| [face as f32, x as f32, y as f32];
    // A face's coordinates grow towards its right and its bottom: any turn or mirror moves them.
    let gradient = |size: usize| {
        let texel = |i: usize| colour_of(i / (size * size), i % size, i / size % size);
        Cube { face_size: size, rgb: (0..6 * size * size).flat_map(texel).collect() }
    };
    for size in [1, 2, 3, 8] {
        let map = to_panorama(&gradient(size));
        let mut seen = 0;
        for index in 0..map.width() * map.height() {
            let (column, row) = (index % map.width(), index / map.width());
            let at = |index: usize, count: usize| (index as f64 + 0.5) / count as f64;
            let (face, st) = cube_face_st(panorama_direction(at(column, map.width()), at(row, map.height())));
            if st.iter().any(|st| st.abs() > 1.0 - 1.5 / size as f64) && size > 1 {
                continue;
            }
            let [x, y] = st.map(|st| (st + 1.0) * 0.5 * size as f64 - 0.5);
            let texel = map.texel(column, row);
            if size > 2 || st.iter().all(|st| st.abs() < 0.5) {
                check_within("face", f64::from(texel[0]), face as f64, if size == 1 { 0.6 } else { 1e-6 });
            }
            if size > 2 {
                check_within("x", f64::from(texel[1]), x, 0.75);
                check_within("y", f64::from(texel[2]), y, 0.75);
                seen += 1;
            }
        }
        assert!(size < 8 || seen > 100, "{seen} texels compared");
    }
    let cube = gradient(8);
    let mirrored = kiln_image::cube_layout::mirror(&cube, kiln_image::cube_layout::Mirror::Z);
    assert_ne!(to_panorama(&mirrored), to_panorama(&cube));
}

#[test]
fn prefiltering_through_a_cube_agrees_with_prefiltering_the_panorama() {
    let request = AnalysisRequest { alpha_min: 0.25, sheen_alpha_min: None, error: 1e-5 };
    // Smooth, with one bright window.
    let map = panorama(256, 128, |index| {
        let (column, row) = (index % 256, index / 256);
        let [x, y, z] = panorama_direction((column as f64 + 0.5) / 256.0, (row as f64 + 0.5) / 128.0);
        let window = if (40..60).contains(&column) && (30..50).contains(&row) { 20.0 } else { 0.0 };
        [1.5 + x + window, 1.5 + y * z + window, 1.2 + z + window].map(|value| value as f32)
    });
    let direct = specular_level(&analyse(&map, &request), 0.25, 16).cube;
    let error_through = |cube: &Cube| {
        let through = specular_level(&analyse(&to_panorama(cube), &request), 0.25, 16).cube;
        let (mut error, mut power) = (0.0, 0.0);
        for (index, (a, b)) in through.rgb.iter().zip(&direct.rgb).enumerate() {
            let solid_angle = texel_solid_angle_sr(16, index / 3);
            error += solid_angle * f64::from(a - b).powi(2);
            power += solid_angle * f64::from(*b).powi(2);
        }
        (error / power).sqrt()
    };
    let cube = skybox(&map, 256).remove(0);
    let error = error_through(&cube);
    assert!(error < 1e-3, "{error}");
    let half_round = kiln_image::cube_layout::mirror(&cube, kiln_image::cube_layout::Mirror::X);
    assert!(error_through(&half_round) > 0.05, "the check itself");
}

#[test]
fn sky_box_of_a_cube_at_its_own_size_is_that_cube_and_its_mips_are_means() {
    for face_size in [1, 2, 3, 8, 12] {
        let cube = random_cube(face_size, 3);
        let levels = to_skybox(&cube, face_size);
        assert_eq!(levels[0], cube);
        let sizes: Vec<usize> = levels.iter().map(|level| level.face_size).collect();
        let wanted: Vec<usize> =
            std::iter::successors(Some(face_size), |size| (*size > 1).then_some(size / 2)).collect();
        assert_eq!(sizes, wanted);
        for level in &levels {
            check_within("flux", flux_error(flux_of_cube(level), flux_of_cube(&cube)), 0.0, 1e-6);
        }
    }
}

#[test]
fn sky_box_of_a_cube_at_other_sizes_keeps_flux_and_direction() {
    let light = |d: [f64; 3]| [2.0 + d[0] + 0.3 * d[1] * d[2], 2.0 + d[1], 2.0 + d[2]].map(|v| v as f32);
    let painted = |face_size: usize| {
        let texels = (0..6 * face_size * face_size).flat_map(|i| light(texel_direction(face_size, i)));
        Cube { face_size, rgb: texels.collect() }
    };
    let cube = painted(24);
    let worst = |level: &Cube| {
        let wanted = painted(level.face_size).rgb;
        level.rgb.iter().zip(wanted).map(|(a, b)| (a - b).abs()).fold(0.0_f32, f32::max)
    };
    // Halved, through the panorama, larger, odd.
    for face_size in [12, 6, 10, 48, 33] {
        let level = &to_skybox(&cube, face_size)[0];
        assert_eq!(level.face_size, face_size);
        check_within("flux", flux_error(flux_of_cube(level), flux_of_cube(&cube)), 0.0, 1e-6);
        assert!(worst(level) < 0.15, "{face_size}: {}", worst(level));
    }
    let halves = to_skybox(&cube, 24).remove(1);
    assert_eq!(to_skybox(&cube, 12)[0], halves, "a smaller one is a mip");
    let mirrored = kiln_image::cube_layout::mirror(&cube, kiln_image::cube_layout::Mirror::X);
    assert!(worst(&to_skybox(&mirrored, 10)[0]) > 1.0, "the check itself");
}
