//! A window without a display: egui draws into a texture, and the live picture into it.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::channel;

use eframe::egui_wgpu::{RenderState, Renderer, RendererOptions, ScreenDescriptor};
use egui::{Event, RawInput, Rect, Ui, ViewportId, vec2};
use image::RgbaImage;
use kiln_gpu::Gpu;
use kiln_link::{FrameReport, Revision};

use crate::frame_watcher::FrameWatcher;
use crate::live_picture::LivePicture;
use crate::panel::{self, Connection, PanelState};
use crate::prepare::Preparer;
use crate::theme;
use crate::view::{Selection, View};
use crate::worker::{Ready, unix_ms};

/// The parts of a window, without threads for wire and preparation.
pub struct Offscreen {
    gpu: Gpu,
    context: egui::Context,
    render_state: RenderState,
    target: wgpu::Texture,
    scale: f32,
    frames: u32,
    preparer: Preparer,
    pub picture: LivePicture,
    pub panels: PanelState,
    pub reports: std::sync::mpsc::Receiver<FrameReport>,
}

impl Offscreen {
    /// `size` in pixels; `scale` in pixels a point; screenshots go into `folder`.
    pub fn new(gpu: &Gpu, size: [u32; 2], scale: f32, folder: PathBuf) -> Self {
        let context = egui::Context::default();
        theme::apply(&context);
        let format = wgpu::TextureFormat::Rgba8Unorm;
        let renderer = Renderer::new(&gpu.device, format, RendererOptions::PREDICTABLE);
        let render_state = RenderState {
            adapter: gpu.adapter.clone(),
            available_adapters: Vec::new(),
            instance: wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle()),
            device: gpu.device.clone(),
            queue: gpu.queue.clone(),
            target_format: format,
            renderer: Arc::new(egui::mutex::RwLock::new(renderer)),
        };
        let target = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("window"),
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let (sender, reports) = channel();
        let watcher =
            FrameWatcher::spawn(move |report| drop(sender.send(report)), || ()).expect("a thread starts");
        let picture = LivePicture::new(gpu.clone(), render_state.clone(), watcher, folder, &context);
        let mut panels = PanelState::new(gpu.description(), Selection::default(), View::default());
        panels.connection = Connection::Connected;
        panels.project = "demo".to_owned();
        Offscreen {
            gpu: gpu.clone(),
            context,
            render_state,
            target,
            scale,
            frames: 0,
            preparer: Preparer::new(gpu),
            picture: picture.expect("threads start"),
            panels,
            reports,
        }
    }

    /// Shows a revision, as the window does.
    pub fn apply(&mut self, revision: &Revision) {
        let received_unix_ms = unix_ms();
        self.panels.receive(&revision.table, received_unix_ms);
        let parameters = self.panels.view.parameters.overrides();
        let prepared = self.preparer.prepare(revision, &self.panels.selection, &parameters);
        let prepared = Arc::new(prepared.expect("the device takes the built-in tonemap"));
        let is_new = prepared.report.revision != self.panels.report.revision;
        self.panels.adopt(prepared.report.clone());
        self.picture.replace(Ready { prepared, received_unix_ms, ready_unix_ms: unix_ms() }, is_new);
    }

    /// One frame of the window, after `events`.
    pub fn frame(&mut self, events: Vec<Event>) {
        let [width, height] = [self.target.width(), self.target.height()].map(|side| side as f32);
        let mut input = RawInput {
            screen_rect: Some(Rect::from_min_size(egui::Pos2::ZERO, vec2(width, height) / self.scale)),
            time: Some(f64::from(self.frames) / 60.0),
            events,
            ..RawInput::default()
        };
        input.viewports.entry(ViewportId::ROOT).or_default().native_pixels_per_point = Some(self.scale);
        self.frames += 1;
        let Offscreen { context, picture, panels, .. } = self;
        let mut output = context.run_ui(input, |ui: &mut Ui| {
            panel::show(ui, panels, |ui, state| picture.show(ui, state));
        });
        self.paint(&mut output);
        for finished in self.picture.finished() {
            self.panels.history.note_frame(&finished.report);
        }
    }

    fn paint(&mut self, output: &mut egui::FullOutput) {
        let (device, queue) = (&self.gpu.device, &self.gpu.queue);
        let mut renderer = self.render_state.renderer.write();
        for (id, deltas) in output.textures_delta.set.drain() {
            for delta in deltas {
                renderer.update_texture(device, queue, id, &delta);
            }
        }
        let scale = self.context.pixels_per_point();
        let screen = ScreenDescriptor {
            pixels_per_point: scale,
            size_in_pixels: [self.target.width(), self.target.height()],
        };
        let jobs = self.context.tessellate(std::mem::take(&mut output.shapes), scale);
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let buffers = renderer.update_buffers(device, queue, &mut encoder, &jobs, &screen);
        let view = self.target.create_view(&wgpu::TextureViewDescriptor::default());
        let attachment = wgpu::RenderPassColorAttachment {
            view: &view,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                store: wgpu::StoreOp::Store,
            },
            depth_slice: None,
        };
        let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(attachment)],
            ..Default::default()
        });
        renderer.render(&mut pass.forget_lifetime(), &jobs, &screen);
        queue.submit(buffers.into_iter().chain([encoder.finish()]));
        for id in output.textures_delta.free.drain() {
            renderer.free_texture(&id);
        }
    }

    /// What the window shows. With `KILN_PICTURES` set it is written there under `name`, for people to look at.
    pub fn picture_of(&self, name: &str) -> RgbaImage {
        let bytes = self.gpu.read_texture(&self.target, 0).expect("the device reads back");
        let picture = RgbaImage::from_raw(self.target.width(), self.target.height(), bytes);
        let picture = picture.expect("the picture is whole");
        if let Some(folder) = std::env::var_os("KILN_PICTURES") {
            let path = PathBuf::from(folder).join(format!("{name}.png"));
            picture.save(path).expect("the folder can be written");
        }
        picture
    }

    /// Frames until `is_done`, while threads work; fails after a while.
    pub fn frames_until(&mut self, what: &str, is_done: impl Fn(&Offscreen) -> bool) {
        let start = std::time::Instant::now();
        while !is_done(self) {
            assert!(
                start.elapsed() < std::time::Duration::from_secs(60),
                "{what} did not happen within a minute"
            );
            self.frame(Vec::new());
            // Waits for the device and so for the threads that wait for it.
            self.gpu.wait().expect("the device lives");
        }
    }
}
