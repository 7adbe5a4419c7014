//! The sun, or any dominant small light, taken out of a panorama as a directional light.
//!
//! What is found: the texels around the brightest one that hold at least half its luminance (the core), if they span no
//! more than a sun may; then those around them, within a sun's radius, that are over twice the surroundings' luminance
//! (glare, half-covered edges). They are filled with the mean radiance of the texels around them, and the light is what
//! the panorama lost by that, texel by texel, as the `f32` texels stand: so light + remaining = original.

use crate::patch::Patch;
use kiln_image::{Image, Panorama};
use kiln_sphere::{Cancel, Cancelled, panorama_direction};
use std::collections::BTreeSet;
use std::f64::consts::PI;

/// What counts as a dominant small light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunRequest {
    /// Largest angular diameter in radians, at most 1; two texels are always allowed.
    pub angular_diameter_max: f64,
    /// Least luminance of the brightest texel, in units of the surroundings' median.
    pub contrast_min: f64,
    /// Least part of the panorama's whole luminous flux that the light must carry.
    pub flux_share_min: f64,
}

impl SunRequest {
    /// Finds suns through thin cloud and street lamps at night, leaves windows and soft boxes alone.
    pub const USUAL: Self = Self { angular_diameter_max: 0.05, contrast_min: 20.0, flux_share_min: 0.02 };
}

/// Radians: beyond it a directional light makes no sense, and two texels of a map of some rows are more.
const DIAMETER_MAX: f64 = 1.0;

/// A directional light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Unit vector towards the light: the centre of its luminous flux.
    pub direction: [f64; 3],
    /// E = Σ L ω on a surface that faces it, per channel, in the panorama's radiance times steradian.
    pub irradiance: [f64; 3],
    /// `irradiance` over its largest channel.
    pub colour: [f64; 3],
    /// Solid angle in steradians of a disc of constant radiance with the same Σ Y ω and Σ Y² ω.
    pub solid_angle_sr: f64,
    /// Diameter in radians of that disc.
    pub angular_diameter: f64,
    /// Texels that were changed.
    pub texel_count: usize,
}

/// Σ L ω over all texels, in `f64`, per channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FluxAccount {
    /// Of the panorama given.
    pub original: [f64; 3],
    /// Of the light.
    pub light: [f64; 3],
    /// Of what is left, as stored.
    pub remaining: [f64; 3],
}

/// A panorama without its sun.
#[derive(Clone, Debug, PartialEq)]
pub struct SunExtraction {
    /// What was taken out.
    pub sun: Sun,
    /// The panorama with the surroundings' radiance in its place; nowhere brighter than before.
    pub remaining: Panorama,
    /// The proof: original = light + remaining to 1e-12.
    pub flux: FluxAccount,
}

/// Why a panorama has no dominant small light.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoSun {
    /// Nothing shines.
    #[error("the panorama is black")]
    Black,
    /// The brightest light is too large, say a window or a soft box.
    #[error("the brightest light reaches {angle:.3} rad from its brightest texel, a sun at most {limit:.3}")]
    TooLarge {
        /// From the brightest texel to one with half its luminance, connected with it.
        angle: f64,
        /// What was allowed.
        limit: f64,
    },
    /// The brightest texel does not stand out.
    #[error(
        "the brightest texel has {contrast:.1} times its surroundings' luminance, a sun at least {limit:.1}"
    )]
    Faint {
        /// Peak over the surroundings' median.
        contrast: f64,
        /// What was asked for.
        limit: f64,
    },
    /// The brightest light hardly matters.
    #[error("the brightest light carries {share:.4} of the flux, a dominant one at least {limit:.4}")]
    Minor {
        /// Of the whole luminous flux.
        share: f64,
        /// What was asked for.
        limit: f64,
    },
}

/// Takes the dominant small light out of a panorama of finite, not negative texels; [`NoSun`] says why there is none.
///
/// Of several lights the one with the brightest texel is taken, of equal ones the first in row order.
///
/// # Errors
/// [`Cancelled`] within a row's work.
pub fn extract_sun(
    panorama: &Panorama,
    request: &SunRequest,
    cancel: Cancel,
) -> Result<Result<SunExtraction, NoSun>, Cancelled> {
    let sphere = Sphere::new(panorama);
    let Some((peak, brightest)) = sphere.brightest(cancel)? else { return Ok(Err(NoSun::Black)) };
    let texel = PI / sphere.height as f64;
    let limit = request.angular_diameter_max.max(2.0 * texel).min(DIAMETER_MAX);
    // A light that fills the map would be walked over texel by texel: the walk ends where it is too large for sure.
    let from_brightest = |index| distance(sphere.direction(index), sphere.direction(brightest));
    let core = sphere.connected(vec![brightest], cancel, |index| {
        sphere.luminance(index) >= 0.5 * peak && from_brightest(index) <= limit + 2.0 * texel
    })?;
    let angle = core.iter().map(|&index| from_brightest(index)).fold(0.0, f64::max);
    if angle > limit {
        return Ok(Err(NoSun::TooLarge { angle, limit }));
    }
    let centre = sphere.centre(&core, |index| sphere.luminance(index));
    let reach = 0.5 * limit + 1.5 * texel;
    let surroundings = sphere.median_luminance(centre, [reach, 2.0 * reach + texel], cancel)?;
    let contrast = peak / surroundings;
    // NaN is impossible: the peak is over 0.
    if contrast < request.contrast_min {
        return Ok(Err(NoSun::Faint { contrast, limit: request.contrast_min }));
    }
    let region = sphere.connected(core, cancel, |index| {
        sphere.luminance(index) > 2.0 * surroundings && distance(sphere.direction(index), centre) <= reach
    })?;
    let extraction = sphere.take(&region, cancel)?;
    let share = luminance(extraction.flux.light) / luminance(extraction.flux.original);
    if share < request.flux_share_min {
        return Ok(Err(NoSun::Minor { share, limit: request.flux_share_min }));
    }
    Ok(Ok(extraction))
}

/// Rec. 709.
fn luminance(rgb: [f64; 3]) -> f64 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

/// A panorama as patches of the sphere.
struct Sphere<'a> {
    panorama: &'a Panorama,
    width: usize,
    height: usize,
}

impl<'a> Sphere<'a> {
    fn new(panorama: &'a Panorama) -> Self {
        Self { panorama, width: panorama.width(), height: panorama.height() }
    }

    fn patch(&self, index: usize) -> Patch {
        Patch::of_texel(self.width, self.height, index)
    }

    fn rgb(&self, index: usize) -> [f64; 3] {
        std::array::from_fn(|channel| f64::from(self.panorama.rgb()[3 * index + channel]))
    }

    fn luminance(&self, index: usize) -> f64 {
        luminance(self.rgb(index))
    }

    fn direction(&self, index: usize) -> [f64; 3] {
        let at = |index: usize, count: usize| (index as f64 + 0.5) / count as f64;
        panorama_direction(at(index % self.width, self.width), at(index / self.width, self.height))
    }

    /// Luminance and index of the brightest texel, of equal ones the first; `None` if all is black.
    fn brightest(&self, cancel: Cancel) -> Result<Option<(f64, usize)>, Cancelled> {
        let mut brightest = None;
        for row in 0..self.height {
            cancel.check()?;
            for index in row * self.width..(row + 1) * self.width {
                let luminance = self.luminance(index);
                if luminance > brightest.map_or(0.0, |(value, _)| value) {
                    brightest = Some((luminance, index));
                }
            }
        }
        Ok(brightest)
    }

    /// Texels that touch one, by a side or a corner. Over a pole all of a row touch: the one opposite stands for them,
    /// since a light on the pole goes round it along the row.
    fn neighbours(&self, index: usize) -> impl Iterator<Item = usize> + use<> {
        let (width, height) = (self.width, self.height);
        let (row, column) = (index / width, index % width);
        let across = column + width / 2;
        let above = if row == 0 { (0, across) } else { (row - 1, column) };
        let below = if row + 1 == height { (row, across) } else { (row + 1, column) };
        [above, (row, column), below]
            .into_iter()
            .flat_map(move |(row, column)| {
                [column + width - 1, column, column + 1].map(|column| row * width + column % width)
            })
            .filter(move |&neighbour| neighbour != index)
    }

    /// `seeds` and all accepted texels that touch them or each other, ascending.
    fn connected(
        &self,
        seeds: Vec<usize>,
        cancel: Cancel,
        accepts: impl Fn(usize) -> bool,
    ) -> Result<Vec<usize>, Cancelled> {
        let mut texels: BTreeSet<usize> = seeds.iter().copied().collect();
        let mut open = seeds;
        while let Some(index) = open.pop() {
            cancel.check()?;
            for neighbour in self.neighbours(index) {
                if accepts(neighbour) && texels.insert(neighbour) {
                    open.push(neighbour);
                }
            }
        }
        Ok(texels.into_iter().collect())
    }

    /// Direction of ∫ weight · ω dω over the texels.
    fn centre(&self, texels: &[usize], weight: impl Fn(usize) -> f64) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for &index in texels {
            let weight = weight(index);
            for node in self.patch(index).nodes(2) {
                for (sum, part) in sum.iter_mut().zip(node.direction) {
                    *sum += weight * node.solid_angle_sr * part;
                }
            }
        }
        let length = (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]).sqrt();
        sum.map(|value| value / length)
    }

    /// Median luminance of the texels whose centres lie between two angles from a direction; 0 if there are none.
    fn median_luminance(&self, centre: [f64; 3], ring: [f64; 2], cancel: Cancel) -> Result<f64, Cancelled> {
        let theta = libm::acos(centre[1].clamp(-1.0, 1.0));
        let row_of = |theta: f64| ((theta / PI).clamp(0.0, 1.0) * self.height as f64) as usize;
        let rows = row_of(theta - ring[1])..(row_of(theta + ring[1]) + 1).min(self.height);
        let mut values = Vec::new();
        for row in rows {
            cancel.check()?;
            for index in row * self.width..(row + 1) * self.width {
                let distance = distance(self.direction(index), centre);
                if distance > ring[0] && distance <= ring[1] {
                    values.push(self.luminance(index));
                }
            }
        }
        if values.is_empty() {
            return Ok(0.0);
        }
        let middle = values.len() / 2;
        Ok(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
    }

    /// Mean radiance of the texels that touch a region; black if there are none.
    fn fill(&self, region: &[usize]) -> [f64; 3] {
        let is_inside = |index: &usize| region.binary_search(index).is_ok();
        let rim: BTreeSet<usize> = region
            .iter()
            .flat_map(|&index| self.neighbours(index))
            .filter(|index| !is_inside(index))
            .collect();
        let (mut sum, mut solid_angle) = ([0.0; 3], 0.0);
        for index in rim {
            let weight = self.patch(index).solid_angle_sr();
            solid_angle += weight;
            for (sum, value) in sum.iter_mut().zip(self.rgb(index)) {
                *sum += weight * value;
            }
        }
        if solid_angle > 0.0 { sum.map(|value| value / solid_angle) } else { sum }
    }

    /// Fills the region and makes a light of what that takes away.
    fn take(&self, region: &[usize], cancel: Cancel) -> Result<SunExtraction, Cancelled> {
        let fill = self.fill(region);
        let mut rgb = Vec::with_capacity(self.panorama.rgb().len());
        for row in self.panorama.rgb().chunks_exact(3 * self.width) {
            cancel.check()?;
            rgb.extend_from_slice(row);
        }
        for &index in region {
            for (value, fill) in rgb[3 * index..3 * index + 3].iter_mut().zip(fill) {
                *value = value.min(fill as f32);
            }
        }
        let image = Image { width: self.width, height: self.height, rgb };
        let remaining = Panorama::new(image).expect("the size is the original's");
        let taken = |index: usize| -> [f64; 3] {
            let left = Sphere::new(&remaining).rgb(index);
            let whole = self.rgb(index);
            std::array::from_fn(|channel| whole[channel] - left[channel])
        };
        let sun = self.light(region, taken);
        let flux = FluxAccount {
            original: self.flux(cancel)?,
            light: sun.irradiance,
            remaining: Sphere::new(&remaining).flux(cancel)?,
        };
        Ok(SunExtraction { sun, remaining, flux })
    }

    fn light(&self, region: &[usize], taken: impl Fn(usize) -> [f64; 3]) -> Sun {
        let mut irradiance = [0.0; 3];
        let (mut first, mut second) = (0.0, 0.0);
        for &index in region {
            let (rgb, solid_angle_sr) = (taken(index), self.patch(index).solid_angle_sr());
            for (sum, value) in irradiance.iter_mut().zip(rgb) {
                *sum += solid_angle_sr * value;
            }
            first += solid_angle_sr * luminance(rgb);
            second += solid_angle_sr * luminance(rgb) * luminance(rgb);
        }
        let largest = irradiance.iter().fold(0.0, |a: f64, &b| a.max(b));
        let solid_angle_sr = if second > 0.0 { first * first / second } else { 0.0 };
        Sun {
            direction: self.centre(region, |index| luminance(taken(index))),
            irradiance,
            colour: irradiance.map(|value| if largest > 0.0 { value / largest } else { 0.0 }),
            solid_angle_sr,
            angular_diameter: disc_diameter(solid_angle_sr),
            texel_count: region.len(),
        }
    }

    /// Σ L ω, row by row, so that rounding stays at 1e-15 of it.
    fn flux(&self, cancel: Cancel) -> Result<[f64; 3], Cancelled> {
        let mut flux = [0.0; 3];
        for (row, texels) in self.panorama.rgb().chunks_exact(3 * self.width).enumerate() {
            cancel.check()?;
            let mut sum = [0.0; 3];
            for texel in texels.chunks_exact(3) {
                for (sum, &value) in sum.iter_mut().zip(texel) {
                    *sum += f64::from(value);
                }
            }
            let solid_angle_sr = self.patch(row * self.width).solid_angle_sr();
            for (flux, sum) in flux.iter_mut().zip(sum) {
                *flux += solid_angle_sr * sum;
            }
        }
        Ok(flux)
    }
}

/// Angle between two unit vectors, exact for small ones.
fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let chord2: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    2.0 * libm::asin((0.5 * chord2.sqrt()).min(1.0))
}

/// Angular diameter of a disc: Ω = 2π (1 − cos(diameter/2)).
fn disc_diameter(solid_angle_sr: f64) -> f64 {
    4.0 * libm::asin((solid_angle_sr / (4.0 * PI)).sqrt().min(1.0))
}
