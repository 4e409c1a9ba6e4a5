//! The picture to match.

use crate::error::{Error, Result};

/// An 8-bit sRGB colour.
pub type Rgb = [u8; 3];

/// A colour as `#rrggbb`.
#[must_use]
pub fn hexadecimal([r, g, b]: Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Largest side of a picture in px. Positions in 1/64 px stay exact in the f32 columns of population files.
pub const TARGET_SIDE_MAX_PX: u32 = 65_535;
/// Largest weight of a pixel: an error of at most 765 then still fits 14 bits.
pub const WEIGHT_MAX: u8 = 16;

/// The weight of a pixel, 1 to [`WEIGHT_MAX`], where a map of weights has this luma: black is 1, white is the most.
#[must_use]
pub fn weight_of_luma(luma: u8) -> u8 {
    1 + ((u32::from(luma) * u32::from(WEIGHT_MAX - 1) * 2 + 255) / 510) as u8
}

/// The pixels to match: 8-bit sRGB, row by row from the top. If they do not all matter alike, they have weights.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    width_px: u32,
    height_px: u32,
    pixels: Vec<Rgb>,
    weights: Option<Vec<u8>>,
    transparent: Option<Vec<bool>>,
}

impl Target {
    /// A target of `width_px` x `height_px` from its pixels, row by row from the top.
    ///
    /// # Errors
    /// [`Error::Parameter`] if a side is 0 or above [`TARGET_SIDE_MAX_PX`], or if the pixel count does not fit.
    pub fn new(width_px: u32, height_px: u32, pixels: Vec<Rgb>) -> Result<Self> {
        let sides = 1..=TARGET_SIDE_MAX_PX;
        if !sides.contains(&width_px) || !sides.contains(&height_px) {
            return Err(Error::parameter(
                "picture",
                format!("its sides must be 1 to {TARGET_SIDE_MAX_PX} px, not {width_px}x{height_px}"),
            ));
        }
        let target = Self { width_px, height_px, pixels, weights: None, transparent: None };
        target.check_count("picture", "pixels", target.pixels.len())?;
        Ok(target)
    }

    /// The same pixels, with the error of each multiplied by its weight, 1 to [`WEIGHT_MAX`], row by row from the top.
    ///
    /// Only proportions matter, so the weights are divided by their greatest common divisor. If all of them become 1,
    /// the target has no weights.
    ///
    /// # Errors
    /// [`Error::Parameter`] if their count does not fit the size, or if one is out of range.
    pub fn with_weights(mut self, mut weights: Vec<u8>) -> Result<Self> {
        self.check_count("weights", "weights", weights.len())?;
        if let Some(wrong) = weights.iter().find(|weight| !(1..=WEIGHT_MAX).contains(*weight)) {
            return Err(Error::parameter("weights", format!("each must be 1 to {WEIGHT_MAX}, not {wrong}")));
        }
        let divisor = weights.iter().copied().fold(0, greatest_common_divisor);
        weights.iter_mut().for_each(|weight| *weight /= divisor);
        self.weights = Some(weights).filter(|weights| weights.iter().any(|&weight| weight != 1));
        Ok(self)
    }

    /// The same pixels, row by row from the top, where no tile is wanted at those marked true. If none is, the target
    /// is opaque.
    ///
    /// # Errors
    /// [`Error::Parameter`] if their count does not fit the size.
    pub fn with_transparent(mut self, transparent: Vec<bool>) -> Result<Self> {
        self.check_count("transparent", "pixels that are transparent or not", transparent.len())?;
        self.transparent = Some(transparent).filter(|transparent| transparent.contains(&true));
        Ok(self)
    }

    /// Width in px.
    #[must_use]
    pub fn width_px(&self) -> u32 {
        self.width_px
    }

    /// Height in px.
    #[must_use]
    pub fn height_px(&self) -> u32 {
        self.height_px
    }

    /// All pixels, row by row from the top.
    #[must_use]
    pub fn pixels(&self) -> &[Rgb] {
        &self.pixels
    }

    /// What the error of every pixel is multiplied by, row by row, 1 to [`WEIGHT_MAX`] and with no common divisor;
    /// `None` if all pixels count alike.
    #[must_use]
    pub fn weights(&self) -> Option<&[u8]> {
        self.weights.as_deref()
    }

    /// For each pixel, row by row, whether no tile is wanted there; `None` if tiles are wanted everywhere.
    #[must_use]
    pub fn transparent(&self) -> Option<&[bool]> {
        self.transparent.as_deref()
    }

    /// Checks that there is one value for each pixel: `count` of what `plural` names, for the parameter `name`.
    fn check_count(&self, name: &str, plural: &str, count: usize) -> Result<()> {
        let Self { width_px, height_px, .. } = self;
        if count == *width_px as usize * *height_px as usize {
            return Ok(());
        }
        Err(Error::parameter(name, format!("a picture of {width_px}x{height_px} px cannot have {count} {plural}")))
    }
}

fn greatest_common_divisor(a: u8, b: u8) -> u8 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target() -> Target {
        Target::new(2, 2, vec![[9, 8, 7]; 4]).expect("four pixels are 2x2")
    }

    #[test]
    fn the_luma_of_a_map_becomes_the_nearest_of_16_weights() {
        for luma in 0..=255_u8 {
            let nearest = 1 + (f64::from(luma) * 15.0 / 255.0).round() as u8;
            assert_eq!(weight_of_luma(luma), nearest, "luma {luma}");
        }
        assert_eq!([0, 255].map(weight_of_luma), [1, WEIGHT_MAX]);
    }

    #[test]
    fn weights_are_divided_by_their_common_divisor() {
        let weighted = target().with_weights(vec![4, 16, 8, 4]).expect("four weights in range");
        assert_eq!(weighted.weights(), Some(&[1, 4, 2, 1][..]));
        let coprime = target().with_weights(vec![16, 16, 3, 16]).expect("four weights in range");
        assert_eq!(coprime.weights(), Some(&[16, 16, 3, 16][..]));
    }

    #[test]
    fn a_uniform_map_of_any_weight_is_no_map() {
        for weight in 1..=WEIGHT_MAX {
            assert_eq!(target().with_weights(vec![weight; 4]).expect("four weights in range"), target());
        }
        let replaced = target().with_weights(vec![1, 2, 3, 4]).and_then(|weighted| weighted.with_weights(vec![7; 4]));
        assert_eq!(replaced.expect("four weights in range"), target());
    }

    #[test]
    fn an_opaque_picture_has_no_transparent_pixels() {
        assert_eq!(target().with_transparent(vec![false; 4]).expect("four pixels"), target());
        let cut = target().with_transparent(vec![false, true, false, false]).expect("four pixels");
        assert_eq!(cut.transparent(), Some(&[false, true, false, false][..]));
        assert_eq!(cut.weights(), None);
    }

    #[test]
    fn planes_of_another_size_and_weights_out_of_range_are_refused() {
        for count in [0, 3, 5] {
            let refusal = target().with_weights(vec![1; count]).expect_err("the count is wrong");
            assert!(refusal.to_string().contains(&format!("2x2 px cannot have {count} weights")), "{refusal}");
            let refusal = target().with_transparent(vec![true; count]).expect_err("the count is wrong");
            assert!(refusal.to_string().contains(&format!("2x2 px cannot have {count} pixels")), "{refusal}");
        }
        for wrong in [0, WEIGHT_MAX + 1, 255] {
            assert!(target().with_weights(vec![1, 1, wrong, 1]).is_err(), "{wrong}");
        }
    }
}
