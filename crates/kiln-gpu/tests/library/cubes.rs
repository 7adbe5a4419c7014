//! Cube maps: reading them as texture hardware does, in `f64`, and comparing them.

use kiln_gpu::Gpu;
use kiln_image::{Cube, Image, Panorama};
use kiln_sphere::direction::cube_texel_centre;
use kiln_sphere::{cube_direction, cube_face_st, cube_texel_solid_angle_sr};

pub type Rgb = [f64; 3];

/// A cube map's levels, largest first.
pub struct Levels(pub Vec<Cube>);

impl Levels {
    pub fn face_size(&self) -> usize {
        self.0[0].face_size
    }

    /// Trilinear lookup, across the edges of faces too (Vulkan 1.3, "Cube map edge handling").
    pub fn sample(&self, direction: [f64; 3], level: f64) -> Rgb {
        let level = level.clamp(0.0, (self.0.len() - 1) as f64);
        let below = bilinear(&self.0[level.floor() as usize], direction);
        let above = bilinear(&self.0[level.ceil() as usize], direction);
        let t = level.fract();
        std::array::from_fn(|i| below[i] * (1.0 - t) + above[i] * t)
    }
}

fn bilinear(cube: &Cube, direction: [f64; 3]) -> Rgb {
    let (face, st) = cube_face_st(direction);
    let size = cube.face_size as f64;
    let [x, y] = st.map(|s| 0.5 * (s + 1.0) * size - 0.5);
    let (x0, y0) = (x.floor(), y.floor());
    let mut sum = [0.0; 4];
    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        let weight = (1.0 - (x - x0 - dx).abs()) * (1.0 - (y - y0 - dy).abs());
        // Three faces meet in a corner: there is no fourth texel, and the other three share its weight.
        if let Some(texel) = texel(cube, face, x0 + dx, y0 + dy) {
            for (sum, value) in sum.iter_mut().zip(texel.into_iter().chain([1.0])) {
                *sum += weight * value;
            }
        }
    }
    [0, 1, 2].map(|i| sum[i] / sum[3])
}

/// The texel at column x and row y of a face, which may be one step over an edge.
fn texel(cube: &Cube, face: usize, x: f64, y: f64) -> Option<Rgb> {
    let size = cube.face_size as f64;
    let inside = |a: f64| (0.0..size).contains(&a);
    let (face, x, y) = match (inside(x), inside(y)) {
        (true, true) => (face, x, y),
        (false, false) => return None,
        _ => {
            // A hair beyond the edge the neighbour's face begins.
            let centre =
                |a: f64| if inside(a) { (2.0 * a + 1.0) / size - 1.0 } else { (a.signum()) * (1.0 + 1e-9) };
            let (face, [s, t]) = cube_face_st(cube_direction(face, centre(x), centre(y)));
            let index = |s: f64| (0.5 * (s + 1.0) * size).floor().clamp(0.0, size - 1.0);
            (face, index(s), index(t))
        }
    };
    let at = ((face * cube.face_size + y as usize) * cube.face_size + x as usize) * 3;
    Some([0, 1, 2].map(|i| f64::from(cube.rgb[at + i])))
}

/// A picture's bilinear value at (u, v) from its top left: clamps in v, and in u unless it `repeats`.
pub fn image_bilinear(width: usize, rgb: &[f32], [u, v]: [f64; 2], repeats: bool) -> Rgb {
    let (columns, rows) = (width as f64, (rgb.len() / 3 / width) as f64);
    let (x, y) = (u * columns - 0.5, v * rows - 0.5);
    let mut sum = [0.0; 3];
    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        let (column, row) = (x.floor() + dx, y.floor() + dy);
        let weight = (1.0 - (x - column).abs()) * (1.0 - (y - row).abs());
        let column = if repeats { column.rem_euclid(columns) } else { column.clamp(0.0, columns - 1.0) };
        let at = (row.clamp(0.0, rows - 1.0) as usize * width + column as usize) * 3;
        for (sum, &value) in sum.iter_mut().zip(&rgb[at..at + 3]) {
            *sum += weight * f64::from(value);
        }
    }
    sum
}

/// As [`image_bilinear`].
pub fn panorama_bilinear(panorama: &Panorama, uv: [f64; 2], repeats: bool) -> Rgb {
    image_bilinear(panorama.width(), panorama.rgb(), uv, repeats)
}

/// A cube of what `radiance` says in the direction of each texel.
pub fn cube_of(face_size: usize, radiance: impl Fn([f64; 3]) -> Rgb) -> Cube {
    let texel = |index: usize| {
        let (face, y, x) =
            (index / (face_size * face_size), index / face_size % face_size, index % face_size);
        radiance(cube_direction(face, cube_texel_centre(face_size, x), cube_texel_centre(face_size, y)))
    };
    let rgb = (0..6 * face_size * face_size).flat_map(texel).map(|value| value as f32).collect();
    Cube { face_size, rgb }
}

/// How far a map is from another.
#[derive(Clone, Copy, Debug)]
pub struct Difference {
    /// RMS over the sphere and channels, relative to the other's RMS; NaN if anything is.
    pub rms: f64,
    /// Largest, relative to the other's RMS.
    pub worst: f64,
}

pub fn difference(actual: &Cube, expected: &Cube) -> Difference {
    assert_eq!(actual.face_size, expected.face_size);
    let size = actual.face_size;
    let (mut error, mut total, mut worst, mut weights) = (0.0, 0.0, 0.0_f64, 0.0);
    for (index, (a, e)) in actual.rgb.iter().zip(&expected.rgb).enumerate() {
        let texel = index / 3;
        let weight = cube_texel_solid_angle_sr(size, texel % size, texel / size % size);
        let off = (f64::from(*a) - f64::from(*e)).abs();
        error += weight * off * off;
        total += weight * f64::from(*e).powi(2);
        weights += weight;
        worst = if off.is_nan() { f64::INFINITY } else { worst.max(off) };
    }
    Difference { rms: (error / total).sqrt(), worst: worst / (total / weights).sqrt() }
}

fn texture(gpu: &Gpu, size: [u32; 3], levels: usize) -> wgpu::Texture {
    let [width, height, depth_or_array_layers] = size;
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width, height, depth_or_array_layers },
        mip_level_count: levels as u32,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Float,
        usage: wgpu::TextureUsages::COPY_SRC
            | wgpu::TextureUsages::COPY_DST
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::STORAGE_BINDING
            | wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    })
}

pub fn flat_texture(gpu: &Gpu, width: usize, height: usize) -> wgpu::Texture {
    texture(gpu, [width as u32, height as u32, 1], 1)
}

/// What a fragment stage with two components draws into.
pub fn pair_texture(gpu: &Gpu, size: usize) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: size as u32, height: size as u32, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rg32Float,
        usage: wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    })
}

pub fn cube_texture(gpu: &Gpu, face_size: usize, levels: usize) -> wgpu::Texture {
    texture(gpu, [face_size as u32, face_size as u32, 6], levels)
}

fn write(gpu: &Gpu, texture: &wgpu::Texture, level: usize, [width, height, layers]: [usize; 3], rgb: &[f32]) {
    let rgba: Vec<f32> = rgb.chunks_exact(3).flat_map(|t| [t[0], t[1], t[2], 1.0]).collect();
    gpu.queue.write_texture(
        wgpu::TexelCopyTextureInfo { mip_level: level as u32, ..texture.as_image_copy() },
        bytemuck::cast_slice(&rgba),
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(width as u32 * 16),
            rows_per_image: Some(height as u32),
        },
        wgpu::Extent3d { width: width as u32, height: height as u32, depth_or_array_layers: layers as u32 },
    );
}

pub fn upload_cube(gpu: &Gpu, levels: &Levels) -> wgpu::Texture {
    let texture = cube_texture(gpu, levels.face_size(), levels.0.len());
    for (level, cube) in levels.0.iter().enumerate() {
        write(gpu, &texture, level, [cube.face_size, cube.face_size, 6], &cube.rgb);
    }
    texture
}

pub fn upload_image(gpu: &Gpu, width: usize, rgb: &[f32]) -> wgpu::Texture {
    let height = rgb.len() / 3 / width;
    let texture = flat_texture(gpu, width, height);
    write(gpu, &texture, 0, [width, height, 1], rgb);
    texture
}

fn read(gpu: &Gpu, texture: &wgpu::Texture, level: usize) -> Vec<f32> {
    let bytes = gpu.read_texture(texture, level as u32).unwrap();
    let rgba: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes);
    rgba.chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).collect()
}

pub fn read_cube(gpu: &Gpu, texture: &wgpu::Texture, level: usize) -> Cube {
    Cube { face_size: (texture.width() >> level) as usize, rgb: read(gpu, texture, level) }
}

pub fn read_image(gpu: &Gpu, texture: &wgpu::Texture) -> Image {
    Image::new(texture.width() as usize, texture.height() as usize, read(gpu, texture, 0)).unwrap()
}

pub fn cube_view(texture: &wgpu::Texture) -> wgpu::TextureView {
    let dimension = Some(wgpu::TextureViewDimension::Cube);
    texture.create_view(&wgpu::TextureViewDescriptor { dimension, ..Default::default() })
}

/// One level as an array of six layers: what a storage texture is, and a source whose texels are loaded.
pub fn level_view(texture: &wgpu::Texture, level: usize) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        base_mip_level: level as u32,
        mip_level_count: Some(1),
        ..Default::default()
    })
}
