//! The picture in the window: drawn when something changed, turned by the hand.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

use eframe::egui_wgpu::RenderState;
use egui::load::SizedTexture;
use egui::{PointerButton, Response, Sense, Ui};
use kiln_gpu::Gpu;

use crate::frame_watcher::{FrameWatcher, Watched};
use crate::live_probe::LiveProbe;
use crate::panel::{Findings, PanelState};
use crate::renderer::Renderer;
use crate::scaling::Scaling;
use crate::view::View;
use crate::worker::Ready;

/// The renderer's picture as a texture of egui.
pub(crate) struct LivePicture {
    gpu: Gpu,
    render_state: RenderState,
    renderer: Renderer,
    watcher: FrameWatcher,
    texture: Option<egui::TextureId>,
    /// What the picture shows; drawn again only when this changes.
    drawn: Option<View>,
    /// The revision whose first frame is still to be drawn.
    first_frame_of: Option<Ready>,
    started: Instant,
    scaling: Scaling,
    /// Width and height of the place, in pixels.
    size: [u32; 2],
    /// Share of it that the picture has.
    scale: f64,
    /// How long the frame took that was submitted with this scale, when it is done.
    in_flight: Option<(f64, Receiver<f64>)>,
    /// Counts frames.
    frame: u64,
    probe: LiveProbe,
}

impl LivePicture {
    /// An empty picture.
    pub fn new(gpu: Gpu, render_state: RenderState, watcher: FrameWatcher) -> Self {
        let mut renderer = Renderer::new(&gpu, [1, 1]);
        renderer.keeps_depth = true;
        LivePicture {
            renderer,
            gpu,
            render_state,
            watcher,
            texture: None,
            drawn: None,
            first_frame_of: None,
            started: Instant::now(),
            scaling: Scaling::new(),
            size: [1, 1],
            scale: 1.0,
            in_flight: None,
            frame: 0,
            probe: LiveProbe::default(),
        }
    }

    /// Replaces what is shown; `is_new` if it is another revision than before, whose first frame is reported.
    pub fn replace(&mut self, ready: Ready, is_new: bool) {
        self.renderer.show(Arc::clone(&ready.prepared));
        self.drawn = None;
        self.scaling.forget();
        self.first_frame_of = is_new.then_some(ready).or(self.first_frame_of.take());
    }

    /// From noticing the change to the picture of the newest revision, once.
    pub fn latency_ms(&self) -> Option<f64> {
        self.watcher.latency_ms()
    }

    /// Draws if something changed, and reacts to the hand.
    pub fn show(&mut self, ui: &mut Ui, state: &mut PanelState) {
        let space = ui.available_size();
        let pixels = (space * ui.ctx().pixels_per_point()).round();
        let size = [pixels.x as u32, pixels.y as u32];
        if self.size != size {
            self.size = size;
            self.drawn = None;
        }
        if self.texture.is_none() {
            self.register_picture();
        }
        let Some(texture) = self.texture else { return };
        let image = egui::Image::new(SizedTexture::new(texture, space)).sense(Sense::click_and_drag());
        let response = ui.add(image);
        self.control_camera(ui, &response, &mut state.view);
        if self.renderer.shown().is_some_and(|prepared| prepared.is_animated) {
            state.view.time_s = self.started.elapsed().as_secs_f32();
            ui.ctx().request_repaint();
        }
        self.take_findings(&mut state.findings);
        self.draw(ui, &state.view, state.work.noticed_unix_ms);
        if self.scale >= 1.0 {
            let (renderer, frame) = ((&self.gpu, &self.renderer), (self.frame, self.renderer.size()));
            self.probe.update(ui, &response, renderer, frame, &mut state.findings.probe);
        }
    }

    /// What frames before told by now.
    fn take_findings(&mut self, findings: &mut Findings) {
        // Only moves finished work along; a lost device shows elsewhere.
        drop(self.gpu.device.poll(wgpu::PollType::Poll));
        if let Some((scale, done)) = &self.in_flight {
            match done.try_recv() {
                Err(TryRecvError::Empty) => {}
                Err(TryRecvError::Disconnected) => self.in_flight = None,
                Ok(ms) => {
                    self.scaling.note(*scale, ms);
                    findings.frame_ms = Some(ms);
                    self.in_flight = None;
                }
            }
        }
        let inspector = self.renderer.inspector();
        if let Some(times) = inspector.take_pass_times(Duration::ZERO) {
            findings.pass_times = times;
        }
        if let Some(faults) = inspector.take_faults(Duration::ZERO) {
            findings.faults = Some(faults);
        }
        findings.scale = self.scaling.moving_scale() as f32;
    }

    /// Draws if something changed, and no earlier than the frame before is done: a queue of frames would only make them late.
    /// While things move the picture may be smaller than its place.
    fn draw(&mut self, ui: &Ui, view: &View, noticed_unix_ms: f64) {
        let now = Instant::now();
        let is_new = self.drawn.as_ref() != Some(view);
        let is_change = is_new && self.drawn.is_some();
        if is_change {
            self.scaling.change(now);
        }
        let scale = self.scaling.scale(now);
        let is_coarse = self.scale < 1.0 && scale >= 1.0;
        if let Some(left) = self.scaling.rest_in(now) {
            ui.ctx().request_repaint_after(left);
        }
        if self.in_flight.is_some() {
            // Wakes up soon after the frame is done.
            return ui.ctx().request_repaint_after(Duration::from_millis(2));
        }
        if !is_new && !is_coarse {
            return;
        }
        let size = self.size.map(|pixels| ((f64::from(pixels) * scale).round() as u32).max(1));
        if self.renderer.resize(size) {
            self.register_picture();
        }
        (self.scale, self.drawn) = (scale, Some(view.clone()));
        let begun = Instant::now();
        if self.renderer.render(view).is_none() {
            return;
        }
        self.frame += 1;
        let (sender, done) = channel();
        self.gpu.queue.on_submitted_work_done(move || {
            // A receiver that is gone belongs to a window that is gone.
            let _ = sender.send(begun.elapsed().as_secs_f64() * 1e3);
        });
        self.in_flight = Some((scale, done));
        ui.ctx().request_repaint_after(Duration::from_millis(2));
        if let Some(ready) = self.first_frame_of.take() {
            self.watcher.watch(Watched { submitted: self.gpu.submitted(), ready, noticed_unix_ms });
        }
    }

    fn register_picture(&mut self) {
        let mut egui_renderer = self.render_state.renderer.write();
        let (device, view) = (&self.gpu.device, self.renderer.output_view());
        let filter = wgpu::FilterMode::Linear;
        match self.texture {
            Some(id) => egui_renderer.update_egui_texture_from_wgpu_texture(device, view, filter, id),
            None => self.texture = Some(egui_renderer.register_native_texture(device, view, filter)),
        }
    }

    fn control_camera(&self, ui: &Ui, response: &Response, view: &mut View) {
        if response.double_clicked() {
            view.camera = None;
        }
        let scroll = if response.hovered() { ui.input(|input| input.smooth_scroll_delta().y) } else { 0.0 };
        let drag = response.drag_delta() / response.rect.height().max(1.0);
        if drag == egui::Vec2::ZERO && scroll == 0.0 {
            return;
        }
        let Some(mut camera) = self.renderer.camera(view) else { return };
        let is_pan = !response.dragged_by(PointerButton::Primary) || ui.input(|input| input.modifiers.shift);
        if is_pan {
            camera.pan(-drag.x, drag.y);
        } else {
            // Half a turn for a drag over the picture's height.
            camera.orbit(-drag.x * std::f32::consts::PI, drag.y * std::f32::consts::PI);
        }
        camera.dolly((-scroll * 0.002).exp());
        view.camera = Some(camera);
    }
}
