//! Grout: the mortar that shows between the tiles of a mosaic, drawn as the outer ring of each tile in one colour.

use super::fly::SIDE_MAX;
use super::target::Rgb;

/// The ring of every opaque tile of a population; translucent tiles have none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grout {
    /// Width of the ring in 1/64 px at evaluation size, the same for every tile, 1 to [`GROUT_WIDTH_MAX`].
    pub width: u32,
    /// Its colour.
    pub color: Rgb,
}

/// Widest ring in 1/64 px: half of the longest side, so that every tile is all grout.
pub const GROUT_WIDTH_MAX: u32 = SIDE_MAX / 2;
