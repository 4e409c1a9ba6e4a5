//! The ink of a drawing, texel by texel.

/// One texel of a drawing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Ink {
    /// How much of the texel is drawn on: 0 is a hole, 255 is full.
    pub alpha: u8,
    /// How bright the drawing is there, up to 255; without meaning where alpha is 0.
    pub intensity: u8,
}
