//! What of a mosaic is seen: a place of it in the middle of the stage, and a scale. Plain arithmetic.
//!
//! Lengths on the stage are physical pixels of the screen; lengths of the picture are its pixels. A picture of `width`
//! px spans 0 to `width`; the centre of pixel (0, 0) lies at (0.5, 0.5).

use egui::{Pos2, Rect, Vec2, pos2, vec2};

use crate::gpu::LiveView;
use crate::model::Canvas;
use crate::model::target::TARGET_SIDE_MAX_PX;

/// Smallest length on the stage of the longer side of a picture.
const LONG_SIDE_MIN_PX: f32 = 16.0;
/// Share of the stage that a fitted picture leaves free.
const MARGIN: f32 = 0.03;

/// Where one looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Camera {
    /// The place of the picture in the middle of the stage; none while the whole picture is fitted to the stage.
    aim: Option<Aim>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Aim {
    centre: Pos2,
    scale: f32,
}

/// A picture on the stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Framed {
    /// The stage, in physical pixels.
    pub stage: Rect,
    /// The whole picture, in physical pixels; it may reach beyond the stage.
    pub picture: Rect,
    /// Physical pixels for each pixel of the picture.
    pub scale: f32,
    canvas: Canvas,
}

impl Camera {
    /// The whole picture, as large as it fits.
    pub(super) const FITTED: Self = Self { aim: None };

    /// A picture of `size` px on a stage.
    pub(super) fn frame(&self, size: [u32; 2], stage: Rect) -> Framed {
        let Aim { centre, scale } = self.aim.unwrap_or_else(|| fitted(size, stage));
        let (long_side, scale) = whole(size, scale);
        let canvas = Canvas::scaled(size[0], size[1], long_side);
        let corner = stage.center() - centre.to_vec2() * scale;
        let corner = pos2(corner.x.round(), corner.y.round());
        let picture = Rect::from_min_size(corner, vec2(canvas.width_px as f32, canvas.height_px as f32));
        Framed { stage, picture, scale, canvas }
    }

    /// Moves the picture by a distance on the stage.
    pub(super) fn pan(&mut self, size: [u32; 2], stage: Rect, by: Vec2) {
        if by != Vec2::ZERO {
            let Aim { centre, scale } = self.aim.unwrap_or_else(|| fitted(size, stage));
            self.aim = Some(Aim { centre: within(centre - by / scale, size), scale });
        }
    }

    /// Enlarges the picture by a factor, and what lies under `pointer` stays there.
    pub(super) fn zoom(&mut self, size: [u32; 2], stage: Rect, pointer: Pos2, factor: f32) {
        let Aim { centre, scale } = self.aim.unwrap_or_else(|| fitted(size, stage));
        let long = size[0].max(size[1]) as f32;
        let (_, scale) = whole(size, scale);
        let next = (scale * factor).clamp(LONG_SIDE_MIN_PX / long, TARGET_SIDE_MAX_PX as f32 / long);
        let (_, next) = whole(size, next);
        let offset = pointer - stage.center();
        self.aim = Some(Aim { centre: within(centre + offset / scale - offset / next, size), scale: next });
    }

    /// Shows one pixel of the picture as one of the screen.
    pub(super) fn one_to_one(&mut self, size: [u32; 2], stage: Rect) {
        let Aim { centre, .. } = self.aim.unwrap_or_else(|| fitted(size, stage));
        self.aim = Some(Aim { centre, scale: 1.0 });
    }
}

/// The aim that shows all of a picture.
fn fitted(size: [u32; 2], stage: Rect) -> Aim {
    let size = vec2(size[0] as f32, size[1] as f32);
    let room = stage.size() * (1.0 - MARGIN);
    let scale = (room.x / size.x).min(room.y / size.y).max(LONG_SIDE_MIN_PX / size.max_elem());
    Aim { centre: (size / 2.0).to_pos2(), scale }
}

/// The longer side and the scale at which it has whole pixels, as what the engine draws.
fn whole(size: [u32; 2], scale: f32) -> (u32, f32) {
    let long = size[0].max(size[1]) as f32;
    let long_side = (long * scale).round().clamp(1.0, TARGET_SIDE_MAX_PX as f32);
    (long_side as u32, long_side / long)
}

/// A place that is moved into the picture, so that it cannot be lost.
fn within(place: Pos2, size: [u32; 2]) -> Pos2 {
    place.clamp(Pos2::ZERO, pos2(size[0] as f32, size[1] as f32))
}

impl Framed {
    /// The part of the picture that is on the stage, as the engine draws it, and where it lies; none if no pixel is.
    pub(super) fn visible(&self) -> Option<(LiveView, Rect)> {
        let seen = self.picture.intersect(self.stage);
        let (first, last) = ((seen.min - self.picture.min).floor(), (seen.max - self.picture.min).ceil());
        let (width_px, height_px) = ((last.x - first.x) as u32, (last.y - first.y) as u32);
        if !seen.is_positive() || width_px == 0 || height_px == 0 {
            return None;
        }
        let view = LiveView { canvas: self.canvas, x: first.x as u32, y: first.y as u32, width_px, height_px };
        Some((view, Rect::from_min_max(self.picture.min + first, self.picture.min + last)))
    }

    /// The place of the picture at a point of the stage.
    pub(super) fn place_at(&self, point: Pos2) -> Pos2 {
        ((point - self.picture.min) / self.scale).to_pos2()
    }

    /// The point of the stage at a place of the picture.
    pub(super) fn point_of(&self, place: Pos2) -> Pos2 {
        self.picture.min + place.to_vec2() * self.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [300, 200];
    const STAGE: Rect = Rect { min: pos2(100.0, 50.0), max: pos2(700.0, 650.0) };

    #[test]
    fn a_fitted_picture_is_whole_and_in_the_middle() {
        let framed = Camera::FITTED.frame(SIZE, STAGE);
        assert!(STAGE.contains_rect(framed.picture), "{framed:?}");
        assert!((framed.picture.center() - STAGE.center()).length() < 1.5, "{framed:?}");
        assert!(framed.picture.width() > 0.9 * STAGE.width());
    }

    #[test]
    fn zooming_keeps_what_lies_under_the_pointer() {
        let mut camera = Camera::FITTED;
        for (pointer, factor) in [(pos2(250.0, 300.0), 3.0), (pos2(600.0, 320.0), 0.7), (pos2(400.0, 400.0), 9.0)] {
            let before = camera.frame(SIZE, STAGE);
            camera.zoom(SIZE, STAGE, pointer, factor);
            let after = camera.frame(SIZE, STAGE);
            let moved = (before.place_at(pointer) - after.place_at(pointer)).length();
            // The corner lies on a whole pixel before and after, each at its own scale.
            assert!(moved * before.scale.min(after.scale) < 2.0, "{before:?} {after:?}");
        }
    }

    #[test]
    fn what_is_visible_is_a_rectangle_of_the_canvas() {
        let mut camera = Camera::FITTED;
        camera.zoom(SIZE, STAGE, pos2(300.0, 300.0), 40.0);
        let framed = camera.frame(SIZE, STAGE);
        let (view, rect) = framed.visible().expect("the pointer was over the picture");
        assert!(view.x + view.width_px <= view.canvas.width_px && view.y + view.height_px <= view.canvas.height_px);
        assert_eq!((view.width_px, view.height_px), (600, 600));
        assert_eq!(rect, STAGE);
        assert_eq!(framed.point_of(framed.place_at(pos2(321.0, 432.0))).round(), pos2(321.0, 432.0));
    }

    #[test]
    fn a_picture_can_be_neither_lost_nor_enlarged_beyond_what_the_engine_draws() {
        let mut camera = Camera::FITTED;
        camera.pan(SIZE, STAGE, vec2(1e6, -1e6));
        assert!(camera.frame(SIZE, STAGE).visible().is_some());
        for _ in 0..99 {
            camera.zoom(SIZE, STAGE, STAGE.center(), 4.0);
        }
        assert!(camera.frame(SIZE, STAGE).picture.width() <= TARGET_SIDE_MAX_PX as f32);
        for _ in 0..99 {
            camera.zoom(SIZE, STAGE, STAGE.center(), 0.2);
        }
        assert!(camera.frame(SIZE, STAGE).visible().is_some());
        camera.one_to_one(SIZE, STAGE);
        assert_eq!(camera.frame(SIZE, STAGE).picture.size(), vec2(300.0, 200.0));
        camera = Camera::FITTED;
        assert_eq!(camera, Camera::FITTED);
    }
}
