//! How long each pass of a frame takes on the device, where it has clocks that passes can read.

use std::cell::{Cell, RefCell};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use kiln_gpu::Gpu;

/// Passes of a frame that are timed.
const PASSES_MAX: u32 = 16;
const BYTES: u64 = 2 * PASSES_MAX as u64 * wgpu::QUERY_SIZE as u64;

/// How long a pass took.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct PassTime {
    /// As `opaque`.
    pub pass: String,
    /// Milliseconds on the device.
    pub ms: f64,
}

/// Clocks around the passes of one frame after another. While the times of one are on their way, others go untimed.
#[derive(Debug)]
pub(crate) struct PassTimer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readback: wgpu::Buffer,
    /// Nanoseconds of a tick.
    period_ns: f64,
    /// Those of the frame that is being recorded.
    passes: RefCell<Vec<&'static str>>,
    is_recording: Cell<bool>,
    pending: RefCell<Option<Pending>>,
}

#[derive(Debug)]
struct Pending {
    passes: Vec<&'static str>,
    mapped: Receiver<Result<(), wgpu::BufferAsyncError>>,
}

impl PassTimer {
    /// `None` if the device has no such clocks.
    pub fn new(gpu: &Gpu) -> Option<Self> {
        if !gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let buffer = |label, usage| {
            let mapped_at_creation = false;
            let label = Some(label);
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label,
                size: BYTES,
                usage,
                mapped_at_creation,
            })
        };
        let copied = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
        Some(PassTimer {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("passes"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * PASSES_MAX,
            }),
            resolved: buffer("pass times", wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            readback: buffer("pass times", copied),
            period_ns: f64::from(gpu.queue.get_timestamp_period()),
            passes: RefCell::default(),
            is_recording: Cell::new(false),
            pending: RefCell::default(),
        })
    }

    /// A frame begins.
    pub fn begin(&self) {
        self.passes.borrow_mut().clear();
        self.is_recording.set(self.pending.borrow().is_none());
    }

    /// The clocks of the next pass.
    pub fn pass(&self, name: &'static str) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        let [first, last] = self.passes(name)?;
        let (beginning_of_pass_write_index, end_of_pass_write_index) = (Some(first), Some(last));
        let query_set = &self.queries;
        Some(wgpu::RenderPassTimestampWrites {
            query_set,
            beginning_of_pass_write_index,
            end_of_pass_write_index,
        })
    }

    /// The clocks before the first and after the last of several passes that count as one.
    pub fn span(&self, name: &'static str) -> Option<[wgpu::RenderPassTimestampWrites<'_>; 2]> {
        let [first, last] = self.passes(name)?;
        let writes = |beginning_of_pass_write_index, end_of_pass_write_index| {
            let query_set = &self.queries;
            wgpu::RenderPassTimestampWrites {
                query_set,
                beginning_of_pass_write_index,
                end_of_pass_write_index,
            }
        };
        Some([writes(Some(first), None), writes(None, Some(last))])
    }

    fn passes(&self, name: &'static str) -> Option<[u32; 2]> {
        let mut passes = self.passes.borrow_mut();
        let index = passes.len() as u32;
        if !self.is_recording.get() || index == PASSES_MAX {
            return None;
        }
        passes.push(name);
        Some([2 * index, 2 * index + 1])
    }

    /// All passes are recorded.
    pub fn end(&self, encoder: &mut wgpu::CommandEncoder) {
        let count = self.passes.borrow().len() as u32;
        if count > 0 {
            encoder.resolve_query_set(&self.queries, 0..2 * count, &self.resolved, 0);
            encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readback, 0, BYTES);
        }
    }

    /// The frame is on its way: its times come when it is done.
    pub fn submitted(&self) {
        self.is_recording.set(false);
        let passes = std::mem::take(&mut *self.passes.borrow_mut());
        if passes.is_empty() {
            return;
        }
        let (sender, mapped) = channel();
        // A receiver that is gone belongs to a renderer that is gone.
        self.readback.map_async(wgpu::MapMode::Read, .., move |result| drop(sender.send(result)));
        *self.pending.borrow_mut() = Some(Pending { passes, mapped });
    }

    /// The times of the last timed frame, once, when they are there.
    /// Waits for them so long.
    pub fn take(&self, limit: Duration) -> Option<Vec<PassTime>> {
        let result = self.pending.borrow().as_ref()?.mapped.recv_timeout(limit).ok()?;
        let Pending { passes, .. } = self.pending.borrow_mut().take()?;
        // What cannot be mapped belongs to a lost device.
        result.ok()?;
        let ticks = self.readback.get_mapped_range(..).ok().map(|bytes| {
            let ticks =
                bytes.chunks_exact(8).map(|tick| u64::from_le_bytes(tick.try_into().unwrap_or_default()));
            ticks.collect::<Vec<u64>>()
        });
        self.readback.unmap();
        let ticks = ticks?;
        let time = |(index, name): (usize, &&str)| PassTime {
            pass: (*name).to_owned(),
            ms: ticks[2 * index + 1].saturating_sub(ticks[2 * index]) as f64 * self.period_ns / 1e6,
        };
        Some(passes.iter().enumerate().map(time).collect())
    }
}
