//! Pictures reduced to brightness and transparency.

use image::DynamicImage;

use super::color;
use super::decode::decode_raw;
use super::kinds::{Kind, kind_of};
use super::raw::CutShort;

/// A picture in memory: luma and alpha.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stencil {
    /// Width in px, at least 1.
    pub width_px: u32,
    /// Height in px, at least 1.
    pub height_px: u32,
    /// Luma of the colour without its alpha, and alpha (255 if the picture has none), of every pixel, row by row from
    /// the top; `width_px * height_px` of them.
    pub pixels: Vec<[u8; 2]>,
}

/// Whether these bytes begin like a picture of a format that is read.
#[must_use]
pub fn is_picture(bytes: &[u8]) -> bool {
    matches!(kind_of(bytes), Kind::Read(_))
}

/// The upright picture in the bytes of a file, of an animation the first frame.
///
/// # Errors
/// A sentence for the user, without the file's name, if the bytes are not one of the formats, are broken or cut short,
/// or exceed [`super::SIDE_MAX_PX`] or [`super::PIXEL_COUNT_MAX`].
pub fn decode_stencil(bytes: &[u8]) -> Result<Stencil, String> {
    let format = match kind_of(bytes) {
        Kind::Read(format) => format,
        Kind::Foreign(foreign) => return Err(foreign.reason()),
        Kind::Other => return Err("not a picture that can be read; convert it to PNG".to_owned()),
    };
    let raw = decode_raw(bytes, format, CutShort::Refuse)?;
    let mut image = DynamicImage::ImageLumaA8(color::to_luma_and_alpha(raw.image, &raw.space));
    image.apply_orientation(raw.orientation);
    let (width_px, height_px) = (image.width(), image.height());
    let (pixels, _) = image.as_bytes().as_chunks::<2>();
    Ok(Stencil { width_px, height_px, pixels: pixels.to_vec() })
}
