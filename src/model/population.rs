//! The flies of one lane together with what is needed to draw them again: picture size, masks, background, grout.

use super::fly::Fly;
use super::grout::Grout;
use super::mask::MaskSet;
use super::target::Rgb;

/// The most flies that one population may have.
pub const FLY_COUNT_MAX: usize = 1_000_000;

/// What lies behind all tiles of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backdrop {
    /// A colour: the picture has no alpha.
    Color(Rgb),
    /// Nothing: the picture has alpha.
    Transparent,
}

impl Backdrop {
    /// The colour behind the tiles for a picture that cannot have alpha: black if the backdrop is transparent.
    #[must_use]
    pub fn color(self) -> Rgb {
        match self {
            Self::Color(color) => color,
            Self::Transparent => [0; 3],
        }
    }
}

impl From<Rgb> for Backdrop {
    fn from(color: Rgb) -> Self {
        Self::Color(color)
    }
}

/// A whole solution: together the flies are the mosaic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Population {
    /// Width in px of the picture that the genes refer to.
    pub width_px: u32,
    /// Height in px of the picture that the genes refer to.
    pub height_px: u32,
    /// What shows where no tile is.
    pub background: Backdrop,
    /// Ring of every tile, if the tiles are opaque; `None` draws tiles to their edges.
    pub grout: Option<Grout>,
    /// Tile shapes that `Fly::mask` refers to.
    pub masks: MaskSet,
    /// The flies; their order breaks ties in depth.
    pub flies: Vec<Fly>,
}
