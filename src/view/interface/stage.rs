//! The stage: the mosaic, how it compares with the photo, and the tile under the pointer.

use std::sync::Arc;

use egui::{
    Color32, ColorImage, CursorIcon, Id, Painter, PointerButton, Pos2, Rect, Response, Sense, Stroke, StrokeKind,
    TextureId, TextureOptions, Ui, Vec2, pos2, vec2,
};

use super::{Drawn, Interface, looks};
use crate::model::{Backdrop, Population};
use crate::view::camera::Framed;
use crate::view::news::{Doing, PictureNews};
use crate::view::pick;

/// Half the width in points of what the divider is held by.
const DIVIDER_REACH: f32 = 7.0;
/// Points of a scroll that double the scale.
const SCROLL_PER_DOUBLE: f32 = 260.0;
/// Points that an arrow key moves the picture by.
const KEY_STEP: f32 = 40.0;
/// Side in points of a square of the pattern behind transparent pictures.
const CHECKER: f32 = 8.0;

/// What the mosaic is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::view) enum Compare {
    /// The mosaic alone.
    Mosaic,
    /// Photo and mosaic, with a divider between.
    Divider,
    /// The photo alone.
    Photo,
    /// Where the mosaic differs from the photo.
    Error,
}

impl Compare {
    pub(super) const ALL: [Self; 4] = [Self::Mosaic, Self::Divider, Self::Photo, Self::Error];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Mosaic => "Tiles",
            Self::Divider => "Divider",
            Self::Photo => "Photo",
            Self::Error => "Error",
        }
    }

    pub(super) fn description(self) -> &'static str {
        match self {
            Self::Mosaic => "The mosaic alone (T); hold C to see the photo",
            Self::Divider => "Photo on the left, mosaic on the right of a line that you drag (D)",
            Self::Photo => "The photo as it is evolved (P)",
            Self::Error => "Where the mosaic differs from the photo: the brighter, the more (E)",
        }
    }
}

impl Interface {
    pub(super) fn show_stage(&mut self, ui: &mut Ui, drawn: Option<Drawn>) {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Image, true, "mosaic"));
        let painter = ui.painter_at(rect);
        let back = looks::stage_color(ui.visuals().dark_mode);
        self.wanted = None;
        self.hovered = None;
        let Some(picture) = self.news.picture.clone() else {
            self.on_stage = None;
            painter.rect_filled(rect, 0.0, back);
            self.show_invitation(ui, rect);
            return;
        };
        let ppp = ui.ctx().pixels_per_point();
        let stage = Rect::from_min_max((rect.min * ppp).round(), (rect.max * ppp).round());
        let size = self.tiles().map_or(picture.size, |tiles| [tiles.width_px, tiles.height_px]);
        self.on_stage = Some((size, stage));
        self.show_divider_handle(ui, rect);
        self.steer_camera(ui, &response, size, stage, ppp);
        let framed = self.camera.frame(size, stage);
        let in_points = |rect: Rect| Rect::from_min_max(rect.min / ppp, rect.max / ppp);
        let whole = in_points(framed.picture);
        let is_clear = |tiles: &Arc<Population>| tiles.background == Backdrop::Transparent;
        let is_clear = self.tiles().is_none_or(is_clear);
        // What lies behind an opaque mosaic is not painted, since software Vulkan would do that for every pixel.
        let is_alone = drawn.is_some() && !is_clear && self.compare == Compare::Mosaic && !self.peek;
        let hidden = framed.visible().filter(|_| is_alone).map(|(_, place)| in_points(place));
        fill_around(&painter, rect, hidden, back);
        if let Some((view, place)) = framed.visible() {
            self.wanted = Some(view);
            if is_clear {
                show_checkers(&painter, whole.intersect(rect), ui.visuals().dark_mode);
            }
            let mosaic = drawn.filter(|_| self.tiles().is_some()).map(|drawn| {
                let used =
                    vec2(view.width_px as f32 / drawn.image[0] as f32, view.height_px as f32 / drawn.image[1] as f32);
                (drawn.texture, in_points(place), Rect::from_min_max(Pos2::ZERO, used.to_pos2()))
            });
            self.show_pictures(ui, &painter, rect, whole, mosaic, &picture);
        }
        self.show_weight(ui, &painter, whole, size);
        if self.brush.is_on {
            self.paint_weight(ui, &response, &framed, ppp, size);
        } else {
            self.show_hovered(ui, &response, &painter, &framed, ppp);
        }
        self.show_state(ui, rect);
    }

    /// Mosaic, photo, error or both sides of the divider.
    fn show_pictures(
        &mut self,
        ui: &Ui,
        painter: &Painter,
        stage: Rect,
        whole: Rect,
        mosaic: Option<(TextureId, Rect, Rect)>,
        picture: &Arc<PictureNews>,
    ) {
        let everything = Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0));
        let photo = self.photo_texture(ui, picture).map(|texture| (texture, whole, everything));
        let image = |painter: &Painter, shown: Option<(TextureId, Rect, Rect)>| {
            if let Some((texture, rect, uv)) = shown {
                painter.image(texture, rect, uv, Color32::WHITE);
            }
        };
        let compare = if self.peek { Compare::Photo } else { self.compare };
        match compare {
            Compare::Mosaic => image(painter, mosaic.or(photo)),
            Compare::Photo => image(painter, photo),
            Compare::Error => match self.error_texture(ui) {
                Some(texture) => image(painter, Some((texture, whole, everything))),
                None => image(painter, mosaic),
            },
            Compare::Divider => {
                let x = stage.left() + self.divider * stage.width();
                let left = Rect::from_min_max(stage.min, pos2(x, stage.bottom()));
                let right = Rect::from_min_max(pos2(x, stage.top()), stage.max);
                image(&painter.with_clip_rect(left), photo);
                image(&painter.with_clip_rect(right), mosaic);
                painter.vline(x, stage.y_range(), Stroke::new(2.0, looks::ACCENT));
                let handle = Rect::from_center_size(pos2(x, stage.center().y), vec2(10.0, 36.0));
                painter.rect_filled(handle, 5.0, looks::ACCENT);
            }
        }
    }

    /// What the divider is dragged by; it lies above the stage.
    fn show_divider_handle(&mut self, ui: &Ui, stage: Rect) {
        if self.compare != Compare::Divider {
            return;
        }
        let x = stage.left() + self.divider * stage.width();
        let reach = Rect::from_x_y_ranges(x - DIVIDER_REACH..=x + DIVIDER_REACH, stage.y_range());
        let response = ui.interact(reach, Id::new("divider"), Sense::drag());
        let share = f64::from(self.divider);
        response.widget_info(|| egui::WidgetInfo::slider(true, share, "divider between photo and mosaic"));
        if let Some(pointer) = response.interact_pointer_pos().filter(|_| response.dragged()) {
            self.divider = ((pointer.x - stage.left()) / stage.width()).clamp(0.0, 1.0);
        }
        if response.has_focus() {
            let step = |key| ui.input(|input| input.key_pressed(key));
            let by = f32::from(u8::from(step(egui::Key::ArrowRight))) - f32::from(u8::from(step(egui::Key::ArrowLeft)));
            self.divider = (self.divider + by * 0.05).clamp(0.0, 1.0);
        }
        response.on_hover_and_drag_cursor(CursorIcon::ResizeHorizontal);
    }

    fn steer_camera(&mut self, ui: &Ui, response: &Response, size: [u32; 2], stage: Rect, ppp: f32) {
        let is_painting = self.brush.is_on;
        let drags =
            response.dragged_by(PointerButton::Middle) || (!is_painting && response.dragged_by(PointerButton::Primary));
        if drags {
            self.camera.pan(size, stage, response.drag_delta() * ppp);
        }
        // Also where the divider lies above the stage.
        let pointer = ui.input(|input| input.pointer.hover_pos()).filter(|_| ui.rect_contains_pointer(response.rect));
        if let Some(pointer) = pointer {
            let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
            let factor = (scroll / SCROLL_PER_DOUBLE).exp2() * pinch;
            if (factor - 1.0).abs() > f32::EPSILON {
                self.camera.zoom(size, stage, pointer * ppp, factor);
            }
        }
        if response.double_clicked() && !is_painting {
            self.camera = crate::view::camera::Camera::FITTED;
        }
        if ui.ctx().memory(|memory| memory.focused().is_none_or(|focused| focused == response.id)) {
            let pressed = |key| f32::from(u8::from(ui.input(|input| input.key_pressed(key))));
            let by = vec2(
                pressed(egui::Key::ArrowLeft) - pressed(egui::Key::ArrowRight),
                pressed(egui::Key::ArrowUp) - pressed(egui::Key::ArrowDown),
            );
            self.camera.pan(size, stage, by * KEY_STEP * ppp);
        }
    }

    /// The outline and the genes of the tile under the pointer.
    fn show_hovered(&mut self, ui: &Ui, response: &Response, painter: &Painter, framed: &Framed, ppp: f32) {
        let Some(pointer) = response.hover_pos().filter(|_| !response.dragged()) else { return };
        let Some((view, place)) = framed.visible() else { return };
        let Some(tiles) = self.tiles().cloned() else { return };
        let pixel = pointer * ppp - place.min + vec2(view.x as f32, view.y as f32);
        let pixel = (pixel.x.floor() as i32, pixel.y.floor() as i32);
        let Some(number) = pick::fly_at(&tiles, &view.canvas, pixel) else { return };
        self.hovered = Some(number);
        let Some(fly) = tiles.flies.get(number) else { return };
        let on_screen = |polygon: Vec<Pos2>| polygon.into_iter().map(|place| framed.point_of(place) / ppp).collect();
        let outlines: Vec<Vec<Pos2>> = pick::footprint(&tiles, fly).into_iter().map(on_screen).collect();
        for (color, width) in [(Color32::BLACK, 3.0), (Color32::WHITE, 1.2)] {
            let line = |outline: &Vec<Pos2>| egui::Shape::closed_line(outline.clone(), Stroke::new(width, color));
            painter.extend(outlines.iter().map(line));
        }
        self.show_genes(ui, painter.clip_rect(), &tiles, number);
    }

    fn show_genes(&self, ui: &Ui, stage: Rect, tiles: &Population, number: usize) {
        let fly = &tiles.flies[number];
        let (genes, [r, g, b]) = (fly.genes(), fly.color());
        let fitness = self.news.marginal.as_ref().filter(|_| self.moment.is_none());
        let fitness = fitness.and_then(|all| all.get(number));
        egui::Area::new(Id::new("genes"))
            .fixed_pos(stage.left_bottom() + vec2(12.0, -12.0))
            .pivot(egui::Align2::LEFT_BOTTOM)
            .interactable(false)
            .show(ui.ctx(), |ui| {
                egui::Frame::popup(ui.style()).show(ui, |ui| {
                    ui.horizontal(|ui| {
                        let (swatch, _) = ui.allocate_exact_size(Vec2::splat(28.0), Sense::hover());
                        ui.painter().rect_filled(swatch, 4.0, Color32::from_rgb(r, g, b));
                        ui.vertical(|ui| {
                            ui.strong(format!("Tile {number}   #{r:02x}{g:02x}{b:02x}"));
                            ui.label(format!(
                                "{:.1} x {:.1} px at {:.1}, {:.1}; {:.0}°, depth {:+.3}",
                                genes.w, genes.h, genes.x, genes.y, genes.angle_deg, genes.z
                            ));
                            ui.label(match fitness {
                                Some(fitness) => format!("marginal fitness {fitness:+}"),
                                None if self.moment.is_some() => {
                                    "marginal fitness: known of the present only".to_owned()
                                }
                                None => "marginal fitness: not known yet".to_owned(),
                            });
                        });
                    });
                });
            });
    }

    /// What is seen before a picture is open.
    fn show_invitation(&mut self, ui: &mut Ui, rect: Rect) {
        let middle = Rect::from_center_size(rect.center(), vec2(420.0_f32.min(rect.width()), 150.0));
        ui.scope_builder(egui::UiBuilder::new().max_rect(middle), |ui| {
            ui.vertical_centered(|ui| {
                ui.add_space(12.0);
                if self.news.doing == Doing::Opening {
                    ui.spinner();
                    ui.label("Reading…");
                    return;
                }
                ui.heading("Drop a picture here");
                ui.label("or open one: it turns into a mosaic before your eyes.");
                ui.add_space(10.0);
                self.show_open_field(ui);
            });
        });
        if ui.input(|input| !input.raw.hovered_files.is_empty()) {
            ui.painter().rect_stroke(rect.shrink(6.0), 8.0, Stroke::new(3.0, looks::ACCENT), StrokeKind::Inside);
        }
    }

    /// A word about what is happening, in the corner.
    fn show_state(&self, ui: &Ui, rect: Rect) {
        let text = match self.news.doing {
            _ if self.news.is_saving => "Saving…",
            Doing::Opening => "Reading…",
            Doing::Paused => "Paused",
            _ if self.brush.is_on => "Paint what matters",
            Doing::Running | Doing::Done(_) | Doing::Nothing | Doing::Showing => return,
        };
        let painter = ui.painter_at(rect);
        let font = egui::TextStyle::Button.resolve(ui.style());
        let text = painter.layout_no_wrap(text.to_owned(), font, Color32::WHITE);
        let back = Rect::from_min_size(rect.left_top() + vec2(12.0, 12.0), text.size() + vec2(16.0, 8.0));
        painter.rect_filled(back, 6.0, Color32::from_black_alpha(170));
        painter.galley(back.min + vec2(8.0, 4.0), text, Color32::WHITE);
    }

    fn photo_texture(&mut self, ui: &Ui, picture: &Arc<PictureNews>) -> Option<TextureId> {
        if picture.rgba.is_empty() {
            return None;
        }
        if self.photo.as_ref().is_none_or(|(known, _)| !Arc::ptr_eq(known, picture)) {
            let [width, height] = picture.size.map(|side| side as usize);
            let image = ColorImage::from_rgba_unmultiplied([width, height], &picture.rgba);
            self.photo = Some((Arc::clone(picture), ui.ctx().load_texture("photo", image, TextureOptions::NEAREST)));
        }
        self.photo.as_ref().map(|(_, texture)| texture.id())
    }

    fn error_texture(&mut self, ui: &Ui) -> Option<TextureId> {
        let (errors, picture) = (self.news.error_map.clone()?, self.news.picture.clone()?);
        let [width, height] = picture.size.map(|side| side as usize);
        if errors.len() != width * height || self.moment.is_some() {
            return None;
        }
        if self.error.as_ref().is_none_or(|(known, _)| !Arc::ptr_eq(known, &errors)) {
            let pixels = errors.iter().map(|&error| looks::error_color(error)).collect();
            let image = ColorImage::new([width, height], pixels);
            match &mut self.error {
                Some((known, texture)) => {
                    *known = errors;
                    texture.set(image, TextureOptions::NEAREST);
                }
                None => self.error = Some((errors, ui.ctx().load_texture("error", image, TextureOptions::NEAREST))),
            }
        }
        self.error.as_ref().map(|(_, texture)| texture.id())
    }
}

/// Fills a rectangle, but not what of it is hidden.
fn fill_around(painter: &Painter, rect: Rect, hidden: Option<Rect>, color: Color32) {
    // Edges are softened over a pixel, which must lie behind what hides them.
    let hole = hidden.map(|hidden| hidden.intersect(rect).shrink(2.0)).filter(Rect::is_positive);
    let Some(hole) = hole else {
        painter.rect_filled(rect, 0.0, color);
        return;
    };
    for side in [
        Rect::from_min_max(rect.min, pos2(rect.right(), hole.top())),
        Rect::from_min_max(pos2(rect.left(), hole.bottom()), rect.max),
        Rect::from_min_max(pos2(rect.left(), hole.top()), hole.left_bottom()),
        Rect::from_min_max(hole.right_top(), pos2(rect.right(), hole.bottom())),
    ] {
        painter.rect_filled(side, 0.0, color);
    }
}

/// The pattern that means transparent.
fn show_checkers(painter: &Painter, rect: Rect, is_dark: bool) {
    if !rect.is_positive() {
        return;
    }
    let (even, odd) = looks::checker_colors(is_dark);
    painter.rect_filled(rect, 0.0, even);
    let mut mesh = egui::Mesh::default();
    let (columns, rows) = ((rect.width() / CHECKER).ceil() as i32, (rect.height() / CHECKER).ceil() as i32);
    for row in 0..rows {
        for column in (row % 2..columns).step_by(2) {
            let corner = rect.min + vec2(column as f32, row as f32) * CHECKER;
            mesh.add_colored_rect(Rect::from_min_size(corner, Vec2::splat(CHECKER)).intersect(rect), odd);
        }
    }
    painter.add(egui::Shape::mesh(mesh));
}
