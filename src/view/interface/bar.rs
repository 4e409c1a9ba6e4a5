//! The bar at the top: files, the course of the search, and how to look at it; and the keys for all of it.

use egui::{Button, Key, KeyboardShortcut, Modifiers, Ui};

use super::stage::Compare;
use super::{Interface, Request};
use crate::view::camera::Camera;
use crate::view::news::{Doing, Order};

const OPEN: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::O);
const SAVE: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::S);
const RESTART: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::R);
const UNDO: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::Z);
const REDO: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND.plus(Modifiers::SHIFT), Key::Z);
/// Factor of the scale at a key.
const ZOOM_STEP: f32 = 1.25;

impl Interface {
    pub(super) fn show_bar(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            if button(
                ui,
                true,
                "Open…",
                "Open a picture or saved tiles (Ctrl+O); a folder of snapshots can be dropped on the window",
            ) {
                self.begin_open();
            }
            let has_tiles = self.news.tiles.is_some();
            if button(ui, has_tiles && !self.news.is_saving, "Save…", "Save the mosaic in any format (Ctrl+S)") {
                self.save.is_open = true;
            }
            ui.separator();
            self.show_course_buttons(ui);
            ui.separator();
            if button(ui, self.history.can_undo(), "Undo", "Take the last change back (Ctrl+Z)") {
                self.undo();
            }
            if button(ui, self.history.can_redo(), "Redo", "Make it again (Ctrl+Shift+Z)") {
                self.redo();
            }
            ui.separator();
            for compare in Compare::ALL {
                let label = ui.selectable_label(self.compare == compare, compare.name());
                if label.on_hover_text(compare.description()).clicked() {
                    self.compare = compare;
                }
            }
            ui.separator();
            if button(ui, has_tiles, "Fit", "The whole picture (F)") {
                self.camera = Camera::FITTED;
            }
            if button(ui, has_tiles, "1:1", "One pixel of the picture is one of the screen (1)") {
                self.one_to_one();
            }
            ui.separator();
            egui::widgets::global_theme_preference_switch(ui);
        });
    }

    fn show_course_buttons(&mut self, ui: &mut Ui) {
        let doing = self.news.doing;
        let (text, hint) = if doing == Doing::Running { ("Pause", "Rest (Space)") } else { ("Go on", "Go on (Space)") };
        if button(ui, matches!(doing, Doing::Running | Doing::Paused), text, hint) {
            self.toggle();
        }
        let can_step = matches!(doing, Doing::Running | Doing::Paused);
        if button(ui, can_step, "Step", "One round, then rest (S)") {
            self.orders.push(Order::Step);
        }
        let can_restart = matches!(doing, Doing::Running | Doing::Paused | Doing::Done(_));
        if button(ui, can_restart, "Restart", "Begin again from nothing, with these settings (Ctrl+R)") {
            self.restart();
        }
    }

    fn toggle(&mut self) {
        self.moment = None;
        self.orders.push(if self.is_at_work() { Order::Pause } else { Order::Go });
    }

    fn restart(&mut self) {
        self.moment = None;
        self.orders.push(Order::Restart);
    }

    fn begin_open(&mut self) {
        if self.has_dialogs {
            self.requests.push(Request::Open);
        } else {
            self.begin_typing();
        }
    }

    /// Shows the field for a path, with the cursor in it.
    pub(super) fn begin_typing(&mut self) {
        (self.wants_open_field, self.wants_cursor) = (true, true);
    }

    fn one_to_one(&mut self) {
        if let Some((size, stage)) = self.on_stage {
            self.camera.one_to_one(size, stage);
        }
    }

    fn zoom(&mut self, factor: f32) {
        if let Some((size, stage)) = self.on_stage {
            self.camera.zoom(size, stage, stage.center(), factor);
        }
    }

    /// The keys, wherever the pointer is. While a text is typed they are letters.
    pub(super) fn keys(&mut self, ui: &Ui) {
        let ctx = ui.ctx();
        let [open, save] = [OPEN, SAVE].map(|keys| ctx.input_mut(|input| input.consume_shortcut(&keys)));
        if open {
            self.begin_open();
        }
        if save && self.news.tiles.is_some() {
            self.save.is_open = true;
        }
        // Without a picture they would arm what nobody sees.
        if ctx.text_edit_focused() || self.tiles().is_none() {
            return;
        }
        // The longer one first, which has the shorter one in it.
        let [restart, redo, undo] =
            [RESTART, REDO, UNDO].map(|keys| ctx.input_mut(|input| input.consume_shortcut(&keys)));
        if restart {
            self.restart();
        }
        if undo && self.history.can_undo() {
            self.undo();
        }
        if redo && self.history.can_redo() {
            self.redo();
        }
        // A focused button takes the space bar for itself.
        let is_free = ctx.memory(|memory| memory.focused().is_none());
        let pressed = |key: Key| ctx.input(|input| input.modifiers.is_none() && input.key_pressed(key));
        if is_free && pressed(Key::Space) && matches!(self.news.doing, Doing::Running | Doing::Paused) {
            self.toggle();
        }
        if pressed(Key::S) && matches!(self.news.doing, Doing::Running | Doing::Paused) {
            self.orders.push(Order::Step);
        }
        if pressed(Key::F) {
            self.camera = Camera::FITTED;
        }
        if pressed(Key::Num1) {
            self.one_to_one();
        }
        // On many keyboards it is typed with Shift.
        let is_plus = ctx.input(|input| !input.modifiers.command && input.key_pressed(Key::Plus));
        if is_plus || pressed(Key::Equals) {
            self.zoom(ZOOM_STEP);
        }
        if pressed(Key::Minus) {
            self.zoom(1.0 / ZOOM_STEP);
        }
        for (key, compare) in [Key::T, Key::D, Key::P, Key::E].into_iter().zip(Compare::ALL) {
            if pressed(key) {
                self.compare = compare;
            }
        }
        if pressed(Key::B) {
            self.brush.is_on = !self.brush.is_on;
        }
        self.peek = ctx.input(|input| input.key_down(Key::C));
    }
}

/// A button with a hint; whether it was pressed.
fn button(ui: &mut Ui, is_enabled: bool, text: &str, hint: &str) -> bool {
    ui.add_enabled(is_enabled, Button::new(text)).on_hover_text(hint).clicked()
}
