//! A picture to be made into a mosaic.

use std::fmt;
use std::path::Path;

use super::parameters::contradiction;
use crate::error::Result;
use crate::photo::{CutShort, Decoded};

/// A picture: upright, of any size, with or without transparency. It may serve many recipes.
///
/// **Identity.** The key of a mosaic tells which picture it was made of by a SHA-256 ([`Picture::sha256`]). For a
/// picture from a file, or from the bytes of one, that is the hash of these bytes. For pixels that never were a file it
/// is the hash of the text `smalti CHANNELS WIDTHxHEIGHT`, a line break, and the bytes of the pixels.
#[derive(Clone)]
pub struct Picture {
    decoded: Decoded,
}

impl Picture {
    /// A picture of 8-bit sRGB pixels: red, green and blue, row by row from the top.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] if `pixels` has not `width_px * height_px * 3` bytes, or the size is none or more
    /// than 65,535 px a side or 2^28 px in all.
    pub fn from_rgb8(width_px: u32, height_px: u32, pixels: &[u8]) -> Result<Self> {
        Self::from_pixels(width_px, height_px, 3, pixels)
    }

    /// As [`Picture::from_rgb8`], with an alpha that the colours are not multiplied by.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] if `pixels` has not `width_px * height_px * 4` bytes, or the size is none or too
    /// large.
    pub fn from_rgba8(width_px: u32, height_px: u32, pixels: &[u8]) -> Result<Self> {
        Self::from_pixels(width_px, height_px, 4, pixels)
    }

    fn from_pixels(width_px: u32, height_px: u32, channels: u8, pixels: &[u8]) -> Result<Self> {
        let decoded = Decoded::from_pixels(width_px, height_px, channels, pixels);
        decoded.map(|decoded| Self { decoded }).map_err(|reason| contradiction("picture", reason))
    }

    /// Reads a PNG, JPEG, JPEG XL, WebP, TIFF, BMP or GIF file (its first frame): EXIF orientation is applied, colours
    /// are converted to sRGB.
    ///
    /// # Errors
    /// [`crate::Error::Input`] if the file cannot be read, is no such picture, is broken or cut short, is too large, or
    /// takes more memory to decode than is free.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        Decoded::read(path.as_ref(), CutShort::Refuse).map(|decoded| Self { decoded })
    }

    /// As [`Picture::open`], and takes of a file that is cut short what is there; the rest is grey, black or
    /// transparent. [`Picture::warnings`] tells.
    ///
    /// # Errors
    /// As [`Picture::open`], if nothing can be taken.
    pub fn open_lenient(path: impl AsRef<Path>) -> Result<Self> {
        Decoded::read(path.as_ref(), CutShort::Take).map(|decoded| Self { decoded })
    }

    /// As [`Picture::open`], from the bytes of the file.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] in the same cases.
    pub fn from_encoded(bytes: &[u8]) -> Result<Self> {
        let decoded = Decoded::from_bytes(bytes);
        decoded.map(|decoded| Self { decoded }).map_err(|reason| contradiction("picture", reason))
    }

    /// Width and height in px, before a recipe reduces the picture.
    #[must_use]
    pub fn size_px(&self) -> (u32, u32) {
        self.decoded.size_px()
    }

    /// What identifies the picture: 64 lower-case hexadecimal digits.
    #[must_use]
    pub fn sha256(&self) -> &str {
        self.decoded.sha256()
    }

    /// What was ignored or mended while the picture was decoded, one sentence for each thing.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        self.decoded.warnings()
    }

    pub(super) fn decoded(&self) -> &Decoded {
        &self.decoded
    }
}

impl fmt::Debug for Picture {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Picture").field("size_px", &self.size_px()).field("sha256", &self.sha256()).finish()
    }
}
