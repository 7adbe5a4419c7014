//! The shading model beside the integral that it stands for.
//!
//! Shaders look light up twice and multiply by a table: the split sum (Karis 2013). [`split_sum_radiance`] does that with exact
//! lookups, [`PathTracer`] integrates the same lobes without splitting. What lies between the two is the model's own error,
//! which no map, however exact, takes away.

use std::f64::consts::PI;

use kiln_brdf::sampling::{
    hammersley, orthonormal_basis, pdf_cosine, pdf_ggx_visible, sample_cosine, sample_ggx_visible,
};
use kiln_brdf::{d_ggx, dfg_ggx, f_schlick, v_smith_ggx_correlated};
use kiln_image::Panorama;
use kiln_sphere::{Lobe, panorama_uv};

use crate::patch::Patch;
use crate::prefilter::ALPHA_MIN;
use crate::reference::reference_radiance;

/// A metallic-roughness surface without textures, as glTF 2.0 has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Linear base colour.
    pub color: [f64; 3],
    /// 0 = dielectric of index 1.5, 1 = metal.
    pub metallic: f64,
    /// Perceptual: α is its square.
    pub roughness: f64,
}

/// What the lobes reflect, channel by channel: the specular lobe's F0, and the share of E/π that comes back diffusely.
struct Albedos {
    f0: [f64; 3],
    single: [f64; 3],
    diffuse: [f64; 3],
}

impl Surface {
    /// Albedos of single and multiple scattering (Fdez-Agüera 2019) and of what these leave to the diffuse lobe.
    fn albedos(self, n_dot_v: f64) -> Albedos {
        let [scale, bias] = dfg_ggx(n_dot_v, self.roughness);
        let lost = 1.0 - scale - bias;
        let f0 = self.color.map(|color| 0.04 * (1.0 - self.metallic) + color * self.metallic);
        let single = f0.map(|f0| f0 * scale + bias);
        let multiple: [f64; 3] = std::array::from_fn(|channel| {
            let average = f0[channel] + (1.0 - f0[channel]) / 21.0;
            single[channel] * average * lost / (1.0 - average * lost)
        });
        let both = |channel: usize| single[channel] + multiple[channel];
        let left = 1.0 - (0..3).map(both).fold(0.0, f64::max);
        let diffuse = |channel: usize| multiple[channel] + self.color[channel] * (1.0 - self.metallic) * left;
        Albedos { f0, single, diffuse: std::array::from_fn(diffuse) }
    }
}

/// Radiance towards `view` from a surface of `normal` (unit vectors, less than 90° apart), as `shaders/pbr/base.wgsl` computes it: the
/// GGX lobe and Lambert's, each convolved exactly with `panorama`, times the exact table.
///
/// Costs two [`reference_radiance`]s.
pub fn split_sum_radiance(
    panorama: &Panorama,
    surface: Surface,
    normal: [f64; 3],
    view: [f64; 3],
) -> [f64; 3] {
    split_sum(surface, normal, view, |lobe, direction| reference_radiance(panorama, lobe, direction))
}

/// The same with other lookups: `light` is what an environment convolved with a lobe holds in a direction, of unit length.
pub fn split_sum(
    surface: Surface,
    normal: [f64; 3],
    view: [f64; 3],
    light: impl Fn(Lobe, [f64; 3]) -> [f64; 3],
) -> [f64; 3] {
    let signed = dot(normal, view);
    let Albedos { single, diffuse, .. } = surface.albedos(signed.clamp(0.0, 1.0));
    // The lobe's mean direction leans from the mirror direction towards the normal (Lagarde and de Rousiers 2014, listing 22).
    let alpha = surface.roughness * surface.roughness;
    let smoothness = 1.0 - alpha;
    let towards_mirror = smoothness * (smoothness.sqrt() + alpha);
    let mirror: [f64; 3] = std::array::from_fn(|i| 2.0 * signed * normal[i] - view[i]);
    let direction = normalised(std::array::from_fn(|i| normal[i] + (mirror[i] - normal[i]) * towards_mirror));
    let reflected = light(Lobe::Ggx { alpha }, direction);
    let irradiance_over_pi = light(Lobe::Lambert, normal);
    std::array::from_fn(|i| single[i] * reflected[i] + diffuse[i] * irradiance_over_pi[i])
}

/// A mean with its standard error, channel by channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Traced {
    /// Radiance towards the eye.
    pub radiance: [f64; 3],
    /// Of the mean, from independent runs.
    pub standard_error: [f64; 3],
}

/// Follows paths from the eye over a convex surface, which are two segments long, to an environment of constant patches.
///
/// A third of the directions follow the light, a third the visible normals of GGX, a third the cosine, weighted by the balance
/// heuristic (Veach and Guibas 1995).
#[derive(Debug)]
pub struct PathTracer<'a> {
    panorama: &'a Panorama,
    /// Sums of power up to and with each texel.
    power: Vec<f64>,
}

/// Runs with their own rotation of the point set, of which the standard error is told.
const RUNS: u32 = 16;

impl<'a> PathTracer<'a> {
    /// Sums the light up.
    pub fn new(panorama: &'a Panorama) -> Self {
        let (width, height) = (panorama.width(), panorama.height());
        let mut sum = 0.0;
        let power = panorama.rgb().chunks_exact(3).enumerate().map(|(index, texel)| {
            let brightest = texel.iter().copied().fold(0.0_f32, f32::max);
            sum += f64::from(brightest) * Patch::of_texel(width, height, index).solid_angle_sr();
            sum
        });
        PathTracer { power: power.collect(), panorama }
    }

    /// Radiance towards `view` from a surface of `normal` (unit vectors, less than 90° apart), from `count` directions of each kind in each
    /// of 16 runs. The lobes are those of [`split_sum_radiance`]; light that scatters several times is Lambert's in both.
    pub fn radiance(
        &self,
        surface: Surface,
        normal: [f64; 3],
        view: [f64; 3],
        count: u32,
        seed: u64,
    ) -> Traced {
        let scene = Path::new(surface, normal, view);
        let runs: Vec<[f64; 3]> =
            (0..RUNS).map(|run| self.run(&scene, count, seed ^ (u64::from(run) << 32))).collect();
        let n = f64::from(RUNS);
        let mean: [f64; 3] = std::array::from_fn(|i| runs.iter().map(|run| run[i]).sum::<f64>() / n);
        let variance = |i: usize| runs.iter().map(|run| (run[i] - mean[i]).powi(2)).sum::<f64>() / (n - 1.0);
        Traced { radiance: mean, standard_error: std::array::from_fn(|i| (variance(i) / n).sqrt()) }
    }

    fn run(&self, path: &Path, count: u32, seed: u64) -> [f64; 3] {
        let mut sum = [0.0; 3];
        let mut add = |light: [f64; 3]| {
            let n_dot_l = dot(path.normal, light);
            let density = (self.pdf(light) + path.pdf_visible(light) + pdf_cosine(n_dot_l)) / 3.0;
            if n_dot_l > 0.0 && density > 0.0 {
                let (radiance, reflected) = (self.texel(light), path.reflected(light));
                (0..3).for_each(|i| sum[i] += f64::from(radiance[i]) * reflected[i] * n_dot_l / density);
            }
        };
        for kind in 0..3_u64 {
            let shift = [2 * kind, 2 * kind + 1].map(|axis| unit_random(seed ^ (axis + 1)));
            for index in 0..count {
                let point = hammersley(index, count);
                let point = std::array::from_fn(|i| (point[i] + shift[i]).fract());
                match kind {
                    0 => self.sample(point).into_iter().for_each(&mut add),
                    1 => add(path.sample_visible(point)),
                    _ => add(path.to_world(sample_cosine(point))),
                }
            }
        }
        sum.map(|sum| sum / (3.0 * f64::from(count)))
    }

    fn index(&self, direction: [f64; 3]) -> usize {
        let (width, height) = (self.panorama.width(), self.panorama.height());
        let [u, v] = panorama_uv(direction);
        let at = |part: f64, size: usize| ((part * size as f64) as usize).min(size - 1);
        at(v, height) * width + at(u, width)
    }

    fn texel(&self, direction: [f64; 3]) -> &[f32] {
        let index = self.index(direction);
        &self.panorama.rgb()[3 * index..3 * index + 3]
    }

    fn share(&self, index: usize) -> f64 {
        let before = if index == 0 { 0.0 } else { self.power[index - 1] };
        (self.power[index] - before) / self.power.last().copied().unwrap_or(1.0)
    }

    /// A direction distributed as the light's power; `None` where there is none.
    fn sample(&self, [u, v]: [f64; 2]) -> Option<[f64; 3]> {
        let (width, height) = (self.panorama.width(), self.panorama.height());
        let total = *self.power.last().filter(|total| **total > 0.0)?;
        let wanted = u * total;
        let index = self.power.partition_point(|sum| *sum <= wanted).min(self.power.len() - 1);
        let before = if index == 0 { 0.0 } else { self.power[index - 1] };
        // What is left of u is as good a number as a third.
        let along = ((wanted - before) / (self.power[index] - before)).clamp(0.0, 1.0);
        let Patch { theta, lambda } = Patch::of_texel(width, height, index);
        let cosine = libm::cos(theta[0]) + v * (libm::cos(theta[1]) - libm::cos(theta[0]));
        let sine = ((1.0 - cosine) * (1.0 + cosine)).max(0.0).sqrt();
        let (sin_lambda, cos_lambda) = libm::sincos(lambda[0] + along * (lambda[1] - lambda[0]));
        Some(crate::patch::direction(sine, cosine, sin_lambda, cos_lambda))
    }

    /// Density of [`PathTracer::sample`] per steradian.
    fn pdf(&self, direction: [f64; 3]) -> f64 {
        let index = self.index(direction);
        let patch = Patch::of_texel(self.panorama.width(), self.panorama.height(), index);
        self.share(index) / patch.solid_angle_sr()
    }
}

/// The last but one point of a path: a surface as the eye sees it.
struct Path {
    normal: [f64; 3],
    basis: [[f64; 3]; 2],
    /// In the surface's own frame, z its normal.
    view: [f64; 3],
    alpha: f64,
    f0: [f64; 3],
    diffuse: [f64; 3],
}

impl Path {
    fn new(surface: Surface, normal: [f64; 3], view: [f64; 3]) -> Self {
        let Albedos { f0, diffuse, .. } = surface.albedos(dot(normal, view).clamp(0.0, 1.0));
        let basis = orthonormal_basis(normal);
        let alpha = (surface.roughness * surface.roughness).max(ALPHA_MIN);
        let mut path = Path { normal, basis, view: [0.0; 3], alpha, f0, diffuse };
        path.view = path.to_local(view);
        path
    }

    fn to_local(&self, direction: [f64; 3]) -> [f64; 3] {
        [dot(self.basis[0], direction), dot(self.basis[1], direction), dot(self.normal, direction)]
    }

    fn to_world(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| x * self.basis[0][i] + y * self.basis[1][i] + z * self.normal[i])
    }

    fn half(&self, light: [f64; 3]) -> [f64; 3] {
        let light = self.to_local(light);
        normalised(std::array::from_fn(|i| light[i] + self.view[i]))
    }

    /// The BRDF.
    fn reflected(&self, light: [f64; 3]) -> [f64; 3] {
        let half = self.half(light);
        let n_dot_l = dot(self.normal, light);
        let lobe = d_ggx(self.alpha, half[0] * half[0] + half[1] * half[1])
            * v_smith_ggx_correlated(self.alpha, self.view[2], n_dot_l);
        let v_dot_h = dot(self.view, half).clamp(0.0, 1.0);
        std::array::from_fn(|i| lobe * f_schlick(self.f0[i], v_dot_h) + self.diffuse[i] / PI)
    }

    fn sample_visible(&self, point: [f64; 2]) -> [f64; 3] {
        let half = sample_ggx_visible(self.view, point, self.alpha);
        let v_dot_h = dot(self.view, half);
        self.to_world(std::array::from_fn(|i| 2.0 * v_dot_h * half[i] - self.view[i]))
    }

    /// Density of [`Path::sample_visible`] per steradian of light.
    fn pdf_visible(&self, light: [f64; 3]) -> f64 {
        let half = self.half(light);
        let v_dot_h = dot(self.view, half);
        if v_dot_h > 0.0 { pdf_ggx_visible(self.view, half, self.alpha) / (4.0 * v_dot_h) } else { 0.0 }
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn normalised(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt();
    if length > 0.0 { v.map(|x| x / length) } else { [0.0, 0.0, 1.0] }
}

/// A number of [0, 1) for a seed (SplitMix64, Steele et al. 2014).
fn unit_random(seed: u64) -> f64 {
    let mut z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}
