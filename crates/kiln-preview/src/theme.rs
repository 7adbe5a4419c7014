//! Colours and spacing of the panels: dark and quiet, so that the picture is what one sees.

use egui::{Color32, CornerRadius, FontFamily, FontId, Margin, Stroke, TextStyle, Vec2};

pub(crate) const VIEWPORT: Color32 = Color32::from_rgb(0x0e, 0x0f, 0x11);
pub(crate) const PANEL: Color32 = Color32::from_rgb(0x18, 0x1a, 0x1d);
pub(crate) const RAISED: Color32 = Color32::from_rgb(0x23, 0x26, 0x2a);
pub(crate) const LINE: Color32 = Color32::from_rgb(0x2c, 0x30, 0x35);
pub(crate) const TEXT: Color32 = Color32::from_rgb(0xd8, 0xdb, 0xdf);
pub(crate) const WEAK: Color32 = Color32::from_rgb(0x8e, 0x95, 0x9d);
pub(crate) const ACCENT: Color32 = Color32::from_rgb(0xe3, 0x91, 0x4f);
pub(crate) const GOOD: Color32 = Color32::from_rgb(0x7f, 0xb9, 0x86);
pub(crate) const WARNING: Color32 = Color32::from_rgb(0xdc, 0xb8, 0x62);
pub(crate) const ERROR: Color32 = Color32::from_rgb(0xe5, 0x70, 0x6b);

/// Applies colours, fonts and spacing to every theme of the context: there is one look.
pub(crate) fn apply(context: &egui::Context) {
    context.set_theme(egui::Theme::Dark);
    context.all_styles_mut(|style| {
        style.visuals = visuals();
        style.text_styles = [
            (TextStyle::Small, FontId::new(11.0, FontFamily::Proportional)),
            (TextStyle::Body, FontId::new(13.0, FontFamily::Proportional)),
            (TextStyle::Button, FontId::new(13.0, FontFamily::Proportional)),
            (TextStyle::Heading, FontId::new(15.0, FontFamily::Proportional)),
            (TextStyle::Monospace, FontId::new(12.0, FontFamily::Monospace)),
        ]
        .into();
        style.spacing.item_spacing = Vec2::new(8.0, 6.0);
        style.spacing.button_padding = Vec2::new(8.0, 4.0);
        style.spacing.interact_size.y = 24.0;
        style.spacing.slider_width = 150.0;
    });
}

fn visuals() -> egui::Visuals {
    let mut visuals = egui::Visuals::dark();
    visuals.panel_fill = PANEL;
    visuals.window_fill = PANEL;
    visuals.window_stroke = Stroke::new(1.0, LINE);
    visuals.extreme_bg_color = VIEWPORT;
    visuals.faint_bg_color = RAISED;
    visuals.override_text_color = Some(TEXT);
    visuals.weak_text_color = Some(WEAK);
    visuals.warn_fg_color = WARNING;
    visuals.error_fg_color = ERROR;
    visuals.selection.bg_fill = ACCENT.gamma_multiply(0.45);
    visuals.selection.stroke = Stroke::new(1.0, ACCENT);
    visuals.slider_trailing_fill = true;
    let widgets = &mut visuals.widgets;
    for (widget, fill) in [
        (&mut widgets.noninteractive, PANEL),
        (&mut widgets.inactive, RAISED),
        (&mut widgets.hovered, LINE),
        (&mut widgets.active, LINE),
        (&mut widgets.open, RAISED),
    ] {
        widget.bg_fill = fill;
        widget.weak_bg_fill = fill;
        widget.bg_stroke = Stroke::new(1.0, LINE);
        widget.corner_radius = CornerRadius::same(4);
    }
    visuals
}

/// A panel's frame.
pub(crate) fn panel_frame() -> egui::Frame {
    egui::Frame::new().fill(PANEL).inner_margin(Margin::symmetric(14, 10))
}

/// A card that lies over the picture.
pub(crate) fn card_frame(edge: Color32) -> egui::Frame {
    egui::Frame::new()
        .fill(PANEL.gamma_multiply(0.94))
        .stroke(Stroke::new(1.0, edge.gamma_multiply(0.6)))
        .corner_radius(CornerRadius::same(6))
        .inner_margin(Margin::symmetric(12, 10))
}
