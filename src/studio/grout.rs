//! The grout that was asked for: its colour and its width.

use super::choices::GroutColor;
use super::parameters::contradiction;
use crate::error::Result;
use crate::model::fly::UNITS_PER_PX;
use crate::model::{Grout, Rgb, Target};

/// Width over the mean side of a tile, in 1/256, where the style has none and a colour is asked for.
const USUAL_Q8: u32 = 16;

/// What was asked for, checked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct GroutChoice {
    color: Option<GroutColor>,
    /// In 1/64 px.
    width: Option<u32>,
}

impl GroutChoice {
    /// Checks what was asked for; a width in px is in range.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] if there is to be no grout, of some width.
    pub(super) fn new(color: Option<GroutColor>, width_px: Option<f64>) -> Result<Self> {
        if width_px.is_some() && color == Some(GroutColor::None) {
            return Err(contradiction("grout", "none and `grout_width` contradict each other; drop one"));
        }
        let in_units = |px: f64| (px * f64::from(UNITS_PER_PX)).round() as u32;
        Ok(Self { color, width: width_px.map(in_units) })
    }

    /// Some grout, of the usual width and colour.
    pub(super) fn auto() -> Self {
        Self { color: Some(GroutColor::Auto), width: None }
    }

    /// The parameter that asks for grout, if one does.
    pub(super) fn asking_parameter(&self) -> Option<&'static str> {
        match self.color {
            Some(GroutColor::Auto | GroutColor::This(_)) => Some("grout"),
            Some(GroutColor::None) | None => self.width.map(|_| "grout_width"),
        }
    }

    /// The grout of tiles of the mean side `side` (1/64 px), in a style whose ring has a width of `usual_q8` / 256 over
    /// it.
    pub(super) fn of(&self, usual_q8: u32, side: u32, target: &Target) -> Option<Grout> {
        let is_asked_for = self.width.is_some() || self.color.is_some();
        let usual_q8 = if usual_q8 == 0 && is_asked_for { USUAL_Q8 } else { usual_q8 };
        if self.color == Some(GroutColor::None) || usual_q8 == 0 && self.width.is_none() {
            return None;
        }
        let color = match self.color {
            Some(GroutColor::This(color)) => color,
            _ => mean_color(target).map(|channel| ((u32::from(channel) * 3 + 2) / 4) as u8),
        };
        Some(Grout { width: self.width.unwrap_or_else(|| ((side * usual_q8) >> 8).max(1)), color })
    }
}

/// The mean colour where tiles are wanted, rounded half up. Grout a quarter darker than that parts the tiles
/// everywhere, and takes hardly 2 % of the whole's brightness.
pub(super) fn mean_color(target: &Target) -> Rgb {
    let is_wanted = |place: usize| target.transparent().is_none_or(|transparent| !transparent[place]);
    let (mut sums, mut count) = ([0_u64; 3], 0_u64);
    for (_, color) in target.pixels().iter().enumerate().filter(|&(place, _)| is_wanted(place)) {
        sums.iter_mut().zip(color).for_each(|(sum, &channel)| *sum += u64::from(channel));
        count += 1;
    }
    sums.map(|sum| ((2 * sum + count) / (2 * count.max(1))) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target() -> Target {
        Target::new(2, 1, vec![[0, 10, 255], [1, 20, 255]]).expect("two pixels are 2x1")
    }

    #[test]
    fn the_grout_is_that_of_the_style_unless_told_otherwise() {
        let of = |color, width, usual_q8| {
            GroutChoice::new(color, width).expect("it is in range").of(usual_q8, 640, &target())
        };
        assert_eq!(of(None, None, 0), None);
        assert_eq!(of(None, None, 16), Some(Grout { width: 40, color: [1, 11, 191] }));
        assert_eq!(of(Some(GroutColor::Auto), None, 0), of(None, None, 16));
        assert_eq!(of(Some(GroutColor::None), None, 16), None);
        assert_eq!(of(None, Some(1.5), 0), Some(Grout { width: 96, color: [1, 11, 191] }));
        assert_eq!(of(Some(GroutColor::This([9; 3])), Some(0.02), 16), Some(Grout { width: 1, color: [9; 3] }));
    }

    #[test]
    fn what_is_transparent_has_no_part_in_the_colour_of_grout() {
        let cut = target().with_transparent(vec![true, false]).expect("two pixels");
        assert_eq!(mean_color(&cut), [1, 20, 255]);
    }
}
