//! PNG files: pixels, and what their chunks say about colours.

use std::io::Cursor;

use image::metadata::Orientation;
use image::{DynamicImage, ImageBuffer, ImageFormat};
use png::{BitDepth, ColorType, DecodingError, Transformations};

use super::png_space;
use super::raw::{CutShort, Need, Raw, Space, broken_sentence, space_of, taken_in_part};

/// Most bytes that all chunks together take besides the pixels.
const CHUNK_BYTES_MAX: usize = 64 << 20;

/// The picture as it is stored; of an animation its first frame.
pub(super) fn decode(bytes: &[u8], cut_short: CutShort) -> Result<Raw, String> {
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), png::Limits { bytes: CHUNK_BYTES_MAX });
    decoder.set_ignore_text_chunk(true);
    // Palettes and fewer than 8 bits become channels of 8; 16 bits stay.
    decoder.set_transformations(Transformations::EXPAND);
    let header = decoder.read_header_info().map_err(|error| why_undecodable(&error))?;
    let size_px = (header.width, header.height);
    let stored_bytes = match (header.color_type, header.bit_depth) {
        (_, BitDepth::Sixteen) => 8,
        (ColorType::Grayscale, _) => 2,
        _ => 4,
    };
    Need { size_px, stored_bytes, own_bytes: 0 }.check(ImageFormat::Png, bytes.len())?;
    let mut reader = decoder.read_info().map_err(|error| why_undecodable(&error))?;
    let mut warnings = Vec::new();
    let space = space(reader.info(), &mut warnings);
    let exif = reader.info().exif_metadata.as_deref();
    let orientation = exif.and_then(Orientation::from_exif_chunk).unwrap_or(Orientation::NoTransforms);
    let (color, depth) = reader.output_color_type();
    let mut samples =
        vec![0; reader.output_buffer_size().ok_or_else(|| why_undecodable(&DecodingError::LimitsExceeded))?];
    match reader.next_frame(&mut samples) {
        Ok(_) => {}
        Err(_) if cut_short == CutShort::Take && samples.iter().any(|&sample| sample != 0) => {
            warnings.push(taken_in_part("black or transparent"));
        }
        Err(error) => return Err(why_undecodable(&error)),
    }
    let image = image(size_px, color, depth, samples);
    let image =
        image.ok_or_else(|| broken_sentence(ImageFormat::Png, "it has not as many samples as its size says"))?;
    Ok(Raw { image, space, orientation, warnings })
}

/// What the chunks say that channels mean. The first that is there counts (PNG, third edition, 4.3).
fn space(info: &png::Info<'_>, warnings: &mut Vec<String>) -> Space {
    if let Some(coded) = info.coding_independent_code_points {
        match png_space::of_code_points(coded) {
            Ok(space) => return space.map_or(Space::Srgb, Space::Png),
            Err(reason) => warnings.push(format!("its chunk cICP is ignored, so colours may be off: {reason}")),
        }
    }
    if let Some(icc) = info.icc_profile.as_deref() {
        return space_of(Some(icc.to_vec()), warnings);
    }
    if info.srgb.is_some() {
        return Space::Srgb;
    }
    let gamma = info.gama_chunk.map(png::ScaledFloat::into_scaled);
    let xy =
        |(x, y): (png::ScaledFloat, png::ScaledFloat)| [x, y].map(|part| f64::from(part.into_scaled()) / 100_000.0);
    let primaries = info.chrm_chunk.map(|told| [told.white, told.red, told.green, told.blue].map(xy));
    let told = png_space::of_gamma_and_primaries(gamma, primaries).unwrap_or_else(|reason| {
        warnings.push(format!("its chunks gAMA and cHRM are ignored, so colours may be off: {reason}"));
        None
    });
    told.map_or(Space::Srgb, Space::Png)
}

fn image(
    (width_px, height_px): (u32, u32),
    color: ColorType,
    depth: BitDepth,
    samples: Vec<u8>,
) -> Option<DynamicImage> {
    use DynamicImage::{
        ImageLuma8, ImageLuma16, ImageLumaA8, ImageLumaA16, ImageRgb8, ImageRgb16, ImageRgba8, ImageRgba16,
    };
    if depth == BitDepth::Sixteen {
        let samples: Vec<u16> = samples.as_chunks().0.iter().map(|&sample| u16::from_be_bytes(sample)).collect();
        return match color {
            ColorType::Grayscale => ImageBuffer::from_raw(width_px, height_px, samples).map(ImageLuma16),
            ColorType::GrayscaleAlpha => ImageBuffer::from_raw(width_px, height_px, samples).map(ImageLumaA16),
            ColorType::Rgb => ImageBuffer::from_raw(width_px, height_px, samples).map(ImageRgb16),
            ColorType::Rgba => ImageBuffer::from_raw(width_px, height_px, samples).map(ImageRgba16),
            ColorType::Indexed => None,
        };
    }
    match color {
        ColorType::Grayscale => ImageBuffer::from_raw(width_px, height_px, samples).map(ImageLuma8),
        ColorType::GrayscaleAlpha => ImageBuffer::from_raw(width_px, height_px, samples).map(ImageLumaA8),
        ColorType::Rgb => ImageBuffer::from_raw(width_px, height_px, samples).map(ImageRgb8),
        ColorType::Rgba => ImageBuffer::from_raw(width_px, height_px, samples).map(ImageRgba8),
        ColorType::Indexed => None,
    }
}

fn why_undecodable(error: &DecodingError) -> String {
    match error {
        DecodingError::LimitsExceeded => {
            "the chunks of the PNG take more memory than the limit of 64 MiB; save the picture again".to_owned()
        }
        error => broken_sentence(ImageFormat::Png, &error.to_string()),
    }
}
