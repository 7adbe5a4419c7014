//! Textures on the device: environment cubes, tables, material images.

use std::borrow::Cow;

use half::f16;
use kiln_diagnostic::Diagnostic;
use kiln_gpu::Gpu;
use kiln_image::ktx2;
use kiln_link::{Revision, Target};
use kiln_scene::{Image8, Sampler, Wrap};

use crate::mip::{Average, smaller_levels};
use crate::neutral;
use crate::target::{CubeMeta, LutMeta, TexelFormat};
use crate::upload::Uploader;

/// An environment map with what a lookup needs to know.
#[derive(Clone, Debug)]
pub(crate) struct CubeTexture {
    pub view: wgpu::TextureView,
    pub levels: u32,
    /// First and last level that there is; the others are black, and nothing reads them.
    present: [u32; 2],
    /// Radiance is texel · scale.
    pub scale: f32,
    /// What differs from the target, for the user.
    pub notes: Vec<String>,
}

/// A two-channel table.
#[derive(Clone, Debug)]
pub(crate) struct LutTexture {
    pub view: wgpu::TextureView,
}

impl CubeTexture {
    /// Uploads a cube target, level by level.
    pub fn upload(
        uploader: &Uploader,
        name: &str,
        target: &Target,
        revision: &Revision,
        meta: &CubeMeta,
    ) -> Result<Self, Diagnostic> {
        let gpu = &uploader.gpu;
        let limit = gpu.device.limits().max_texture_dimension_2d;
        let levels_max = meta.size.checked_ilog2().map_or(0, |log| log + 1);
        if meta.size == 0 || meta.size > limit || meta.levels == 0 || meta.levels > levels_max {
            return Err(Diagnostic::error(format!(
                "cube `{name}` has size {} and {} levels",
                meta.size, meta.levels
            ))
            .with_note(format!("this device takes sizes 1 to {limit} and at most log2(size) + 1 levels")));
        }
        let format = meta.format.unpacked();
        if format.channels() != 4 {
            return Err(Diagnostic::error(format!("cube `{name}` has texels of format {:?}", meta.format)));
        }
        let parts = read_levels(name, target, revision, meta)?;
        let extra_log2 = if filterable(gpu, format) == format { 0 } else { overflow_log2(&parts) };
        let texture = create_texture(gpu, name, meta.size, 6, meta.levels, filterable(gpu, format).wgpu());
        for (level, texels) in &parts {
            let texels = convert(texels, format, filterable(gpu, format), extra_log2);
            uploader.write_level(&texture, *level, &texels);
        }
        Ok(CubeTexture {
            view: cube_view(&texture),
            levels: meta.levels,
            present: [parts.first(), parts.last()].map(|level| level.map_or(0, |(level, _)| *level)),
            scale: exp2(meta.scale_log2.saturating_add(extra_log2)),
            notes: notes_on_cube(gpu, name, meta, parts.len()),
        })
    }

    /// The perceptual roughness that can be looked up nearest to a wish; 0 stays what it is, no lookup.
    pub fn nearest_roughness(&self, wish: f32) -> f32 {
        let level_max = (self.levels - 1).max(1) as f32;
        let [first, last] = self.present.map(|level| level as f32 / level_max);
        if wish > 0.0 { wish.clamp(first, last.max(first)) } else { wish }
    }

    /// The same dim grey from everywhere: stands in for an absent map.
    pub fn neutral(uploader: &Uploader) -> Self {
        let grey = [neutral::RADIANCE, neutral::RADIANCE, neutral::RADIANCE, 1.0].map(f16::from_f32);
        let texels = [grey; 6].map(|texel| texel.map(f16::to_bits));
        Self::of_one_level(uploader, "neutral environment", 1, bytemuck::cast_slice(&texels), 0)
    }

    /// A cube of RGBA in binary16, six faces of `size`² texels; radiance is texel · 2^`scale_log2`.
    pub fn of_one_level(uploader: &Uploader, label: &str, size: u32, texels: &[u8], scale_log2: i32) -> Self {
        let format = wgpu::TextureFormat::Rgba16Float;
        let texture = create_texture(&uploader.gpu, label, size, 6, 1, format);
        uploader.write_level(&texture, 0, texels);
        let (view, scale) = (cube_view(&texture), exp2(scale_log2));
        CubeTexture { view, levels: 1, present: [0, 0], scale, notes: Vec::new() }
    }
}

impl LutTexture {
    /// Uploads a `lut` target.
    pub fn upload(
        uploader: &Uploader,
        name: &str,
        texels: &[u8],
        meta: &LutMeta,
    ) -> Result<Self, Diagnostic> {
        let gpu = &uploader.gpu;
        let limit = gpu.device.limits().max_texture_dimension_2d;
        let expected = u64::from(meta.size) * u64::from(meta.size) * meta.format.bytes();
        if meta.size == 0 || meta.size > limit || meta.format.channels() != 2 {
            let message = format!("table `{name}` has size {} and format {:?}", meta.size, meta.format);
            return Err(Diagnostic::error(message));
        }
        check_length(name, "texels", texels, expected)?;
        let format = filterable(gpu, meta.format);
        let texture = create_texture(gpu, name, meta.size, 1, 1, format.wgpu());
        uploader.write_level(&texture, 0, &convert(texels, meta.format, format, 0));
        Ok(LutTexture { view: texture.create_view(&wgpu::TextureViewDescriptor::default()) })
    }

    /// Scale 1, bias 0: reflectance is F0, whatever the view.
    pub fn neutral(uploader: &Uploader) -> Self {
        let texture = create_texture(&uploader.gpu, "neutral table", 1, 1, 1, wgpu::TextureFormat::Rg16Float);
        let texel = [f16::ONE.to_bits(), f16::ZERO.to_bits()];
        uploader.write_level(&texture, 0, bytemuck::cast_slice(&texel));
        LutTexture { view: texture.create_view(&wgpu::TextureViewDescriptor::default()) }
    }
}

/// Uploads an image with all its levels; one that is larger than the device takes loses its first levels.
pub(crate) fn upload_image(
    uploader: &Uploader,
    label: &str,
    image: &Image8,
    average: Average,
) -> wgpu::TextureView {
    let gpu = &uploader.gpu;
    let limit = gpu.device.limits().max_texture_dimension_2d;
    let smaller = smaller_levels(image, average);
    let all = std::iter::once(image).chain(&smaller);
    let levels: Vec<&Image8> = all.skip_while(|level| level.width.max(level.height) > limit).collect();
    let format = match average {
        Average::Srgb => wgpu::TextureFormat::Rgba8UnormSrgb,
        Average::Linear => wgpu::TextureFormat::Rgba8Unorm,
    };
    let size = wgpu::Extent3d { width: levels[0].width, height: levels[0].height, depth_or_array_layers: 1 };
    let texture = create_sized_texture(gpu, label, size, levels.len() as u32, format);
    for (level, image) in levels.iter().enumerate() {
        uploader.write_level(&texture, level as u32, &image.rgba);
    }
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// A sampler as the file asks for it; anisotropic where that is cheap and the file filters anyway.
pub(crate) fn create_sampler(gpu: &Gpu, sampler: Sampler) -> wgpu::Sampler {
    let filter = |linear| if linear { wgpu::FilterMode::Linear } else { wgpu::FilterMode::Nearest };
    let all_linear = sampler.mag_linear && sampler.min_linear && sampler.mip_linear == Some(true);
    gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        address_mode_u: address_mode(sampler.wrap_u),
        address_mode_v: address_mode(sampler.wrap_v),
        mag_filter: filter(sampler.mag_linear),
        min_filter: filter(sampler.min_linear),
        mipmap_filter: match sampler.mip_linear {
            Some(true) => wgpu::MipmapFilterMode::Linear,
            Some(false) | None => wgpu::MipmapFilterMode::Nearest,
        },
        lod_max_clamp: if sampler.mip_linear.is_some() { 32.0 } else { 0.0 },
        anisotropy_clamp: if all_linear && !gpu.is_software() { 8 } else { 1 },
        ..Default::default()
    })
}

/// Linear between texels and levels, clamped.
pub(crate) fn create_trilinear_sampler(gpu: &Gpu) -> wgpu::Sampler {
    gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        mipmap_filter: wgpu::MipmapFilterMode::Linear,
        ..Default::default()
    })
}

fn address_mode(wrap: Wrap) -> wgpu::AddressMode {
    match wrap {
        Wrap::Repeat => wgpu::AddressMode::Repeat,
        Wrap::MirroredRepeat => wgpu::AddressMode::MirrorRepeat,
        Wrap::ClampToEdge => wgpu::AddressMode::ClampToEdge,
    }
}

/// A level's number and its texels.
type Level<'a> = (u32, Cow<'a, [u8]>);

/// The levels a cube target holds, with their bytes checked; levels that nothing needs may be absent.
fn read_levels<'a>(
    name: &str,
    target: &Target,
    revision: &'a Revision,
    meta: &CubeMeta,
) -> Result<Vec<Level<'a>>, Diagnostic> {
    let mut levels = Vec::new();
    for level in 0..meta.levels {
        let part_name = format!("mip{level}");
        let Some(part) = target.parts.iter().find(|part| part.name == part_name) else { continue };
        let size = u64::from((meta.size >> level).max(1));
        let bytes: &[u8] = revision.bytes(part);
        let texels = match meta.format.packed() {
            Some(format) => Cow::Owned(unpack(format, size as usize, bytes).ok_or_else(|| {
                Diagnostic::error(format!(
                    "part `{part_name}` of `{name}` has {} bytes, too few",
                    bytes.len()
                ))
            })?),
            None => {
                check_length(name, &part_name, bytes, 6 * size * size * meta.format.bytes())?;
                Cow::Borrowed(bytes)
            }
        };
        levels.push((level, texels));
    }
    if levels.is_empty() {
        return Err(Diagnostic::error(format!("cube `{name}` has no level")));
    }
    Ok(levels)
}

/// Packed texels of six faces as binary16, alpha 1; `None` if the bytes are not that many.
fn unpack(format: ktx2::Format, size: usize, bytes: &[u8]) -> Option<Vec<u8>> {
    let values = format.decode_image(size, size, bytes).filter(|values| values.len() == 18 * size * size)?;
    let texel =
        |rgb: &[f32; 3]| [rgb[0], rgb[1], rgb[2], 1.0].map(|value| f16::from_f32(value).to_le_bytes());
    Some(values.as_chunks().0.iter().flat_map(texel).flatten().collect())
}

fn check_length(name: &str, part: &str, bytes: &[u8], expected: u64) -> Result<(), Diagnostic> {
    if bytes.len() as u64 == expected {
        return Ok(());
    }
    Err(Diagnostic::error(format!("part `{part}` of `{name}` has {} bytes, not {expected}", bytes.len())))
}

fn notes_on_cube(gpu: &Gpu, name: &str, meta: &CubeMeta, present: usize) -> Vec<String> {
    let mut notes = Vec::new();
    if filterable(gpu, meta.format) != meta.format {
        notes.push(format!("`{name}` is shown in 16-bit floats: this device does not filter 32-bit ones"));
    }
    if present < meta.levels as usize && meta.first_level.is_none() {
        notes.push(format!(
            "{} of {} levels of `{name}` are absent and black",
            meta.levels as usize - present,
            meta.levels
        ));
    }
    notes
}

/// The format itself, or its 16-bit sister where the device cannot filter it.
fn filterable(gpu: &Gpu, format: TexelFormat) -> TexelFormat {
    if format.is_float32() && !gpu.filters_float32() { format.halved() } else { format }
}

/// Smallest power of two that brings every float of the levels under binary16's largest value.
fn overflow_log2(levels: &[Level]) -> i32 {
    let values = levels.iter().flat_map(|(_, bytes)| floats(bytes));
    let largest =
        values.filter(|value| value.is_finite()).fold(0.0_f32, |largest, value| largest.max(value.abs()));
    (0..128).find(|&log2| largest / exp2(log2) <= f16::MAX.to_f32()).unwrap_or(0)
}

fn exp2(log2: i32) -> f32 {
    // A scale outside f32's range would only come from a damaged target; it must stay finite and positive.
    2.0_f32.powi(log2.clamp(-126, 127))
}

fn floats(bytes: &[u8]) -> impl Iterator<Item = f32> {
    bytes.chunks_exact(4).map(|chunk| f32::from_le_bytes([chunk[0], chunk[1], chunk[2], chunk[3]]))
}

fn convert(texels: &[u8], from: TexelFormat, to: TexelFormat, scale_log2: i32) -> Cow<'_, [u8]> {
    if from == to {
        return Cow::Borrowed(texels);
    }
    let factor = exp2(-scale_log2);
    Cow::Owned(floats(texels).flat_map(|value| f16::from_f32(value * factor).to_le_bytes()).collect())
}

fn create_texture(
    gpu: &Gpu,
    label: &str,
    size: u32,
    layers: u32,
    levels: u32,
    format: wgpu::TextureFormat,
) -> wgpu::Texture {
    let size = wgpu::Extent3d { width: size, height: size, depth_or_array_layers: layers };
    create_sized_texture(gpu, label, size, levels, format)
}

fn create_sized_texture(
    gpu: &Gpu,
    label: &str,
    size: wgpu::Extent3d,
    levels: u32,
    format: wgpu::TextureFormat,
) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size,
        mip_level_count: levels,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    })
}

fn cube_view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::Cube),
        ..Default::default()
    })
}
