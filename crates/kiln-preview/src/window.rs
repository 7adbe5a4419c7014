//! The window: panels around the live picture.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context as _, anyhow};
use eframe::egui_wgpu::{WgpuSetup, WgpuSetupCreateNew};
use egui::Ui;
use kiln_gpu::Gpu;
use kiln_link::{ClientEvent, Revision};

use crate::connection::{Connection, Heard};
use crate::frame_watcher::FrameWatcher;
use crate::live_picture::LivePicture;
use crate::panel::{self, PanelState, Progress};
use crate::parameter::ParameterValues;
use crate::theme;
use crate::view::{Selection, View};
use crate::worker::{Request, Worker};

/// What to show in a window.
#[derive(Clone, Debug)]
pub struct WindowOptions {
    /// Socket of the project's daemon.
    pub socket: PathBuf,
    /// Title of the window.
    pub title: String,
    /// Width and height of the window in points.
    pub size: [f32; 2],
    /// What to show at first.
    pub selection: Selection,
    /// How to show it at first.
    pub view: View,
}

/// Device errors kept on screen.
const DEVICE_ERRORS_SHOWN_MAX: usize = 8;

/// Opens the window and returns when it is closed.
///
/// # Errors
/// No display, or no device that can draw to it.
pub fn run_window(options: WindowOptions) -> anyhow::Result<()> {
    let title = options.title.clone();
    let native = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title(title.clone())
            .with_inner_size(options.size)
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
    eframe::run_native(&title, native, Box::new(|context| Ok(Box::new(Window::new(context, options)?))))
        .map_err(|error| anyhow!("{error}"))
        .context("opening the window")
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
}

impl Window {
    fn new(context: &eframe::CreationContext<'_>, options: WindowOptions) -> anyhow::Result<Self> {
        theme::apply(&context.egui_ctx);
        let render_state = context.wgpu_render_state.clone().context("the window has no wgpu device")?;
        let (device, queue) = (render_state.device.clone(), render_state.queue.clone());
        let gpu = Gpu::from_parts(render_state.adapter.clone(), device, queue);
        let waker = |context: &egui::Context| {
            let context = context.clone();
            move || context.request_repaint()
        };
        let connection =
            Connection::open(options.socket, waker(&context.egui_ctx)).context("starting a thread")?;
        let worker = Worker::spawn(gpu.clone(), waker(&context.egui_ctx)).context("starting a thread")?;
        let reports = connection.reports().context("the connection is closed")?;
        let watcher = FrameWatcher::spawn(reports, waker(&context.egui_ctx))?;
        let panels = PanelState::new(gpu.description(), options.selection.clone(), options.view);
        Ok(Window {
            picture: LivePicture::new(gpu.clone(), render_state, watcher),
            gpu,
            connection,
            worker,
            panels,
            revision: None,
            requested: (options.selection, ParameterValues::default()),
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
            if ready.prepared.report.shown != self.panels.report.shown {
                self.connection.want(&ready.prepared.report.shown);
            }
            self.panels.report = ready.prepared.report.clone();
            self.panels.view.parameters.settle(&self.panels.report.parameters);
            self.picture.replace(ready, is_new);
        }
        if let Some(latency_ms) = self.picture.latency_ms() {
            self.panels.latency_ms = Some(latency_ms);
        }
        self.panels.device_errors.extend(self.gpu.take_errors());
        self.panels.device_errors.extend(self.gpu.lost().filter(|_| self.panels.device_errors.is_empty()));
        let surplus = self.panels.device_errors.len().saturating_sub(DEVICE_ERRORS_SHOWN_MAX);
        self.panels.device_errors.drain(..surplus);
    }

    fn receive(&mut self, revision: Arc<Revision>, received_unix_ms: f64) {
        self.panels.receive(&revision.table);
        self.revision = Some((revision, received_unix_ms));
        self.request();
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
        let Window { panels, picture, .. } = self;
        panel::show(ui, panels, |ui, state| picture.show(ui, state));
        self.panels.requests.take().into_iter().for_each(|ask| self.connection.request(ask));
        if self.wanted() != self.requested {
            self.request();
        }
    }

    fn clear_color(&self, _visuals: &egui::Visuals) -> [f32; 4] {
        theme::VIEWPORT.to_normalized_gamma_f32()
    }
}
