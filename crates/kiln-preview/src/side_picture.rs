//! One picture of the window: a renderer, what it shows, and egui's handle on it.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

use eframe::egui_wgpu::RenderState;
use egui::TextureId;
use kiln_gpu::Gpu;

use crate::prepare::Prepared;
use crate::renderer::Renderer;
use crate::scaling::{FrameQuality, Scaling};
use crate::view::View;

/// Soon after a frame is done somebody has to look.
const FRAME_ASK_INTERVAL: Duration = Duration::from_millis(2);

/// Draws only when what it shows or how it is seen has changed, and no earlier than the frame before is done: a queue of
/// frames would only make them late. While things move a pixel may have fewer samples and the picture fewer
/// pixels than its place.
pub(crate) struct SidePicture {
    gpu: Gpu,
    pub renderer: Renderer,
    texture: Option<TextureId>,
    prepared: Option<Arc<Prepared>>,
    drawn: Option<View>,
    /// Counts frames.
    pub frame: u64,
    scaling: Scaling,
    /// Width and height of the place, in pixels.
    size: [u32; 2],
    /// What the last frame was drawn with.
    quality: FrameQuality,
    /// How long the frame took that was submitted with this quality, when it is done.
    in_flight: Option<(FrameQuality, Receiver<f64>)>,
}

impl SidePicture {
    /// An empty picture.
    pub fn new(gpu: &Gpu) -> Self {
        SidePicture {
            gpu: gpu.clone(),
            renderer: Renderer::new(gpu, [1, 1]),
            texture: None,
            prepared: None,
            drawn: None,
            frame: 0,
            scaling: Scaling::new(),
            size: [1, 1],
            quality: FrameQuality::WHOLE,
            in_flight: None,
        }
    }

    /// Makes its place this wide and high in pixels; egui's name for it.
    pub fn fit(&mut self, render_state: &RenderState, size: [u32; 2]) -> TextureId {
        if self.size != size {
            (self.size, self.drawn) = (size, None);
        }
        match self.texture {
            Some(texture) => texture,
            None => self.register(render_state),
        }
    }

    fn register(&mut self, render_state: &RenderState) -> TextureId {
        let mut egui_renderer = render_state.renderer.write();
        // One texel a pixel: nothing to filter.
        let filter =
            if self.quality.scale >= 1.0 { wgpu::FilterMode::Nearest } else { wgpu::FilterMode::Linear };
        let (device, view) = (&self.gpu.device, self.renderer.output_view());
        if let Some(id) = self.texture {
            egui_renderer.update_egui_texture_from_wgpu_texture(device, view, filter, id);
        }
        *self.texture.get_or_insert_with(|| egui_renderer.register_native_texture(device, view, filter))
    }

    /// Replaces what is shown, if it is something else.
    pub fn show(&mut self, prepared: &Arc<Prepared>) {
        if !self.prepared.as_ref().is_some_and(|shown| Arc::ptr_eq(shown, prepared)) {
            self.renderer.show(Arc::clone(prepared));
            (self.prepared, self.drawn) = (Some(Arc::clone(prepared)), None);
            self.scaling.forget();
        }
    }

    /// Draws if something changed; whether it did.
    pub fn draw(&mut self, context: &egui::Context, render_state: &RenderState, view: &View) -> bool {
        let now = Instant::now();
        let is_new = self.drawn.as_ref() != Some(view);
        if is_new && self.drawn.is_some() {
            self.scaling.change(now);
        }
        let mut quality = self.scaling.quality(now);
        if view.fault_limit.is_some() {
            // A fault is one of a sample.
            quality.sample_count = FrameQuality::WHOLE.sample_count;
        }
        let FrameQuality { scale, sample_count } = quality;
        let is_coarse = !self.is_whole() && quality == FrameQuality::WHOLE;
        if let Some(left) = self.scaling.rest_in(now) {
            context.request_repaint_after(left);
        }
        if self.in_flight.is_some() {
            context.request_repaint_after(FRAME_ASK_INTERVAL);
            return false;
        }
        if !is_new && !is_coarse {
            return false;
        }
        let is_other_filter = (scale >= 1.0) != (self.quality.scale >= 1.0);
        let size = self.size.map(|pixels| ((f64::from(pixels) * scale).round() as u32).max(1));
        (self.quality, self.drawn) = (quality, Some(view.clone()));
        if self.renderer.resize_sampled(size, sample_count) || is_other_filter {
            self.register(render_state);
        }
        let begun = Instant::now();
        if self.renderer.render(view).is_none() {
            return false;
        }
        self.frame += 1;
        let (sender, done) = channel();
        self.gpu.queue.on_submitted_work_done(move || {
            // A receiver that is gone belongs to a window that is gone.
            let _ = sender.send(begun.elapsed().as_secs_f64() * 1e3);
        });
        self.in_flight = Some((quality, done));
        context.request_repaint_after(FRAME_ASK_INTERVAL);
        true
    }

    /// How long the last frame took, once, when it is done.
    pub fn take_frame_ms(&mut self) -> Option<f64> {
        let (quality, done) = self.in_flight.as_ref()?;
        match done.try_recv() {
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                self.in_flight = None;
                None
            }
            Ok(ms) => {
                self.scaling.note(*quality, ms);
                self.in_flight = None;
                Some(ms)
            }
        }
    }

    /// Whether the last frame has all samples for each pixel of its place.
    pub fn is_whole(&self) -> bool {
        self.quality == FrameQuality::WHOLE
    }

    /// What moving frames are drawn with.
    pub fn moving_quality(&self) -> FrameQuality {
        self.scaling.moving_quality()
    }

    /// Another picture has posed what both draw.
    pub fn forget_pose(&mut self) {
        self.renderer.forget_pose();
    }

    /// What is shown.
    pub fn prepared(&self) -> Option<&Arc<Prepared>> {
        self.prepared.as_ref()
    }

    /// How the last frame was seen.
    pub fn drawn(&self) -> Option<&View> {
        self.drawn.as_ref()
    }

    /// Gives egui's handle back.
    pub fn release(&mut self, render_state: &RenderState) {
        if let Some(texture) = self.texture.take() {
            render_state.renderer.write().free_texture(&texture);
        }
    }
}
