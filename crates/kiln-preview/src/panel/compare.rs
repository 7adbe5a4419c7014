//! A|B: what is pinned, which two pictures are compared and how. Plain state; `crate::side_picture` draws.

use egui::{Align2, Color32, FontId, Id, Rect, Sense, Stroke, TextureId, Ui, pos2, vec2};

use super::PanelState;
use crate::look::Look;
use crate::theme;

/// Pins kept at once: each may hold a whole scene and its maps on the device.
pub(crate) const PINS_MAX: usize = 8;
/// Width of the place by which the divider is taken.
const GRIP: f32 = 14.0;

/// Which picture stands on a side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) enum Side {
    /// What the panels show, of the newest or the held revision.
    #[default]
    Live,
    /// [`Pin::id`].
    Pin(u64),
}

/// How two pictures are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Mode {
    /// A to the left of a line, B to its right.
    #[default]
    Swipe,
    /// One of them, changed by a key.
    Flip,
    /// Where and how much an observer notices, FLIP.
    HeatMap,
}

/// A picture kept: what it is drawn with and how it is seen.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pin {
    pub id: u64,
    pub revision: u64,
    pub look: Look,
    /// Whether only its settings count, and the revision follows the live one. Selection and overrides have to be the live
    /// ones for that; while they are not it stays as it was pinned.
    pub is_settings: bool,
    /// What it holds on the device, shared or not.
    pub bytes: u64,
}

impl Pin {
    /// In a few words.
    pub fn title(&self) -> String {
        let what = if self.is_settings { "settings of revision" } else { "revision" };
        let shown = &self.look.selection;
        let names = [shown.scene.as_deref(), shown.env.as_deref(), shown.variant.as_deref()];
        let names = names.into_iter().flatten().collect::<Vec<_>>().join(", ");
        format!("{}: {what} {}, {names}", self.id, self.revision)
    }
}

/// How much two pictures of one size differ, display values; see `kiln_image::compare`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Numbers {
    pub rmse: f64,
    pub psnr_db: f64,
    pub flip_mean: f64,
    pub flip_max: f64,
    /// In 1/255.
    pub difference_max: u8,
}

impl Numbers {
    /// A line.
    pub fn text(&self) -> String {
        let Numbers { rmse, psnr_db, flip_mean, flip_max, difference_max } = self;
        let psnr = if psnr_db.is_finite() { format!("{psnr_db:.1} dB") } else { "equal".to_owned() };
        format!(
            "RMSE {rmse:.5}   PSNR {psnr}   FLIP {flip_mean:.4}, at most {flip_max:.3}   channel ≤ {difference_max}/255"
        )
    }
}

/// Everything about A|B.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Compare {
    pub is_on: bool,
    pub pins: Vec<Pin>,
    /// A, then B.
    pub sides: [Side; 2],
    pub mode: Mode,
    /// Of the picture's width, from the left.
    pub divider: f32,
    /// What flip shows: 0 = A, 1 = B.
    pub flipped_to: usize,
    /// Whether both are seen by the live camera at the live moment.
    pub is_linked: bool,
    /// `None` until measured, or while the picture moves.
    pub numbers: Option<Numbers>,
    /// Device memory that pins hold and the live picture does not.
    pub own_bytes: u64,
    next_id: u64,
}

impl Default for Compare {
    fn default() -> Self {
        Compare {
            is_on: false,
            pins: Vec::new(),
            sides: [Side::Live; 2],
            mode: Mode::Swipe,
            divider: 0.5,
            flipped_to: 1,
            is_linked: true,
            numbers: None,
            own_bytes: 0,
            next_id: 1,
        }
    }
}

impl Compare {
    /// Whether there is something to compare: pins, and two sides that differ.
    pub fn is_shown(&self) -> bool {
        self.is_on && self.sides[0] != self.sides[1]
    }

    pub fn toggle(&mut self) {
        self.is_on = !self.is_on && self.has_pins();
    }

    pub fn compare_by(&mut self, mode: Mode) {
        self.mode = mode;
        self.is_on = self.has_pins();
    }

    pub fn show_side(&mut self, side: usize) {
        self.compare_by(Mode::Flip);
        self.flipped_to = side;
    }

    pub fn pin(&self, id: u64) -> Option<&Pin> {
        self.pins.iter().find(|pin| pin.id == id)
    }

    /// Forgets a pin; a side that showed it is live again.
    pub fn unpin(&mut self, id: u64) {
        self.pins.retain(|pin| pin.id != id);
        for side in &mut self.sides {
            if *side == Side::Pin(id) {
                *side = Side::Live;
            }
        }
        if self.sides[0] == self.sides[1] {
            self.sides[0] = self.pins.last().map_or(Side::Live, |pin| Side::Pin(pin.id));
        }
        self.is_on &= self.sides[0] != self.sides[1];
    }

    fn has_pins(&self) -> bool {
        !self.pins.is_empty()
    }

    fn title(&self, side: Side, live: &str) -> String {
        match side {
            Side::Live => live.to_owned(),
            Side::Pin(id) => self.pin(id).map_or_else(|| live.to_owned(), Pin::title),
        }
    }
}

impl PanelState {
    /// Keeps the live picture and compares it with what comes; the oldest pin goes if there are too many.
    pub(crate) fn pin_as_a(&mut self) {
        if self.report.revision == 0 {
            return;
        }
        let compare = &mut self.compare;
        if compare.pins.len() == PINS_MAX {
            compare.unpin(compare.pins[0].id);
        }
        let id = compare.next_id;
        compare.next_id += 1;
        let look = Look { selection: self.report.shown.clone(), view: self.view.clone() };
        compare.pins.push(Pin { id, revision: self.report.revision, look, is_settings: false, bytes: 0 });
        (compare.sides, compare.is_on) = ([Side::Pin(id), Side::Live], true);
    }
}

/// What to paint: the pictures of A and B, and the heat map if there is one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pictures {
    pub sides: [TextureId; 2],
    pub heat_map: Option<TextureId>,
}

/// Paints both sides into `place` and lets the divider be dragged.
pub(crate) fn paint(ui: &mut Ui, place: Rect, pictures: Pictures, state: &mut PanelState) {
    let live = format!("live, revision {}", state.report.revision);
    let compare = &mut state.compare;
    let titles = compare.sides.map(|side| compare.title(side, &live));
    match compare.mode {
        Mode::Swipe => swipe(ui, place, pictures, compare, &titles),
        Mode::Flip => {
            let side = compare.flipped_to.min(1);
            picture(ui, pictures.sides[side], place, place);
            label(ui, place, side, &titles[side]);
        }
        Mode::HeatMap => {
            match pictures.heat_map {
                Some(heat_map) => picture(ui, heat_map, place, place),
                None => picture(ui, pictures.sides[1], place, place),
            }
            let text = if pictures.heat_map.is_some() { "FLIP of A and B" } else { "measuring A and B" };
            text_on_dark(ui, place.left_center() + vec2(14.0, 0.0), Align2::LEFT_CENTER, text);
        }
    }
    let numbers = compare.numbers.map_or_else(|| "numbers when the picture rests".to_owned(), |it| it.text());
    let top = pos2(place.center().x, place.top() + 10.0);
    text_on_dark(ui, top, Align2::CENTER_TOP, &numbers);
}

fn swipe(ui: &mut Ui, place: Rect, pictures: Pictures, compare: &mut Compare, titles: &[String; 2]) {
    let x_of = |divider: f32| place.left() + divider.clamp(0.0, 1.0) * place.width();
    let grip =
        Rect::from_center_size(pos2(x_of(compare.divider), place.center().y), vec2(GRIP, place.height()));
    let response = ui.interact(grip, Id::unique("kiln divider"), Sense::drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Slider, true, "divider"));
    if let Some(pointer) = response.interact_pointer_pos().filter(|_| response.dragged()) {
        compare.divider = ((pointer.x - place.left()) / place.width().max(1.0)).clamp(0.0, 1.0);
    }
    // On a whole pixel: both pictures keep theirs.
    let scale = ui.ctx().pixels_per_point();
    let x = (x_of(compare.divider) * scale).round() / scale;
    let (left, right) = place.split_left_right_at_x(x);
    picture(ui, pictures.sides[0], place, left);
    picture(ui, pictures.sides[1], place, right);
    let color =
        if response.hovered() || response.dragged() { theme::of(ui).accent } else { Color32::from_gray(210) };
    ui.painter().vline(x, place.y_range(), Stroke::new(1.0, color));
    ui.painter().circle_filled(pos2(x, place.center().y), 5.0, color);
    if response.hovered() || response.dragged() {
        ui.ctx().set_cursor_icon(egui::CursorIcon::ResizeHorizontal);
    }
    label(ui, place, 0, &titles[0]);
    label(ui, place, 1, &titles[1]);
}

/// The part of a picture that lies in `part`.
fn picture(ui: &Ui, texture: TextureId, place: Rect, part: Rect) {
    let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
    ui.painter().with_clip_rect(part).image(texture, place, whole, Color32::WHITE);
}

/// The name of a side at its edge, where no card lies over it.
fn label(ui: &Ui, place: Rect, side: usize, title: &str) {
    let (corner, align, name) = match side {
        0 => (place.left_center() + vec2(14.0, 0.0), Align2::LEFT_CENTER, "A"),
        _ => (place.right_center() + vec2(-14.0, 0.0), Align2::RIGHT_CENTER, "B"),
    };
    text_on_dark(ui, corner, align, &format!("{name}  {title}"));
}

/// Text that is legible over any picture.
fn text_on_dark(ui: &Ui, at: egui::Pos2, align: Align2, text: &str) {
    let (font, width) = (FontId::proportional(12.0), (ui.clip_rect().width() - 40.0).max(80.0));
    let galley = ui.painter().layout(text.to_owned(), font, theme::DARK.text, width);
    let place = align.anchor_size(at, galley.size());
    ui.painter().rect_filled(place.expand2(vec2(8.0, 4.0)), 5.0, Color32::from_black_alpha(190));
    ui.painter().galley(place.min, galley, theme::DARK.text);
}

/// The section beside the picture.
pub(super) fn show(ui: &mut Ui, state: &mut PanelState) {
    super::side::section(ui, "Compare A | B");
    ui.horizontal_wrapped(|ui| {
        let pin = egui::Button::new("Pin as A");
        if ui.add_enabled(state.report.revision > 0, pin).on_hover_text("P").clicked() {
            state.pin_as_a();
        }
        let compare = &mut state.compare;
        if compare.has_pins() {
            let label = if compare.is_on { "Stop comparing" } else { "Compare" };
            if ui.button(label).on_hover_text("C").clicked() {
                compare.toggle();
            }
        }
    });
    let compare = &mut state.compare;
    if !compare.has_pins() {
        return;
    }
    ui.horizontal(|ui| {
        for (mode, name) in [(Mode::Swipe, "Swipe"), (Mode::Flip, "Flip"), (Mode::HeatMap, "Heat map")] {
            if ui.selectable_label(compare.mode == mode, name).clicked() {
                compare.compare_by(mode);
            }
        }
    });
    show_sides(ui, compare);
    ui.checkbox(&mut compare.is_linked, "same camera and moment");
    show_pins(ui, compare);
}

fn show_sides(ui: &mut Ui, compare: &mut Compare) {
    for (index, name) in ["A", "B"].into_iter().enumerate() {
        ui.horizontal(|ui| {
            ui.label(name);
            let shown = compare.title(compare.sides[index], "live");
            let list = egui::ComboBox::from_id_salt(name).width(ui.available_width() - 8.0).truncate();
            let choices = std::iter::once(Side::Live).chain(compare.pins.iter().map(|pin| Side::Pin(pin.id)));
            let choices: Vec<(Side, String)> =
                choices.map(|side| (side, compare.title(side, "live"))).collect();
            let response = list.selected_text(shown).show_ui(ui, |ui| {
                for (side, title) in choices {
                    ui.selectable_value(&mut compare.sides[index], side, title);
                }
            });
            let label = format!("side {name}");
            response.response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ComboBox, true, &label));
        });
    }
}

fn show_pins(ui: &mut Ui, compare: &mut Compare) {
    let mut unpinned = None;
    for pin in &mut compare.pins {
        ui.horizontal(|ui| {
            let unpin = ui.small_button("Unpin");
            unpin.widget_info(|| {
                egui::WidgetInfo::labeled(egui::Role::Button, true, format!("unpin {}", pin.id))
            });
            if unpin.clicked() {
                unpinned = Some(pin.id);
            }
            let help = "draw the newest revision with the pinned light, camera and parameters";
            ui.checkbox(&mut pin.is_settings, "settings only").on_hover_text(help);
            ui.label(
                egui::RichText::new(format!("{}  {}", pin.id, megabytes(pin.bytes)))
                    .small()
                    .color(theme::of(ui).weak),
            );
        });
    }
    if let Some(id) = unpinned {
        compare.unpin(id);
    }
    let text = format!("pins hold {} beside the live picture", megabytes(compare.own_bytes));
    ui.label(egui::RichText::new(text).small().color(theme::of(ui).weak));
}

/// `12.3 MB`.
pub(crate) fn megabytes(bytes: u64) -> String {
    format!("{:.1} MB", bytes as f64 / 1e6)
}
