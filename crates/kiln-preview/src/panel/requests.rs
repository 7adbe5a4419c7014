//! What the window asks the daemon to do, and what it says of it: values written into sources, files dropped on the window.

use egui::{Align2, Area, Id, Order, Rect, RichText, Ui, vec2};
use kiln_diagnostic::Diagnostic;
use kiln_link::{Answer, Ask, ParameterWrite, RevisionTable};

use super::{PanelState, diagnostics};
use crate::parameter::{OfferedParameter, ParameterValues};
use crate::theme;
use crate::view::Selection;

/// Room between the message and the picture's edge.
const MARGIN: f32 = 14.0;

/// Requests that are to be sent, and what became of those that were.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Requests {
    to_send: Vec<Ask>,
    /// Those without an answer.
    open: usize,
    /// The last answer, until it is dismissed or something else is asked.
    said: Option<Answer>,
    /// Groups of targets to show as soon as there are any.
    awaited: Vec<String>,
}

impl Requests {
    /// What is to be sent now.
    pub fn take(&mut self) -> Vec<Ask> {
        std::mem::take(&mut self.to_send)
    }

    fn ask(&mut self, ask: Ask) {
        self.to_send.push(ask);
        self.open += 1;
        self.said = None;
    }

    /// Asks for the values of these parameters to be written where they are declared.
    pub fn write<'a>(
        &mut self,
        parameters: impl IntoIterator<Item = &'a OfferedParameter>,
        values: &ParameterValues,
    ) {
        let write = |parameter: &OfferedParameter| ParameterWrite {
            shader: parameter.shader.clone(),
            name: parameter.name.clone(),
            value: values.of(parameter),
        };
        let parameters: Vec<ParameterWrite> = parameters.into_iter().map(write).collect();
        self.ask(Ask::WriteParameters { parameters });
    }
}

/// Takes an answer of the daemon's.
pub(crate) fn receive(state: &mut PanelState, answer: Answer) {
    let requests = &mut state.requests;
    requests.open = requests.open.saturating_sub(1);
    requests.awaited.extend(answer.targets.iter().cloned());
    requests.said = Some(answer);
    let (scenes, envs) = (state.report.scenes.clone(), state.report.envs.clone());
    let known = |kind: &str, names: &[String]| {
        names.iter().map(|name| format!("{kind}/{name}")).collect::<Vec<String>>()
    };
    select_awaited(state, &[known("scene", &scenes), known("env", &envs)].concat());
}

/// Shows what was added, once a revision has it.
pub(crate) fn receive_revision(state: &mut PanelState, table: &RevisionTable) {
    if state.requests.awaited.is_empty() {
        return;
    }
    let group = |name: &String| name.splitn(3, '/').take(2).collect::<Vec<_>>().join("/");
    let groups: Vec<String> = table.targets.keys().map(group).collect();
    select_awaited(state, &groups);
}

fn select_awaited(state: &mut PanelState, groups: &[String]) {
    let awaited = std::mem::take(&mut state.requests.awaited);
    let (there, awaited): (Vec<String>, Vec<String>) =
        awaited.into_iter().partition(|it| groups.contains(it));
    state.requests.awaited = awaited;
    for group in there {
        match group.split_once('/') {
            Some(("scene", name)) => {
                let Selection { env, diffuse, .. } = std::mem::take(&mut state.selection);
                (state.view.camera, state.view.scene_camera, state.view.animation) = (None, 0, None);
                state.selection =
                    Selection { scene: Some(name.to_owned()), env, diffuse, ..Selection::default() };
            }
            Some(("env", name)) => state.selection.env = Some(name.to_owned()),
            _ => {}
        }
    }
}

/// Asks for what was dropped on the window.
pub(super) fn take_dropped(ui: &Ui, state: &mut PanelState) {
    let dropped = ui.ctx().input(|input| input.raw.dropped_files.clone());
    if dropped.is_empty() {
        return;
    }
    let paths: Option<Vec<String>> =
        dropped.iter().map(|file| file.path().to_str().map(str::to_owned)).collect();
    match paths {
        Some(paths) => state.requests.ask(Ask::AddFiles { paths }),
        None => {
            let fault = Diagnostic::error("a file was dropped whose name is no UTF-8 text; it was not added");
            state.requests.said = Some(Answer::refused(0, fault.with_help("give it another name")));
        }
    }
}

/// What a drop would do, and the last answer.
pub(super) fn show_over(ui: &Ui, place: Rect, state: &mut PanelState) {
    let hovered = ui.ctx().input(|input| input.raw.hovered_files.len());
    if hovered > 0 {
        let to = if state.project.is_empty() { "the project" } else { &state.project };
        let text = format!("Drop to add to {to}: .hdr .exr .ktx .ktx2 .dds .gltf .glb");
        show_card(ui, place, "kiln drop", Align2::CENTER_CENTER, theme::of(ui).accent, |ui| {
            _ = ui.label(text);
        });
    }
    let Requests { said, open, .. } = &mut state.requests;
    let Some(answer) = said else {
        if *open > 0 {
            let show =
                |ui: &mut Ui| _ = ui.label(RichText::new("asked the daemon …").color(theme::of(ui).weak));
            show_card(ui, place, "kiln answer", Align2::RIGHT_TOP, theme::of(ui).line, show);
        }
        return;
    };
    let edge = if answer.is_done() { theme::of(ui).good } else { theme::of(ui).error };
    let mut is_dismissed = false;
    show_card(ui, place, "kiln answer", Align2::RIGHT_TOP, edge, |ui| {
        if !answer.message.is_empty() {
            ui.label(RichText::new(&answer.message).color(theme::of(ui).good));
        }
        answer.diagnostics.iter().for_each(|diagnostic| diagnostics::show_diagnostic(ui, diagnostic));
        is_dismissed = ui.small_button("Dismiss").clicked();
    });
    if is_dismissed {
        *said = None;
    }
}

/// A card over the picture, at one of its corners or in its middle.
fn show_card(
    ui: &Ui,
    place: Rect,
    id: &str,
    corner: Align2,
    edge: egui::Color32,
    show: impl FnOnce(&mut Ui),
) {
    let at = corner.pos_in_rect(&place.shrink2(vec2(MARGIN, MARGIN)));
    let area = Area::new(Id::unique(id)).order(Order::Foreground).constrain_to(place);
    area.pivot(corner).fixed_pos(at).show(ui.ctx(), |ui| {
        theme::card_frame(ui, edge).show(ui, |ui| {
            ui.set_max_width((place.width() * 0.5).clamp(160.0, 520.0));
            show(ui);
        });
    });
}
