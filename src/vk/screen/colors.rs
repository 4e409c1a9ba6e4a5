//! Colours on their way to the renderer of the interface, which computes with light: it takes the colours of vertices
//! to the power of 2.2 and reads its textures as sRGB. What is shown is stored as sRGB, and `egui` wants it blended as
//! it is stored. So each colour goes in as what the renderer makes the right one of.
//!
//! A colour of 8 bits comes out at most one step off, and black and white exactly. Images that are shown by
//! `Screen::add_image` do not pass here: every byte of them is exact.

use egui::epaint::Primitive;
use egui::{ClippedPrimitive, Color32};

/// What each 8-bit channel goes in as.
pub(super) struct Channels([u8; 256]);

impl Channels {
    /// For vertices.
    pub(super) fn of_vertices() -> Self {
        Self::inverting(|share| share.powf(1.0 / 2.2))
    }

    /// For texels of the interface's own textures.
    pub(super) fn of_texels() -> Self {
        let encoded = |light: f32| {
            if light <= 0.003_130_8 { light * 12.92 } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
        };
        Self::inverting(encoded)
    }

    fn inverting(encode: impl Fn(f32) -> f32) -> Self {
        Self(std::array::from_fn(|channel| (255.0 * encode(channel as f32 / 255.0)).round() as u8))
    }

    /// What a colour goes in as. Its opacity stays as it is.
    pub(super) fn of(&self, color: Color32) -> Color32 {
        let [r, g, b, alpha] = color.to_array();
        let [r, g, b] = [r, g, b].map(|channel| self.0[usize::from(channel)]);
        Color32::from_rgba_premultiplied(r, g, b, alpha)
    }

    /// The meshes that show something, with the colours of their vertices as they go in.
    pub(super) fn of_primitives(&self, primitives: &[ClippedPrimitive]) -> Vec<ClippedPrimitive> {
        let is_shown = |it: &&ClippedPrimitive| matches!(&it.primitive, Primitive::Mesh(mesh) if !mesh.is_empty());
        let mut primitives: Vec<ClippedPrimitive> = primitives.iter().filter(is_shown).cloned().collect();
        for primitive in &mut primitives {
            if let Primitive::Mesh(mesh) = &mut primitive.primitive {
                mesh.vertices.iter_mut().for_each(|vertex| vertex.color = self.of(vertex.color));
            }
        }
        primitives
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The light that a device makes of an 8-bit sRGB channel.
    fn decoded(channel: u8) -> f32 {
        let share = f32::from(channel) / 255.0;
        if share <= 0.040_45 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
    }

    #[test]
    fn what_the_renderer_makes_of_a_colour_is_that_colour() {
        let (vertices, texels) = (Channels::of_vertices(), Channels::of_texels());
        for channel in 0..=255_u8 {
            let [vertex, texel] = [&vertices, &texels].map(|channels| channels.of(Color32::from_gray(channel)).r());
            let power = 255.0 * (f32::from(vertex) / 255.0).powf(2.2);
            let light = 255.0 * decoded(texel);
            for shown in [power, light] {
                assert!((shown - f32::from(channel)).abs() < 1.5, "{channel} is shown as {shown}");
            }
        }
        for color in [Color32::BLACK, Color32::WHITE, Color32::TRANSPARENT] {
            assert_eq!([vertices.of(color), texels.of(color)], [color; 2]);
        }
        assert_eq!(vertices.of(Color32::from_rgba_premultiplied(255, 0, 255, 9)).to_array(), [255, 0, 255, 9]);
    }
}
