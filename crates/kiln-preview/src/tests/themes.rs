//! Themes and sizes: texts can be read, and everything has its place in a small window.

use egui::Color32;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;

use super::panels::{harness, state};
use crate::panel::{self, PanelState};
use crate::saved::ThemeChoice;
use crate::theme::{self, DARK, LIGHT, Palette, badge_fill};

/// WCAG 2.2, 1.4.3: what text needs.
const CONTRAST_MIN: f32 = 4.5;

/// WCAG 2.2, "contrast ratio" of "relative luminances".
fn contrast(a: Color32, b: Color32) -> f32 {
    let linear = |channel: u8| {
        let value = f32::from(channel) / 255.0;
        if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    };
    let luminance =
        |color: Color32| 0.2126 * linear(color.r()) + 0.7152 * linear(color.g()) + 0.0722 * linear(color.b());
    let (a, b) = (luminance(a), luminance(b));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

/// Texts of a theme with what they stand on.
fn pairs(palette: &Palette) -> Vec<(&'static str, Color32, Color32)> {
    let Palette { panel, raised, line, text, weak, accent, good, warning, error, chosen, field } = *palette;
    let mut pairs = vec![
        ("text on a field", text, field),
        ("text on a hovered button", text, line),
        ("text on what is chosen", text, chosen),
    ];
    for (name, color) in [("text", text), ("weak", weak), ("accent", accent)] {
        pairs.extend([(name, color, panel), (name, color, raised)]);
    }
    for (name, color) in
        [("good", good), ("warning", warning), ("error", error), ("accent", accent), ("weak", weak)]
    {
        pairs.extend([(name, color, panel), (name, color, panel.blend(badge_fill(color)))]);
    }
    pairs
}

#[test]
fn every_text_of_both_themes_has_the_contrast_that_wcag_asks_for() {
    for (theme, palette) in [("dark", &DARK), ("light", &LIGHT)] {
        for (what, text, ground) in pairs(palette) {
            let found = contrast(text, ground);
            assert!(found >= CONTRAST_MIN, "{theme}, {what}: {found:.2} of {text:?} on {ground:?}");
        }
    }
}

#[test]
fn contrast_check_rejects_a_grey_that_is_too_pale() {
    assert!((contrast(Color32::WHITE, Color32::BLACK) - 21.0).abs() < 1e-3);
    let pale = Palette { weak: Color32::from_gray(0x99), ..LIGHT };
    assert!(pairs(&pale).iter().any(|(_, text, ground)| contrast(*text, *ground) < CONTRAST_MIN));
}

#[test]
fn theme_is_chosen_in_the_panel() {
    let mut harness = Harness::builder().with_size([1280.0, 1600.0]).build_ui_state(
        |ui: &mut egui::Ui, state: &mut PanelState| panel::show(ui, state, |_, _| ()),
        state(),
    );
    theme::apply(&harness.ctx);
    harness.run_steps(4);
    assert!(harness.ctx.options(|options| options.theme_preference) == egui::ThemePreference::System);
    harness.get_by_role_and_label(egui::accesskit::Role::ComboBox, "theme").click();
    harness.run_steps(4);
    harness.get_by_label("light").click();
    harness.run_steps(4);
    assert_eq!(harness.state().layout.theme, ThemeChoice::Light);
    assert!(!harness.ctx.global_style().visuals.dark_mode);
}

#[test]
fn bar_and_panels_lie_within_the_smallest_windows() {
    for [width, height] in [[1280.0, 720.0], [640.0, 400.0]] {
        let mut state = state();
        state.report.stale = vec!["shader/pbr/base".to_owned()];
        state.project = "a project of a rather long name".to_owned();
        let mut harness = harness(state);
        harness.set_size(egui::vec2(width, height));
        harness.run_steps(4);
        for label in ["Kiln", "stale", "?", "Hold", "connected", "revision 7"] {
            let place = harness.get_by_label(label).rect();
            let window = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(width, height));
            assert!(window.contains_rect(place), "`{label}` lies at {place:?} in {window:?}");
        }
    }
}
