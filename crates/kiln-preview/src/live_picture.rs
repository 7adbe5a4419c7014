//! The picture in the window, or the two that are compared: drawn when something changed, turned by the hand.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use eframe::egui_wgpu::RenderState;
use egui::{PointerButton, Rect, Response, Sense, TextureHandle, TextureOptions, Ui, pos2};
use kiln_gpu::Gpu;

use crate::camera::OrbitCamera;
use crate::frame_watcher::{Finished, FrameWatcher, Watched};
use crate::live_probe::LiveProbe;
use crate::look::LookSheet;
use crate::measurer::{Measurer, Pair};
use crate::memory::{Holdings, holdings, own_bytes};
use crate::panel::compare::{self, Mode, Pictures, Side};
use crate::panel::turntable::Turning;
use crate::panel::{Findings, Framing, PanelState};
use crate::pick::pick;
use crate::prepare::Prepared;
use crate::readout::copy_of;
use crate::renderer::Renderer;
use crate::shot::{Composition, Shot, ShotWriter, stem};
use crate::side_picture::SidePicture;
use crate::view::View;
use crate::worker::Ready;

/// Where A and B stand in [`LivePicture::pictures`]; without comparison only B is drawn.
const A: usize = 0;
const B: usize = 1;

/// Everything that draws.
pub(crate) struct LivePicture {
    gpu: Gpu,
    render_state: RenderState,
    pictures: [SidePicture; 2],
    watcher: FrameWatcher,
    /// What the panels show.
    live: Option<Arc<Prepared>>,
    /// What pins keep, by their numbers.
    pinned: BTreeMap<u64, (Arc<Prepared>, Holdings)>,
    measurer: Measurer,
    heat_map: Option<TextureHandle>,
    /// The frames that numbers and heat map are of.
    measured: Option<[u64; 2]>,
    /// The frames that were there before, to see whether the pictures rest.
    last_frames: [u64; 2],
    writer: ShotWriter,
    /// Where screenshots go.
    folder: PathBuf,
    /// The revision whose first frame is still to be drawn.
    first_frame_of: Option<Ready>,
    started: Instant,
    probe: LiveProbe,
}

impl LivePicture {
    /// An empty picture; screenshots go into `folder`. `context` is woken when something is measured or written.
    pub fn new(
        gpu: Gpu,
        render_state: RenderState,
        watcher: FrameWatcher,
        folder: PathBuf,
        context: &egui::Context,
    ) -> anyhow::Result<Self> {
        let waker = || {
            let context = context.clone();
            move || context.request_repaint()
        };
        let mut pictures = [SidePicture::new(&gpu), SidePicture::new(&gpu)];
        pictures[B].renderer.keeps_depth = true;
        Ok(LivePicture {
            pictures,
            measurer: Measurer::spawn(gpu.clone(), waker())?,
            writer: ShotWriter::spawn(gpu.clone(), waker())?,
            gpu,
            render_state,
            watcher,
            live: None,
            pinned: BTreeMap::new(),
            heat_map: None,
            measured: None,
            last_frames: [0; 2],
            folder,
            first_frame_of: None,
            started: Instant::now(),
            probe: LiveProbe::default(),
        })
    }

    /// Replaces what is shown; `is_new` if it is another revision than before, whose first frame is reported.
    pub fn replace(&mut self, ready: Ready, is_new: bool) {
        self.live = Some(Arc::clone(&ready.prepared));
        self.first_frame_of = is_new.then_some(ready).or(self.first_frame_of.take());
    }

    /// The frames that the device has finished and somebody waits for, each once.
    pub fn finished(&self) -> impl Iterator<Item = Finished> {
        self.watcher.finished()
    }

    /// Draws what changed, and reacts to the hand.
    pub fn show(&mut self, ui: &mut Ui, state: &mut PanelState) {
        let (place, size) = whole_pixels(ui);
        let response = ui.allocate_rect(place, Sense::click_and_drag());
        self.keep_pins(state);
        let textures = [A, B].map(|index| {
            let is_drawn = index == B || state.compare.is_shown();
            is_drawn.then(|| self.pictures[index].fit(&self.render_state, size))
        });
        self.move_camera(ui, &response, state);
        if self.live.as_ref().is_some_and(|prepared| prepared.is_animated) {
            state.view.time_s = self.started.elapsed().as_secs_f32();
            ui.ctx().request_repaint();
        }
        self.take_findings(&mut state.findings);
        self.draw(ui, state);
        match textures {
            [Some(a), Some(b)] => {
                self.measure(ui, state);
                let heat_map = self.heat_map.as_ref().map(TextureHandle::id);
                compare::paint(ui, place, Pictures { sides: [a, b], heat_map }, state);
            }
            [_, Some(shown)] => {
                let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
                ui.painter().image(shown, place, whole, egui::Color32::WHITE);
                self.stop_comparing(state);
            }
            _ => {}
        }
        self.ask_pixel(ui, &response, state);
        self.take_shots(ui, state);
    }

    /// What frames before told by now.
    fn take_findings(&mut self, findings: &mut Findings) {
        // Only moves finished work along; a lost device shows elsewhere.
        drop(self.gpu.device.poll(wgpu::PollType::Poll));
        self.pictures[A].take_frame_ms();
        let shown = &mut self.pictures[B];
        findings.frame_ms = shown.take_frame_ms().or(findings.frame_ms);
        findings.moving = Some(shown.moving_quality());
        let inspector = shown.renderer.inspector();
        if let Some(times) = inspector.take_pass_times(Duration::ZERO) {
            findings.pass_times = times;
        }
        if let Some(faults) = inspector.take_faults(Duration::ZERO) {
            findings.faults = Some(faults);
        }
    }

    /// Asks for the pixel below the pointer; a smaller picture has none of its own there.
    fn ask_pixel(&mut self, ui: &Ui, response: &Response, state: &mut PanelState) {
        let shown = &self.pictures[B];
        if shown.is_whole() {
            let frame = (shown.frame, shown.renderer.size());
            let probed = &mut state.findings.probe;
            self.probe.update(ui, response, (&self.gpu, &shown.renderer), frame, probed);
        }
    }

    /// Keeps for each pin what it is drawn with, and lets the others go.
    fn keep_pins(&mut self, state: &mut PanelState) {
        let is_pinned = |id: &u64| state.compare.pin(*id).is_some();
        self.pinned.retain(|id, _| is_pinned(id));
        let Some(live) = &self.live else { return };
        for pin in &mut state.compare.pins {
            let (_, held) = self.pinned.entry(pin.id).or_insert_with(|| (Arc::clone(live), holdings(live)));
            pin.bytes = held.values().sum();
        }
        if !self.pinned.is_empty() {
            state.compare.own_bytes = own_bytes(self.pinned.values().map(|(_, held)| held), &holdings(live));
        }
    }

    /// What stands on a side, and how it is seen.
    fn side(&self, side: Side, state: &PanelState) -> Option<(Arc<Prepared>, View)> {
        let live = self.live.clone()?;
        let Side::Pin(id) = side else { return Some((live, state.view.clone())) };
        let (Some(pin), Some((kept, _))) = (state.compare.pin(id), self.pinned.get(&id)) else {
            return Some((live, state.view.clone()));
        };
        let has_its_pipelines = pin.look.selection == live.report.shown
            && pin.look.view.parameters.overrides() == state.view.parameters.overrides();
        let prepared = if pin.is_settings && has_its_pipelines { live } else { Arc::clone(kept) };
        let mut view = pin.look.view.clone();
        if state.compare.is_linked {
            view.camera = self.camera(state).or(view.camera);
            (view.animation, view.time_s) = (state.view.animation, state.view.time_s);
        }
        Some((prepared, view))
    }

    /// The live camera.
    fn camera(&self, state: &PanelState) -> Option<OrbitCamera> {
        self.pictures[B].renderer.camera(&state.view)
    }

    fn draw(&mut self, ui: &Ui, state: &PanelState) {
        let is_compared = state.compare.is_shown();
        let sides = if is_compared { state.compare.sides } else { [Side::Live; 2] };
        // B first: the live camera is that of its scene.
        for index in if is_compared { &[B, A][..] } else { &[B] } {
            let Some((prepared, view)) = self.side(sides[*index], state) else { continue };
            let picture = &mut self.pictures[*index];
            picture.show(&prepared);
            if is_compared {
                picture.forget_pose();
            }
            if !picture.draw(ui.ctx(), &self.render_state, &view) {
                continue;
            }
            if sides[*index] == Side::Live
                && let Some(ready) = self.first_frame_of.take()
            {
                let noticed_unix_ms = state.history.noticed_unix_ms(ready.prepared.report.revision);
                self.watcher.watch(Watched { submitted: self.gpu.submitted(), ready, noticed_unix_ms });
            }
        }
    }

    /// Measures the pictures when they rest.
    fn measure(&mut self, ui: &Ui, state: &mut PanelState) {
        if let Some(measured) = self.measurer.take() {
            state.compare.numbers = Some(measured.numbers);
            self.measured = Some(measured.frames);
            let (image, options) = (measured.heat_map, TextureOptions::NEAREST);
            match &mut self.heat_map {
                Some(texture) => texture.set(image, options),
                None => self.heat_map = Some(ui.ctx().load_texture("heat map", image, options)),
            }
        }
        let frames = [A, B].map(|index| self.pictures[index].frame);
        if self.measured.is_some_and(|measured| measured != frames) {
            (self.measured, self.heat_map, state.compare.numbers) = (None, None, None);
        }
        let are_whole = self.pictures.iter().all(SidePicture::is_whole);
        let rests = are_whole && frames == self.last_frames && !ui.input(|input| input.pointer.any_down());
        self.last_frames = frames;
        if self.measured.is_some() || self.measurer.is_busy() {
            return;
        }
        if rests {
            let copies = [A, B].map(|index| copy_of(&self.gpu, self.pictures[index].renderer.output()));
            self.measurer.measure(Pair { pictures: copies, copied: self.gpu.submitted(), frames });
        } else {
            ui.ctx().request_repaint();
        }
    }

    /// Gives back what only comparing needs.
    fn stop_comparing(&mut self, state: &mut PanelState) {
        if self.pictures[A].prepared().is_some() {
            self.pictures[A].release(&self.render_state);
            self.pictures[A] = SidePicture::new(&self.gpu);
            self.pictures[B].forget_pose();
            (self.measured, self.heat_map, state.compare.numbers) = (None, None, None);
        }
    }

    /// Sends what is seen to be written, if that was asked for.
    fn take_shots(&mut self, ui: &Ui, state: &mut PanelState) {
        if let Some(said) = self.writer.take() {
            state.shots.say(said);
        }
        if state.shots.asked.is_some() && !self.pictures.iter().all(SidePicture::is_whole) {
            // What moves is shown with fewer pixels; a screenshot has them all.
            return ui.ctx().request_repaint();
        }
        let Some(radiance) = state.shots.asked.take() else { return };
        let mut sides = vec![B];
        let mut composition = Composition::One;
        if state.compare.is_shown() {
            match state.compare.mode {
                Mode::Swipe => (sides, composition) = (vec![A, B], Composition::Swipe(state.compare.divider)),
                Mode::Flip => sides = vec![state.compare.flipped_to.min(B)],
                Mode::HeatMap => (sides, composition) = (vec![A, B], Composition::HeatMap),
            }
        }
        let Some(last) = sides.last().map(|side| &self.pictures[*side]) else { return };
        let Some(prepared) = last.prepared() else { return };
        let suffixes = if sides.len() == 1 { &[""][..] } else { &["_a", "_b"] };
        let sheets = sides
            .iter()
            .zip(suffixes)
            .filter_map(|(side, suffix)| Some((*suffix, self.sheet(&self.pictures[*side])?)));
        let output = |side: &usize| copy_of(&self.gpu, self.pictures[*side].renderer.output());
        self.writer.write(Shot {
            folder: self.folder.clone(),
            stem: stem(&prepared.report.shown, prepared.report.revision),
            pictures: sides.iter().map(output).collect(),
            composition,
            radiance: radiance.then(|| copy_of(&self.gpu, last.renderer.radiance())),
            copied: self.gpu.submitted(),
            sheets: sheets.collect(),
        });
    }

    /// All that is needed to draw a picture again.
    fn sheet(&self, picture: &SidePicture) -> Option<LookSheet> {
        let output = picture.renderer.output();
        // A camera of the file that moves with an animation is found again by its index.
        let size = [output.width(), output.height()];
        Some(LookSheet::new(&picture.prepared()?.report, picture.drawn()?, size, &self.gpu.description()))
    }

    /// Lets the hand, the turntable and what was asked for move the camera.
    fn move_camera(&self, ui: &Ui, response: &Response, state: &mut PanelState) {
        if response.clicked() || response.drag_started() {
            // The keys are the window's again.
            ui.ctx().memory_mut(|memory| memory.focused().map(|field| memory.surrender_focus(field)));
        }
        if response.double_clicked()
            && let Some(pointer) = response.interact_pointer_pos()
        {
            let place = (pointer - response.rect.min) / response.rect.size();
            state.frame_asked = Some(Framing::At([place.x, place.y]));
        }
        if let Some(framing) = state.frame_asked.take() {
            self.frame(framing, &mut state.view);
        }
        self.turn(ui, response, state);
        let index = side_below_hand(ui, response, state);
        let renderer = &self.pictures[index].renderer;
        control_camera(renderer, ui, response, moved_view(index, state));
    }

    fn frame(&self, framing: Framing, view: &mut View) {
        let renderer = &self.pictures[B].renderer;
        let (Some(camera), Some(pose)) = (renderer.camera(view), renderer.pose()) else { return };
        let picked = match framing {
            Framing::Scene => None,
            Framing::At(place) => {
                let (origin, direction) = camera.ray(place, renderer.aspect());
                pick(pose, origin, direction)
            }
        };
        if let Some(bounds) = picked.or(pose.bounds) {
            view.camera = Some(camera.framed(bounds, renderer.aspect()));
        }
    }

    fn turn(&self, ui: &Ui, response: &Response, state: &mut PanelState) {
        let Some(turning) = state.turntable.turning else { return };
        if response.dragged() && turning == Turning::Camera {
            // The hand takes over.
            state.turntable.turning = None;
            return;
        }
        let step_rad = state.turntable.step_rad(ui.input(|input| input.stable_dt));
        match turning {
            Turning::Light => {
                let turned = state.view.environment_rotation_rad + step_rad;
                state.view.environment_rotation_rad = turned.rem_euclid(std::f32::consts::TAU);
            }
            Turning::Camera => {
                if let Some(mut camera) = self.camera(state) {
                    camera.orbit(step_rad, 0.0);
                    state.view.camera = Some(camera);
                }
            }
        }
        ui.ctx().request_repaint();
    }
}

/// Which picture the hand is on: it matters where both have cameras of their own.
fn side_below_hand(ui: &Ui, response: &Response, state: &PanelState) -> usize {
    let compare = &state.compare;
    if !compare.is_shown() || compare.is_linked {
        return B;
    }
    // Where a drag began, wherever it goes.
    let pointer = ui.input(|input| input.pointer.press_origin().or(input.pointer.hover_pos()));
    match compare.mode {
        Mode::Flip => compare.flipped_to.min(B),
        Mode::HeatMap => B,
        Mode::Swipe => {
            let divider = response.rect.left() + compare.divider * response.rect.width();
            if pointer.is_some_and(|pointer| pointer.x < divider) { A } else { B }
        }
    }
}

/// The view that the hand changes on a picture: a pin's where it has a camera of its own.
fn moved_view(index: usize, state: &mut PanelState) -> &mut View {
    let PanelState { compare, view, .. } = state;
    let has_its_own = compare.is_shown() && !compare.is_linked;
    match compare.sides[index] {
        Side::Pin(id) if has_its_own => {
            let pin = compare.pins.iter_mut().find(|pin| pin.id == id);
            pin.map_or(view, |pin| &mut pin.look.view)
        }
        _ => view,
    }
}

fn control_camera(renderer: &Renderer, ui: &Ui, response: &Response, view: &mut View) {
    let scroll = if response.hovered() { ui.input(|input| input.smooth_scroll_delta().y) } else { 0.0 };
    let drag = response.drag_delta() / response.rect.height().max(1.0);
    if drag == egui::Vec2::ZERO && scroll == 0.0 {
        return;
    }
    let Some(mut camera) = renderer.camera(view) else { return };
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

/// The space that is left, on whole pixels of the screen, and how many: pictures are shown texel by pixel at any scale.
fn whole_pixels(ui: &Ui) -> (Rect, [u32; 2]) {
    let scale = ui.ctx().pixels_per_point();
    let space = ui.available_rect_before_wrap();
    let min = (space.min.to_vec2() * scale).ceil();
    let size = ((space.max.to_vec2() * scale).floor() - min).max(egui::Vec2::splat(1.0));
    (Rect::from_min_size((min / scale).to_pos2(), size / scale), [size.x as u32, size.y as u32])
}
