//! The one wgpu device: adapter choice, errors as data, compute passes, readback.
//!
//! Start at [`Gpu::headless`] for work without a window, or [`Gpu::from_parts`] where a window system made
//! the device (give it [`choose_adapter`] and [`device_descriptor`], so that both ways end at the same one).
//!
//! Conventions: hardware before software, Vulkan/Metal/DX12 before GL (whose cube maps have seams); errors
//! that wgpu reports outside an error scope are kept in [`Gpu::take_errors`], never a panic.
//!
//! Not here: what is drawn (`kiln-preview`), shaders (`kiln-shader`), texel formats (`kiln-image`).

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

pub use adapter::{FoundAdapter, choose_adapter, describe_adapter, device_descriptor, list_adapters};

pub use compute::ComputePass;

pub use submitted::Submitted;

mod adapter;
mod compute;
mod readback;
mod submitted;
#[cfg(test)]
mod tests;

/// Why there is no device, or why it did not do its work.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
pub enum GpuError {
    /// No driver offers an adapter.
    #[error(
        "no graphics adapter was found ({reason}); install a Vulkan driver: for software rendering the package mesa-vulkan-drivers"
    )]
    NoAdapter {
        /// What wgpu said.
        reason: String,
    },
    /// The adapter refused to open a device.
    #[error("adapter {adapter} gives no device: {reason}")]
    NoDevice {
        /// As [`describe_adapter`] words it.
        adapter: String,
        /// What wgpu said.
        reason: String,
    },
    /// A texture cannot be read back.
    #[error("texture of format {format} and {sample_count} samples a texel cannot be read back")]
    NotReadable {
        /// wgpu's name of the format.
        format: String,
        /// More than 1 cannot be copied.
        sample_count: u32,
    },
    /// A compute pass, or what was bound to it, is not what the device takes.
    #[error("the graphics device refuses a compute pass: {reason}")]
    Pass {
        /// What wgpu said.
        reason: String,
    },
    /// The copy or the map failed; the device is most likely lost.
    #[error("reading back from the graphics device failed: {reason}")]
    Readback {
        /// What wgpu said.
        reason: String,
    },
}

/// Messages kept by the error log; later ones are counted, not kept.
const ERRORS_KEPT_MAX: usize = 64;

#[derive(Debug, Default)]
struct Faults {
    errors: Vec<String>,
    dropped: usize,
    lost: Option<String>,
}

/// A device with the adapter it came from. Clones share everything.
#[derive(Clone, Debug)]
pub struct Gpu {
    /// What the device runs on.
    pub adapter: wgpu::Adapter,
    /// Makes resources.
    pub device: wgpu::Device,
    /// Runs commands.
    pub queue: wgpu::Queue,
    faults: Arc<Mutex<Faults>>,
}

impl Gpu {
    /// Opens the best adapter without a window.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`], which names the package to install, and [`GpuError::NoDevice`].
    pub fn headless() -> Result<Self, GpuError> {
        // GL is asked last: its libraries look for a display, and complain where there is none.
        let adapter = adapter_of(wgpu::Backends::PRIMARY)
            .or_else(|_| adapter_of(wgpu::Backends::SECONDARY))
            .map_err(|reason| GpuError::NoAdapter { reason })?;
        let opened = pollster::block_on(adapter.request_device(&device_descriptor(&adapter)));
        let (device, queue) = opened.map_err(|error| GpuError::NoDevice {
            adapter: describe_adapter(&adapter.get_info()),
            reason: error.to_string(),
        })?;
        Ok(Self::from_parts(adapter, device, queue))
    }

    /// Takes over a device that a window system opened; its uncaptured errors go to this log from now on.
    pub fn from_parts(adapter: wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let faults = Arc::new(Mutex::new(Faults::default()));
        let log = Arc::clone(&faults);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| lock(&log).push(error.to_string())));
        let log = Arc::clone(&faults);
        device.set_device_lost_callback(move |reason, message| {
            lock(&log).lost = Some(format!("{reason:?}: {message}"));
        });
        Gpu { adapter, device, queue, faults }
    }

    /// Name, driver and backend in one line, as `llvmpipe (LLVM 15, 256 bits), Vulkan, Mesa 22.3.6`.
    pub fn description(&self) -> String {
        describe_adapter(&self.adapter.get_info())
    }

    /// Whether drawing happens on the CPU, so that costly filtering is not worth its time.
    pub fn is_software(&self) -> bool {
        self.adapter.get_info().device_type == wgpu::DeviceType::Cpu
    }

    /// Bytes of device memory that resources have now; `None` where the driver's allocator does not say.
    pub fn memory_bytes(&self) -> Option<u64> {
        Some(self.device.generate_allocator_report()?.total_allocated_bytes)
    }

    /// Whether textures of 32-bit floats can be filtered.
    pub fn filters_float32(&self) -> bool {
        self.device.features().contains(wgpu::Features::FLOAT32_FILTERABLE)
    }

    /// Errors since the last call that no error scope caught, oldest first.
    pub fn take_errors(&self) -> Vec<String> {
        let mut faults = lock(&self.faults);
        let dropped = std::mem::take(&mut faults.dropped);
        let mut errors = std::mem::take(&mut faults.errors);
        if dropped > 0 {
            errors.push(format!("{dropped} further errors"));
        }
        errors
    }

    /// Why the device is lost, once it is: everything drawn or read from then on is undefined.
    pub fn lost(&self) -> Option<String> {
        lock(&self.faults).lost.clone()
    }

    /// Runs `work` and returns the validation, memory or internal error that it caused on this thread, if any.
    pub fn catch_errors<T>(&self, work: impl FnOnce() -> T) -> (T, Option<String>) {
        let filters =
            [wgpu::ErrorFilter::Internal, wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Validation];
        let scopes = filters.map(|filter| self.device.push_error_scope(filter));
        let result = work();
        // Scopes are a stack: the last one pushed is popped first.
        let errors = scopes.into_iter().rev().filter_map(|scope| pollster::block_on(scope.pop()));
        let first = errors.map(|error| error.to_string()).fold(None, |first, error| first.or(Some(error)));
        (result, first)
    }
}

impl Faults {
    fn push(&mut self, error: String) {
        if self.errors.len() < ERRORS_KEPT_MAX {
            self.errors.push(error);
        } else {
            self.dropped += 1;
        }
    }
}

/// A panic elsewhere leaves the log readable: it holds plain text.
fn adapter_of(backends: wgpu::Backends) -> Result<wgpu::Adapter, String> {
    choose_adapter(&adapters_of(backends), None)
}

fn adapters_of(backends: wgpu::Backends) -> Vec<wgpu::Adapter> {
    let descriptor =
        wgpu::InstanceDescriptor { backends, ..wgpu::InstanceDescriptor::new_without_display_handle() };
    pollster::block_on(wgpu::Instance::new(descriptor).enumerate_adapters(backends))
}

fn lock(faults: &Mutex<Faults>) -> MutexGuard<'_, Faults> {
    faults.lock().unwrap_or_else(PoisonError::into_inner)
}
