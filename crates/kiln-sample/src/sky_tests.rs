use super::{Ground, LIMB_DARKENING, Sky, SunPosition, UNIT_CD_PER_M2, sun_and_sky, zenith};
use crate::panorama::Row;
use kiln_image::{Cancel, Panorama, check_texels, colour::luminance};
use std::f64::consts::PI;

fn at(elevation_deg: f64) -> SunPosition {
    SunPosition { elevation_deg, azimuth_deg: 30.0 }
}

/// Σ radiance · solid angle of one channel over the upper half, sun and sky.
fn upper_flux(panorama: &Panorama, channel: usize) -> f64 {
    let (width, height) = (panorama.width(), panorama.height());
    let row_flux = |y: usize| {
        let sum: f64 = (0..width).map(|x| f64::from(panorama.texel(x, y)[channel])).sum();
        sum * Row::new(y, height).texel_solid_angle_sr(width)
    };
    (0..height / 2).map(row_flux).sum()
}

#[test]
fn every_sun_and_turbidity_gives_finite_radiance() {
    for elevation in [-90.0, 0.0, 0.1, 2.0, 45.0, 90.0, 400.0, f64::NAN] {
        for turbidity in [0.0, 3.0, 50.0, f64::NAN] {
            for width in [2, 64] {
                let report =
                    check_texels(sun_and_sky(width, at(elevation), turbidity).image(), Cancel::NEVER)
                        .expect("nobody cancels");
                assert!(report.is_radiance(), "{elevation}°, T = {turbidity}, {width}: {report:?}");
                assert!(report.max > 0.0);
            }
        }
    }
}

#[test]
fn sun_flux_is_the_same_at_every_resolution() {
    let sun = at(40.0);
    let expected = Sky::new(sun, 2.5).sun_irradiance();
    for width in [2, 64, 256, 1024, 2048] {
        let mut black = vec![[0.0; 3]; width * width / 2];
        Sky::new(sun, 2.5).add_sun(width, width / 2, &mut black);
        for channel in 0..3 {
            let flux: f64 = black
                .iter()
                .enumerate()
                .map(|(i, rgb)| rgb[channel] * Row::new(i / width, width / 2).texel_solid_angle_sr(width))
                .sum();
            let error = (flux / expected[channel] - 1.0).abs();
            assert!(error <= 1e-9, "{width}, channel {channel}: off by {error}");
        }
    }
}

#[test]
fn sun_fills_its_physical_area_and_stands_where_it_was_put() {
    let sun = SunPosition { elevation_deg: 30.0, azimuth_deg: 90.0 };
    let panorama = sun_and_sky(2048, sun, 2.5);
    let is_sun = |x: usize, y: usize| panorama.texel(x, y)[0] > 1000.0;
    let texels = (0..1024).flat_map(|y| (0..2048).map(move |x| (x, y))).filter(|&(x, y)| is_sun(x, y));
    let texels: Vec<(usize, usize)> = texels.collect();
    // 0.533° is 3.03 texels across: 7.2 texels of area at the equator, 8.3 at 30°, edge texels besides.
    assert!((8..=22).contains(&texels.len()), "{} texels", texels.len());
    for (x, y) in texels {
        // Azimuth 90° is three quarters across (towards +X), elevation 30° a third down.
        assert!(x.abs_diff(1536) <= 3 && y.abs_diff(341) <= 3, "({x}, {y})");
    }
}

#[test]
fn sun_and_sky_have_the_brightness_of_a_clear_day() {
    let sun = at(45.0);
    let sky = Sky::new(sun, 2.5);
    let irradiance = sky.sun_irradiance().map(|value| value as f32);
    let illuminance_lx = luminance(irradiance) * UNIT_CD_PER_M2;
    assert!((70_000.0..110_000.0).contains(&illuminance_lx), "direct sun: {illuminance_lx} lx");
    let zenith_cd_per_m2 = 1000.0 * zenith(2.5, PI / 4.0)[0];
    assert!((2000.0..8000.0).contains(&zenith_cd_per_m2), "zenith: {zenith_cd_per_m2} cd/m²");
    // The disc as seen from the ground has about 1.5e9 cd/m²; the darkened limb and half-covered texels have less.
    let peak_cd_per_m2 = f64::from(sun_and_sky(1024, sun, 2.5).max_value()) * UNIT_CD_PER_M2;
    assert!((5e8..3e9).contains(&peak_cd_per_m2), "peak: {peak_cd_per_m2} cd/m²");
}

/// Appendix A.2 evaluated by hand at T = 3 and θ = 60°: χ = (4/9 − 3/120) · π/3, Y = 7.1649 tan χ + 1.7727.
#[test]
fn zenith_is_the_published_polynomial() {
    let [luminance, x, y] = zenith(3.0, PI / 3.0);
    let chi: f64 = (4.0 / 9.0 - 0.025) * (PI / 3.0);
    assert!((luminance - (7.1649 * chi.tan() + 1.7727)).abs() <= 1e-9);
    assert!((x - 0.244_93).abs() <= 2e-5 && (y - 0.252_57).abs() <= 2e-5, "a blue zenith, not {x}, {y}");
}

#[test]
fn low_sun_is_red_and_high_sun_nearly_white() {
    let ratio = |elevation: f64| {
        let [r, _, b] = Sky::new(at(elevation), 2.5).sun_irradiance();
        r / b
    };
    assert!(ratio(2.0) > 10.0 && ratio(60.0) < 1.8 && ratio(60.0) > 1.0, "{} {}", ratio(2.0), ratio(60.0));
}

#[test]
fn sun_at_the_horizon_shows_its_upper_half_and_below_is_clamped() {
    let half = |elevation: f64| {
        let mut rgb = vec![[0.0; 3]; 512 * 256];
        let sky = Sky::new(at(elevation), 3.0);
        sky.add_sun(512, 256, &mut rgb);
        let y = |i: usize| Row::new(i / 512, 256).texel_solid_angle_sr(512);
        rgb.iter().enumerate().map(|(i, rgb)| rgb[0] * y(i)).sum::<f64>() / sky.sun_irradiance()[0]
    };
    assert!((half(0.0) - 0.5).abs() <= 1e-9, "{}", half(0.0));
    assert!((half(1.0) - 1.0).abs() <= 1e-9, "{}", half(1.0));
    assert_eq!(sun_and_sky(64, at(-10.0), 3.0), sun_and_sky(64, at(0.0), 3.0));
}

#[test]
fn horizon_is_continuous_and_the_ground_darkens_towards_the_feet() {
    let ground = Ground { near: [0.1; 3], horizon: [0.5; 3] };
    let at = |elevation_deg: f64| ground.under([2.0; 3], elevation_deg.to_radians())[0];
    assert!((at(-1e-9) - 2.0).abs() <= 1e-8);
    let falling = [-0.1, -1.0, -5.0, -20.0, -89.0].map(at);
    assert!(falling.windows(2).all(|pair| pair[0] > pair[1]), "{falling:?}");
    assert!((at(-89.0) - 0.1).abs() <= 1e-4);
}

#[test]
fn limb_darkening_leaves_the_limb_darker_than_the_centre() {
    const { assert!(LIMB_DARKENING > 0.0 && LIMB_DARKENING < 1.0) };
    let pieces = Sky::new(at(40.0), 2.5).sun_pieces(256);
    let extreme = |pick: fn(f64, f64) -> f64, start| pieces.iter().map(|(_, w)| *w).fold(start, pick);
    assert!(extreme(f64::max, 0.0) > 0.99 && extreme(f64::min, 1.0) < 0.5);
}

#[test]
fn width_is_made_even_and_the_sky_does_not_depend_on_it() {
    assert_eq!((sun_and_sky(0, at(40.0), 2.5).width(), sun_and_sky(7, at(40.0), 2.5).width()), (2, 6));
    let [coarse, fine] = [128, 1024].map(|width| upper_flux(&sun_and_sky(width, at(40.0), 2.5), 2));
    assert!((coarse / fine - 1.0).abs() <= 2e-3, "{coarse} against {fine}");
}
