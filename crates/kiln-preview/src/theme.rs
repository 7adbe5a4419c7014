//! Colours and spacing of the panels: quiet, so that the picture is what one sees. Dark or light; the place around the picture
//! is dark in both, because the eye judges a picture by what is beside it.

use egui::{
    Color32, CornerRadius, FontFamily, FontId, Margin, Stroke, TextStyle, Theme, ThemePreference, Ui, Vec2,
};

use crate::saved::ThemeChoice;

/// Behind the picture.
pub(crate) const VIEWPORT: Color32 = Color32::from_rgb(0x0e, 0x0f, 0x11);

/// The colours of a theme. Every text has a contrast of 4.5 to 1 with what it stands on (WCAG 2.2, 1.4.3).
#[derive(Debug)]
pub(crate) struct Palette {
    pub panel: Color32,
    pub raised: Color32,
    pub line: Color32,
    pub text: Color32,
    pub weak: Color32,
    pub accent: Color32,
    pub good: Color32,
    pub warning: Color32,
    pub error: Color32,
    /// Behind what is chosen.
    pub chosen: Color32,
    /// Behind what is typed.
    pub field: Color32,
}

pub(crate) const DARK: Palette = Palette {
    panel: Color32::from_rgb(0x18, 0x1a, 0x1d),
    raised: Color32::from_rgb(0x23, 0x26, 0x2a),
    line: Color32::from_rgb(0x2c, 0x30, 0x35),
    text: Color32::from_rgb(0xd8, 0xdb, 0xdf),
    weak: Color32::from_rgb(0x96, 0x9d, 0xa5),
    accent: Color32::from_rgb(0xe3, 0x91, 0x4f),
    good: Color32::from_rgb(0x7f, 0xb9, 0x86),
    warning: Color32::from_rgb(0xdc, 0xb8, 0x62),
    error: Color32::from_rgb(0xe8, 0x7a, 0x75),
    chosen: Color32::from_rgb(0x66, 0x41, 0x24),
    field: VIEWPORT,
};

pub(crate) const LIGHT: Palette = Palette {
    panel: Color32::from_rgb(0xf3, 0xf4, 0xf5),
    raised: Color32::from_rgb(0xe3, 0xe5, 0xe8),
    line: Color32::from_rgb(0xc8, 0xcc, 0xd1),
    text: Color32::from_rgb(0x1d, 0x20, 0x24),
    weak: Color32::from_rgb(0x54, 0x5a, 0x62),
    accent: Color32::from_rgb(0x8f, 0x47, 0x0c),
    good: Color32::from_rgb(0x22, 0x60, 0x2d),
    warning: Color32::from_rgb(0x66, 0x4b, 0x00),
    error: Color32::from_rgb(0xa8, 0x1f, 0x1a),
    chosen: Color32::from_rgb(0xf0, 0xcf, 0xb2),
    field: Color32::from_rgb(0xff, 0xff, 0xff),
};

/// The colours that `ui` is drawn in.
pub(crate) fn of(ui: &Ui) -> &'static Palette {
    if ui.visuals().dark_mode { &DARK } else { &LIGHT }
}

/// Applies colours, fonts and spacing to the context's themes; until one is chosen it is the system's.
pub(crate) fn apply(context: &egui::Context) {
    for (theme, palette) in [(Theme::Dark, &DARK), (Theme::Light, &LIGHT)] {
        context.style_mut_of(theme, |style| style.visuals = visuals(theme, palette));
    }
    choose(context, ThemeChoice::System);
    context.options_mut(|options| options.fallback_theme = Theme::Dark);
    context.all_styles_mut(|style| {
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

/// Draws in another theme from the next frame on.
pub(crate) fn choose(context: &egui::Context, choice: ThemeChoice) {
    let preference = match choice {
        ThemeChoice::System => ThemePreference::System,
        ThemeChoice::Dark => ThemePreference::Dark,
        ThemeChoice::Light => ThemePreference::Light,
    };
    if context.options(|options| options.theme_preference) != preference {
        context.set_theme(preference);
        context.request_repaint();
    }
}

fn visuals(theme: Theme, palette: &Palette) -> egui::Visuals {
    let mut visuals = theme.default_visuals();
    visuals.panel_fill = palette.panel;
    visuals.window_fill = palette.panel;
    visuals.window_stroke = Stroke::new(1.0, palette.line);
    visuals.extreme_bg_color = palette.field;
    visuals.faint_bg_color = palette.raised;
    visuals.override_text_color = Some(palette.text);
    visuals.weak_text_color = Some(palette.weak);
    visuals.warn_fg_color = palette.warning;
    visuals.error_fg_color = palette.error;
    visuals.selection.bg_fill = palette.chosen;
    visuals.selection.stroke = Stroke::new(1.0, palette.accent);
    visuals.slider_trailing_fill = true;
    let widgets = &mut visuals.widgets;
    for (widget, fill) in [
        (&mut widgets.noninteractive, palette.panel),
        (&mut widgets.inactive, palette.raised),
        (&mut widgets.hovered, palette.line),
        (&mut widgets.active, palette.line),
        (&mut widgets.open, palette.raised),
    ] {
        widget.bg_fill = fill;
        widget.weak_bg_fill = fill;
        widget.bg_stroke = Stroke::new(1.0, palette.line);
        widget.fg_stroke.color = palette.text;
        widget.corner_radius = CornerRadius::same(4);
    }
    visuals
}

/// What lies behind a badge of this colour.
pub(crate) fn badge_fill(color: Color32) -> Color32 {
    color.gamma_multiply(0.18)
}

/// A panel's frame.
pub(crate) fn panel_frame(ui: &Ui) -> egui::Frame {
    egui::Frame::new().fill(of(ui).panel).inner_margin(Margin::symmetric(14, 10))
}

/// A card that lies over the picture.
pub(crate) fn card_frame(ui: &Ui, edge: Color32) -> egui::Frame {
    egui::Frame::new()
        .fill(of(ui).panel)
        .stroke(Stroke::new(1.0, edge.gamma_multiply(0.6)))
        .corner_radius(CornerRadius::same(6))
        .inner_margin(Margin::symmetric(12, 10))
}
