//! The brush that paints where likeness matters: a map with a luma for each pixel of the picture.

use std::sync::Arc;

use egui::{Color32, ColorImage, CursorIcon, Painter, Pos2, Rect, Response, Slider, Stroke, TextureHandle};
use egui::{TextureOptions, Ui, pos2};

use super::Interface;
use super::files::{Field, Taken};
use crate::error::Error;
use crate::photo::{self, Photo};
use crate::view::camera::Framed;
use crate::view::news::Note;
use crate::view::wishes::WeightMap;

/// Most bytes of a map that is read.
const MAP_BYTES_MAX: u64 = 1 << 28;

/// The brush and what it painted.
pub(super) struct Brush {
    pub is_on: bool,
    /// Radius in px of the picture.
    radius: f32,
    /// Whether it takes away.
    erases: bool,
    /// What is being painted; none if nothing was.
    map: Option<WeightMap>,
    /// The map as it is shown, and the one that it was made of.
    texture: Option<TextureHandle>,
    is_stale: bool,
    /// Where the brush was last.
    last: Option<Pos2>,
}

impl Default for Brush {
    fn default() -> Self {
        let (map, texture, last) = (None, None, None);
        Self { is_on: false, radius: 24.0, erases: false, map, texture, is_stale: false, last }
    }
}

impl Brush {
    /// Forgets what was painted, so that the wishes tell it again.
    pub(super) fn forget(&mut self) {
        (self.map, self.texture, self.last) = (None, None, None);
    }

    /// Paints along a line from the last place to this one.
    fn stroke(&mut self, size: [u32; 2], place: Pos2) {
        let luma = if self.erases { 0 } else { 255 };
        let [width, height] = size;
        let empty = || WeightMap { size, luma: vec![0; width as usize * height as usize] };
        let map = self.map.get_or_insert_with(empty);
        if map.size != size {
            *map = empty();
        }
        let from = self.last.unwrap_or(place);
        let steps = ((place - from).length() / (self.radius / 3.0).max(0.5)).ceil().max(1.0) as u32;
        for step in 0..=steps {
            dab(map, from + (place - from) * (step as f32 / steps as f32), self.radius, luma);
        }
        (self.last, self.is_stale) = (Some(place), true);
    }
}

/// A disc of a luma.
fn dab(map: &mut WeightMap, centre: Pos2, radius: f32, luma: u8) {
    let [width, height] = map.size;
    let rows = (centre.y - radius).floor().max(0.0) as u32..((centre.y + radius).ceil().max(0.0) as u32).min(height);
    let columns = (centre.x - radius).floor().max(0.0) as u32..((centre.x + radius).ceil().max(0.0) as u32).min(width);
    for row in rows {
        for column in columns.clone() {
            let pixel = pos2(column as f32 + 0.5, row as f32 + 0.5);
            if (pixel - centre).length() <= radius {
                map.luma[(row * width + column) as usize] = luma;
            }
        }
    }
}

impl Interface {
    pub(super) fn show_brush(&mut self, ui: &mut Ui) {
        ui.weak("Paint over what should come closest, such as faces. Restart uses the map from the beginning.");
        ui.horizontal(|ui| {
            ui.toggle_value(&mut self.brush.is_on, "Brush").on_hover_text("Paint on the picture (B)");
            for (erases, name, hint) in [(false, "more", "What matters"), (true, "less", "What does not matter")] {
                let is_chosen = self.brush.is_on && self.brush.erases == erases;
                if ui.selectable_label(is_chosen, name).on_hover_text(hint).clicked() {
                    (self.brush.is_on, self.brush.erases) = (true, erases);
                }
            }
        });
        ui.add(Slider::new(&mut self.brush.radius, 1.0..=300.0).logarithmic(true).suffix(" px").text("brush"));
        let has_map = self.wishes.weight.is_some();
        if ui.add_enabled(has_map, egui::Button::new("Clear")).on_hover_text("All parts matter alike").clicked() {
            self.wishes.weight = None;
            self.brush.forget();
        }
        let now = ui.input(|input| input.time);
        let size = self.news.picture.as_ref().map(|picture| picture.size);
        let hint = "A grey picture: white is what matters most";
        if let (Some(Taken { path, .. }), Some(size)) = (self.show_path(ui, Field::LoadMap, hint), size) {
            match read_map(&path, size) {
                Ok(map) => {
                    self.brush.forget();
                    self.wishes.weight = Some(Arc::new(map));
                }
                Err(error) => self.say(Note::failure(error), now),
            }
        }
        let hint = "Write the map as a PNG, for --weight";
        if let Some(taken) = self.show_path(ui, Field::SaveMap, hint) {
            let note = match self.wishes.weight.as_deref().map(|map| write_map(&taken, map)) {
                None => Note::failure("there is no map yet: paint one first"),
                Some(Ok(())) => Note::done(format!("Wrote {}", taken.path.display())),
                Some(Err(error)) => Note::failure(error.to_string()),
            };
            self.say(note, now);
        }
    }

    /// Paints where the pointer is dragged.
    pub(super) fn paint_weight(&mut self, ui: &Ui, response: &Response, framed: &Framed, ppp: f32, size: [u32; 2]) {
        let Some(pointer) = response.interact_pointer_pos().or(response.hover_pos()) else { return };
        let place = framed.place_at(pointer * ppp);
        if self.brush.map.is_none() {
            self.brush.map = self.wishes.weight.as_deref().filter(|map| map.size == size).cloned();
        }
        let is_painting = response.is_pointer_button_down_on() && ui.input(|input| input.pointer.primary_down());
        if is_painting {
            self.brush.stroke(size, place);
            ui.ctx().request_repaint();
        } else if self.brush.last.take().is_some() {
            self.wishes.weight = self.brush.map.clone().map(Arc::new);
        }
        let circle = (framed.point_of(place) / ppp, self.brush.radius * framed.scale / ppp);
        let painter = ui.painter_at(response.rect);
        painter.circle_stroke(circle.0, circle.1, Stroke::new(3.0, Color32::from_black_alpha(160)));
        painter.circle_stroke(circle.0, circle.1, Stroke::new(1.2, Color32::WHITE));
        ui.ctx().set_cursor_icon(CursorIcon::Crosshair);
    }

    /// What was painted, as a tint over the picture; only while the brush is in use.
    pub(super) fn show_weight(&mut self, ui: &Ui, painter: &Painter, whole: Rect, size: [u32; 2]) {
        if !self.brush.is_on {
            return;
        }
        let Some(map) = self.brush.map.as_ref().or(self.wishes.weight.as_deref()).filter(|map| map.size == size) else {
            return;
        };
        if self.brush.is_stale || self.brush.texture.is_none() {
            let tint = |&luma: &u8| Color32::from_rgba_unmultiplied(255, 176, 32, luma / 2);
            let image = ColorImage::new(size.map(|side| side as usize), map.luma.iter().map(tint).collect());
            match &mut self.brush.texture {
                Some(texture) => texture.set(image, TextureOptions::LINEAR),
                None => self.brush.texture = Some(ui.ctx().load_texture("weight", image, TextureOptions::LINEAR)),
            }
            self.brush.is_stale = false;
        }
        if let Some(texture) = &self.brush.texture {
            painter.image(texture.id(), whole, Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0)), Color32::WHITE);
        }
    }
}

fn read_map(path: &std::path::Path, size: [u32; 2]) -> Result<WeightMap, String> {
    let unreadable = |error: std::io::Error| format!("{}: {}", path.display(), crate::error::in_words(&error));
    if std::fs::metadata(path).map_err(unreadable)?.len() > MAP_BYTES_MAX {
        return Err(format!("{}: is too large for a map; give a smaller picture", path.display()));
    }
    let bytes = std::fs::read(path).map_err(unreadable)?;
    let luma = photo::decode_weights(&bytes, size[0], size[1]);
    luma.map(|luma| WeightMap { size, luma }).map_err(|reason| format!("{}: {reason}", path.display()))
}

fn write_map(Taken { path, by_dialog }: &Taken, map: &WeightMap) -> crate::error::Result<()> {
    let refuse = |reason: &str| Err(Error::Output { path: path.to_owned(), reason: reason.to_owned() });
    if path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("png")) {
        return refuse("is no PNG by its name; end it with .png");
    }
    if path.exists() && !by_dialog {
        return refuse("is there already; choose another name");
    }
    crate::output::write_atomically(path, &encoded(map)?)
}

/// A map as a PNG.
pub(in crate::view) fn encoded(map: &WeightMap) -> crate::error::Result<Vec<u8>> {
    let pixels = map.luma.iter().map(|&luma| [luma; 3]).collect();
    photo::encode_png(&Photo { width_px: map.size[0], height_px: map.size[1], pixels }, &Vec::new())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stroke_covers_the_line_and_stays_in_the_map() {
        let mut brush = Brush { radius: 3.0, ..Brush::default() };
        brush.stroke([40, 20], pos2(5.0, 10.0));
        brush.stroke([40, 20], pos2(60.0, 10.0));
        let map = brush.map.as_ref().expect("something was painted");
        let at = |column: usize, row: usize| map.luma[row * 40 + column];
        assert!((5..40).all(|column| at(column, 10) == 255), "{:?}", &map.luma[400..440]);
        assert!((0..40).all(|column| at(column, 5) == 0 && at(column, 15) == 0));
        brush.erases = true;
        brush.last = None;
        brush.stroke([40, 20], pos2(20.0, 10.0));
        let map = brush.map.as_ref().expect("something was painted");
        assert_eq!((map.luma[10 * 40 + 20], map.luma[10 * 40 + 30]), (0, 255));
    }

    #[test]
    fn a_map_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let typed = |name| Taken { path: folder.path().join(name), by_dialog: false };
        let taken = typed("map.png");
        let map = WeightMap { size: [7, 3], luma: (0..21).map(|place| place * 12).collect() };
        write_map(&taken, &map).expect("it is written");
        assert!(write_map(&taken, &map).is_err_and(|error| error.to_string().contains("is there already")));
        let asked = Taken { by_dialog: true, ..typed("map.png") };
        write_map(&asked, &map).expect("the dialog has asked whether to replace it");
        assert!(write_map(&typed("map.jpg"), &map).is_err(), "it would be a PNG");
        assert_eq!(read_map(&taken.path, [7, 3]), Ok(map));
        assert!(read_map(&taken.path, [3, 7]).is_err_and(|error| error.contains("proportions")));
    }
}
