//! Frames that show what a pixel is made of, and marks on what is wrong with it.

use glam::Vec3;
use kiln_gpu::Gpu;

use super::{Behind, Look, Renderer, Shown, Stage};
use crate::channel::{Channel, FAULTS_CODE};
use crate::inspector::Inspector;
use crate::probe::PendingProbe;
use crate::program::SAMPLE_COUNT;
use crate::uniform::InspectValues;

impl Renderer {
    /// Draws a channel in place of the picture.
    pub(super) fn draw_channel(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        shown: &Shown,
        channel: Channel,
        behind: &Behind<'_>,
        eye: Vec3,
    ) {
        if let (Channel::Transmission, Some(scene_color), Some(downsampler)) =
            (channel, &shown.scene_color, self.downsampler.get())
        {
            self.draw_scene_color(encoder, shown, (scene_color, downsampler), behind, eye);
        }
        write_inspect(&self.gpu, shown, channel.code(), f32::MAX);
        let is_radiance = channel.is_radiance();
        let empty = if is_radiance { wgpu::Color::BLACK } else { wgpu::Color::TRANSPARENT };
        let look = Look {
            label: "channel",
            draws: &shown.prepared.inspect,
            frames: &shown.inspect,
            behind: None,
            blends: is_radiance,
            empty,
            keeps_samples: false,
        };
        self.draw_scene(encoder, shown, &look, Stage::Whole, Some(&self.picture.hdr), eye);
        if is_radiance {
            self.draw_tonemap(encoder, shown);
        } else {
            self.inspector.display(&self.gpu, encoder, &self.picture, channel);
        }
    }

    /// Marks radiance that no display can show in the finished picture, sample by sample. Where the scene's shader can tell, it
    /// is asked, because what it writes may be mended, and 16 bits hide what was infinite.
    pub(super) fn mark_faults(
        &self,
        shown: &Shown,
        radiance_max: f32,
        eye: Vec3,
    ) -> Option<wgpu::SubmissionIndex> {
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let are_classified = !shown.inspect.is_empty();
        if are_classified {
            write_inspect(&self.gpu, shown, FAULTS_CODE, radiance_max);
            let look = Look {
                label: "faults",
                draws: &shown.prepared.inspect,
                frames: &shown.inspect,
                behind: None,
                blends: false,
                empty: wgpu::Color::TRANSPARENT,
                keeps_samples: true,
            };
            self.draw_scene(&mut encoder, shown, &look, Stage::Whole, None, eye);
        }
        self.inspector.mark_faults(&self.gpu, encoder, &self.picture, radiance_max, are_classified)
    }

    /// What was found out about frames, and what asks.
    pub fn inspector(&self) -> &Inspector {
        &self.inspector
    }

    /// Asks about a pixel of the last frame; `None` if it lies outside, or if its depth was not kept.
    pub fn probe(&self, pixel: [u32; 2]) -> Option<PendingProbe> {
        let is_within = (0..2).all(|axis| pixel[axis] < self.picture.size[axis]);
        let has_samples = self.picture.sample_count == SAMPLE_COUNT;
        (is_within && has_samples && self.keeps_depth)
            .then(|| self.inspector.ask(&self.gpu, &self.picture, pixel))?
    }
}

/// Tells the variants that show channels which one.
fn write_inspect(gpu: &Gpu, shown: &Shown, channel: u32, radiance_max: f32) {
    for (frame, binding) in shown.inspect.iter().zip(&shown.prepared.inspect.programs) {
        let variant_color = shown.prepared.report.inspection.color_of(binding.program.name());
        frame.write_inspect(gpu, &InspectValues { channel, radiance_max, variant_color });
    }
}
