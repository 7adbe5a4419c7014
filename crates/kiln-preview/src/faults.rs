//! The overlay over radiance that no display can show: what is no number, infinite, negative, or beyond a limit.

use std::cell::RefCell;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use kiln_gpu::Gpu;
use wgpu::util::{BufferInitDescriptor, DeviceExt as _};

use crate::inspect::full_screen_pipeline;

const COUNT_BYTES: u64 = 16;

/// Pixels with such radiance. One that has several kinds counts in each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct FaultCounts {
    /// No number. Magenta.
    pub nan: u32,
    /// Infinite; where the shader has no feature `inspect`, also what is beyond 65504. Yellow.
    pub infinite: u32,
    /// Below 0. Blue.
    pub negative: u32,
    /// Beyond the limit. Red.
    pub over_range: u32,
}

impl FaultCounts {
    /// Each kind with its name and colour, sRGB.
    pub(crate) fn rows(self) -> [(&'static str, u32, [u8; 3]); 4] {
        [
            ("NaN", self.nan, [255, 0, 255]),
            ("infinite", self.infinite, [255, 255, 0]),
            ("negative", self.negative, [0, 102, 255]),
            ("over range", self.over_range, [255, 26, 0]),
        ]
    }
}

/// Marks such pixels.
#[derive(Debug)]
pub(crate) struct FaultOverlay {
    pipeline: wgpu::RenderPipeline,
    counts: wgpu::Buffer,
    readback: wgpu::Buffer,
    pending: RefCell<Option<Receiver<Result<(), wgpu::BufferAsyncError>>>>,
}

impl FaultOverlay {
    /// Makes the pipeline; `None` where fragments cannot count.
    pub fn new(gpu: &Gpu) -> Option<Self> {
        let flags = gpu.adapter.get_downlevel_capabilities().flags;
        if !flags.contains(wgpu::DownlevelFlags::FRAGMENT_WRITABLE_STORAGE) {
            return None;
        }
        let module = gpu.device.create_shader_module(wgpu::include_wgsl!("faults.wgsl"));
        let buffer = |usage| {
            let (label, mapped_at_creation) = (Some("fault counts"), false);
            let size = COUNT_BYTES;
            gpu.device.create_buffer(&wgpu::BufferDescriptor { label, size, usage, mapped_at_creation })
        };
        let counted =
            wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        Some(FaultOverlay {
            pipeline: full_screen_pipeline(gpu, "faults", &module, None),
            counts: buffer(counted),
            readback: buffer(wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ),
            pending: RefCell::default(),
        })
    }

    /// What it reads, of samples of one size.
    pub fn bind(
        &self,
        gpu: &Gpu,
        samples: &wgpu::TextureView,
        radiance_max: f32,
        are_classified: bool,
    ) -> wgpu::BindGroup {
        let limits = gpu.device.create_buffer_init(&BufferInitDescriptor {
            label: Some("limits"),
            contents: bytemuck::cast_slice(&[u32::from(are_classified), radiance_max.to_bits(), 0, 0]),
            usage: wgpu::BufferUsages::UNIFORM,
        });
        let view = wgpu::BindingResource::TextureView(samples);
        let entries = [
            wgpu::BindGroupEntry { binding: 0, resource: view },
            wgpu::BindGroupEntry { binding: 1, resource: limits.as_entire_binding() },
            wgpu::BindGroupEntry { binding: 2, resource: self.counts.as_entire_binding() },
        ];
        let layout = &self.pipeline.get_bind_group_layout(0);
        let label = Some("faults");
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label, layout, entries: &entries })
    }

    /// Before a frame's overlay is drawn.
    pub fn begin(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.counts, 0, None);
    }

    /// Draws it over the finished picture.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, group: &wgpu::BindGroup) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.draw(0..3, 0..1);
    }

    /// After it is drawn, unless the counts of an earlier frame are still on their way; true if those of this one come.
    pub fn end(&self, encoder: &mut wgpu::CommandEncoder) -> bool {
        let is_free = self.pending.borrow().is_none();
        if is_free {
            encoder.copy_buffer_to_buffer(&self.counts, 0, &self.readback, 0, COUNT_BYTES);
        }
        is_free
    }

    /// The frame is on its way.
    pub fn submitted(&self) {
        let (sender, mapped) = channel();
        // A receiver that is gone belongs to a renderer that is gone.
        self.readback.map_async(wgpu::MapMode::Read, .., move |result| drop(sender.send(result)));
        *self.pending.borrow_mut() = Some(mapped);
    }

    /// The counts of the last counted frame, once, when they are there.
    /// Waits for them so long.
    pub fn take(&self, limit: Duration) -> Option<FaultCounts> {
        let result = self.pending.borrow().as_ref()?.recv_timeout(limit).ok()?;
        self.pending.borrow_mut().take();
        // What cannot be mapped belongs to a lost device.
        result.ok()?;
        let counts = self.readback.get_mapped_range(..).ok().map(|bytes| {
            let count = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap_or_default());
            FaultCounts { nan: count(0), infinite: count(4), negative: count(8), over_range: count(12) }
        });
        self.readback.unmap();
        counts
    }
}
