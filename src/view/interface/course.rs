//! The course of the run: how the error falls, and the time slider.

use egui::{Color32, Pos2, Rect, Sense, Shape, Slider, Stroke, Ui, pos2, vec2};

use super::{Interface, looks};
use crate::evolve::StopReason;
use crate::view::news::{Doing, Moment};

impl Interface {
    pub(super) fn show_course(&mut self, ui: &mut Ui) {
        ui.add_space(2.0);
        ui.horizontal(|ui| {
            ui.label(self.status());
            if !self.news.command.is_empty() {
                ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                    let mut hint = format!("Copy the command that makes this again:\n{}", self.news.command);
                    if self.news.command.contains(" --replay ") {
                        hint += "\nIts steps are written beside the mosaic when it is saved.";
                    }
                    if ui.button("Copy command").on_hover_text(hint).clicked() {
                        ui.ctx().copy_text(self.news.command.clone());
                        let now = ui.input(|input| input.time);
                        self.say(crate::view::news::Note::done("The command is in the clipboard"), now);
                    }
                    let text = egui::RichText::new(&self.news.command).monospace().small();
                    ui.add(egui::Label::new(text).truncate().selectable(true));
                });
            }
        });
        let moments = self.news.course.clone();
        let height = (ui.available_height() - 28.0).max(24.0);
        let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), height), Sense::click_and_drag());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Image, true, "error over evals"));
        show_curve(ui, rect, &moments, self.moment);
        if let Some(pointer) = response.interact_pointer_pos().filter(|_| moments.len() > 1) {
            let share = ((pointer.x - rect.left()) / rect.width()).clamp(0.0, 1.0);
            self.moment = nearest(&moments, f64::from(share));
        }
        ui.horizontal(|ui| {
            let last = moments.len().saturating_sub(1);
            let mut place = self.moment.unwrap_or(last);
            ui.spacing_mut().slider_width = (ui.available_width() - 190.0).max(80.0);
            let slider = Slider::new(&mut place, 0..=last).show_value(false).text("time");
            if ui.add_enabled(last > 0, slider).on_hover_text("Go back to how the mosaic was").changed() {
                self.moment = (place < last).then_some(place);
            }
            let is_past = self.moment.is_some();
            let button = ui.add_enabled(is_past, egui::Button::new("Now"));
            if button.on_hover_text("Back to the present").clicked() {
                self.moment = None;
            }
        });
    }

    /// One line about how far the search is.
    fn status(&self) -> String {
        let standing = &self.news.standing;
        let past = self.moment.and_then(|place| self.news.course.get(place));
        let (evals, error) = past.map_or((standing.evals, standing.error), |moment| (moment.evals, moment.error));
        let share = 100.0 * evals as f64 / standing.evals_planned.max(1) as f64;
        let tiles = grouped(standing.tile_count as u64);
        match self.news.doing {
            Doing::Nothing => "No picture is open".to_owned(),
            Doing::Opening => "Reading…".to_owned(),
            Doing::Showing => format!("{tiles} saved tiles, {} evals", grouped(evals)),
            doing => {
                let how = match doing {
                    Doing::Running if past.is_none() => {
                        format!("{share:.0} %, {}/s", grouped(standing.evals_per_s as u64))
                    }
                    Doing::Done(StopReason::Evals | StopReason::Births) if past.is_none() => "done".to_owned(),
                    Doing::Done(_) if past.is_none() => "ended".to_owned(),
                    _ => format!("{share:.0} %"),
                };
                format!("{tiles} tiles · error {error:.2} of 255 · {} evals, {how}", grouped(evals))
            }
        }
    }
}

/// The error of all moments, and a line at the one that is shown.
fn show_curve(ui: &Ui, rect: Rect, moments: &[Moment], shown: Option<usize>) {
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 4.0, ui.visuals().extreme_bg_color);
    let (Some(first), Some(last)) = (moments.first(), moments.last()) else { return };
    let span = (last.evals - first.evals).max(1) as f64;
    let most = moments.iter().map(|moment| moment.error).fold(1e-9, f64::max);
    let inner = rect.shrink2(vec2(0.0, 4.0));
    let at = |moment: &Moment| -> Pos2 {
        let x = (moment.evals - first.evals) as f64 / span;
        // A root tells small errors apart.
        let y = (moment.error / most).sqrt();
        pos2(inner.left() + x as f32 * inner.width(), inner.bottom() - y as f32 * inner.height())
    };
    let points: Vec<Pos2> = moments.iter().map(at).collect();
    let mut fill = egui::Mesh::default();
    let color = looks::ACCENT.gamma_multiply(0.25);
    for pair in points.windows(2) {
        let start = fill.vertices.len() as u32;
        for point in pair {
            fill.colored_vertex(*point, color);
            fill.colored_vertex(pos2(point.x, inner.bottom()), color);
        }
        fill.add_triangle(start, start + 1, start + 2);
        fill.add_triangle(start + 1, start + 2, start + 3);
    }
    painter.add(Shape::mesh(fill));
    painter.add(Shape::line(points.clone(), Stroke::new(1.8, looks::ACCENT)));
    let place = shown.unwrap_or(points.len() - 1);
    if let Some(point) = points.get(place) {
        if shown.is_some() {
            painter.vline(point.x, rect.y_range(), Stroke::new(1.0, Color32::GRAY));
        }
        painter.circle_filled(*point, 4.0, looks::ACCENT);
    }
    let text = format!("{most:.1}");
    let font = egui::TextStyle::Small.resolve(ui.style());
    painter.text(
        rect.right_top() + vec2(-6.0, 3.0),
        egui::Align2::RIGHT_TOP,
        text,
        font,
        ui.visuals().weak_text_color(),
    );
}

/// The moment nearest to a share of the run; none if that is the last one.
fn nearest(moments: &[Moment], share: f64) -> Option<usize> {
    let (first, last) = (moments.first()?.evals, moments.last()?.evals);
    let evals = first + (share * (last - first) as f64) as u64;
    let place = moments.iter().enumerate().min_by_key(|(_, moment)| moment.evals.abs_diff(evals))?.0;
    (place + 1 < moments.len()).then_some(place)
}

/// A number with a comma after every three digits.
pub(super) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_grouped_by_three_digits() {
        for (number, text) in [(0, "0"), (999, "999"), (1_000, "1,000"), (12_345_678, "12,345,678")] {
            assert_eq!(grouped(number), text);
        }
    }
}
