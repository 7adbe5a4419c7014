//! The panels: plain state in, plain state out, no device and no connection, so that tests drive them as users do.

use egui::{CentralPanel, Panel, Ui};
use kiln_diagnostic::Diagnostic;
use kiln_link::{RevisionTable, Work};

use self::scene::Playback;
use crate::report::ApplyReport;
use crate::theme;
use crate::view::{Selection, View};

mod diagnostics;
mod parameters;
pub(crate) mod requests;
mod scene;
mod side;
mod surroundings;
mod timeline;
mod top;

/// Whether there is a daemon.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Connection {
    /// Never seen one.
    Connecting,
    Connected,
    /// It was there; the last picture stays.
    Gone {
        reason: String,
    },
}

/// How far a running build is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Progress {
    pub done: usize,
    pub total: usize,
    pub current: String,
}

/// Everything the panels show and change.
#[derive(Clone, Debug)]
pub(crate) struct PanelState {
    pub connection: Connection,
    /// Name of the project, as the daemon says it.
    pub project: String,
    pub adapter: String,
    pub progress: Option<Progress>,
    /// What is on screen.
    pub report: ApplyReport,
    /// What is wrong with the project.
    pub diagnostics: Vec<Diagnostic>,
    /// What the device reported, newest last.
    pub device_errors: Vec<String>,
    /// The last build.
    pub work: Work,
    /// From noticing the change to the finished frame.
    pub latency_ms: Option<f64>,
    /// What the user chose; the window prepares it when it changes.
    pub selection: Selection,
    /// How the user wants to see it.
    pub view: View,
    pub playback: Playback,
    /// What the daemon is asked to do.
    pub requests: requests::Requests,
}

impl PanelState {
    /// Before anything was heard.
    pub fn new(adapter: String, selection: Selection, view: View) -> Self {
        PanelState {
            connection: Connection::Connecting,
            project: String::new(),
            adapter,
            progress: None,
            report: ApplyReport::default(),
            diagnostics: Vec::new(),
            device_errors: Vec::new(),
            work: Work::default(),
            latency_ms: None,
            selection,
            view,
            playback: Playback::default(),
            requests: requests::Requests::default(),
        }
    }

    /// Takes over what a new revision says; the picture follows when it is prepared.
    pub fn receive(&mut self, table: &RevisionTable) {
        self.diagnostics = table.diagnostics.clone();
        self.work = table.work.clone();
        self.progress = None;
        requests::receive_revision(self, table);
    }

    /// The daemon is gone, or there never was one.
    pub fn lose_connection(&mut self, reason: String) {
        self.progress = None;
        // A reason to wait longer is none to alarm someone who just started.
        if self.connection != Connection::Connecting {
            self.connection = Connection::Gone { reason };
        }
    }

    /// The project's diagnostics, then the preview's.
    fn all_diagnostics(&self) -> impl Iterator<Item = &Diagnostic> {
        self.diagnostics.iter().chain(&self.report.diagnostics)
    }
}

/// Lays the panels out around the picture, which `show_picture` draws in the space left.
pub(crate) fn show(ui: &mut Ui, state: &mut PanelState, show_picture: impl FnOnce(&mut Ui, &mut PanelState)) {
    scene::play(ui, state);
    requests::take_dropped(ui, state);
    let bar = Panel::top("top").frame(theme::panel_frame());
    bar.show(ui, |ui| top::show(ui, state));
    let timeline = Panel::bottom("timeline").frame(theme::panel_frame()).resizable(true);
    timeline.default_size(132.0).size_range(44.0..=420.0).show(ui, |ui| timeline::show(ui, state));
    let side = Panel::right("side").frame(theme::panel_frame()).resizable(true);
    side.default_size(296.0).size_range(240.0..=440.0).show(ui, |ui| side::show(ui, state));
    let picture = CentralPanel::default().frame(egui::Frame::new().fill(theme::VIEWPORT));
    picture.show(ui, |ui| {
        let place = ui.max_rect();
        show_picture(ui, state);
        diagnostics::show_over(ui, place, state);
        requests::show_over(ui, place, state);
    });
}
