//! Running a pass of `shaders/bake`: resources and settings by name.

use kiln_gpu::{ComputePass, Gpu};
use kiln_shader::{BindingKind, Compiled};

use crate::support::{binding, compile};

/// A compiled pass.
pub struct Pass {
    compiled: Compiled,
    pass: ComputePass,
}

/// A member of a pass's settings.
#[derive(Clone)]
pub enum Setting {
    F32(f32),
    U32(u32),
    Matrix([[f32; 4]; 4]),
    /// An array of vectors, or the columns of a smaller matrix, each in the room of four.
    Vectors(Vec<[f32; 4]>),
}

impl Setting {
    pub fn bytes(&self) -> &[u8] {
        match self {
            Self::F32(value) => bytemuck::bytes_of(value),
            Self::U32(value) => bytemuck::bytes_of(value),
            Self::Matrix(columns) => bytemuck::bytes_of(columns),
            Self::Vectors(vectors) => bytemuck::cast_slice(vectors),
        }
    }
}

impl Pass {
    #[track_caller]
    pub fn new(gpu: &Gpu, path: &str, entry_point: &str, features: &[&str]) -> Self {
        let compiled = compile(path, None, features);
        let pass = gpu.compute_pass(&compiled.wgsl, entry_point, &[]).unwrap();
        Self { compiled, pass }
    }

    /// Runs it over `size` invocations. What the entry point does not use of `resources` is passed over.
    #[track_caller]
    pub fn run(
        &self,
        gpu: &Gpu,
        resources: &[(&str, wgpu::BindingResource<'_>)],
        settings: &[(&str, Setting)],
        size: [u32; 3],
    ) {
        let uniform = self.settings(settings);
        let buffer = gpu.buffer(&uniform, wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST);
        let mut entries: Vec<wgpu::BindGroupEntry<'_>> = resources
            .iter()
            .map(|(name, resource)| wgpu::BindGroupEntry {
                binding: binding(&self.compiled, name).binding,
                resource: resource.clone(),
            })
            .collect();
        if !uniform.is_empty() {
            let binding = binding(&self.compiled, "settings").binding;
            entries.push(wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() });
        }
        let [x, y, z] = size;
        gpu.run_pass(&self.pass, &entries, [x.div_ceil(8), y.div_ceil(8), z]).unwrap();
    }

    /// The uniform `settings`, member by member; members that nobody names are 0.
    fn settings(&self, settings: &[(&str, Setting)]) -> Vec<u8> {
        if settings.is_empty() {
            return Vec::new();
        }
        let BindingKind::Uniform { size_bytes, members } = &binding(&self.compiled, "settings").kind else {
            panic!("settings are a uniform");
        };
        let mut bytes = vec![0; *size_bytes as usize];
        for (name, value) in settings {
            let member = members.iter().find(|member| member.name == *name);
            let member = member.unwrap_or_else(|| panic!("no setting is called {name}"));
            let (start, value) = (member.offset_bytes as usize, value.bytes());
            bytes[start..start + value.len()].copy_from_slice(value);
        }
        bytes
    }
}

/// Trilinear; repeats in u where `repeats`, which panoramas do.
pub fn sampler(gpu: &Gpu, repeats: bool) -> wgpu::Sampler {
    gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        address_mode_u: if repeats { wgpu::AddressMode::Repeat } else { wgpu::AddressMode::ClampToEdge },
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        mipmap_filter: wgpu::MipmapFilterMode::Linear,
        ..Default::default()
    })
}
