//! Looking into the frame: channels, marks on what no display can show, the pixel under the pointer, times of passes.

use egui::{Color32, ComboBox, Grid, RichText, Sense, Slider, Ui, Vec2};

use super::PanelState;
use super::side::{row, section};
use crate::channel::{Channel, Encoding, LEVEL_COLORS};
use crate::faults::FaultCounts;
use crate::inspect::InspectionState;
use crate::pass_timer::PassTime;
use crate::probe::PixelProbe;
use crate::scaling::FrameQuality;
use crate::theme;

/// Where marks begin: no 16-bit float is larger.
const F16_MAX: f32 = 65504.0;

/// What was found out about the frames that are shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Findings {
    /// The pixel under the pointer, or the pinned one.
    pub probe: Option<PixelProbe>,
    pub faults: Option<FaultCounts>,
    /// Empty where the device has no clocks.
    pub pass_times: Vec<PassTime>,
    /// From one frame to the next while the picture changes.
    pub frame_ms: Option<f64>,
    /// What moving frames are drawn with; `None` before the first.
    pub moving: Option<FrameQuality>,
}

pub(super) fn show(ui: &mut Ui, state: &mut PanelState) {
    section(ui, "Look into");
    show_channels(ui, state);
    show_marks(ui, state);
}

fn show_channels(ui: &mut Ui, state: &mut PanelState) {
    let PanelState { report, view, .. } = state;
    let label = |channel: Option<Channel>| channel.map_or("picture", Channel::label);
    let list = ComboBox::from_id_salt("channel").width(ui.available_width() - 8.0).height(420.0);
    let response = list.selected_text(label(view.channel)).show_ui(ui, |ui| {
        for channel in std::iter::once(None).chain(Channel::ALL.map(Some)) {
            let refusal = channel.and_then(|channel| report.inspection.refusal(channel));
            let row = egui::Button::selectable(view.channel == channel, label(channel));
            let row = ui.add_enabled(refusal.is_none(), row);
            if row.clicked() {
                view.channel = channel;
            }
            row.on_disabled_hover_text(refusal.unwrap_or_default());
        }
    });
    response.response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ComboBox, true, "channel"));
    let Some(channel) = view.channel else { return };
    if let Some(refusal) = report.inspection.refusal(channel) {
        ui.label(RichText::new(format!("Not shown: {refusal}.")).small().color(theme::of(ui).warning));
    } else if report.inspection.state == InspectionState::NotAsked {
        ui.label(RichText::new("Waiting for the shaders that show it.").small().color(theme::of(ui).weak));
    } else {
        show_legend(ui, channel, &report.inspection.variants);
    }
}

fn show_legend(ui: &mut Ui, channel: Channel, variants: &[(String, [f32; 3])]) {
    let text = match channel.encoding() {
        Encoding::Color => "Linear values, sRGB-encoded like textures.",
        Encoding::Data => "0 is black, 1 is white, 0.5 is 128 of 255.",
        Encoding::Direction => "x, y, z in the world from -1 to 1 are red, green, blue from 0 to 1.",
        Encoding::Uv => "Red and green are the fractions of u and v.",
        Encoding::Level => "The level read of the base colour's texture; 0 is the sharpest.",
        Encoding::Radiance => "What it adds to the picture, exposed and tone-mapped.",
    };
    if channel != Channel::Variant {
        ui.label(RichText::new(text).small().color(theme::of(ui).weak));
    }
    if channel == Channel::Mip {
        ui.horizontal(|ui| {
            for (level, color) in LEVEL_COLORS.iter().enumerate() {
                swatch(ui, color.map(|component| (component * 255.0) as u8));
                ui.label(RichText::new(level.to_string()).small());
            }
        });
    }
    for (name, color) in variants.iter().filter(|_| channel == Channel::Variant) {
        ui.horizontal(|ui| {
            swatch(ui, color.map(encode));
            ui.label(RichText::new(name).small());
        });
    }
}

/// IEC 61966-2-1, of 255.
fn encode(linear: f32) -> u8 {
    egui::ecolor::gamma_u8_from_linear_f32(linear)
}

fn swatch(ui: &mut Ui, [red, green, blue]: [u8; 3]) {
    let (place, _) = ui.allocate_exact_size(Vec2::splat(10.0), Sense::hover());
    ui.painter().rect_filled(place, 2.0, Color32::from_rgb(red, green, blue));
}

fn show_marks(ui: &mut Ui, state: &mut PanelState) {
    let PanelState { view, findings, report, .. } = state;
    let mut is_marking = view.fault_limit.is_some();
    let help = "Stripes over pixels with radiance that is no number, infinite, negative, or above the limit";
    if ui.checkbox(&mut is_marking, "Mark faults").on_hover_text(help).changed() {
        view.fault_limit = is_marking.then_some(F16_MAX);
    }
    let Some(limit) = &mut view.fault_limit else { return };
    Grid::new("fault limit").num_columns(2).spacing([12.0, 8.0]).show(ui, |ui| {
        row(ui, "Limit", Slider::new(limit, 1.0..=F16_MAX).logarithmic(true).max_decimals(0));
    });
    if let InspectionState::Unable(reason) = &report.inspection.state {
        let text = format!("Only what the shader writes is seen, as 16-bit floats: {reason}.");
        ui.label(RichText::new(text).small().color(theme::of(ui).weak));
    }
    for (name, count, color) in findings.faults.unwrap_or_default().rows() {
        ui.horizontal(|ui| {
            swatch(ui, color);
            let text = RichText::new(format!("{name}: {count} pixels")).small();
            ui.label(if count > 0 {
                text.color(theme::of(ui).error)
            } else {
                text.color(theme::of(ui).weak)
            });
        });
    }
}

/// The pixel under the pointer.
pub(super) fn show_probe(ui: &mut Ui, probe: Option<&PixelProbe>) {
    section(ui, "Pixel");
    let Some(probe) = probe else {
        let help = "Point at the picture; right click pins a pixel, and right click again lets it go.";
        ui.label(RichText::new(help).small().color(theme::of(ui).weak));
        return;
    };
    Grid::new("pixel").num_columns(2).spacing([12.0, 2.0]).show(ui, |ui| {
        for (name, value) in probe_rows(probe) {
            ui.label(RichText::new(name).small().color(theme::of(ui).weak));
            ui.label(RichText::new(value).monospace().small());
            ui.end_row();
        }
    });
}

fn probe_rows(probe: &PixelProbe) -> Vec<(String, String)> {
    let numbers = |values: &[f32]| values.iter().map(|value| number(*value)).collect::<Vec<_>>().join("  ");
    let [red, green, blue] = probe.srgb;
    let mut rows = vec![("pixel".to_owned(), format!("{}, {}", probe.pixel[0], probe.pixel[1]))];
    let mut push = |name: &str, value: Option<String>| {
        rows.extend(value.map(|value| (name.to_owned(), value)));
    };
    if let Some((channel, value)) = &probe.channel {
        let value = value.as_ref().map_or_else(|| "nothing here".to_owned(), |value| numbers(value));
        push(channel.name(), Some(value));
    }
    push("radiance", probe.radiance.map(|radiance| numbers(&radiance)));
    push("luminance", probe.luminance.map(number));
    push("above grey", probe.ev_above_middle_grey.map(|stops| format!("{stops:+.2} EV")));
    push("shown", Some(format!("{red}  {green}  {blue}   #{red:02x}{green:02x}{blue:02x}")));
    push("position", probe.position.map(|position| numbers(&position)));
    push("depth", probe.depth.map(|depth| format!("{depth:.6}")));
    rows
}

/// Four digits that count.
fn number(value: f32) -> String {
    let size = value.abs();
    if !value.is_finite() || size == 0.0 || (1e-3..1e5).contains(&size) {
        let whole = if size >= 1.0 { size.log10().floor() as i32 + 1 } else { 0 };
        format!("{value:.*}", (4 - whole).clamp(0, 4) as usize)
    } else {
        format!("{value:.3e}")
    }
}

/// What frames cost.
pub(super) fn show_times(ui: &mut Ui, findings: &Findings) {
    if findings.frame_ms.is_none() && findings.pass_times.is_empty() {
        return;
    }
    section(ui, "Frame");
    Grid::new("times").num_columns(2).spacing([12.0, 2.0]).show(ui, |ui| {
        let mut line = |name: &str, value: String| {
            ui.label(RichText::new(name).small().color(theme::of(ui).weak));
            ui.label(RichText::new(value).monospace().small());
            ui.end_row();
        };
        for time in &findings.pass_times {
            line(&time.pass, format!("{:.2} ms", time.ms));
        }
        if let Some(frame_ms) = findings.frame_ms {
            line("whole frame", format!("{frame_ms:.1} ms"));
        }
        if let Some(moving) = findings.moving.filter(|moving| *moving != FrameQuality::WHOLE) {
            line("while it moves", format!("{:.0} % of the size, one sample a pixel", moving.scale * 100.0));
        }
    });
}
