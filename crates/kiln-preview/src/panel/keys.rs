//! The keyboard: one table, from which keys are dispatched and help is written.

use egui::{Event, FocusDirection, Key, Modifiers, Ui};

use super::compare::Mode;
use super::turntable::Turning;
use super::{PanelState, scene};

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Command {
    Help,
    Close,
    HidePanels,
    FrameScene,
    Reset,
    TogglePlay,
    Turn(Turning),
    /// Step through the project's environments, 1 or −1.
    StepEnv(i8),
    /// Step through the project's scenes, 1 or −1.
    StepScene(i8),
    ToggleHold,
    PinAsA,
    ToggleCompare,
    CompareBy(Mode),
    /// Shows A, or B, alone.
    ShowSide(usize),
    Screenshot {
        radiance: bool,
    },
}

/// A key and what it does.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Binding {
    pub key: Key,
    pub shift: bool,
    /// As help shows it.
    pub name: &'static str,
    pub command: Command,
    /// In a few words; bindings one after another with the same words are shown as one.
    pub help: &'static str,
}

const fn key(key: Key, name: &'static str, command: Command, help: &'static str) -> Binding {
    Binding { key, shift: false, name, command, help }
}

const fn shift(key: Key, name: &'static str, command: Command, help: &'static str) -> Binding {
    Binding { key, shift: true, name, command, help }
}

/// Every key that the window knows by itself.
pub(crate) const BINDINGS: &[Binding] = &[
    key(Key::F, "F", Command::FrameScene, "frame the scene"),
    key(Key::R, "R", Command::Reset, "reset camera and light"),
    key(Key::Space, "Space", Command::TogglePlay, "play or pause the animation"),
    key(Key::T, "T", Command::Turn(Turning::Camera), "turn the camera, or stop"),
    shift(Key::T, "Shift T", Command::Turn(Turning::Light), "turn the light, or stop"),
    key(Key::ArrowLeft, "←", Command::StepEnv(-1), "previous or next environment"),
    key(Key::ArrowRight, "→", Command::StepEnv(1), "previous or next environment"),
    key(Key::ArrowUp, "↑", Command::StepScene(-1), "previous or next scene"),
    key(Key::ArrowDown, "↓", Command::StepScene(1), "previous or next scene"),
    key(Key::L, "L", Command::ToggleHold, "hold this revision, or go on to the newest"),
    key(Key::P, "P", Command::PinAsA, "pin the picture as A and compare"),
    key(Key::C, "C", Command::ToggleCompare, "compare A with B, or stop"),
    key(Key::A, "A", Command::ShowSide(0), "show A alone, or B"),
    key(Key::B, "B", Command::ShowSide(1), "show A alone, or B"),
    key(Key::Num1, "1", Command::CompareBy(Mode::Swipe), "compare by swipe, flip or heat map"),
    key(Key::Num2, "2", Command::CompareBy(Mode::Flip), "compare by swipe, flip or heat map"),
    key(Key::Num3, "3", Command::CompareBy(Mode::HeatMap), "compare by swipe, flip or heat map"),
    key(Key::S, "S", Command::Screenshot { radiance: false }, "save a picture and its parameter sheet"),
    shift(Key::S, "Shift S", Command::Screenshot { radiance: true }, "save its radiance as OpenEXR too"),
    key(Key::Tab, "Tab", Command::HidePanels, "hide or show the panels"),
    key(Key::H, "H", Command::Help, "show or hide this help"),
    shift(Key::Questionmark, "?", Command::Help, "show or hide this help"),
    key(Key::Questionmark, "?", Command::Help, "show or hide this help"),
    key(Key::Escape, "Esc", Command::Close, "close what lies over the picture"),
];

/// Carries out the keys that were pressed, unless somebody is typing.
pub(super) fn dispatch(ui: &Ui, state: &mut PanelState) {
    if ui.ctx().memory(|memory| memory.focused().is_some()) {
        return;
    }
    for command in take_pressed(ui) {
        if command == Command::HidePanels {
            // It would go to the next field otherwise.
            ui.ctx().memory_mut(|memory| memory.move_focus(FocusDirection::None));
        }
        state.run(command);
    }
}

fn take_pressed(ui: &Ui) -> Vec<Command> {
    let mut commands = Vec::new();
    ui.input_mut(|input| {
        input.events.retain(|event| {
            let Event::Key { key, pressed: true, repeat: false, modifiers, .. } = event else { return true };
            let found = binding_of(*key, *modifiers);
            commands.extend(found.map(|binding| binding.command));
            found.is_none()
        });
    });
    commands
}

fn binding_of(key: Key, modifiers: Modifiers) -> Option<&'static Binding> {
    let is_plain = !(modifiers.ctrl || modifiers.alt || modifiers.command);
    BINDINGS.iter().find(|it| is_plain && it.key == key && it.shift == modifiers.shift)
}

impl PanelState {
    /// Does what was asked for.
    pub(crate) fn run(&mut self, command: Command) {
        match command {
            Command::Help => self.is_help_open = !self.is_help_open,
            Command::Close => (self.is_help_open, self.are_diagnostics_open) = (false, false),
            Command::HidePanels => self.are_panels_hidden = !self.are_panels_hidden,
            Command::FrameScene => self.frame_asked = Some(super::Framing::Scene),
            Command::Reset => self.reset_view(),
            Command::TogglePlay => scene::toggle(self),
            Command::Turn(turning) => self.turntable.toggle(turning),
            Command::StepEnv(step) => self.step_env(step),
            Command::StepScene(step) => self.step_scene(step),
            Command::ToggleHold => self.hold.is_on = !self.hold.is_on,
            Command::PinAsA => self.pin_as_a(),
            Command::ToggleCompare => self.compare.toggle(),
            Command::CompareBy(mode) => self.compare.compare_by(mode),
            Command::ShowSide(side) => self.compare.show_side(side),
            Command::Screenshot { radiance } => self.shots.ask(radiance),
        }
    }

    /// Camera and light as they are at first; parameters stay.
    fn reset_view(&mut self) {
        let first = crate::View::default();
        let kept = (self.view.animation, self.view.time_s, std::mem::take(&mut self.view.parameters));
        self.view = first;
        (self.view.animation, self.view.time_s, self.view.parameters) = kept;
    }

    fn step_env(&mut self, step: i8) {
        let shown = self.report.shown.env.clone();
        if let Some(env) = neighbour(&self.report.envs, shown.as_deref(), step) {
            self.selection.env = Some(env);
        }
    }

    fn step_scene(&mut self, step: i8) {
        let shown = self.report.shown.scene.clone();
        if let Some(scene) = neighbour(&self.report.scenes, shown.as_deref(), step) {
            self.choose_scene(scene);
        }
    }
}

/// The name before or after `shown`, around the end.
fn neighbour(names: &[String], shown: Option<&str>, step: i8) -> Option<String> {
    let at = names.iter().position(|name| Some(name.as_str()) == shown)?;
    let next = (at as i64 + i64::from(step)).rem_euclid(names.len() as i64);
    names.get(next as usize).cloned()
}
