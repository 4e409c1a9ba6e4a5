//! How wrong a colour is at a pixel, and the stack of flies there.
//!
//! Twin: `glsl/shared/cells_pixel.glsl`.

/// Most flies that may lie on one pixel. A child that would lie deeper is refused, so stacks are always complete and
/// answers always exact.
pub const STACK_DEPTH: usize = 16;
/// As [`STACK_DEPTH`], for translucent tiles, which show through each other.
pub const TRANSLUCENT_DEPTH: usize = 24;
/// Depth of the background: behind every fly.
pub const BACKGROUND_Z: u32 = 1 << 24;

/// Flag in the highest byte of a target word: the pixel lies inside the picture.
pub const INSIDE: u32 = 1 << 24;
/// Flag in the highest byte of a target word: no tile is wanted at this pixel.
pub const TRANSPARENT: u32 = 1 << 25;
/// The error of any tile at a pixel where none is wanted.
pub const UNWANTED_ERROR: i32 = 765;

/// Sum of the absolute differences of three 8-bit channels.
#[inline(always)]
#[must_use]
pub fn difference(one: u32, other: u32) -> i32 {
    let channel = |shift: u32| ((one >> shift & 255) as i32 - (other >> shift & 255) as i32).abs();
    channel(0) + channel(8) + channel(16)
}
