//! From a [`Photo`] to the bytes of a file. The same photo and metadata always give the same bytes.

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::webp::WebPEncoder;

use super::metadata::{self, Metadata};
use super::{Photo, jpeg_segments, webp};
use crate::error::{Error, Result};

/// Deflate level of PNG files, 1 to 9.
const PNG_LEVEL: u8 = 6;

/// A file format that pictures are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Lossless; 8-bit RGB, or RGBA with [`encode_with_alpha`], marked as sRGB.
    Png,
    /// Lossy; without colour subsampling (4:4:4).
    Jpeg {
        /// From 1 (smallest) to 100 (best).
        quality: u8,
    },
    /// Lossless; 8-bit RGB, or RGBA with [`encode_with_alpha`].
    WebP,
}

/// The photo as a file of this format.
///
/// # Errors
/// As [`encode_png`], [`encode_jpeg`] and [`encode_webp`].
pub fn encode(format: Format, photo: &Photo, metadata: &Metadata) -> Result<Vec<u8>> {
    match format {
        Format::Png => encode_png(photo, metadata),
        Format::Jpeg { quality } => encode_jpeg(photo, quality, metadata),
        Format::WebP => encode_webp(photo, metadata),
    }
}

/// The photo as a file of this format, with an opacity per pixel, 0 to 255; not premultiplied. A format without alpha
/// stores it over black. Without `alpha` this is [`encode`].
///
/// # Errors
/// As [`encode`], and [`Error::Internal`] if there is not one opacity per pixel.
pub fn encode_with_alpha(format: Format, photo: &Photo, alpha: Option<&[u8]>, metadata: &Metadata) -> Result<Vec<u8>> {
    let Some(alpha) = alpha else { return encode(format, photo, metadata) };
    if alpha.len() != photo.pixels.len() {
        return Err(Error::Internal(format!("{} opacities for {} pixels", alpha.len(), photo.pixels.len())));
    }
    let pixels = || photo.pixels.iter().zip(alpha).map(|(&[r, g, b], &a)| [r, g, b, a]);
    match format {
        Format::Png => {
            metadata::check(metadata)?;
            let size_px = (photo.width_px, photo.height_px);
            let pixels: Vec<[u8; 4]> = pixels().collect();
            png_bytes(size_px, png::ColorType::Rgba, pixels.as_flattened(), metadata).map_err(|error| not_png(&error))
        }
        Format::WebP => {
            let pixels: Vec<[u8; 4]> = pixels().collect();
            webp_bytes((photo.width_px, photo.height_px), ExtendedColorType::Rgba8, pixels.as_flattened(), metadata)
        }
        Format::Jpeg { .. } => {
            let over_black =
                |[r, g, b, a]: [u8; 4]| [r, g, b].map(|c| ((u32::from(c) * u32::from(a) + 127) / 255) as u8);
            encode(format, &Photo { pixels: pixels().map(over_black).collect(), ..*photo }, metadata)
        }
    }
}

/// The photo as an 8-bit RGB PNG with an sRGB chunk and the metadata as text chunks.
///
/// # Errors
/// [`Error::Parameter`] if the metadata does not fit (see [`Metadata`]), [`Error::Encoding`] if there are no pixels.
pub fn encode_png(photo: &Photo, metadata: &Metadata) -> Result<Vec<u8>> {
    metadata::check(metadata)?;
    let size_px = (photo.width_px, photo.height_px);
    png_bytes(size_px, png::ColorType::Rgb, photo.pixels.as_flattened(), metadata).map_err(|error| not_png(&error))
}

fn not_png(error: &png::EncodingError) -> Error {
    Error::picture_as("PNG", error)
}

fn png_bytes(
    size_px: (u32, u32),
    color: png::ColorType,
    samples: &[u8],
    metadata: &Metadata,
) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png_encoder(&mut bytes, size_px, color);
    metadata::add_to_png(&mut encoder, metadata)?;
    let mut writer = encoder.write_header()?;
    writer.write_image_data(samples)?;
    writer.finish()?;
    Ok(bytes)
}

/// Pixels with alpha, not premultiplied, as an 8-bit RGBA PNG with an sRGB chunk and the metadata as text chunks.
///
/// # Errors
/// [`Error::Parameter`] if the metadata does not fit (see [`Metadata`]); [`Error::Encoding`] if there are not
/// `width_px * height_px` pixels, or none.
pub fn encode_png_with_alpha(
    width_px: u32,
    height_px: u32,
    pixels: &[[u8; 4]],
    metadata: &Metadata,
) -> Result<Vec<u8>> {
    metadata::check(metadata)?;
    png_bytes((width_px, height_px), png::ColorType::Rgba, pixels.as_flattened(), metadata)
        .map_err(|error| not_png(&error))
}

/// An encoder with the settings of every PNG that is written.
fn png_encoder(
    bytes: &mut Vec<u8>,
    (width_px, height_px): (u32, u32),
    color: png::ColorType,
) -> png::Encoder<'_, &mut Vec<u8>> {
    let mut encoder = png::Encoder::new(bytes, width_px, height_px);
    encoder.set_color(color);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.set_deflate_compression(png::DeflateCompression::Level(PNG_LEVEL));
    encoder.set_filter(png::Filter::Adaptive);
    encoder
}

/// The photo as a JPEG of `quality` 1 to 100, without colour subsampling, with the metadata as comments.
///
/// # Errors
/// [`Error::Parameter`] if the metadata does not fit (see [`Metadata`]) or `quality` is out of range;
/// [`Error::Encoding`] if a side of the photo is 0 or above 65,535 px.
pub fn encode_jpeg(photo: &Photo, quality: u8, metadata: &Metadata) -> Result<Vec<u8>> {
    metadata::check(metadata)?;
    if !(1..=100).contains(&quality) {
        return Err(Error::parameter("quality", format!("a JPEG's must be 1 to 100, not {quality}")));
    }
    let refused = |why: &dyn std::fmt::Display| Error::picture_as("JPEG", why);
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

/// The photo as a lossless WebP with the metadata as an XMP packet.
///
/// # Errors
/// [`Error::Parameter`] if the metadata does not fit (see [`Metadata`]); [`Error::Encoding`] if a side of the photo is
/// 0 or above [`webp::WEBP_SIDE_MAX_PX`].
pub fn encode_webp(photo: &Photo, metadata: &Metadata) -> Result<Vec<u8>> {
    webp_bytes((photo.width_px, photo.height_px), ExtendedColorType::Rgb8, photo.pixels.as_flattened(), metadata)
}

fn webp_bytes(
    (width_px, height_px): (u32, u32),
    color: ExtendedColorType,
    samples: &[u8],
    metadata: &Metadata,
) -> Result<Vec<u8>> {
    metadata::check(metadata)?;
    if samples.is_empty() || width_px.max(height_px) > webp::WEBP_SIDE_MAX_PX {
        return Err(Error::picture_as(
            "WebP",
            &format!("its sides must be 1 to {} px, not {width_px}x{height_px}", webp::WEBP_SIDE_MAX_PX),
        ));
    }
    let mut bytes = Vec::new();
    WebPEncoder::new_lossless(&mut bytes)
        .encode(samples, width_px, height_px, color)
        .map_err(|error| Error::picture_as("WebP", &error))?;
    if metadata.is_empty() {
        return Ok(bytes);
    }
    let alpha = if color == ExtendedColorType::Rgba8 { webp::HAS_ALPHA } else { 0 };
    Ok(webp::with_metadata(&bytes, (width_px, height_px), alpha, metadata))
}
