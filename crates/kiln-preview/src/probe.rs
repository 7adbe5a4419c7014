//! What a frame holds at one pixel, read back without waiting for it.

use std::sync::mpsc::{Receiver, TryRecvError, channel};

use glam::{Mat4, Vec3};
use kiln_gpu::Gpu;
use wgpu::util::{BufferInitDescriptor, DeviceExt as _};

use crate::channel::Channel;
use crate::inspector::ANSWER_LIMIT;

/// Size of `Answer` in `probe.wgsl`.
const ANSWER_BYTES: u64 = 48;
/// Where samples lie in a pixel: the standard places of Vulkan, Direct3D and Metal for four.
const SAMPLE_PLACES: [[f32; 2]; 4] = [[0.375, 0.125], [0.875, 0.375], [0.125, 0.625], [0.625, 0.875]];
/// Luminance that cameras expose to the middle: 18 % of white.
const MIDDLE_GREY: f32 = 0.18;

/// A pixel of a frame.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct PixelProbe {
    /// Column and row from the upper left.
    pub pixel: [u32; 2],
    /// Linear radiance before exposure; of a channel that is radiance, its share. `None` while values are shown.
    pub radiance: Option<[f32; 3]>,
    /// Relative luminance of it.
    pub luminance: Option<f32>,
    /// Stops of the exposed luminance above middle grey, 18 %; `None` where there is no light.
    pub ev_above_middle_grey: Option<f32>,
    /// The channel that is shown and its value there, 16-bit floats; `None` where nothing has one.
    pub channel: Option<(Channel, Option<Vec<f32>>)>,
    /// Shown red, green and blue, sRGB-encoded, of 255.
    pub srgb: [u8; 3],
    /// Depth of the nearest sample, 0 near to 1 far; `None` where the scene is not.
    pub depth: Option<f32>,
    /// Where that sample is in the world.
    pub position: Option<[f32; 3]>,
}

/// What is known of the frame that is asked.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ProbedFrame<'a> {
    /// Radiance or values of a channel.
    pub values: &'a wgpu::TextureView,
    pub output: &'a wgpu::TextureView,
    pub depth: &'a wgpu::TextureView,
    pub channel: Option<Channel>,
    pub world_from_clip: Mat4,
    pub exposure_ev: f32,
    pub size: [u32; 2],
}

/// Asks frames about pixels.
#[derive(Debug)]
pub(crate) struct Prober {
    pipeline: wgpu::ComputePipeline,
}

/// A question on its way.
#[derive(Debug)]
pub(crate) struct PendingProbe {
    readback: wgpu::Buffer,
    mapped: Receiver<Result<(), wgpu::BufferAsyncError>>,
    pixel: [u32; 2],
    channel: Option<Channel>,
    world_from_clip: Mat4,
    exposure_ev: f32,
    size: [u32; 2],
}

impl Prober {
    /// Makes the pipeline; `None` where the device runs no compute passes.
    pub fn new(gpu: &Gpu) -> Option<Self> {
        let flags = gpu.adapter.get_downlevel_capabilities().flags;
        if !flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS) {
            return None;
        }
        let module = gpu.device.create_shader_module(wgpu::include_wgsl!("probe.wgsl"));
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("probe"),
            layout: None,
            module: &module,
            entry_point: None,
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        Some(Prober { pipeline })
    }

    /// Asks about a pixel of the last frame that was submitted; it must lie within.
    pub fn ask(&self, gpu: &Gpu, pixel: [u32; 2], frame: ProbedFrame<'_>) -> PendingProbe {
        let buffer = |label, usage| {
            let mapped_at_creation = false;
            let (label, size) = (Some(label), ANSWER_BYTES);
            gpu.device.create_buffer(&wgpu::BufferDescriptor { label, size, usage, mapped_at_creation })
        };
        let question = gpu.device.create_buffer_init(&BufferInitDescriptor {
            label: Some("question"),
            contents: bytemuck::cast_slice(&[pixel[0], pixel[1], 0, 0]),
            usage: wgpu::BufferUsages::UNIFORM,
        });
        let answer = buffer("answer", wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        let readback = buffer("answer", wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ);
        let view = wgpu::BindingResource::TextureView;
        let resources = [
            question.as_entire_binding(),
            view(frame.values),
            view(frame.output),
            view(frame.depth),
            answer.as_entire_binding(),
        ];
        let entry = |(binding, resource): (u32, _)| wgpu::BindGroupEntry { binding, resource };
        let entries: Vec<_> = (0..).zip(resources).map(entry).collect();
        let layout = &self.pipeline.get_bind_group_layout(0);
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("probe"),
            layout,
            entries: &entries,
        });
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(1, 1, 1);
        }
        encoder.copy_buffer_to_buffer(&answer, 0, &readback, 0, ANSWER_BYTES);
        gpu.queue.submit([encoder.finish()]);
        let (sender, mapped) = channel();
        // A receiver that is gone no longer needs the answer.
        readback.map_async(wgpu::MapMode::Read, .., move |result| drop(sender.send(result)));
        let ProbedFrame { channel, world_from_clip, exposure_ev, size, .. } = frame;
        PendingProbe { readback, mapped, pixel, channel, world_from_clip, exposure_ev, size }
    }
}

impl PendingProbe {
    /// The answer of a device that has done its work: another thread that polls it may still be about to deliver it.
    pub fn wait(self) -> Option<PixelProbe> {
        matches!(self.mapped.recv_timeout(ANSWER_LIMIT), Ok(Ok(()))).then(|| self.read())?
    }

    /// The answer: `Err` while it is on its way, `Ok(None)` if it will never come.
    pub fn take(self, gpu: &Gpu) -> Result<Option<PixelProbe>, PendingProbe> {
        // Only moves finished work along; a lost device shows elsewhere.
        drop(gpu.device.poll(wgpu::PollType::Poll));
        match self.mapped.try_recv() {
            Err(TryRecvError::Empty) => Err(self),
            Ok(Ok(())) => Ok(self.read()),
            Ok(Err(_)) | Err(TryRecvError::Disconnected) => Ok(None),
        }
    }

    fn read(&self) -> Option<PixelProbe> {
        let bytes = self.readback.get_mapped_range(..).ok()?;
        let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().unwrap_or_default());
        let floats: Vec<f32> = bytes.chunks_exact(4).map(number).collect();
        let [value, display] = [0, 4].map(|at| [floats[at], floats[at + 1], floats[at + 2], floats[at + 3]]);
        let sample = SAMPLE_PLACES.get(floats[9].to_bits() as usize).copied().unwrap_or([0.5; 2]);
        Some(self.describe(value, display, (floats[8], sample)))
    }

    fn describe(&self, value: [f32; 4], display: [f32; 4], (depth, place): (f32, [f32; 2])) -> PixelProbe {
        let [red, green, blue, alpha] = value;
        let is_value = self.channel.is_some_and(|channel| !channel.is_radiance());
        let radiance = (!is_value).then_some([red, green, blue]);
        let luminance = radiance.map(|[red, green, blue]| 0.2126 * red + 0.7152 * green + 0.0722 * blue);
        let stops = |luminance: f32| (luminance / MIDDLE_GREY).log2() + self.exposure_ev;
        let channel = self.channel.map(|channel| {
            let share = if is_value { alpha } else { 1.0 };
            let components = [red, green, blue].map(|component| component / share);
            (channel, (share > 0.0).then(|| components[..channel.component_count()].to_vec()))
        });
        let depth = (depth < 1.0).then_some(depth);
        PixelProbe {
            pixel: self.pixel,
            radiance,
            luminance,
            ev_above_middle_grey: luminance.filter(|luminance| *luminance > 0.0).map(stops),
            channel,
            srgb: [0, 1, 2].map(|index| (display[index] * 255.0).round() as u8),
            depth,
            position: depth.map(|depth| self.position(depth, place).to_array()),
        }
    }

    /// The place in the world of a place in the pixel at a depth.
    fn position(&self, depth: f32, place: [f32; 2]) -> Vec3 {
        let share = |axis: usize| (self.pixel[axis] as f32 + place[axis]) / self.size[axis] as f32;
        self.world_from_clip.project_point3(Vec3::new(2.0 * share(0) - 1.0, 1.0 - 2.0 * share(1), depth))
    }
}
