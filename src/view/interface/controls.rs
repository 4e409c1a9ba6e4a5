//! The controls: everything that can be wished for. Each section holds what belongs together.

use egui::{Checkbox, CollapsingHeader, ComboBox, DragValue, Response, RichText, ScrollArea, Slider, Ui};

use super::course::grouped;
use super::files::{Field, Taken};
use super::{Interface, looks};
use crate::evolve::cells::EVALS_PER_FLY;
use crate::model::Rgb;
use crate::model::population::FLY_COUNT_MAX;
use crate::photo;
use crate::shapes::Shader;
use crate::view::news::Note;
use crate::view::wishes::{ColorWish, GroundWish, GroutWish, StyleWish, UsualBounds, Wishes};

/// Most px of the longer side at which a picture evolves here.
const SIZE_MAX: u64 = 4_096;
/// Tiles of a picture of 512x512 px, before there is one.
const USUAL_TILES: u64 = 5_000;

impl Interface {
    pub(super) fn show_controls(&mut self, ui: &mut Ui) {
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            ui.add_space(6.0);
            self.show_styles(ui);
            self.show_tiles(ui);
            section(ui, "Shape of the tiles", true, |ui| self.show_masks(ui));
            section(ui, "Grout and ground", true, |ui| show_grout(ui, &mut self.wishes));
            section(ui, "Colours", false, |ui| self.show_colors(ui));
            section(ui, "What matters", true, |ui| self.show_brush(ui));
            section(ui, "Limits", false, |ui| show_bounds(ui, &mut self.wishes));
            section(ui, "Search", false, |ui| show_search(ui, &mut self.wishes));
            ui.add_space(8.0);
            if ui.button("Reset all").on_hover_text("Put all settings back").clicked() {
                self.wishes = Wishes::default();
                self.brush.forget();
            }
            ui.add_space(6.0);
            let device = &self.news.device;
            if !device.is_empty() {
                ui.weak(format!("Searched on: {device}"));
            }
        });
    }

    fn show_styles(&mut self, ui: &mut Ui) {
        ui.label(RichText::new("Style").strong());
        ui.horizontal_wrapped(|ui| {
            for style in StyleWish::ALL {
                let is_chosen = self.wishes.style == style;
                let name = looks::title(style.name());
                if ui.selectable_label(is_chosen, name).on_hover_text(style.description()).clicked() && !is_chosen {
                    // What belongs to a style does not follow into another.
                    let kept = self.wishes.clone();
                    self.wishes = Wishes {
                        style,
                        masks: Vec::new(),
                        shader: None,
                        grout: GroutWish::OfStyle,
                        grout_width: None,
                        ground: GroundWish::OfStyle,
                        bounds: crate::view::wishes::BoundWishes::default(),
                        ..kept
                    };
                }
            }
        });
    }

    fn show_tiles(&mut self, ui: &mut Ui) {
        let present = self.news.tiles.as_ref().map(|tiles| tiles.flies.len()).or(Some(self.news.standing.tile_count));
        let usual = present.filter(|&count| count > 0).map_or(USUAL_TILES, |count| count as u64);
        let mut tiles = self.wishes.tiles.unwrap_or(usual);
        let slider = Slider::new(&mut tiles, 1..=FLY_COUNT_MAX as u64)
            .logarithmic(true)
            .custom_formatter(|value, _| grouped(value as u64))
            .custom_parser(count)
            .text("tiles");
        let hint = "How many tiles there are. Another number begins the picture anew.";
        if ui.add(slider).on_hover_text(hint).changed() {
            self.wishes.tiles = Some(tiles);
        }
        let mut is_usual = self.wishes.tiles.is_none();
        let hint = "As many tiles as suit the size of the picture";
        if ui.checkbox(&mut is_usual, "automatic number").on_hover_text(hint).changed() {
            self.wishes.tiles = (!is_usual).then_some(tiles);
        }
        ui.add_space(4.0);
    }

    fn show_colors(&mut self, ui: &mut Ui) {
        let chosen = match &self.wishes.colors {
            ColorWish::Full => "all colours".to_owned(),
            ColorWish::Few(count) => format!("{count} of the picture"),
            ColorWish::Palette { name, colors } => format!("{name}, {} colours", colors.len()),
        };
        let mut few = if let ColorWish::Few(count) = self.wishes.colors { count } else { 16 };
        ComboBox::from_label("colours").selected_text(chosen).show_ui(ui, |ui| {
            let is_full = self.wishes.colors == ColorWish::Full;
            if ui.selectable_label(is_full, "all colours").clicked() {
                self.wishes.colors = ColorWish::Full;
            }
            let is_few = matches!(self.wishes.colors, ColorWish::Few(_));
            if ui.selectable_label(is_few, "a few of the picture").clicked() {
                self.wishes.colors = ColorWish::Few(few);
            }
        });
        if matches!(self.wishes.colors, ColorWish::Few(_))
            && ui.add(Slider::new(&mut few, 1..=256).logarithmic(true).text("of them")).changed()
        {
            self.wishes.colors = ColorWish::Few(few);
        }
        if let ColorWish::Palette { colors, .. } = &self.wishes.colors {
            show_swatches(ui, colors);
        }
        let hint = "A palette of GIMP (.gpl), .pal, .hex, or a picture of at most 256 colours";
        if let Some(Taken { path, .. }) = self.show_path(ui, Field::Palette, hint) {
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            match photo::read_palette(&path) {
                Ok(colors) => self.wishes.colors = ColorWish::Palette { name, colors: colors.into() },
                Err(error) => self.say(Note::failure(error.to_string()), ui.input(|input| input.time)),
            }
        }
    }
}

/// A number of tiles as people type it: 4000, 2.5k, 1M or 12,000.
fn count(text: &str) -> Option<f64> {
    let text = text.trim().replace([',', '_'], "").to_ascii_lowercase();
    let (digits, factor) = match text.strip_suffix('k') {
        Some(digits) => (digits.to_owned(), 1e3),
        None => text.strip_suffix('m').map_or((text.clone(), 1.0), |digits| (digits.to_owned(), 1e6)),
    };
    digits.trim().parse::<f64>().ok().map(|number| number * factor)
}

/// A section that can be closed.
fn section(ui: &mut Ui, name: &str, is_open: bool, show: impl FnOnce(&mut Ui)) {
    CollapsingHeader::new(RichText::new(name).strong()).default_open(is_open).show(ui, show);
}

fn show_swatches(ui: &mut Ui, colors: &[Rgb]) {
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing = egui::vec2(2.0, 2.0);
        for &[r, g, b] in colors {
            let (rect, response) = ui.allocate_exact_size(egui::Vec2::splat(14.0), egui::Sense::hover());
            ui.painter().rect_filled(rect, 2.0, egui::Color32::from_rgb(r, g, b));
            response.on_hover_text(format!("#{r:02x}{g:02x}{b:02x}"));
        }
    });
}

fn show_grout(ui: &mut Ui, wishes: &mut Wishes) {
    let mut color = if let GroutWish::Color(color) = wishes.grout { color } else { [64, 58, 52] };
    let chosen = match wishes.grout {
        GroutWish::OfStyle => "default of the style",
        GroutWish::None => "none",
        GroutWish::Auto => "a darker mean",
        GroutWish::Color(_) => "this colour",
    };
    ui.horizontal(|ui| {
        ComboBox::from_label("grout").selected_text(chosen).show_ui(ui, |ui| {
            ui.selectable_value(&mut wishes.grout, GroutWish::OfStyle, "default of the style");
            ui.selectable_value(&mut wishes.grout, GroutWish::None, "none");
            ui.selectable_value(&mut wishes.grout, GroutWish::Auto, "a darker mean");
            let is_color = matches!(wishes.grout, GroutWish::Color(_));
            if ui.selectable_label(is_color, "this colour").clicked() {
                wishes.grout = GroutWish::Color(color);
            }
        });
        if matches!(wishes.grout, GroutWish::Color(_)) && color_button(ui, &mut color, "colour of the grout").changed()
        {
            wishes.grout = GroutWish::Color(color);
        }
    });
    if wishes.grout == GroutWish::None {
        wishes.grout_width = None;
    } else {
        let hint = "Width of the grout in px of the picture as it evolves";
        optional(ui, &mut wishes.grout_width, 1.0, "width of the grout", hint, |ui, width| {
            ui.add(Slider::new(width, 0.1..=12.0).logarithmic(true).suffix(" px"))
        });
    }
    let mut ground = if let GroundWish::Color(color) = wishes.ground { color } else { [0; 3] };
    let chosen = match wishes.ground {
        GroundWish::OfStyle => "default of the style",
        GroundWish::None => "none: transparent",
        GroundWish::Color(_) => "this colour",
    };
    ui.horizontal(|ui| {
        ComboBox::from_label("background").selected_text(chosen).show_ui(ui, |ui| {
            ui.selectable_value(&mut wishes.ground, GroundWish::OfStyle, "default of the style");
            ui.selectable_value(&mut wishes.ground, GroundWish::None, "none: transparent");
            let is_color = matches!(wishes.ground, GroundWish::Color(_));
            if ui.selectable_label(is_color, "this colour").clicked() {
                wishes.ground = GroundWish::Color(ground);
            }
        });
        let is_color = matches!(wishes.ground, GroundWish::Color(_));
        if is_color && color_button(ui, &mut ground, "colour of the background").changed() {
            wishes.ground = GroundWish::Color(ground);
        }
    });
}

fn color_button(ui: &mut Ui, color: &mut Rgb, name: &str) -> Response {
    ui.color_edit_button_srgb(color).on_hover_text(name)
}

fn show_bounds(ui: &mut Ui, wishes: &mut Wishes) {
    ui.weak("Lengths are multiples of the mean side of a tile.");
    let usual = UsualBounds::of(wishes.style);
    let bounds = &mut wishes.bounds;
    optional(ui, &mut bounds.side, usual.side, "sides", "Smallest and largest side of a tile", |ui, side| {
        let [low, high] = side;
        let smallest = ui.add(DragValue::new(low).range(0.01..=*high).speed(0.01));
        smallest | ui.add(DragValue::new(high).range(*low..=16.0).speed(0.01))
    });
    let hint = "Largest ratio of the sides: 1 is square";
    optional(ui, &mut bounds.aspect, usual.aspect, "slimness", hint, |ui, aspect| {
        ui.add(Slider::new(aspect, 1.0..=64.0).logarithmic(true))
    });
    for (bound, usual, name, hint) in [
        (&mut bounds.overlap, usual.overlap, "overlap", "How much it costs that tiles lie on each other"),
        (&mut bounds.hole, usual.hole, "gaps", "How much it costs that a pixel is covered by no tile"),
        (&mut bounds.turn, usual.turn, "turning", "How much it costs that a tile turns away from the contours"),
    ] {
        optional(ui, bound, usual, name, hint, |ui, cost| ui.add(Slider::new(cost, 0..=255)));
    }
}

fn show_search(ui: &mut Ui, wishes: &mut Wishes) {
    let hint = "Longer side in px at which the picture evolves: more shows finer detail and takes more time";
    ui.add(Slider::new(&mut wishes.size, 32..=SIZE_MAX).logarithmic(true).suffix(" px").text("size"))
        .on_hover_text(hint);
    let hint = "Tries for each tile: more is closer to the picture and takes more time";
    let effort = Slider::new(&mut wishes.evals_per_tile, 10..=EVALS_PER_FLY * 20).logarithmic(true).text("effort");
    ui.add(effort).on_hover_text(hint);
    ui.horizontal(|ui| {
        let hint = "The number that decides every random choice";
        let seed = ui.add(DragValue::new(&mut wishes.seed).range(0..=u64::MAX)).on_hover_text(hint);
        let label = ui.label("seed");
        seed.labelled_by(label.id);
    });
}

/// A value that is wished for if its box is ticked, and else as the style has it.
fn optional<T: Copy>(
    ui: &mut Ui,
    value: &mut Option<T>,
    usual: T,
    name: &str,
    hint: &str,
    show: impl FnOnce(&mut Ui, &mut T) -> Response,
) {
    ui.horizontal(|ui| {
        let mut is_wished = value.is_some();
        if ui.add(Checkbox::new(&mut is_wished, name)).on_hover_text(hint).changed() {
            *value = is_wished.then_some(usual);
        }
        if let Some(wished) = value {
            show(ui, wished);
        }
    });
}

impl Interface {
    pub(super) fn show_shaders(&mut self, ui: &mut Ui) {
        let chosen = self.wishes.shader.map_or("default of the style", Shader::name);
        ComboBox::from_label("shader").selected_text(chosen).show_ui(ui, |ui| {
            ui.selectable_value(&mut self.wishes.shader, None, "default of the style");
            for shader in Shader::ALL {
                let label = ui.selectable_label(self.wishes.shader == Some(shader), shader.name());
                if label.on_hover_text(shader.description()).clicked() {
                    self.wishes.shader = Some(shader);
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_tiles_are_read_as_people_type_them() {
        for (text, number) in
            [("4000", Some(4e3)), ("2.5k", Some(2_500.0)), ("1M", Some(1e6)), ("12,000", Some(12e3)), ("many", None)]
        {
            assert_eq!(count(text), number, "{text}");
        }
    }
}
