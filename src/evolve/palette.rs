//! A fixed set of colours that the tiles of a mosaic may have.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::model::rng::Stream;
use crate::model::{Fly, Rgb};

/// Most colours of a palette: few enough to search for every birth, and as many as palette files can have.
pub const PALETTE_COLORS_MAX: usize = 256;

/// A palette of at least one 8-bit sRGB colour.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Palette {
    colors: Arc<[Rgb]>,
}

impl Palette {
    /// A palette of these colours. Their order breaks ties.
    ///
    /// # Errors
    /// [`Error::Parameter`] if there are none, or more than [`PALETTE_COLORS_MAX`].
    pub fn new(colors: impl Into<Arc<[Rgb]>>) -> Result<Self> {
        let colors = colors.into();
        if !(1..=PALETTE_COLORS_MAX).contains(&colors.len()) {
            return Err(Error::parameter(
                "palette",
                format!("must have 1 to {PALETTE_COLORS_MAX} colours, not {}", colors.len()),
            ));
        }
        Ok(Self { colors })
    }

    /// The colours.
    #[must_use]
    pub fn colors(&self) -> &[Rgb] {
        &self.colors
    }

    /// The colour nearest to `color` by squared distance in 8-bit sRGB. Of equally near ones, the first.
    #[must_use]
    pub fn nearest(&self, color: Rgb) -> Rgb {
        let distance = |other: &Rgb| -> u32 {
            color.iter().zip(other).map(|(&one, &other)| u32::from(one.abs_diff(other)).pow(2)).sum()
        };
        self.colors.iter().copied().min_by_key(distance).unwrap_or(color)
    }

    /// `fly` with the nearest colour of the palette.
    #[must_use]
    pub fn snapped(&self, fly: &Fly) -> Fly {
        fly.with_color(self.nearest(fly.color()))
    }

    /// Any of the colours, all equally likely.
    #[must_use]
    pub fn random(&self, stream: &mut Stream) -> Rgb {
        self.colors[stream.below(self.colors.len() as u32) as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_snap_to_the_nearest_and_ties_to_the_first() {
        let palette = Palette::new([[0, 0, 0], [255, 0, 0], [10, 0, 0], [0, 10, 0]]).expect("four colours");
        assert_eq!(palette.nearest([5, 5, 0]), [0, 0, 0], "as near to the last three as to the first");
        assert_eq!(palette.nearest([6, 5, 0]), [10, 0, 0]);
        assert_eq!(palette.nearest([200, 90, 20]), [255, 0, 0]);
        let snapped = palette.snapped(&Fly { r: 60_000, alive: true, ..Fly::ABSENT });
        assert_eq!((snapped.r, snapped.g, snapped.b), (65_535, 0, 0));
    }

    #[test]
    fn an_empty_palette_and_a_huge_one_are_refused() {
        assert!(Palette::new(Vec::new()).is_err());
        assert!(Palette::new(vec![[0; 3]; PALETTE_COLORS_MAX + 1]).is_err());
        assert!(Palette::new(vec![[0; 3]; PALETTE_COLORS_MAX]).is_ok());
    }
}
