//! The flies of one lane together with what is needed to draw them again: picture size, masks, background, grout.

use super::fly::Fly;
use super::grout::Grout;
use super::mask::MaskSet;
use super::target::Rgb;

/// The most flies that one population may have.
pub const FLY_COUNT_MAX: usize = 1_000_000;

/// A whole solution: together the flies are the mosaic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Population {
    /// Width in px of the picture that the genes refer to.
    pub width_px: u32,
    /// Height in px of the picture that the genes refer to.
    pub height_px: u32,
    /// Colour behind all tiles.
    pub background: Rgb,
    /// Ring of every tile, if the tiles are opaque; `None` draws tiles to their edges.
    pub grout: Option<Grout>,
    /// Tile shapes that `Fly::mask` refers to.
    pub masks: MaskSet,
    /// The flies; their order breaks ties in depth.
    pub flies: Vec<Fly>,
}
