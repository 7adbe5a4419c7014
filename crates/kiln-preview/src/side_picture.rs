//! One picture of the window: a renderer, what it shows, and egui's handle on it.

use std::sync::Arc;

use eframe::egui_wgpu::RenderState;
use egui::TextureId;
use kiln_gpu::Gpu;

use crate::prepare::Prepared;
use crate::renderer::Renderer;
use crate::view::View;

/// Draws only when what it shows or how it is seen has changed.
pub(crate) struct SidePicture {
    gpu: Gpu,
    pub renderer: Renderer,
    texture: Option<TextureId>,
    prepared: Option<Arc<Prepared>>,
    drawn: Option<View>,
    /// Counts frames.
    pub frame: u64,
}

impl SidePicture {
    /// An empty picture.
    pub fn new(gpu: &Gpu) -> Self {
        let renderer = Renderer::new(gpu, [1, 1]);
        SidePicture { gpu: gpu.clone(), renderer, texture: None, prepared: None, drawn: None, frame: 0 }
    }

    /// Makes it this wide and high in pixels; egui's name for it.
    pub fn fit(&mut self, render_state: &RenderState, size: [u32; 2]) -> TextureId {
        let is_resized = self.renderer.resize(size);
        if let Some(texture) = self.texture.filter(|_| !is_resized) {
            return texture;
        }
        self.drawn = None;
        let mut egui_renderer = render_state.renderer.write();
        // One texel a pixel: nothing to filter.
        let (device, filter) = (&self.gpu.device, wgpu::FilterMode::Nearest);
        let view = self.renderer.output_view();
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
        }
    }

    /// Draws if something changed; `None` if nothing was drawn.
    pub fn draw(&mut self, view: &View) -> Option<wgpu::SubmissionIndex> {
        if self.drawn.as_ref() == Some(view) {
            return None;
        }
        self.drawn = Some(view.clone());
        self.frame += 1;
        self.renderer.render(view)
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
