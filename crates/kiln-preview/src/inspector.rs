//! What is found out about frames besides their pictures: times of passes, values of pixels, marks on what is wrong.

use std::cell::{Cell, OnceCell};
use std::time::Duration;

use glam::Mat4;
use kiln_gpu::Gpu;

use crate::channel::Channel;
use crate::faults::{FaultCounts, FaultOverlay};
use crate::inspect::ChannelDisplay;
use crate::pass_timer::{PassTime, PassTimer};
use crate::picture::Picture;
use crate::probe::{PendingProbe, ProbedFrame, Prober};

/// How long an answer of a device that is done may take to be delivered.
pub(crate) const ANSWER_LIMIT: Duration = Duration::from_secs(10);

/// Makes what it needs when somebody first asks for it.
#[derive(Debug)]
pub(crate) struct Inspector {
    pub timer: Option<PassTimer>,
    channel_display: OnceCell<ChannelDisplay>,
    /// `None` inside: the device cannot.
    fault_overlay: OnceCell<Option<FaultOverlay>>,
    prober: OnceCell<Option<Prober>>,
    last: Cell<Option<LastFrame>>,
}

/// The frame that was submitted last.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LastFrame {
    pub channel: Option<Channel>,
    pub world_from_clip: Mat4,
    pub exposure_ev: f32,
}

impl Inspector {
    /// Has the clocks, nothing else yet.
    pub fn new(gpu: &Gpu) -> Self {
        Inspector {
            timer: PassTimer::new(gpu),
            channel_display: OnceCell::new(),
            fault_overlay: OnceCell::new(),
            prober: OnceCell::new(),
            last: Cell::new(None),
        }
    }

    /// A frame begins.
    pub fn begin(&self) {
        self.timer.iter().for_each(PassTimer::begin);
    }

    /// The clocks of the next pass.
    pub fn timed(&self, pass: &'static str) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        self.timer.as_ref()?.pass(pass)
    }

    /// All passes of the frame are recorded.
    pub fn end(&self, encoder: &mut wgpu::CommandEncoder) {
        self.timer.iter().for_each(|timer| timer.end(encoder));
    }

    /// They are on their way.
    pub fn submitted(&self) {
        self.timer.iter().for_each(PassTimer::submitted);
    }

    /// What probes are about from now on.
    pub fn note_frame(&self, frame: LastFrame) {
        self.last.set(Some(frame));
    }

    /// The times of the last timed frame, once, when they are there.
    pub fn take_pass_times(&self, limit: Duration) -> Option<Vec<PassTime>> {
        self.timer.as_ref()?.take(limit)
    }

    /// The counts of the last marked frame, once, when they are there.
    pub fn take_faults(&self, limit: Duration) -> Option<FaultCounts> {
        self.fault_overlay.get()?.as_ref()?.take(limit)
    }

    /// Draws the values of a channel as a picture.
    pub fn display(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        picture: &Picture,
        channel: Channel,
    ) {
        let display = self.channel_display.get_or_init(|| ChannelDisplay::new(gpu));
        let group = display.bind(gpu, &picture.hdr, channel.encoding());
        let mut pass = output_pass(encoder, picture, wgpu::LoadOp::default());
        display.draw(&mut pass, &group);
    }

    /// Marks what is wrong with the samples on the finished picture; `None` where the device cannot.
    pub fn mark_faults(
        &self,
        gpu: &Gpu,
        mut encoder: wgpu::CommandEncoder,
        picture: &Picture,
        radiance_max: f32,
        are_classified: bool,
    ) -> Option<wgpu::SubmissionIndex> {
        let overlay = self.fault_overlay.get_or_init(|| FaultOverlay::new(gpu)).as_ref()?;
        let group = overlay.bind(gpu, &picture.samples, radiance_max, are_classified);
        overlay.begin(&mut encoder);
        {
            let mut pass = output_pass(&mut encoder, picture, wgpu::LoadOp::Load);
            overlay.draw(&mut pass, &group);
        }
        let is_counted = overlay.end(&mut encoder);
        let submission = gpu.queue.submit([encoder.finish()]);
        if is_counted {
            overlay.submitted();
        }
        Some(submission)
    }

    /// Asks about a pixel of the last frame, which lies within it.
    pub fn ask(&self, gpu: &Gpu, picture: &Picture, pixel: [u32; 2]) -> Option<PendingProbe> {
        let prober = self.prober.get_or_init(|| Prober::new(gpu)).as_ref()?;
        let LastFrame { channel, world_from_clip, exposure_ev } = self.last.get()?;
        let frame = ProbedFrame {
            values: &picture.hdr,
            output: &picture.output_view,
            depth: &picture.depth,
            channel,
            world_from_clip,
            exposure_ev,
            size: picture.size,
        };
        Some(prober.ask(gpu, pixel, frame))
    }
}

fn output_pass<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    picture: &Picture,
    load: wgpu::LoadOp<wgpu::Color>,
) -> wgpu::RenderPass<'a> {
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("inspect"),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: &picture.output_view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
        })],
        ..Default::default()
    })
}
