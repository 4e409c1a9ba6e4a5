//! Fields for paths, which are typed or pasted.

use std::path::{Path, PathBuf};

use egui::{Key, TextEdit, Ui};

use super::{Interface, Request, looks};

/// A file that a control reads or writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::view) enum Field {
    Palette,
    Mask,
    LoadMap,
    SaveMap,
}

impl Field {
    const COUNT: usize = 4;

    fn name(self) -> &'static str {
        match self {
            Self::Palette => "palette file",
            Self::Mask => "own shape",
            Self::LoadMap => "load map",
            Self::SaveMap => "save map",
        }
    }
}

/// A path that is typed, and taken with Enter or its button.
#[derive(Default)]
struct PathField {
    text: String,
    is_open: bool,
    /// What a dialog of the desktop gave.
    chosen: Option<PathBuf>,
}

/// All fields for paths, by [`Field`].
#[derive(Default)]
pub(super) struct Fields([PathField; Field::COUNT]);

/// A path that was typed or chosen.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Taken {
    pub path: PathBuf,
    /// Whether a dialog of the desktop gave it, which asks before a file is replaced.
    pub by_dialog: bool,
}

impl Fields {
    /// Opens a field for typing.
    pub(super) fn open(&mut self, field: Field) {
        self.0[field as usize].is_open = true;
    }

    /// Takes a path that a dialog gave.
    pub(super) fn choose(&mut self, field: Field, path: PathBuf) {
        self.0[field as usize].chosen = Some(path);
    }
}

impl PathField {
    fn show(&mut self, ui: &mut Ui, name: &str, hint: &str) -> Option<PathBuf> {
        let mut taken = None;
        ui.horizontal(|ui| {
            let edit =
                TextEdit::singleline(&mut self.text).hint_text("path").desired_width(ui.available_width() - 70.0);
            let response = ui.add(edit).on_hover_text(hint);
            response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::TextEdit, true, name));
            let is_entered = response.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
            if (ui.button("OK").clicked() || is_entered) && !self.text.trim().is_empty() {
                taken = Some(typed(&self.text));
            }
            if ui.small_button("×").on_hover_text("Close").clicked() {
                self.is_open = false;
            }
        });
        self.is_open &= taken.is_none();
        taken
    }
}

/// A path as people type or paste it: with quotation marks, as an address of a file, or with a tilde.
pub(super) fn typed(text: &str) -> PathBuf {
    let text = text.trim().trim_matches(['"', '\'']);
    let text = text.strip_prefix("file://").unwrap_or(text);
    match (text.strip_prefix("~/"), std::env::home_dir()) {
        (Some(rest), Some(home)) => home.join(rest),
        _ => Path::new(text).to_owned(),
    }
}

impl Interface {
    /// A button that opens a dialog of the desktop or, where there is none, a field; the path, once there is one.
    pub(super) fn show_path(&mut self, ui: &mut Ui, field: Field, hint: &str) -> Option<Taken> {
        let (name, path) = (field.name(), &mut self.fields.0[field as usize]);
        let chosen = path.chosen.take().map(|path| Taken { path, by_dialog: true });
        if path.is_open {
            return path.show(ui, name, hint).map(|path| Taken { path, by_dialog: false }).or(chosen);
        }
        if ui.button(format!("{}…", looks::title(name))).on_hover_text(hint).clicked() {
            if self.has_dialogs {
                self.requests.push(Request::Field(field));
            } else {
                path.is_open = true;
            }
        }
        chosen
    }

    /// The field for what is to be opened.
    pub(super) fn show_open_field(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            let edit = TextEdit::singleline(&mut self.open_path).hint_text("type the path of a picture here");
            let response = ui.add(edit.desired_width(280.0));
            if std::mem::take(&mut self.wants_cursor) {
                response.request_focus();
            }
            // In the middle of an empty window it would be taken for a caption.
            let edge = egui::Stroke::new(1.0, ui.visuals().weak_text_color());
            ui.painter().rect_stroke(response.rect.expand(1.0), 4.0, edge, egui::StrokeKind::Outside);
            response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::TextEdit, true, "path to open"));
            let is_entered = response.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
            if (ui.button("Open").clicked() || is_entered) && !self.open_path.trim().is_empty() {
                let path = typed(&self.open_path);
                self.open(path);
                self.wants_open_field = false;
            }
        });
    }

    /// The same as a small window, where a picture is open already and the desktop has no dialog.
    pub(super) fn show_open_window(&mut self, ui: &mut Ui) {
        if !self.wants_open_field || self.news.picture.is_none() {
            return;
        }
        let mut is_open = true;
        egui::Window::new("Open").open(&mut is_open).collapsible(false).resizable(false).show(ui.ctx(), |ui| {
            self.show_open_field(ui);
        });
        self.wants_open_field &= is_open && !ui.input(|input| input.key_pressed(Key::Escape));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_taken_as_people_paste_them() {
        for text in ["a b.png", " a b.png\n", "'a b.png'", "\"a b.png\"", "file://a b.png"] {
            assert_eq!(typed(text), Path::new("a b.png"), "{text:?}");
        }
    }
}
