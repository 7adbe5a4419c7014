use wgpu::{AdapterInfo, Backend, DeviceType};

use crate::adapter::rank;
use crate::{Gpu, GpuError, describe_adapter};

/// A device, or `None` with a loud line; with `KILN_REQUIRE_GPU=1` a missing device fails.
#[expect(clippy::print_stderr, reason = "a skipped test says so")]
fn gpu() -> Option<Gpu> {
    match Gpu::headless() {
        Ok(gpu) => Some(gpu),
        Err(error) if std::env::var_os("KILN_REQUIRE_GPU").is_some() => panic!("{error}"),
        Err(error) => {
            eprintln!("SKIPPED: {error}");
            None
        }
    }
}

fn texture(gpu: &Gpu, width: u32, format: wgpu::TextureFormat, sample_count: u32) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width, height: 3, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::COPY_SRC
            | wgpu::TextureUsages::COPY_DST
            | wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    })
}

#[test]
fn software_vulkan_ranks_after_hardware_and_before_software_gl() {
    let adapters = [
        AdapterInfo::new(DeviceType::Cpu, Backend::Gl),
        AdapterInfo::new(DeviceType::Cpu, Backend::Vulkan),
        AdapterInfo::new(DeviceType::IntegratedGpu, Backend::Vulkan),
        AdapterInfo::new(DeviceType::DiscreteGpu, Backend::Gl),
        AdapterInfo::new(DeviceType::DiscreteGpu, Backend::Vulkan),
    ];
    let mut order: Vec<usize> = (0..adapters.len()).collect();
    order.sort_by_key(|&index| rank(&adapters[index]));
    assert_eq!(order, [4, 2, 3, 1, 0]);
}

#[test]
fn no_adapter_error_names_the_package_to_install() {
    let error = crate::choose_adapter(&[], None).map_err(|reason| GpuError::NoAdapter { reason });
    let message = error.unwrap_err().to_string();
    assert!(message.contains("mesa-vulkan-drivers"), "{message}");
}

#[test]
fn description_of_an_adapter_without_driver_text_has_no_dangling_comma() {
    let mut info = AdapterInfo::new(DeviceType::Cpu, Backend::Vulkan);
    info.name = "llvmpipe".into();
    assert_eq!(describe_adapter(&info), "llvmpipe, Vulkan");
    info.driver_info = "Mesa 22.3.6".into();
    assert_eq!(describe_adapter(&info), "llvmpipe, Vulkan, Mesa 22.3.6");
}

#[test]
fn read_texture_removes_row_padding() {
    let Some(gpu) = gpu() else { return };
    let texture = texture(&gpu, 5, wgpu::TextureFormat::Rgba8Unorm, 1);
    let bytes: Vec<u8> = (0..5 * 3 * 4).collect();
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(20), rows_per_image: Some(3) };
    gpu.queue.write_texture(texture.as_image_copy(), &bytes, layout, texture.size());
    assert_eq!(gpu.read_texture(&texture, 0), Ok(bytes));
}

#[test]
fn read_texture_refuses_multisampled_and_depth_textures() {
    let Some(gpu) = gpu() else { return };
    let multisampled = texture(&gpu, 5, wgpu::TextureFormat::Rgba8Unorm, 4);
    assert!(matches!(gpu.read_texture(&multisampled, 0), Err(GpuError::NotReadable { sample_count: 4, .. })));
    let depth = texture(&gpu, 5, wgpu::TextureFormat::Depth24PlusStencil8, 1);
    assert!(matches!(gpu.read_texture(&depth, 0), Err(GpuError::NotReadable { .. })));
}

#[test]
fn compute_pass_doubles_numbers_and_faults_are_errors() {
    let Some(gpu) = gpu() else { return };
    let wgsl = "override factor: u32;
        @group(0) @binding(3) var<storage, read_write> numbers: array<u32>;
        @compute @workgroup_size(2) fn main(@builtin(global_invocation_id) id: vec3u) { numbers[id.x] *= factor; }";
    let pass = gpu.compute_pass(wgsl, "main", &[("factor", 2.0)]).unwrap();
    let numbers: Vec<u8> = [1u32, 2, 3, 4].iter().flat_map(|number| number.to_le_bytes()).collect();
    let buffer = gpu.buffer(&numbers, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
    let at = |binding| [wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() }];
    assert_eq!(gpu.run_pass(&pass, &at(3), [2, 1, 1]), Ok(()));
    assert_eq!(gpu.read_buffer(&buffer).unwrap(), [2, 0, 0, 0, 4, 0, 0, 0, 6, 0, 0, 0, 8, 0, 0, 0]);
    assert!(matches!(gpu.run_pass(&pass, &at(4), [1, 1, 1]), Err(GpuError::Pass { .. })));
    let missing = gpu.compute_pass(wgsl, "other", &[("factor", 2.0)]);
    assert!(matches!(missing, Err(GpuError::Pass { .. })));
    assert_eq!(gpu.take_errors(), Vec::<String>::new());
}

#[test]
fn invalid_use_inside_a_scope_is_returned_and_outside_is_logged() {
    let Some(gpu) = gpu() else { return };
    let no_usage = wgpu::BufferDescriptor {
        label: Some("faulty"),
        size: 3,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    };
    let (_, caught) = gpu.catch_errors(|| gpu.device.create_buffer(&no_usage));
    assert!(caught.is_some_and(|error| error.contains("faulty")));
    assert_eq!(gpu.take_errors(), Vec::<String>::new());
    drop(gpu.device.create_buffer(&no_usage));
    assert_eq!(gpu.take_errors().len(), 1);
    let (_, clean) = gpu.catch_errors(|| gpu.queue.submit([]));
    assert_eq!(clean, None);
}
