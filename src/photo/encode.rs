//! From a [`Photo`] to the bytes of a file. The same photo and metadata always give the same bytes.

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;

use super::metadata::{self, Metadata};
use super::{Photo, jpeg_segments};
use crate::error::{Error, Result};

/// Deflate level of PNG files, 1 to 9.
const PNG_LEVEL: u8 = 6;

/// A file format that pictures are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Lossless; 8-bit RGB, marked as sRGB.
    Png,
    /// Lossy; without colour subsampling (4:4:4).
    Jpeg {
        /// From 1 (smallest) to 100 (best).
        quality: u8,
    },
}

/// The photo as a file of this format.
///
/// # Errors
/// As [`encode_png`] and [`encode_jpeg`].
pub fn encode(format: Format, photo: &Photo, metadata: &Metadata) -> Result<Vec<u8>> {
    match format {
        Format::Png => encode_png(photo, metadata),
        Format::Jpeg { quality } => encode_jpeg(photo, quality, metadata),
    }
}

/// The photo as an 8-bit RGB PNG with an sRGB chunk and the metadata as text chunks.
///
/// # Errors
/// [`Error::Usage`] if the metadata does not fit (see [`Metadata`]) or the photo has no pixels.
pub fn encode_png(photo: &Photo, metadata: &Metadata) -> Result<Vec<u8>> {
    metadata::check(metadata)?;
    png_bytes(photo, metadata).map_err(|error| Error::Usage(format!("the picture cannot be written as PNG: {error}")))
}

fn png_bytes(photo: &Photo, metadata: &Metadata) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, photo.width_px, photo.height_px);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.set_deflate_compression(png::DeflateCompression::Level(PNG_LEVEL));
    encoder.set_filter(png::Filter::Adaptive);
    // The two kinds of chunk are written one after the other: with one kind the order stays.
    let ascii = metadata.iter().all(|(_, text)| text.is_ascii());
    for (keyword, text) in metadata.iter().cloned() {
        if ascii {
            encoder.add_text_chunk(keyword, text)?;
        } else {
            encoder.add_itxt_chunk(keyword, text)?;
        }
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(photo.pixels.as_flattened())?;
    writer.finish()?;
    Ok(bytes)
}

/// The photo as a JPEG of `quality` 1 to 100, without colour subsampling, with the metadata as comments.
///
/// # Errors
/// [`Error::Usage`] if the metadata does not fit (see [`Metadata`]), `quality` is out of range, or a side of the photo
/// is 0 or above 65,535 px.
pub fn encode_jpeg(photo: &Photo, quality: u8, metadata: &Metadata) -> Result<Vec<u8>> {
    metadata::check(metadata)?;
    if !(1..=100).contains(&quality) {
        return Err(Error::Usage(format!("the quality of a JPEG is 1 to 100, not {quality}")));
    }
    let refused = |why: &dyn std::fmt::Display| Error::Usage(format!("the picture cannot be written as JPEG: {why}"));
    if photo.pixels.is_empty() {
        return Err(refused(&"it has no pixels"));
    }
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality)
        .encode(photo.pixels.as_flattened(), photo.width_px, photo.height_px, ExtendedColorType::Rgb8)
        .map_err(|error| refused(&error))?;
    let comments: Vec<u8> = metadata.iter().flat_map(|(keyword, text)| jpeg_segments::comment(keyword, text)).collect();
    let header_end = jpeg_segments::header_end(&bytes);
    bytes.splice(header_end..header_end, comments);
    Ok(bytes)
}
