//! Small textures that programs of `semantics` sample, by the names that Kiln gives them.

use kiln_gpu::Gpu;

/// What `glslang`'s programs have in group 1, by binding: there, textures and samplers are apart.
pub const SLOTS: [&str; 7] = ["t_0", "t_1", "t_2", "layers", "shadows", "t_sampler", "shadows_sampler"];

const SIDE: u32 = 4;
const LEVELS: u32 = 2;

/// Whether `name` is a sampler, else a texture.
fn is_sampler(name: &str) -> bool {
    name.ends_with("_sampler")
}

fn is_shadow(name: &str) -> bool {
    name.starts_with("shadows")
}

fn layers(name: &str) -> u32 {
    if ["layers", "shadows"].contains(&name) { 4 } else { 1 }
}

fn dimension(name: &str) -> wgpu::TextureViewDimension {
    match layers(name) {
        1 => wgpu::TextureViewDimension::D2,
        _ => wgpu::TextureViewDimension::D2Array,
    }
}

/// How `name` is bound at `binding` for compute.
pub fn layout(binding: u32, name: &str) -> wgpu::BindGroupLayoutEntry {
    let ty = match (is_sampler(name), is_shadow(name)) {
        (true, true) => wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Comparison),
        (true, false) => wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
        (false, is_shadow) => wgpu::BindingType::Texture {
            sample_type: match is_shadow {
                true => wgpu::TextureSampleType::Depth,
                false => wgpu::TextureSampleType::Float { filterable: true },
            },
            view_dimension: dimension(name),
            multisampled: false,
        },
    };
    wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None }
}

/// What is bound.
pub enum Picture {
    Texture(wgpu::TextureView),
    Sampler(wgpu::Sampler),
}

impl Picture {
    /// The one called `name`: no two textures, levels or layers are alike.
    pub fn of(gpu: &Gpu, name: &str) -> Picture {
        match is_sampler(name) {
            true => Picture::Sampler(sampler(gpu, is_shadow(name))),
            false => Picture::Texture(texture(gpu, name)),
        }
    }

    pub fn resource(&self) -> wgpu::BindingResource<'_> {
        match self {
            Picture::Texture(view) => wgpu::BindingResource::TextureView(view),
            Picture::Sampler(sampler) => wgpu::BindingResource::Sampler(sampler),
        }
    }
}

fn sampler(gpu: &Gpu, is_shadow: bool) -> wgpu::Sampler {
    // Neighbours of one texel, so that nothing depends on how a driver mixes them, and both levels.
    gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        address_mode_u: wgpu::AddressMode::Repeat,
        address_mode_v: wgpu::AddressMode::Repeat,
        mipmap_filter: wgpu::MipmapFilterMode::Linear,
        compare: is_shadow.then_some(wgpu::CompareFunction::LessEqual),
        ..Default::default()
    })
}

fn texture(gpu: &Gpu, name: &str) -> wgpu::TextureView {
    use wgpu::TextureUsages;
    let format = match is_shadow(name) {
        true => wgpu::TextureFormat::Depth16Unorm,
        false => wgpu::TextureFormat::Rgba8Unorm,
    };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(name),
        size: wgpu::Extent3d { width: SIDE, height: SIDE, depth_or_array_layers: layers(name) },
        mip_level_count: LEVELS,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let texel_bytes = if is_shadow(name) { 2 } else { 4 };
    let first: u32 = name.bytes().map(u32::from).sum();
    for level in 0..LEVELS {
        let side = SIDE >> level;
        let count = side * side * layers(name) * texel_bytes;
        let noise = |at: u32| (first + 1000 * level + at).wrapping_mul(2_654_435_761).to_be_bytes()[0];
        let texels: Vec<u8> = (0..count).map(noise).collect();
        let target = wgpu::TexelCopyTextureInfo {
            texture: &texture,
            mip_level: level,
            origin: wgpu::Origin3d::ZERO,
            aspect: wgpu::TextureAspect::All,
        };
        let rows = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(side * texel_bytes),
            rows_per_image: Some(side),
        };
        let size = wgpu::Extent3d { width: side, height: side, depth_or_array_layers: layers(name) };
        gpu.queue.write_texture(target, &texels, rows, size);
    }
    texture
        .create_view(&wgpu::TextureViewDescriptor { dimension: Some(dimension(name)), ..Default::default() })
}
