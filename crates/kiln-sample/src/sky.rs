//! A clear day: Preetham's sky, a sun of physical size and brightness, a hazy ground.
//!
//! Unit: 1.0 is 20 kcd/m², which exposes a sunlit white surface a little above 1. A blue zenith is then around 0.2 and
//! the midday sun around 9 · 10⁴, above the largest half float: the hard case for every baker.
//!
//! Source: Preetham, Shirley and Smits 1999, "A Practical Analytic Model for Daylight": eq. 3 (the
//! distribution), appendix A.2 (its coefficients, zenith values) and A.1 (attenuation of sunlight).

use crate::panorama::{self, Rgb, add, lerp, scale};
use kiln_image::{Panorama, colour};
use std::f64::consts::PI;

/// Candela per square metre of 1.0.
pub const UNIT_CD_PER_M2: f64 = 20_000.0;

/// Where the sun stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunPosition {
    /// Above the horizon; clamped to 0…90. At 0 the upper half of the disc is seen.
    pub elevation_deg: f64,
    /// From −Z (the panorama's centre) towards +X (right).
    pub azimuth_deg: f64,
}

/// Radians; the mean apparent diameter is 0.533°.
const SUN_RADIUS_RAD: f64 = 0.5 * 0.533 * PI / 180.0;
/// Outside the atmosphere, lux (the solar illuminance constant).
const SUN_ILLUMINANCE_LX: f64 = 128_000.0;
/// CIE xy of a black body of 5772 K, the sun's effective temperature.
const SUN_XY: [f64; 2] = [0.3265, 0.3358];
/// Linear coefficient of solar limb darkening in visible light.
const LIMB_DARKENING: f64 = 0.6;
/// Dry grass and sand.
const GROUND_ALBEDO: Rgb = [0.27, 0.25, 0.205];
/// Radians below the horizon at which near haze, in the horizon's own colour, has thinned to 1/e: it makes
/// the horizon soft.
const NEAR_HAZE_RAD: f64 = 1.2 * PI / 180.0;
/// The same of wide haze, in the horizon's mean colour: it lets the ground darken towards one's feet.
const WIDE_HAZE_RAD: f64 = 9.0 * PI / 180.0;
const WIDE_HAZE_SHARE: f64 = 0.4;
/// Chromaticity is held from here down (sine of elevation, 5°): the fit turns pink on the last degrees.
const CHROMATICITY_SIN_MIN: f64 = 0.087;
/// The fit holds in this range.
const TURBIDITY_RANGE: (f64, f64) = (1.9, 10.0);

/// Draws `width × width/2` texels (`width` is rounded down to even, at least 2).
///
/// Turbidity is haze: 2 is a very clear sky, 3 a clear one, 6 a hazy one; clamped to 1.9…10, the range of
/// the fit. A NaN angle counts as 0. The sun's flux is the same at every resolution, up to the rounding of
/// its texels to `f32`: the disc is cut into equal pieces and each is added to the texel it falls into.
pub fn sun_and_sky(width: usize, sun: SunPosition, turbidity: f64) -> Panorama {
    let sky = Sky::new(sun, turbidity);
    let ground = Ground { near: sky.ground_radiance(), horizon: sky.mean_horizon() };
    let (width, height) = panorama::size(width);
    let columns = panorama::columns(width);
    let mut rgb = Vec::with_capacity(width * height);
    for y in 0..height {
        let row = panorama::Row::new(y, height);
        // Below the horizon, haze hides the ground in the colour of the horizon above it.
        let seen = if row.elevation < 0.0 { panorama::Row::horizon() } else { row };
        let factors = sky.row(seen.sin_elevation);
        rgb.extend(columns.iter().map(|column| {
            let radiance = sky.radiance(&factors, panorama::dot(seen.direction(column), sky.sun_direction));
            if row.elevation < 0.0 { ground.under(radiance, row.elevation) } else { radiance }
        }));
    }
    sky.add_sun(width, height, &mut rgb);
    panorama::finish(width, height, rgb)
}

/// One Perez distribution: `(1 + A e^{B / cos θ}) (1 + C e^{Dγ} + E cos² γ)`.
#[derive(Clone, Copy, Debug)]
struct Perez([f64; 5]);

impl Perez {
    /// The factor that depends on the row only; `cos_theta = 0` is the limit at the horizon.
    fn gradation(self, cos_theta: f64) -> f64 {
        let [a, b, ..] = self.0;
        1.0 + if cos_theta > 0.0 { a * libm::exp(b / cos_theta) } else { 0.0 }
    }

    /// The factor that depends on the angle to the sun only.
    fn indicatrix(self, gamma: f64, cos_gamma: f64) -> f64 {
        let [_, _, c, d, e] = self.0;
        1.0 + c * libm::exp(d * gamma) + e * cos_gamma * cos_gamma
    }
}

/// What is seen below the horizon.
struct Ground {
    /// At one's feet.
    near: Rgb,
    /// Mean colour of the sky's lowest line.
    horizon: Rgb,
}

impl Ground {
    /// Fades into `outline`, the sky right above, as `elevation` goes to 0 from below.
    fn under(&self, outline: Rgb, elevation: f64) -> Rgb {
        let wide = lerp(self.near, self.horizon, WIDE_HAZE_SHARE * libm::exp(elevation / WIDE_HAZE_RAD));
        lerp(wide, outline, libm::exp(elevation / NEAR_HAZE_RAD))
    }
}

/// Everything that is the same for all texels.
struct Sky {
    sun_direction: [f64; 3],
    sun_elevation: f64,
    turbidity: f64,
    /// Y, x, y.
    perez: [Perez; 3],
    /// Zenith value over the distribution's value there.
    scale: [f64; 3],
}

impl Sky {
    fn new(sun: SunPosition, turbidity: f64) -> Sky {
        let number = |value: f64| if value.is_nan() { 0.0 } else { value };
        let sun_elevation = number(sun.elevation_deg).clamp(0.0, 90.0).to_radians();
        let azimuth = number(sun.azimuth_deg % 360.0).to_radians();
        let t = number(turbidity).clamp(TURBIDITY_RANGE.0, TURBIDITY_RANGE.1);
        let theta_sun = PI / 2.0 - sun_elevation;
        let perez = coefficients(t);
        let zenith = zenith(t, theta_sun);
        let value = |i: usize| {
            let at_zenith = perez[i].gradation(1.0) * perez[i].indicatrix(theta_sun, libm::cos(theta_sun));
            zenith[i] / at_zenith
        };
        Sky {
            sun_direction: panorama::direction(azimuth, sun_elevation),
            sun_elevation,
            turbidity: t,
            perez,
            scale: [value(0), value(1), value(2)],
        }
    }

    /// The row's factors, zenith values included.
    fn row(&self, sin_elevation: f64) -> [f64; 3] {
        let held = sin_elevation.max(CHROMATICITY_SIN_MIN);
        let sines = [sin_elevation, held, held];
        [0, 1, 2].map(|i| self.scale[i] * self.perez[i].gradation(sines[i]))
    }

    /// Linear Rec. 709 of a direction, given its row's factors.
    fn radiance(&self, row: &[f64; 3], cos_gamma: f64) -> Rgb {
        let cos_gamma = cos_gamma.clamp(-1.0, 1.0);
        let gamma = libm::acos(cos_gamma);
        let [luminance, x, y] = [0, 1, 2].map(|i| row[i] * self.perez[i].indicatrix(gamma, cos_gamma));
        // Preetham's luminance is in kcd/m².
        xyy_to_rgb(luminance.max(0.0) * 1000.0 / UNIT_CD_PER_M2, [x, y])
    }

    fn mean_horizon(&self) -> Rgb {
        const COLUMNS: usize = 96;
        let row = self.row(0.0);
        panorama::columns(COLUMNS).iter().fold([0.0; 3], |sum, column| {
            let direction = panorama::Row::horizon().direction(column);
            let radiance = self.radiance(&row, panorama::dot(direction, self.sun_direction));
            add(sum, scale(radiance, 1.0 / COLUMNS as f64))
        })
    }

    /// A Lambertian ground under sky and sun: albedo · E / π.
    fn ground_radiance(&self) -> Rgb {
        const ROWS: usize = 48;
        const COLUMNS: usize = 96;
        let columns = panorama::columns(COLUMNS);
        let mut irradiance = scale(self.sun_irradiance(), libm::sin(self.sun_elevation));
        for i in 0..ROWS {
            // Equal steps in sin² of elevation, which are equal shares of cosine-weighted solid angle.
            let sin_elevation = libm::sqrt((i as f64 + 0.5) / ROWS as f64);
            let cos_elevation = libm::sqrt(1.0 - sin_elevation * sin_elevation);
            let row = self.row(sin_elevation);
            for column in &columns {
                let direction = [column.sin * cos_elevation, sin_elevation, -column.cos * cos_elevation];
                let radiance = self.radiance(&row, panorama::dot(direction, self.sun_direction));
                irradiance = add(irradiance, scale(radiance, PI / (ROWS * COLUMNS) as f64));
            }
        }
        [0, 1, 2].map(|i| GROUND_ALBEDO[i] * irradiance[i] / PI)
    }

    /// On a surface that faces the sun, through the atmosphere, in units · sr.
    fn sun_irradiance(&self) -> Rgb {
        let white = xyy_to_rgb(SUN_ILLUMINANCE_LX / UNIT_CD_PER_M2, SUN_XY);
        let transmitted = self.transmittance();
        [0, 1, 2].map(|i| white[i] * transmitted[i])
    }

    /// Rayleigh scattering, aerosols and ozone at one wavelength for each of red, green and blue.
    fn transmittance(&self) -> Rgb {
        const WAVELENGTH_UM: Rgb = [0.610, 0.550, 0.465];
        /// Per metre of ozone, at these wavelengths.
        const OZONE: Rgb = [12.0, 8.5, 0.75];
        const OZONE_M: f64 = 0.0035;
        let zenith_deg = 90.0 - self.sun_elevation.to_degrees();
        let mass = 1.0 / (libm::sin(self.sun_elevation) + 0.15 * libm::pow(93.885 - zenith_deg, -1.253));
        let beta = 0.04608 * self.turbidity - 0.04586;
        [0, 1, 2].map(|i| {
            let rayleigh = 0.008735 * libm::pow(WAVELENGTH_UM[i], -4.08);
            let aerosol = beta * libm::pow(WAVELENGTH_UM[i], -1.3);
            libm::exp(-mass * (rayleigh + aerosol + OZONE[i] * OZONE_M))
        })
    }

    /// Cuts the disc into small squares and adds each one's flux to its texel, limb darkening included.
    /// What is below the horizon is hidden.
    fn add_sun(&self, width: usize, height: usize, rgb: &mut [Rgb]) {
        let pieces = self.sun_pieces(width);
        let total: f64 = pieces.iter().map(|(_, weight)| weight).sum();
        let irradiance = self.sun_irradiance();
        for (direction, weight) in pieces {
            if direction[1] < 0.0 {
                continue;
            }
            let (x, y) = panorama::texel_of(direction, width, height);
            let solid_angle = panorama::Row::new(y, height).texel_solid_angle_sr(width);
            let texel = &mut rgb[y * width + x];
            *texel = add(*texel, scale(irradiance, weight / total / solid_angle));
        }
    }

    /// Directions on the disc, with weights in proportion to their radiance.
    fn sun_pieces(&self, width: usize) -> Vec<([f64; 3], f64)> {
        // At least 24 pieces along each texel, 256 along the disc.
        let texels_across = SUN_RADIUS_RAD / PI * width as f64;
        let count = (24.0 * texels_across).clamp(256.0, 4096.0) as usize;
        let (right, up) = panorama::tangents(self.sun_direction);
        let position = |i: usize| (2.0 * (i as f64 + 0.5) / count as f64 - 1.0) * SUN_RADIUS_RAD;
        let mut pieces = Vec::new();
        for i in 0..count {
            for j in 0..count {
                let (a, b) = (position(i), position(j));
                let radius_2 = (a * a + b * b) / (SUN_RADIUS_RAD * SUN_RADIUS_RAD);
                if radius_2 < 1.0 {
                    let mu = libm::sqrt(1.0 - radius_2);
                    let offset = add(scale(right, a), scale(up, b));
                    let direction = panorama::normalize(add(self.sun_direction, offset));
                    pieces.push((direction, 1.0 - LIMB_DARKENING * (1.0 - mu)));
                }
            }
        }
        pieces
    }
}

/// Appendix A.2: distribution coefficients A to E of Y, x and y, linear in turbidity.
fn coefficients(t: f64) -> [Perez; 3] {
    const SLOPE: [[f64; 5]; 3] = [
        [0.1787, -0.3554, -0.0227, 0.1206, -0.0670],
        [-0.0193, -0.0665, -0.0004, -0.0641, -0.0033],
        [-0.0167, -0.0950, -0.0079, -0.0441, -0.0109],
    ];
    const OFFSET: [[f64; 5]; 3] = [
        [-1.4630, 0.4275, 5.3251, -2.5771, 0.3703],
        [-0.2592, 0.0008, 0.2125, -0.8989, 0.0452],
        [-0.2608, 0.0092, 0.2102, -1.6537, 0.0529],
    ];
    [0, 1, 2].map(|i| Perez(std::array::from_fn(|j| SLOPE[i][j] * t + OFFSET[i][j])))
}

/// Appendix A.2: zenith luminance in kcd/m² and chromaticity x, y.
fn zenith(t: f64, theta_sun: f64) -> [f64; 3] {
    /// Rows: T², T, 1; columns: θ³, θ², θ, 1.
    const X: [[f64; 4]; 3] = [
        [0.00166, -0.00375, 0.00209, 0.0],
        [-0.02903, 0.06377, -0.03202, 0.00394],
        [0.11693, -0.21196, 0.06052, 0.25886],
    ];
    const Y: [[f64; 4]; 3] = [
        [0.00275, -0.00610, 0.00317, 0.0],
        [-0.04214, 0.08970, -0.04153, 0.00516],
        [0.15346, -0.26756, 0.06670, 0.26688],
    ];
    let powers = [theta_sun * theta_sun * theta_sun, theta_sun * theta_sun, theta_sun, 1.0];
    let polynomial = |m: &[[f64; 4]; 3]| {
        let row = |i: usize| (0..4).map(|j| m[i][j] * powers[j]).sum::<f64>();
        t * t * row(0) + t * row(1) + row(2)
    };
    let chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * theta_sun);
    let luminance = (4.0453 * t - 4.9710) * libm::tan(chi) - 0.2155 * t + 2.4192;
    [luminance, polynomial(&X), polynomial(&Y)]
}

/// Linear Rec. 709; colours outside its gamut lose their negative part.
fn xyy_to_rgb(luminance: f64, [x, y]: [f64; 2]) -> Rgb {
    /// CIE XYZ to linear Rec. 709, from the primaries and D65 of BT.709-6.
    const FROM_XYZ: colour::Matrix = [
        [3.240_969_941_904_523, -1.537_383_177_570_094, -0.498_610_760_293_003_4],
        [-0.969_243_636_280_879_6, 1.875_967_501_507_721, 0.041_555_057_407_175_59],
        [0.055_630_079_696_993_66, -0.203_976_958_888_976_52, 1.056_971_514_242_878_6],
    ];
    let xyz = [x * luminance / y, luminance, (1.0 - x - y) * luminance / y];
    colour::transform(&FROM_XYZ, xyz).map(|value| value.max(0.0))
}

#[cfg(test)]
#[path = "sky_tests.rs"]
mod tests;
