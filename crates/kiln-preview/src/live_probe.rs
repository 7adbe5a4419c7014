//! The pixel under the pointer of the live picture, or the one that was pinned.

use egui::{Color32, Rect, Response, Stroke, Ui, vec2};
use kiln_gpu::Gpu;

use crate::probe::{PendingProbe, PixelProbe};
use crate::renderer::Renderer;

/// One question at a time: the newest pixel is asked about when the answer to the last one is there.
#[derive(Debug, Default)]
pub(crate) struct LiveProbe {
    pending: Option<PendingProbe>,
    /// Share of the picture's width and height.
    pinned: Option<[f32; 2]>,
    /// Pixel and frame of the newest answer or question.
    asked: Option<([u32; 2], u64)>,
}

impl LiveProbe {
    /// Takes answers and asks anew. `frame` counts frames; `size` is that of the whole picture.
    pub fn update(
        &mut self,
        ui: &Ui,
        response: &Response,
        (gpu, renderer): (&Gpu, &Renderer),
        (frame, size): (u64, [u32; 2]),
        shown: &mut Option<PixelProbe>,
    ) {
        if response.secondary_clicked() {
            self.pinned = match self.pinned {
                Some(_) => None,
                None => response.interact_pointer_pos().map(|place| share_of(response.rect, place)),
            };
        }
        if let Some(pending) = self.pending.take() {
            match pending.take(gpu) {
                Ok(answer) => *shown = answer.or(shown.take()),
                Err(pending) => self.pending = Some(pending),
            }
        }
        let hovered = response.hover_pos().map(|place| share_of(response.rect, place));
        let Some(place) = self.pinned.or(hovered) else {
            (*shown, self.asked) = (None, None);
            return;
        };
        let pixel = [0, 1].map(|axis| {
            let pixel = (place[axis] * size[axis] as f32) as u32;
            pixel.min(size[axis].saturating_sub(1))
        });
        if self.pending.is_none() && self.asked != Some((pixel, frame)) {
            self.pending = renderer.probe(pixel);
            self.asked = Some((pixel, frame));
        }
        if self.pending.is_some() {
            ui.ctx().request_repaint();
        }
        if let Some(place) = self.pinned {
            mark(ui, response.rect, place);
        }
    }
}

fn share_of(rect: Rect, place: egui::Pos2) -> [f32; 2] {
    let share = (place - rect.min) / rect.size();
    [share.x.clamp(0.0, 1.0), share.y.clamp(0.0, 1.0)]
}

/// A cross that leaves the pixel itself open.
fn mark(ui: &Ui, rect: Rect, [x, y]: [f32; 2]) {
    let center = rect.min + rect.size() * vec2(x, y);
    for (width, color) in [(3.0, Color32::from_black_alpha(160)), (1.0, Color32::WHITE)] {
        for direction in [vec2(1.0, 0.0), vec2(-1.0, 0.0), vec2(0.0, 1.0), vec2(0.0, -1.0)] {
            let line = [center + direction * 4.0, center + direction * 11.0];
            ui.painter().line_segment(line, Stroke::new(width, color));
        }
    }
}
