//! TIFF files: those with a palette or with inks that have a profile, besides what the decoder of `image` reads.

use std::io::Cursor;

use image::metadata::Orientation;
use image::{DynamicImage, ImageFormat, RgbImage};
use tiff::decoder::{Decoder, DecodingResult, Limits};

use super::icc;
use super::raw::{CutShort, Need, Raw, Space, broken_sentence, by_image, space_of};
use super::tiff_directories::{self as directories, Directory};

/// How pixels are meant: as places in a palette, and as inks.
const PALETTE: u64 = 3;
const INKS: u64 = 5;
/// Samples that begin at black.
const GREY: u8 = 1;
/// Tags of entries.
const WIDTH: u16 = 256;
const HEIGHT: u16 = 257;
const ORIENTATION: u16 = 274;
const ICC_PROFILE: u16 = 34675;

/// The picture as it is stored; of several pages the first.
pub(super) fn decode(bytes: &[u8], cut_short: CutShort) -> Result<Raw, String> {
    let pages = directories::directories(bytes);
    let page = pages.first();
    match page.and_then(|page| page.value(directories::PHOTOMETRIC)) {
        Some(PALETTE) => {
            page.map_or_else(|| by_image(bytes, ImageFormat::Tiff, cut_short, 0), |page| with_palette(bytes, page))
        }
        Some(INKS) => {
            let mut raw = by_image(bytes, ImageFormat::Tiff, cut_short, 4)?;
            if let Space::Icc(profile) = &raw.space
                && icc::is_of_inks(profile)
                && let Ok(DecodingResult::U8(inks)) = samples(bytes)
                && let Ok(converted) = icc::srgb_of_inks(profile, &inks)
                && let Some(image) = RgbImage::from_raw(raw.image.width(), raw.image.height(), converted)
            {
                (raw.image, raw.space) = (DynamicImage::from(image), Space::Srgb);
            }
            Ok(raw)
        }
        _ => by_image(bytes, ImageFormat::Tiff, cut_short, 0),
    }
}

/// The samples of the first page as they are stored.
fn samples(bytes: &[u8]) -> Result<DecodingResult, String> {
    let broken = |error: tiff::TiffError| broken_sentence(ImageFormat::Tiff, &error.to_string());
    // What it takes was compared with the limits before.
    let decoder = Decoder::new(Cursor::new(bytes)).map_err(broken)?;
    decoder.with_limits(Limits::unlimited()).read_image().map_err(broken)
}

/// A page whose samples are places in its palette.
fn with_palette(bytes: &[u8], page: &Directory<'_>) -> Result<Raw, String> {
    let refused = |reason: &str| broken_sentence(ImageFormat::Tiff, reason);
    let side_px = |tag| page.value(tag).and_then(|px| u32::try_from(px).ok()).unwrap_or(0);
    let size_px = (side_px(WIDTH), side_px(HEIGHT));
    Need { size_px, stored_bytes: 3, own_bytes: 2 }.check(ImageFormat::Tiff, bytes.len())?;
    let bits = page.value(directories::BITS_PER_SAMPLE).unwrap_or(1);
    if !matches!(bits, 1 | 2 | 4 | 8 | 16) {
        return Err(refused(&format!("a palette with {bits} bits a sample")));
    }
    let color_count = 1_usize << bits;
    let channels = page.values(directories::COLOR_MAP, 3 * color_count);
    if channels.len() != 3 * color_count {
        return Err(refused("its palette is not whole"));
    }
    // The decoder knows no palettes. To it the places are grey.
    let mut as_grey = bytes.to_vec();
    let place = page.low_byte_of(directories::PHOTOMETRIC);
    *place.and_then(|place| as_grey.get_mut(place)).ok_or_else(|| refused("it is not whole"))? = GREY;
    let places: Vec<u16> = match samples(&as_grey)? {
        DecodingResult::U8(packed) => unpacked(&packed, size_px.0 as usize, bits as usize),
        DecodingResult::U16(places) => places,
        _ => return Err(refused("its samples are no places in a palette")),
    };
    // Channels have 16 bits, though some writers give them 8.
    let shift = if channels.iter().all(|&channel| channel < 256) { 0 } else { 8 };
    let color =
        |place: u16| [0, 1, 2].map(|channel| (channels[channel * color_count + usize::from(place)] >> shift) as u8);
    let colors: Vec<[u8; 3]> = places.into_iter().map(color).collect();
    let image = RgbImage::from_raw(size_px.0, size_px.1, colors.into_flattened());
    let image = DynamicImage::from(image.ok_or_else(|| refused("it has not as many samples as its size says"))?);
    let mut warnings = Vec::new();
    let icc: Vec<u8> = page.values(ICC_PROFILE, usize::MAX).into_iter().map(|byte| byte as u8).collect();
    let space = space_of(Some(icc).filter(|icc| !icc.is_empty()), &mut warnings);
    let turned = page.value(ORIENTATION).and_then(|value| Orientation::from_exif(u8::try_from(value).ok()?));
    Ok(Raw { image, space, orientation: turned.unwrap_or(Orientation::NoTransforms), warnings })
}

/// The samples of rows that are packed in bytes, the first in the highest bits.
fn unpacked(packed: &[u8], width_px: usize, bits: usize) -> Vec<u16> {
    let row_bytes = (width_px * bits).div_ceil(8).max(1);
    let mask = (1_u16 << bits) - 1;
    let sample = |row: &[u8], x: usize| {
        let place = x * bits;
        (u16::from(row[place / 8]) >> (8 - bits - place % 8)) & mask
    };
    packed.chunks_exact(row_bytes).flat_map(|row| (0..width_px).map(|x| sample(row, x)).collect::<Vec<_>>()).collect()
}

#[cfg(test)]
mod tests {
    use super::unpacked;

    #[test]
    fn samples_of_a_few_bits_are_unpacked_row_by_row() {
        assert_eq!(unpacked(&[0b1010_0000, 0b0100_0000], 3, 1), [1, 0, 1, 0, 1, 0]);
        assert_eq!(unpacked(&[0x12, 0x30, 0x45, 0x60], 3, 4), [1, 2, 3, 4, 5, 6]);
        assert_eq!(unpacked(&[7, 255], 2, 8), [7, 255]);
    }
}
