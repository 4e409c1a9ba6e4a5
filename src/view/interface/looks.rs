//! Colours, spacing and type of the window, in light and dark.

use egui::{Color32, Context, CornerRadius, FontId, Stroke, TextStyle, Theme, Visuals, vec2};

/// The colour of what is chosen, dragged or worked on: the blue-green of glass.
pub(in crate::view) const ACCENT: Color32 = Color32::from_rgb(0x1f, 0x9e, 0x98);
/// What failed.
pub(super) const FAILURE: Color32 = Color32::from_rgb(0xd2, 0x4b, 0x3e);

/// Dresses the interface.
pub(in crate::view) fn apply(ctx: &Context) {
    for (theme, visuals) in [(Theme::Dark, dark()), (Theme::Light, light())] {
        ctx.set_visuals_of(theme, visuals);
    }
    ctx.all_styles_mut(|style| {
        style.spacing.item_spacing = vec2(8.0, 6.0);
        style.spacing.button_padding = vec2(8.0, 4.0);
        style.spacing.slider_width = 132.0;
        style.spacing.combo_width = 132.0;
        style.text_styles.insert(TextStyle::Heading, FontId::proportional(19.0));
        style.text_styles.insert(TextStyle::Body, FontId::proportional(13.5));
        style.text_styles.insert(TextStyle::Button, FontId::proportional(13.5));
        style.text_styles.insert(TextStyle::Small, FontId::proportional(11.5));
        style.interaction.tooltip_delay = 0.35;
    });
}

fn dark() -> Visuals {
    let mut visuals = Visuals::dark();
    visuals.panel_fill = Color32::from_rgb(0x20, 0x22, 0x25);
    visuals.window_fill = Color32::from_rgb(0x26, 0x28, 0x2c);
    visuals.extreme_bg_color = Color32::from_rgb(0x17, 0x18, 0x1a);
    visuals.widgets.noninteractive.fg_stroke.color = Color32::from_rgb(0xd6, 0xd8, 0xda);
    visuals.widgets.inactive.fg_stroke.color = Color32::from_rgb(0xe4, 0xe6, 0xe8);
    accented(visuals, Color32::WHITE)
}

fn light() -> Visuals {
    let mut visuals = Visuals::light();
    visuals.panel_fill = Color32::from_rgb(0xf4, 0xf3, 0xf0);
    visuals.window_fill = Color32::from_rgb(0xfb, 0xfa, 0xf8);
    visuals.widgets.noninteractive.fg_stroke.color = Color32::from_rgb(0x2b, 0x2d, 0x30);
    visuals.widgets.inactive.fg_stroke.color = Color32::from_rgb(0x20, 0x22, 0x25);
    accented(visuals, Color32::WHITE)
}

fn accented(mut visuals: Visuals, on_accent: Color32) -> Visuals {
    visuals.selection.bg_fill = ACCENT;
    visuals.selection.stroke = Stroke::new(1.0, on_accent);
    visuals.hyperlink_color = ACCENT;
    visuals.slider_trailing_fill = true;
    for widget in [
        &mut visuals.widgets.noninteractive,
        &mut visuals.widgets.inactive,
        &mut visuals.widgets.hovered,
        &mut visuals.widgets.active,
        &mut visuals.widgets.open,
    ] {
        widget.corner_radius = CornerRadius::same(5);
    }
    visuals
}

/// The colour around the picture, which must not tint what one sees.
pub(super) fn stage_color(is_dark: bool) -> Color32 {
    Color32::from_gray(if is_dark { 0x18 } else { 0xd8 })
}

/// Both colours of the pattern behind transparent pictures.
pub(super) fn checker_colors(is_dark: bool) -> (Color32, Color32) {
    let [even, odd] = if is_dark { [0x3a, 0x46] } else { [0xff, 0xe2] };
    (Color32::from_gray(even), Color32::from_gray(odd))
}

/// The colour of an error of a pixel, 0 to 765: black, blue-green, yellow, white.
pub(super) fn error_color(error: u16) -> Color32 {
    // Most errors are small, and the eye should tell them apart.
    let share = (f32::from(error) / 384.0).min(1.0).sqrt();
    const STOPS: [[f32; 3]; 4] = [[8.0, 10.0, 20.0], [31.0, 110.0, 130.0], [240.0, 200.0, 70.0], [255.0, 255.0, 255.0]];
    let place = share * 3.0;
    let first = (place as usize).min(2);
    let between = place - first as f32;
    let mix = |channel: usize| STOPS[first][channel] + between * (STOPS[first + 1][channel] - STOPS[first][channel]);
    Color32::from_rgb(mix(0) as u8, mix(1) as u8, mix(2) as u8)
}

/// A name as a title.
pub(super) fn title(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().collect::<String>() + letters.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_larger_error_is_brighter() {
        let luma = |error| {
            let [r, g, b, _] = error_color(error).to_array();
            u32::from(r) * 3 + u32::from(g) * 6 + u32::from(b)
        };
        assert!((0..384).all(|error| luma(error) <= luma(error + 1)));
        assert_eq!(error_color(765), Color32::WHITE);
        assert_eq!(title("mosaic"), "Mosaic");
    }
}
