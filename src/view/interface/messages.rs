//! Messages: what was done, what is worth knowing, what failed. The first two go by themselves, a failure is closed.

use egui::{Align2, Color32, Frame, Id, RichText, Stroke, Ui, vec2};

use super::looks;
use crate::view::news::{Note, NoteKind};

/// Seconds that a message stays.
const STAY_S: f64 = 8.0;
/// Most messages at once.
const NOTES_MAX: usize = 5;

#[derive(Default)]
pub(super) struct Messages {
    notes: Vec<(Note, f64)>,
}

impl Messages {
    pub(super) fn add(&mut self, notes: &[Note], now: f64) {
        for note in notes {
            self.notes.retain(|(known, _)| known != note);
            self.notes.push((note.clone(), now));
        }
        let surplus = self.notes.len().saturating_sub(NOTES_MAX);
        self.notes.drain(..surplus);
    }

    pub(super) fn forget_failures(&mut self) {
        self.notes.retain(|(note, _)| note.kind != NoteKind::Failure);
    }

    pub(super) fn show(&mut self, ui: &Ui) {
        let now = ui.input(|input| input.time);
        self.notes.retain(|(note, since)| note.kind == NoteKind::Failure || now - since < STAY_S);
        if self.notes.is_empty() {
            return;
        }
        let mut closed = None;
        egui::Area::new(Id::new("messages")).anchor(Align2::RIGHT_TOP, vec2(-14.0, 52.0)).show(ui.ctx(), |ui| {
            ui.set_max_width(400.0);
            for (place, (note, _)) in self.notes.iter().enumerate() {
                let color = match note.kind {
                    NoteKind::Done => looks::ACCENT,
                    NoteKind::Hint => Color32::GRAY,
                    NoteKind::Failure => looks::FAILURE,
                };
                Frame::popup(ui.style()).stroke(Stroke::new(1.5, color)).show(ui, |ui| {
                    ui.horizontal_top(|ui| {
                        ui.vertical(|ui| {
                            ui.set_width(340.0);
                            let (text, command) = note.text.split_once('\n').unwrap_or((&note.text, ""));
                            ui.label(RichText::new(sentence(text)));
                            if !command.is_empty() {
                                ui.weak(RichText::new(command).small());
                            }
                        });
                        if ui.small_button("×").on_hover_text("Close this message").clicked() {
                            closed = Some(place);
                        }
                    });
                });
                ui.add_space(4.0);
            }
        });
        if let Some(place) = closed {
            self.notes.remove(place);
        }
        ui.ctx().request_repaint_after(std::time::Duration::from_millis(500));
    }

    #[cfg(test)]
    pub(super) fn texts(&self) -> Vec<&str> {
        self.notes.iter().map(|(note, _)| note.text.as_str()).collect()
    }
}

/// An error, which is written to follow other words, as a sentence.
fn sentence(text: &str) -> String {
    let text = text.replace('`', "");
    if text.ends_with(['.', '!', '…']) { text } else { format!("{text}.") }
}
