//! Animations taken apart: the frames of GIF, APNG and WebP as they are shown, and for how long.

use std::io::Cursor;
use std::path::Path;

use image::codecs::gif::GifDecoder;
use image::codecs::png::PngDecoder;
use image::codecs::webp::WebPDecoder;
use image::{AnimationDecoder, DynamicImage, Frames, ImageError, ImageFormat, ImageResult};

use super::decode::{decode_raw, read_picture_file};
use super::kinds::{Coding, Kind};
use super::raw::{CutShort, Space, why_undecodable};
use super::{Background, Metadata, Photo, color, encode_png, encode_png_with_alpha, frames};
use crate::error::{Error, Result};

/// How long a frame is shown whose file says no time, in ms: as browsers do.
const USUAL_MS: u64 = 100;

/// A frame of an animation.
pub struct MovingFrame {
    /// The frame as the bytes of a PNG in sRGB.
    pub png: Vec<u8>,
    /// How long it is shown, in ms, at least 1.
    pub shown_ms: u64,
}

/// How many frames the file at `path` has: 1 if it is no animation.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read.
pub fn frame_count(path: &Path) -> Result<usize> {
    match super::kind_of_file(path)? {
        Kind::Read(Coding::Image(format @ (ImageFormat::Gif | ImageFormat::Png | ImageFormat::WebP))) => {
            let (_, bytes) = read_picture_file(path)?;
            Ok(frames::count(&bytes, format).0)
        }
        _ => Ok(1),
    }
}

/// Gives `each` the frames of the animation at `path`, one after the other.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read, or is no animation, or broken; the errors of `each`.
pub fn take_apart(path: &Path, mut each: impl FnMut(MovingFrame) -> Result<()>) -> Result<()> {
    let (format, bytes) = read_picture_file(path)?;
    // Compares what it takes with limits and free memory, and tells what the colours mean.
    let space = decode_raw(&bytes, format, CutShort::Refuse).map_err(|reason| Error::input(path, reason))?.space;
    let Coding::Image(format) = format else { return Err(Error::input(path, "is not taken apart into frames")) };
    let broken = |error: ImageError| Error::input(path, why_undecodable(format, error));
    for frame in opened(&bytes, format).map_err(broken)? {
        let frame = frame.map_err(broken)?;
        let (numerator, denominator) = frame.delay().numer_denom_ms();
        let shown_ms = match u64::from(numerator) / u64::from(denominator.max(1)) {
            0 => USUAL_MS,
            shown_ms => shown_ms,
        };
        let png = png(DynamicImage::ImageRgba8(frame.into_buffer()), &space)?;
        each(MovingFrame { png, shown_ms })?;
    }
    Ok(())
}

fn opened(bytes: &[u8], format: ImageFormat) -> ImageResult<Frames<'_>> {
    let bytes = Cursor::new(bytes);
    Ok(match format {
        ImageFormat::Gif => GifDecoder::new(bytes)?.into_frames(),
        ImageFormat::Png => PngDecoder::new(bytes)?.apng()?.into_frames(),
        _ => WebPDecoder::new(bytes)?.into_frames(),
    })
}

/// A frame in sRGB.
fn png(frame: DynamicImage, space: &Space) -> Result<Vec<u8>> {
    let metadata = Metadata::new();
    match color::to_srgb(frame, space, Background::Transparent, &mut Vec::new()) {
        DynamicImage::ImageRgba8(cut) => {
            encode_png_with_alpha(cut.width(), cut.height(), cut.as_raw().as_chunks().0, &metadata)
        }
        opaque => {
            let opaque = opaque.into_rgb8();
            let (width_px, height_px) = opaque.dimensions();
            encode_png(&Photo { width_px, height_px, pixels: opaque.as_raw().as_chunks().0.to_vec() }, &metadata)
        }
    }
}
