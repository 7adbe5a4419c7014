//! The picture in the window: drawn when something changed, turned by the hand.

use std::sync::Arc;
use std::time::Instant;

use eframe::egui_wgpu::RenderState;
use egui::load::SizedTexture;
use egui::{PointerButton, Response, Sense, Ui};
use kiln_gpu::Gpu;

use crate::frame_watcher::{FrameWatcher, Watched};
use crate::panel::PanelState;
use crate::renderer::Renderer;
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
}

impl LivePicture {
    /// An empty picture.
    pub fn new(gpu: Gpu, render_state: RenderState, watcher: FrameWatcher) -> Self {
        LivePicture {
            renderer: Renderer::new(&gpu, [1, 1]),
            gpu,
            render_state,
            watcher,
            texture: None,
            drawn: None,
            first_frame_of: None,
            started: Instant::now(),
        }
    }

    /// Replaces what is shown; `is_new` if it is another revision than before, whose first frame is reported.
    pub fn replace(&mut self, ready: Ready, is_new: bool) {
        self.renderer.show(Arc::clone(&ready.prepared));
        self.drawn = None;
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
        if self.renderer.resize([pixels.x as u32, pixels.y as u32]) || self.texture.is_none() {
            self.drawn = None;
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
        self.draw(&state.view, state.work.noticed_unix_ms);
    }

    fn draw(&mut self, view: &View, noticed_unix_ms: f64) {
        if self.drawn.as_ref() == Some(view) {
            return;
        }
        self.drawn = Some(view.clone());
        if self.renderer.render(view).is_none() {
            return;
        }
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
