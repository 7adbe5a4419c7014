//! The window: panels around the live picture.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context as _, anyhow};
use eframe::egui_wgpu::{WgpuSetup, WgpuSetupCreateNew};
use egui::Ui;
use kiln_gpu::Gpu;
use kiln_link::{ClientEvent, Endpoint, Revision};

use crate::connection::{Connection, Heard};
use crate::frame_watcher::{Finished, FrameWatcher};
use crate::live_picture::LivePicture;
use crate::loss::{LossSlot, Opening, survive_losses};
use crate::panel::{self, PanelState, Progress};
use crate::parameter::ParameterValues;
use crate::saved::{Saved, SavedFile};
use crate::theme;
use crate::view::{Selection, View};
use crate::worker::{Request, Worker};

/// What to show in a window.
#[derive(Clone, Debug)]
pub struct WindowOptions {
    /// Where the project's daemon is.
    pub daemon: Endpoint,
    /// Title of the window.
    pub title: String,
    /// Width and height of the window in points, where nothing is remembered.
    pub size: [f32; 2],
    /// What to show at first, where it is given; else what is remembered.
    pub selection: Selection,
    /// How to show it at first: what is not as in [`View::default`]; the rest is as it is remembered.
    pub view: View,
    /// Folder for screenshots, made with the first one.
    pub pictures: PathBuf,
    /// File in which the window remembers how it was; `None` = nothing is read or written.
    pub state: Option<PathBuf>,
    /// Loses the device on purpose after so many frames of a revision: how a window survives that can be tried.
    pub lose_device_after_frames: Option<u32>,
}

/// Device errors kept on screen.
const DEVICE_ERRORS_SHOWN_MAX: usize = 8;

/// Opens the window and returns when it is closed.
///
/// # Errors
/// No display, or no device that can draw to it.
pub fn run_window(options: WindowOptions) -> anyhow::Result<()> {
    let (read, note) = options.state.as_deref().map_or_else(Default::default, Saved::read);
    let saved = read.clone().with_given(&options.selection, &options.view);
    let file = options.state.clone().map(|path| SavedFile::new(path, read));
    survive_losses(Opening { options, saved, file, note })
}

/// Opens one window and returns when it is closed, by the user or because its device is lost.
pub(crate) fn open_window(opening: Opening, loss: &Arc<LossSlot>) -> anyhow::Result<()> {
    let title = opening.options.title.clone();
    let size = opening.saved.layout.window_points.unwrap_or(opening.options.size);
    let native = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title(title.clone())
            .with_inner_size(size)
            .with_min_inner_size([640.0, 400.0]),
        renderer: eframe::Renderer::Wgpu,
        wgpu_options: eframe::egui_wgpu::WgpuConfiguration {
            wgpu_setup: WgpuSetup::CreateNew(WgpuSetupCreateNew {
                native_adapter_selector: Some(Arc::new(kiln_gpu::choose_adapter)),
                device_descriptor: Arc::new(kiln_gpu::device_descriptor),
                ..WgpuSetupCreateNew::without_display_handle()
            }),
            ..Default::default()
        },
        persist_window: false,
        ..Default::default()
    };
    let loss = Arc::clone(loss);
    let open = Box::new(move |context: &eframe::CreationContext<'_>| {
        let Opening { options, saved, file, note } = opening;
        let mut window = Window::new(context, options, file, loss)?;
        context.egui_ctx.set_zoom_factor(saved.layout.zoom);
        saved.restore(&mut window.panels);
        window.panels.window_notes.extend(note);
        window.requested = window.wanted();
        Ok(Box::new(window) as Box<dyn eframe::App>)
    });
    eframe::run_native(&title, native, open).map_err(|error| anyhow!("{error}")).context("opening the window")
}

struct Window {
    gpu: Gpu,
    connection: Connection,
    worker: Worker,
    picture: LivePicture,
    panels: PanelState,
    revision: Option<(Arc<Revision>, f64)>,
    /// What the worker was last asked for.
    requested: (Selection, ParameterValues),
    /// What the daemon was last told.
    told_wants: Vec<String>,
    /// The newest revision, while an older one is held.
    waiting: Option<(Arc<Revision>, f64)>,
    saved: Option<SavedFile>,
    loss: Arc<LossSlot>,
    /// Frames until the device is lost on purpose.
    frames_left: Option<u32>,
}

impl Window {
    fn new(
        context: &eframe::CreationContext<'_>,
        options: WindowOptions,
        saved: Option<SavedFile>,
        loss: Arc<LossSlot>,
    ) -> anyhow::Result<Self> {
        theme::apply(&context.egui_ctx);
        let render_state = context.wgpu_render_state.clone().context("the window has no wgpu device")?;
        let (device, queue) = (render_state.device.clone(), render_state.queue.clone());
        let gpu = Gpu::from_parts(render_state.adapter.clone(), device, queue);
        let waker = |context: &egui::Context| {
            let context = context.clone();
            move || context.request_repaint()
        };
        let connection = Connection::open(options.daemon, waker(&context.egui_ctx));
        let worker = Worker::spawn(gpu.clone(), waker(&context.egui_ctx)).context("starting a thread")?;
        let reporter = connection.reporter();
        let watcher = FrameWatcher::spawn(move |report| reporter.report(report), waker(&context.egui_ctx))?;
        let panels = PanelState::new(gpu.description(), options.selection.clone(), options.view);
        Ok(Window {
            picture: LivePicture::new(
                gpu.clone(),
                render_state,
                watcher,
                options.pictures,
                &context.egui_ctx,
            )?,
            gpu,
            connection,
            worker,
            panels,
            revision: None,
            requested: (options.selection, ParameterValues::default()),
            told_wants: Vec::new(),
            waiting: None,
            saved,
            loss,
            frames_left: options.lose_device_after_frames,
        })
    }

    fn take_news(&mut self) {
        while let Some(Heard { event, unix_ms }) = self.connection.next() {
            match event {
                ClientEvent::Connected { project } => {
                    self.panels.connection = panel::Connection::Connected;
                    self.panels.project = project;
                }
                ClientEvent::Disconnected { reason } => self.panels.lose_connection(reason),
                ClientEvent::Progress { current, .. } if current.is_empty() => self.panels.progress = None,
                ClientEvent::Progress { done, total, current } => {
                    self.panels.progress = Some(Progress { done, total, current });
                }
                ClientEvent::Revision(revision) => self.receive(revision, unix_ms),
                ClientEvent::Answer(answer) => panel::requests::receive(&mut self.panels, answer),
            }
        }
        if let Some(ready) = self.worker.take() {
            let is_new = ready.prepared.report.revision != self.panels.report.revision;
            self.panels.adopt(ready.prepared.report.clone());
            self.panels.view.parameters.settle(&self.panels.report.parameters);
            self.picture.replace(ready, is_new);
        }
        for Finished { report, latency_ms } in self.picture.finished() {
            self.panels.history.note_frame(&report);
            self.panels.latency_ms = latency_ms.or(self.panels.latency_ms);
        }
        self.panels.device_errors.extend(self.gpu.take_errors());
        self.panels.device_errors.extend(self.gpu.lost().filter(|_| self.panels.device_errors.is_empty()));
        let surplus = self.panels.device_errors.len().saturating_sub(DEVICE_ERRORS_SHOWN_MAX);
        self.panels.device_errors.drain(..surplus);
    }

    fn receive(&mut self, revision: Arc<Revision>, received_unix_ms: f64) {
        self.panels.receive(&revision.table, received_unix_ms);
        if self.panels.hold.is_on && self.revision.is_some() {
            self.panels.hold.waiting = Some(revision.table.number);
            self.waiting = Some((revision, received_unix_ms));
            return;
        }
        self.revision = Some((revision, received_unix_ms));
        self.request();
    }

    /// Tells the daemon what is shown, when that changes.
    fn tell_wants(&mut self) {
        let wants = self.panels.report.shown.targets(&self.panels.view);
        if wants != self.told_wants {
            self.connection.want(wants.clone());
            self.told_wants = wants;
        }
    }

    /// Goes on to the revision that waits, once it may.
    fn let_go(&mut self) {
        if self.panels.hold.is_on {
            return;
        }
        self.panels.hold.waiting = None;
        if let Some(waiting) = self.waiting.take() {
            self.revision = Some(waiting);
            self.request();
        }
    }

    /// Remembers how the window is.
    fn remember(&mut self, context: &egui::Context, is_last: bool) {
        let Some(saved) = &mut self.saved else { return };
        let layout = &mut self.panels.layout;
        layout.zoom = context.zoom_factor();
        let inner = context.input(|input| input.viewport().inner_rect);
        layout.window_points = inner.map(|it| [it.width(), it.height()].map(|side| side * layout.zoom));
        if let Some(left) = saved.keep(Saved::of(&self.panels), is_last) {
            context.request_repaint_after(left);
        }
    }

    fn lose_device_on_purpose(&mut self, context: &egui::Context) {
        if let Some(left) = self.frames_left.as_mut().filter(|_| self.panels.report.revision > 0) {
            *left = left.saturating_sub(1);
            context.request_repaint();
            if *left == 0 {
                self.frames_left = None;
                self.gpu.device.destroy();
                // The loss is told to whoever waits next.
                drop(self.gpu.wait());
            }
        }
    }

    /// What has to be prepared.
    fn wanted(&self) -> (Selection, ParameterValues) {
        (self.panels.selection.clone(), self.panels.view.parameters.overrides())
    }

    fn request(&mut self) {
        self.requested = self.wanted();
        if let Some((revision, received_unix_ms)) = &self.revision {
            self.worker.request(Request {
                revision: Arc::clone(revision),
                selection: self.requested.0.clone(),
                overrides: self.requested.1.clone(),
                received_unix_ms: *received_unix_ms,
            });
        }
    }
}

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        self.take_news();
        self.lose_device_on_purpose(ui.ctx());
        if let Some(reason) = self.gpu.lost() {
            // Nothing is drawn: egui's renderer could not.
            self.loss.note(reason, Saved::of(&self.panels));
            return ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
        }
        let Window { panels, picture, .. } = self;
        panel::show(ui, panels, |ui, state| picture.show(ui, state));
        self.let_go();
        self.remember(ui.ctx(), false);
        self.panels.requests.take().into_iter().for_each(|ask| self.connection.request(ask));
        if self.wanted() != self.requested {
            self.request();
        }
        self.tell_wants();
    }

    fn on_exit(&mut self) {
        if let Some(saved) = &mut self.saved {
            saved.keep(Saved::of(&self.panels), true);
        }
    }

    fn clear_color(&self, _visuals: &egui::Visuals) -> [f32; 4] {
        theme::VIEWPORT.to_normalized_gamma_f32()
    }
}
