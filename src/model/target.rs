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

/// The pixels to match: 8-bit sRGB, row by row from the top, no alpha.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    width_px: u32,
    height_px: u32,
    pixels: Vec<Rgb>,
}

impl Target {
    /// A target of `width_px` x `height_px` from its pixels, row by row from the top.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if a side is 0 or above [`TARGET_SIDE_MAX_PX`], or if the pixel count does not fit the size.
    pub fn new(width_px: u32, height_px: u32, pixels: Vec<Rgb>) -> Result<Self> {
        let sides = 1..=TARGET_SIDE_MAX_PX;
        if !sides.contains(&width_px) || !sides.contains(&height_px) {
            return Err(Error::TooLarge(format!(
                "a picture of {width_px}x{height_px} px cannot be evolved: sides must be 1 to {TARGET_SIDE_MAX_PX} px"
            )));
        }
        if pixels.len() != width_px as usize * height_px as usize {
            return Err(Error::TooLarge(format!(
                "a picture of {width_px}x{height_px} px cannot have {} pixels",
                pixels.len()
            )));
        }
        Ok(Self { width_px, height_px, pixels })
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
}
