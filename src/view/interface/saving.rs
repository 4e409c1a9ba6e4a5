//! The form that saves: where, in which format, how large.

use std::path::{Path, PathBuf};

use egui::{ComboBox, Key, Slider, TextEdit, Ui};

use super::course::grouped;
use super::files::typed;
use super::{Interface, Request};
use crate::model::target::TARGET_SIDE_MAX_PX;
use crate::studio::Content;
use crate::view::news::{Order, SaveOrder};

/// The formats: ending, and what it is for.
const FORMATS: [(&str, &str); 8] = [
    ("png", "picture, without losses"),
    ("jpg", "picture, small"),
    ("webp", "picture, without losses and small"),
    ("svg", "vectors, one element for each tile"),
    ("ora", "OpenRaster, tiles in layers"),
    ("npz", "the tiles themselves, to go on from"),
    ("csv", "a table of the tiles"),
    ("json", "the tiles for programs"),
];

/// Longer sides that are often asked for, in px.
const USUAL_SIDES: [u32; 2] = [2_048, 4_096];

/// The content of a file with this ending.
fn content_of(format: &str) -> Option<Content> {
    Content::of_path(&Path::new("mosaic").with_extension(format))
}

/// What the form holds.
pub(super) struct SaveForm {
    pub is_open: bool,
    path: String,
    /// Longer side in px; none is as it evolved.
    long_side_px: Option<u32>,
    /// The file that is there and would be replaced, once it is asked about.
    replaces: Option<PathBuf>,
}

impl Default for SaveForm {
    fn default() -> Self {
        Self { is_open: false, path: "mosaic.png".to_owned(), long_side_px: None, replaces: None }
    }
}

impl SaveForm {
    /// A name beside that of the picture.
    pub(super) fn suggest(&mut self, picture: Option<&Path>) {
        let stem = picture.and_then(Path::file_stem).map(|stem| stem.to_string_lossy().into_owned());
        let name = stem.map_or_else(|| "mosaic.png".to_owned(), |stem| format!("{stem}-mosaic.png"));
        let folder = picture.and_then(Path::parent).unwrap_or(Path::new(""));
        self.path = folder.join(name).display().to_string();
        self.replaces = None;
    }

    /// Takes a path that a dialog of the desktop gave, which has asked whether to replace it.
    pub(super) fn choose(&mut self, path: &Path) {
        self.path = path.display().to_string();
        self.replaces = Some(path.to_owned());
    }

    fn content(&self) -> Option<Content> {
        Content::of_path(&typed(&self.path))
    }

    fn has_size(&self) -> bool {
        self.content().is_some_and(Content::is_picture)
    }
}

impl Interface {
    pub(super) fn show_saving(&mut self, ui: &mut Ui) {
        if !self.save.is_open {
            return;
        }
        let mut is_open = true;
        egui::Window::new("Save")
            .default_pos([420.0, 90.0])
            .open(&mut is_open)
            .collapsible(false)
            .resizable(false)
            .show(ui.ctx(), |ui| {
                ui.set_width(420.0);
                self.show_save_path(ui);
                self.show_save_format(ui);
                if self.save.has_size() {
                    self.show_save_size(ui);
                }
                ui.separator();
                self.show_save_button(ui);
            });
        self.save.is_open &= is_open && !ui.input(|input| input.key_pressed(Key::Escape));
    }

    fn show_save_path(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            let width = if self.has_dialogs { 330.0 } else { 410.0 };
            let response = ui.add(TextEdit::singleline(&mut self.save.path).desired_width(width));
            response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::TextEdit, true, "file to save"));
            if response.changed() {
                self.save.replaces = None;
            }
            if self.has_dialogs && ui.button("Browse…").clicked() {
                self.requests.push(Request::Save(typed(&self.save.path)));
            }
        });
    }

    fn show_save_format(&mut self, ui: &mut Ui) {
        let content = self.save.content();
        let is_chosen = |format: &str| content.is_some() && content == content_of(format);
        let chosen = FORMATS.iter().find(|(format, _)| is_chosen(format)).map_or("choose one", |(format, _)| format);
        ComboBox::from_label("format").selected_text(chosen).show_ui(ui, |ui| {
            for (format, what) in FORMATS {
                if ui.selectable_label(is_chosen(format), format!("{format}: {what}")).clicked() {
                    let path = typed(&self.save.path).with_extension(format);
                    self.save.path = path.display().to_string();
                    self.save.replaces = None;
                }
            }
        });
    }

    fn show_save_size(&mut self, ui: &mut Ui) {
        let evolved = self.tiles().map_or(512, |tiles| tiles.width_px.max(tiles.height_px));
        let mut px = self.save.long_side_px.unwrap_or(evolved);
        ui.horizontal(|ui| {
            let slider =
                Slider::new(&mut px, 16..=TARGET_SIDE_MAX_PX).logarithmic(true).suffix(" px").text("longer side");
            ui.add(slider).on_hover_text("Tiles are drawn anew, so that they are sharp at any size");
            for usual in USUAL_SIDES {
                if ui.small_button(grouped(u64::from(usual))).on_hover_text("px").clicked() {
                    px = usual;
                }
            }
        });
        self.save.long_side_px = (px != evolved).then_some(px);
    }

    fn show_save_button(&mut self, ui: &mut Ui) {
        let path = typed(&self.save.path);
        let is_known = self.save.content().is_some();
        let is_ready = is_known && self.news.tiles.is_some() && !self.news.is_saving;
        let must_ask = path.exists() && self.save.replaces.as_deref() != Some(&path);
        ui.horizontal(|ui| {
            if !must_ask {
                if ui.add_enabled(is_ready, egui::Button::new("Save file")).clicked() {
                    self.order_save(path);
                }
            } else if ui.add_enabled(is_ready, egui::Button::new("Replace the file")).clicked() {
                self.order_save(path);
            }
            if must_ask {
                ui.colored_label(super::looks::FAILURE, "There is a file of this name.");
            } else if !is_known {
                ui.weak("End the name with a format, such as .png");
            } else if self.moment.is_some() {
                ui.weak("The present is saved, not the moment that is shown.");
            }
        });
    }

    fn order_save(&mut self, path: PathBuf) {
        let long_side_px = self.save.long_side_px.filter(|_| self.save.has_size());
        self.orders.push(Order::Save(SaveOrder { path, long_side_px }));
        (self.save.is_open, self.save.replaces) = (false, None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_that_is_offered_is_written() {
        let contents: Vec<_> = FORMATS.iter().map(|(format, _)| content_of(format)).collect();
        assert!(contents.iter().all(Option::is_some), "{contents:?}");
    }
}
