//! Which adapter, and which device to ask it for.

use wgpu::{AdapterInfo, Backend, DeviceType};

/// The best of `adapters` that can present to `surface` (any, if there is none); the signature is the one
/// that eframe's `native_adapter_selector` takes.
///
/// # Errors
/// Says why nothing was chosen.
pub fn choose_adapter(
    adapters: &[wgpu::Adapter],
    surface: Option<&wgpu::Surface<'_>>,
) -> Result<wgpu::Adapter, String> {
    if adapters.is_empty() {
        return Err("no driver offers one".to_owned());
    }
    let presents =
        |adapter: &&wgpu::Adapter| surface.is_none_or(|surface| adapter.is_surface_supported(surface));
    let best = adapters.iter().filter(presents).min_by_key(|adapter| rank(&adapter.get_info()));
    best.cloned().ok_or_else(|| "none of those present can draw to this window".to_owned())
}

/// An adapter of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundAdapter {
    /// As [`describe_adapter`] words it.
    pub description: String,
    /// Longest edge of a texture, in texels.
    pub texture_edge_max: u32,
    /// Whether it draws on the CPU.
    pub is_software: bool,
    /// Whether [`crate::Gpu::headless`] would take it.
    pub is_chosen: bool,
}

/// Every adapter that drivers other than GL offer, whose libraries would complain where there is no display.
pub fn list_adapters() -> Vec<FoundAdapter> {
    let adapters = crate::adapters_of(wgpu::Backends::PRIMARY);
    let chosen = choose_adapter(&adapters, None).ok().map(|adapter| adapter.get_info());
    let found = adapters.iter().map(|adapter| {
        let info = adapter.get_info();
        FoundAdapter {
            description: describe_adapter(&info),
            texture_edge_max: adapter.limits().max_texture_dimension_2d,
            is_software: info.device_type == DeviceType::Cpu,
            is_chosen: chosen.as_ref() == Some(&info),
        }
    });
    found.collect()
}

/// Smaller is better: hardware before software, then explicit interfaces before GL, then power.
pub(crate) fn rank(info: &AdapterInfo) -> (bool, bool, u8) {
    let power = match info.device_type {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        DeviceType::Other => 3,
        DeviceType::Cpu => 4,
    };
    (info.device_type == DeviceType::Cpu, info.backend == Backend::Gl, power)
}

/// Asks for what the adapter has: its own limits, filtering of 32-bit floats, and clocks around passes, where they are offered.
pub fn device_descriptor(adapter: &wgpu::Adapter) -> wgpu::DeviceDescriptor<'static> {
    wgpu::DeviceDescriptor {
        label: Some("kiln"),
        required_features: adapter.features()
            & (wgpu::Features::FLOAT32_FILTERABLE | wgpu::Features::TIMESTAMP_QUERY),
        required_limits: adapter.limits(),
        ..Default::default()
    }
}

/// Name, backend and driver of an adapter in one line.
pub fn describe_adapter(info: &AdapterInfo) -> String {
    let driver = [info.driver.trim(), info.driver_info.trim()];
    let driver = driver.iter().filter(|part| !part.is_empty()).copied().collect::<Vec<_>>().join(" ");
    let name = if info.name.is_empty() { "unnamed adapter" } else { info.name.trim() };
    if driver.is_empty() {
        format!("{name}, {}", backend_name(info.backend))
    } else {
        format!("{name}, {}, {driver}", backend_name(info.backend))
    }
}

fn backend_name(backend: Backend) -> &'static str {
    match backend {
        Backend::Vulkan => "Vulkan",
        Backend::Metal => "Metal",
        Backend::Dx12 => "Direct3D 12",
        Backend::Gl => "OpenGL",
        Backend::BrowserWebGpu => "WebGPU",
        Backend::Noop => "no-op",
    }
}
