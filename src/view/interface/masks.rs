//! The shapes of tiles, chosen by picture: each is shown as the chosen shader makes it.

use std::sync::Arc;

use egui::{Color32, ColorImage, Sense, Stroke, StrokeKind, TextureHandle, TextureOptions, Ui, Vec2};

use super::files::{Field, Taken};
use super::{Interface, looks};
use crate::model::mask::MASK_SIDE;
use crate::shapes::{BuiltIn, Shader, Template};
use crate::view::news::Note;
use crate::view::wishes::MaskWish;

/// Side of a picture of a mask in points, and in px.
const SIDE: f32 = 44.0;
const SIDE_PX: usize = 64;
/// Most bytes of a mask that is carried along.
const MASK_BYTES_MAX: u64 = 1 << 20;

/// Pictures of all masks that come with smalti, under one shader.
pub(super) struct Thumbnails {
    shader: Option<Shader>,
    textures: Vec<(BuiltIn, TextureHandle)>,
}

impl Thumbnails {
    fn new(ui: &Ui, shader: Option<Shader>) -> Self {
        let texture = |shape: BuiltIn| {
            let image = picture(&shape.template(), shader.unwrap_or(Shader::Template));
            (shape, ui.ctx().load_texture(shape.name(), image, TextureOptions::LINEAR))
        };
        Self { shader, textures: BuiltIn::ALL.into_iter().map(texture).collect() }
    }
}

/// A mask as white stone with its shade, transparent where it covers nothing.
fn picture(template: &Template, shader: Shader) -> ColorImage {
    let mask = shader.mask(template);
    let step = MASK_SIDE / SIDE_PX;
    let texel = |place: usize| {
        let (column, row) = (place % SIDE_PX * step, place / SIDE_PX * step);
        let texel = mask.texel(column as u32, row as u32);
        let light = |base: u16| (base * u16::from(texel.shade) / 255) as u8;
        Color32::from_rgba_unmultiplied(light(226), light(214), light(190), texel.coverage)
    };
    ColorImage::new([SIDE_PX, SIDE_PX], (0..SIDE_PX * SIDE_PX).map(texel).collect())
}

impl Interface {
    pub(super) fn show_masks(&mut self, ui: &mut Ui) {
        let shader = self.wishes.shader;
        if self.thumbnails.as_ref().is_none_or(|known| known.shader != shader) {
            self.thumbnails = Some(Thumbnails::new(ui, shader));
        }
        let textures: Vec<_> = self.thumbnails.iter().flat_map(|known| &known.textures).cloned().collect();
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing = Vec2::splat(5.0);
            for (shape, texture) in textures {
                let wish = MaskWish::BuiltIn(shape.name());
                let is_chosen = self.wishes.masks.contains(&wish);
                let (rect, response) = ui.allocate_exact_size(Vec2::splat(SIDE), Sense::click());
                let name = shape.name();
                response.widget_info(|| egui::WidgetInfo::selected(egui::WidgetType::Checkbox, true, is_chosen, name));
                let visuals = ui.style().interact_selectable(&response, is_chosen);
                ui.painter().rect_filled(rect, 5.0, ui.visuals().extreme_bg_color);
                let uv = egui::Rect::from_min_max(egui::Pos2::ZERO, egui::pos2(1.0, 1.0));
                ui.painter().image(texture.id(), rect.shrink(6.0), uv, Color32::WHITE);
                let stroke = if is_chosen { Stroke::new(2.5, looks::ACCENT) } else { visuals.bg_stroke };
                ui.painter().rect_stroke(rect, 5.0, stroke, StrokeKind::Inside);
                if response.on_hover_text(format!("{name}: {}", shape.description())).clicked() {
                    if is_chosen {
                        self.wishes.masks.retain(|mask| *mask != wish);
                    } else {
                        self.wishes.masks.push(wish);
                    }
                }
            }
        });
        let mut removed = None;
        for (place, mask) in self.wishes.masks.iter().enumerate() {
            if let MaskWish::File { name, .. } = mask {
                ui.horizontal(|ui| {
                    ui.label(name);
                    if ui.small_button("×").on_hover_text("Leave this shape out").clicked() {
                        removed = Some(place);
                    }
                });
            }
        }
        if let Some(place) = removed {
            self.wishes.masks.remove(place);
        }
        if self.wishes.masks.is_empty() {
            ui.weak("None chosen: the default of the style. Several make a mix.");
        }
        let hint = "A picture or an SVG of a tile: what is opaque in it is the tile";
        if let Some(Taken { path, .. }) = self.show_path(ui, Field::Mask, hint) {
            match read_mask(&path) {
                Ok(mask) => self.wishes.masks.push(mask),
                Err(error) => self.say(Note::failure(error), ui.input(|input| input.time)),
            }
        }
        self.show_shaders(ui);
    }
}

fn read_mask(path: &std::path::Path) -> Result<MaskWish, String> {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let unreadable = |error: std::io::Error| format!("{}: {}", path.display(), crate::error::in_words(&error));
    if std::fs::metadata(path).map_err(unreadable)?.len() > MASK_BYTES_MAX {
        return Err(format!("{}: is larger than 1 MiB; make a smaller picture of the tile", path.display()));
    }
    let bytes: Arc<[u8]> = std::fs::read(path).map_err(unreadable)?.into();
    // A mask that cannot be read is told here, and not when it is worn.
    crate::studio::Mask::from_encoded(&bytes).map_err(|error| error.to_string())?;
    Ok(MaskWish::File { name, bytes })
}
