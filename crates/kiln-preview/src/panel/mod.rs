//! The panels: plain state in, plain state out, no device and no connection, so that tests drive them as users do.

use std::collections::BTreeMap;

use egui::{CentralPanel, Panel, Ui};
use kiln_diagnostic::{Diagnostic, Severity};
use kiln_link::{RevisionTable, TargetState};

pub(crate) use self::inspect::Findings;

use self::compare::Compare;
use self::hold::Hold;
use self::scene::{NamedView, Playback};
use self::shots::Shots;
use self::turntable::Turntable;
use crate::history::History;
use crate::report::ApplyReport;
use crate::saved::Layout;
use crate::theme;
use crate::view::{Selection, View};

mod appearance;
pub(crate) mod compare;
mod diagnostics;
mod help;
mod hold;
mod inspect;
pub(crate) mod keys;
mod materials;
mod parameters;
pub(crate) mod requests;
pub(crate) mod scene;
pub(crate) mod shots;
mod side;
mod surroundings;
mod timeline;
mod top;
pub(crate) mod turntable;

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
    /// From noticing the change to the finished frame.
    pub latency_ms: Option<f64>,
    /// What the user chose; the window prepares it when it changes.
    pub selection: Selection,
    /// How the user wants to see it.
    pub view: View,
    pub playback: Playback,
    pub findings: Findings,
    /// Every build that was heard of.
    pub history: History,
    pub hold: Hold,
    pub compare: Compare,
    pub shots: Shots,
    pub turntable: Turntable,
    /// What to bring into view with the next frame.
    pub frame_asked: Option<Framing>,
    /// Since which revision targets are stale.
    pub stale_since: BTreeMap<String, u64>,
    /// Whether the card of diagnostics is open; new ones open it.
    pub are_diagnostics_open: bool,
    pub is_help_open: bool,
    pub are_panels_hidden: bool,
    /// Cameras that the user named.
    pub named_views: Vec<NamedView>,
    pub layout: Layout,
    /// What the window has to say of itself.
    pub window_notes: Vec<String>,
    /// What the daemon is asked to do.
    pub requests: requests::Requests,
}

/// What to bring into view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Framing {
    Scene,
    /// What lies below a place of the picture, 0 to 1 from its top left; the scene where nothing does.
    At([f32; 2]),
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
            latency_ms: None,
            selection,
            view,
            playback: Playback::default(),
            findings: Findings::default(),
            history: History::default(),
            hold: Hold::default(),
            compare: Compare::default(),
            shots: Shots::default(),
            turntable: Turntable::default(),
            frame_asked: None,
            stale_since: BTreeMap::new(),
            are_diagnostics_open: true,
            is_help_open: false,
            are_panels_hidden: false,
            named_views: Vec::new(),
            layout: Layout::default(),
            window_notes: Vec::new(),
            requests: requests::Requests::default(),
        }
    }

    /// Takes over what a new revision says; the picture follows when it is prepared.
    pub fn receive(&mut self, table: &RevisionTable, received_unix_ms: f64) {
        if self.diagnostics != table.diagnostics {
            // Notes wait for whoever wants to read them.
            self.are_diagnostics_open = table.diagnostics.iter().any(|it| it.severity > Severity::Note);
        }
        self.diagnostics = table.diagnostics.clone();
        self.note_stale(table);
        self.history.receive(table, received_unix_ms);
        self.progress = None;
        requests::receive_revision(self, table);
    }

    /// Takes over what came of a revision that is shown from now on.
    pub fn adopt(&mut self, report: ApplyReport) {
        self.are_diagnostics_open |=
            report.diagnostics.iter().any(|it| !self.report.diagnostics.contains(it));
        self.report = report;
    }

    fn note_stale(&mut self, table: &RevisionTable) {
        let stale = table.targets.iter().filter(|(_, target)| target.state == TargetState::Stale);
        // A daemon that counts from 1 again knows no more than that they are.
        let since = |name: &String| *self.stale_since.get(name).unwrap_or(&table.number).min(&table.number);
        self.stale_since = stale.map(|(name, _)| (name.clone(), since(name))).collect();
    }

    /// Shows another scene. What was right for the one before is not for it: camera, light, variant, animation.
    pub fn choose_scene(&mut self, scene: String) {
        (self.view.camera, self.view.scene_camera, self.view.animation) = (None, 0, None);
        let diffuse = self.selection.diffuse;
        self.selection = Selection { scene: Some(scene), diffuse, ..Selection::default() };
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
    theme::choose(ui.ctx(), state.layout.theme);
    keys::dispatch(ui, state);
    scene::play(ui, state);
    requests::take_dropped(ui, state);
    if !state.are_panels_hidden {
        show_panels(ui, state);
    }
    let picture = CentralPanel::default().frame(egui::Frame::new().fill(theme::VIEWPORT));
    picture.show(ui, |ui| {
        let place = ui.max_rect();
        show_picture(ui, state);
        diagnostics::show_over(ui, place, state);
        hold::show_over(ui, place, state);
        shots::show_over(ui, place, state);
        help::show_over(ui, state);
        requests::show_over(ui, place, state);
    });
}

fn show_panels(ui: &mut Ui, state: &mut PanelState) {
    let bar = Panel::top("top").frame(theme::panel_frame(ui));
    bar.show(ui, |ui| top::show(ui, state));
    let timeline = Panel::bottom("timeline").frame(theme::panel_frame(ui)).resizable(true);
    // The picture keeps most of a small window; before the first frame it has no size yet.
    let share = 0.28 * ui.available_height().max(360.0);
    let timeline = timeline.default_size(state.layout.timeline_points.min(share)).size_range(44.0..=420.0);
    let shown = timeline.show(ui, |ui| timeline::show(ui, state));
    state.layout.timeline_points = shown.response.rect.height();
    let side = Panel::right("side").frame(theme::panel_frame(ui)).resizable(true);
    let side = side.default_size(state.layout.side_points).size_range(240.0..=440.0);
    let shown = side.show(ui, |ui| side::show(ui, state));
    state.layout.side_points = shown.response.rect.width();
}
