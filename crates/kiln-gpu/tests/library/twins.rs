//! The algorithms of the bake passes and of the tutorials, natively in `f64`: same points, same steps, same order.

use std::f64::consts::PI;

use kiln_brdf::{Masking, d_ggx, sampling};
use kiln_image::{Cube, Panorama};
use kiln_sphere::direction::cube_texel_centre;
use kiln_sphere::{cube_direction, panorama_uv};

use crate::cubes::{Levels, Rgb, image_bilinear, panorama_bilinear};
use crate::support::unit;

/// Tangent and bitangent of a normal.
pub type Basis = fn([f64; 3]) -> [[f64; 3]; 2];

/// That of the tutorials: right = normalize(cross(+Y, N)), up = cross(N, right). Undefined at N = ±Y.
pub fn tutorial_basis([x, y, z]: [f64; 3]) -> [[f64; 3]; 2] {
    let length = x.hypot(z);
    let (right, normal) = ([z / length, 0.0, -x / length], [x, y, z]);
    let cross = [
        normal[1] * right[2] - normal[2] * right[1],
        normal[2] * right[0] - normal[0] * right[2],
        normal[0] * right[1] - normal[1] * right[0],
    ];
    [right, cross]
}

/// That of the tutorials' importance sampling: around +Z, and around +X where the normal is close to ±Z.
pub fn z_up_basis([x, y, z]: [f64; 3]) -> [[f64; 3]; 2] {
    let tangent = if z.abs() < 0.999 {
        let length = x.hypot(y);
        [-y / length, x / length, 0.0]
    } else {
        let length = y.hypot(z);
        [0.0, -z / length, y / length]
    };
    let [a, b, c] = tangent;
    [tangent, [y * c - z * b, z * a - x * c, x * b - y * a]]
}

/// A local direction in the world.
fn in_world(basis: Basis, normal: [f64; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    let [tangent, bitangent] = basis(normal);
    std::array::from_fn(|i| x * tangent[i] + y * bitangent[i] + z * normal[i])
}

fn add(sum: &mut Rgb, weight: f64, value: Rgb) {
    for (sum, value) in sum.iter_mut().zip(value) {
        *sum += weight * value;
    }
}

/// A tutorial's panorama on a cube: the centre column looks along +X, its angles are scaled by 0.1591 and 0.3183.
#[expect(
    clippy::approx_constant,
    reason = "tutorials type four digits of 1/π, and their error is what is measured"
)]
pub fn tutorial_equirect(panorama: &Panorama, face_size: usize) -> Cube {
    crate::cubes::cube_of(face_size, |[x, y, z]| {
        let u = z.atan2(x) * 0.1591 + 0.5;
        let from_below = y.clamp(-1.0, 1.0).asin() * 0.3183 + 0.5;
        panorama_bilinear(panorama, [u, 1.0 - from_below], false)
    })
}

/// (1 + s² + t²)^(−3/2).
fn jacobian(s: f64, t: f64) -> f64 {
    (1.0 + s * s + t * t).powf(-1.5)
}

pub fn equirect_to_cube(panorama: &Panorama, face_size: usize, samples_per_edge: usize) -> Cube {
    let edge = 2.0 / face_size as f64;
    let texel = |index: usize| {
        let (face, y, x) =
            (index / (face_size * face_size), index / face_size % face_size, index % face_size);
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for i in 0..samples_per_edge * samples_per_edge {
            let within = |i: usize| ((i as f64 + 0.5) / samples_per_edge as f64 - 0.5) * edge;
            let s = cube_texel_centre(face_size, x) + within(i % samples_per_edge);
            let t = cube_texel_centre(face_size, y) + within(i / samples_per_edge);
            let weight = jacobian(s, t);
            add(&mut sum, weight, panorama_bilinear(panorama, panorama_uv(cube_direction(face, s, t)), true));
            total += weight;
        }
        sum.map(|value| (value / total) as f32)
    };
    Cube { face_size, rgb: (0..6 * face_size * face_size).flat_map(texel).collect() }
}

/// The next level; `weighted` by solid angles, or plainly, as texture hardware makes it.
pub fn half_size(cube: &Cube, weighted: bool) -> Cube {
    let (above, size) = (cube.face_size, cube.face_size / 2);
    let texel = |index: usize| {
        let (face, y, x) = (index / (size * size), index / size % size, index % size);
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let (x, y) = (2 * x + dx, 2 * y + dy);
            let weight = jacobian(cube_texel_centre(above, x), cube_texel_centre(above, y));
            let weight = if weighted { weight } else { 1.0 };
            let at = ((face * above + y) * above + x) * 3;
            add(&mut sum, weight, [0, 1, 2].map(|i| f64::from(cube.rgb[at + i])));
            total += weight;
        }
        sum.map(|value| (value / total) as f32)
    };
    Cube { face_size: size, rgb: (0..6 * size * size).flat_map(texel).collect() }
}

/// All levels of a cube.
pub fn with_mips(cube: Cube, weighted: bool) -> Levels {
    let mut levels = vec![cube];
    while levels[levels.len() - 1].face_size > 1 {
        levels.push(half_size(&levels[levels.len() - 1], weighted));
    }
    Levels(levels)
}

/// A flat surface of one material under four lights and an environment, as the tutorials' `pbr.frag` shades it.
pub struct Surface<'a> {
    pub albedo: Rgb,
    pub metallic: f64,
    pub roughness: f64,
    pub occlusion: f64,
    pub normal: [f64; 3],
    pub camera: [f64; 3],
    /// Position and colour.
    pub lights: [([f64; 3], Rgb); 4],
    pub irradiance: &'a Levels,
    pub prefiltered: &'a Levels,
    /// Width and texels of the split sum's table.
    pub table: (usize, &'a [f32]),
    /// Added to 4 n·l n·v before dividing by it: 0.0001 in tutorials.
    pub offset: f64,
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

impl Surface<'_> {
    /// What a display is sent: Reinhard's curve and a gamma of 2.2.
    pub fn display(&self, position: [f64; 3]) -> Rgb {
        self.radiance(position).map(|value| (value / (value + 1.0)).powf(1.0 / 2.2))
    }

    fn radiance(&self, position: [f64; 3]) -> Rgb {
        let view = unit(minus(self.camera, position));
        let n_dot_v = dot(self.normal, view).max(0.0);
        let f0 = self.albedo.map(|albedo| 0.04 + (albedo - 0.04) * self.metallic);
        let mut sum = self.ambient(view, n_dot_v, f0);
        let k = (self.roughness + 1.0).powi(2) / 8.0;
        let g = |cosine: f64| cosine / (cosine * (1.0 - k) + k);
        for (at, color) in self.lights {
            let to_light = minus(at, position);
            let light = unit(to_light);
            let half = unit([0, 1, 2].map(|i| view[i] + light[i]));
            let n_dot_l = dot(self.normal, light).max(0.0);
            let n_dot_h = dot(self.normal, half).max(0.0);
            let alpha = self.roughness * self.roughness;
            let d = d_ggx(alpha, 1.0 - n_dot_h * n_dot_h);
            let specular = d * g(n_dot_v) * g(n_dot_l) / (4.0 * n_dot_v * n_dot_l + self.offset);
            let grazing = (1.0 - dot(half, view).max(0.0)).powi(5);
            for i in 0..3 {
                let fresnel = f0[i] + (1.0 - f0[i]) * grazing;
                let diffuse = (1.0 - fresnel) * (1.0 - self.metallic) * self.albedo[i] / PI;
                sum[i] += (diffuse + specular * fresnel) * color[i] / dot(to_light, to_light) * n_dot_l;
            }
        }
        sum
    }

    fn ambient(&self, view: [f64; 3], n_dot_v: f64, f0: Rgb) -> Rgb {
        let grazing = (1.0 - n_dot_v).powi(5);
        let mirrored = [0, 1, 2].map(|i| 2.0 * dot(self.normal, view) * self.normal[i] - view[i]);
        let irradiance = self.irradiance.sample(self.normal, 0.0);
        let prefiltered = self.prefiltered.sample(mirrored, 4.0 * self.roughness);
        let [scale, bias, _] = image_bilinear(self.table.0, self.table.1, [n_dot_v, self.roughness], false);
        std::array::from_fn(|i| {
            let fresnel = f0[i] + ((1.0 - self.roughness).max(f0[i]) - f0[i]) * grazing;
            let diffuse = (1.0 - fresnel) * (1.0 - self.metallic) * irradiance[i] * self.albedo[i];
            (diffuse + prefiltered[i] * (fresnel * scale + bias)) * self.occlusion
        })
    }
}

pub fn irradiance_grid(source: &Levels, basis: Basis, normal: [f64; 3], step: f64) -> Rgb {
    let (columns, rows) = ((2.0 * PI / step).ceil() as u32, (0.5 * PI / step).ceil() as u32);
    let mut sum = [0.0; 3];
    for column in 0..columns {
        let (sin_phi, cos_phi) = (f64::from(column) * step).sin_cos();
        for row in 0..rows {
            let (sine, cosine) = (f64::from(row) * step).sin_cos();
            let light = in_world(basis, normal, [sine * cos_phi, sine * sin_phi, cosine]);
            add(&mut sum, sine * cosine, source.sample(light, 0.0));
        }
    }
    sum.map(|value| value * PI / f64::from(columns * rows))
}

/// Level of the source at which a texel is as large as what a sample stands for.
fn filter_level(source: &Levels, pdf: f64, count: u32, bias: f64) -> f64 {
    level_of_share(source, 1.0 / (f64::from(count) * pdf).max(1e-12), bias)
}

fn level_of_share(source: &Levels, sample_sr: f64, bias: f64) -> f64 {
    let texel_sr = 4.0 * PI / (6.0 * (source.face_size() as f64).powi(2));
    (0.5 * (sample_sr / texel_sr).log2() + bias).max(0.0)
}

pub fn irradiance_cosine(source: &Levels, normal: [f64; 3], count: u32, bias: f64) -> Rgb {
    let mut sum = [0.0; 3];
    for i in 0..count {
        let light = sampling::sample_cosine(sampling::hammersley(i, count));
        let level = filter_level(source, sampling::pdf_cosine(light[2]), count, bias);
        add(&mut sum, 1.0, source.sample(in_world(sampling::orthonormal_basis, normal, light), level));
    }
    sum.map(|value| value / f64::from(count))
}

/// How a GGX level is sampled.
#[derive(Clone, Copy)]
pub struct Prefilter {
    pub roughness: f64,
    pub count: u32,
    pub bias: f64,
    pub basis: Basis,
    /// Added to densities, and to what a sample's share is one over of: tutorials have 0.0001 there.
    pub offsets: [f64; 2],
}

pub fn prefilter(source: &Levels, normal: [f64; 3], how: &Prefilter) -> Rgb {
    let alpha = how.roughness * how.roughness;
    if alpha <= 1e-8 {
        return source.sample(normal, 0.0);
    }
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for i in 0..how.count {
        let [x, y, z] = sampling::sample_ggx(sampling::hammersley(i, how.count), alpha);
        let light = [2.0 * z * x, 2.0 * z * y, 2.0 * z * z - 1.0];
        if light[2] > 0.0 {
            let pdf = 0.25 * d_ggx(alpha, x * x + y * y) + how.offsets[0];
            let level = level_of_share(source, 1.0 / (f64::from(how.count) * pdf + how.offsets[1]), how.bias);
            add(&mut sum, light[2], source.sample(in_world(how.basis, normal, light), level));
            total += light[2];
        }
    }
    sum.map(|value| value / total)
}

/// Where the view lies in Kiln's frame of samples.
pub const ALONG_X: [f64; 2] = [1.0, 0.0];
/// … and in the tutorials': around the normal (0, 0, 1) they take (0, -1, 0) for tangent.
pub const ALONG_Y: [f64; 2] = [0.0, 1.0];

/// [scale, bias] of the split sum. The view lies at `azimuth` of the samples' frame, as cosine and sine.
pub fn scale_bias(
    masking: Masking,
    n_dot_v: f64,
    roughness: f64,
    count: u32,
    [cos_v, sin_v]: [f64; 2],
) -> [f64; 2] {
    let alpha = roughness * roughness;
    let sine = ((1.0 - n_dot_v) * (1.0 + n_dot_v)).sqrt();
    let mut sum = [0.0; 2];
    for i in 0..count {
        let [x, y, z] = sampling::sample_ggx(sampling::hammersley(i, count), alpha);
        let v_dot_h = (sine * (x * cos_v + y * sin_v) + n_dot_v * z).clamp(0.0, 1.0);
        let n_dot_l = 2.0 * v_dot_h * z - n_dot_v;
        if n_dot_l > 0.0 {
            let weight = 4.0 * masking.scattered(alpha, n_dot_v, n_dot_l) * v_dot_h / z;
            let fresnel = (1.0 - v_dot_h).powi(5);
            sum[0] += weight * (1.0 - fresnel);
            sum[1] += weight * fresnel;
        }
    }
    sum.map(|value| value / f64::from(count))
}
