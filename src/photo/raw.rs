//! A picture as its decoder gives it. What decoding needs is compared with the limits and with the free memory before
//! it begins.

use std::io::Cursor;

use image::metadata::Orientation;
use image::{ColorType, DynamicImage, GrayAlphaImage, GrayImage, ImageDecoder, ImageError, ImageFormat, ImageReader};
use image::{Limits, RgbImage, RgbaImage};

use super::frames;
use super::kinds::Coding;
use super::png_space::PngSpace;
use crate::memory;

/// Largest side in px of a picture that is read.
pub const SIDE_MAX_PX: u32 = 65_535;
/// Most pixels of a picture that is read: 2^28.
pub const PIXEL_COUNT_MAX: u64 = 1 << 28;
/// Most bytes that a decoder may allocate: [`PIXEL_COUNT_MAX`] pixels of four floats.
const DECODE_BYTES_MAX: u64 = PIXEL_COUNT_MAX * 16;
/// Most bytes of an ICC profile that is applied, after it is unpacked.
const ICC_BYTES_MAX: usize = 16 << 20;
/// Bytes per pixel after decoding: a copy in sRGB, and one that is turned upright.
const CONVERTED_BYTES: u64 = 8;
/// The same of 16-bit channels, of which there is a copy with four channels as well.
const CONVERTED_BYTES_OF_16_BITS: u64 = 16;
/// Up to this many pixels a file may be as short as it likes.
const FREE_PIXEL_COUNT: u64 = 1 << 24;

/// What is done about a picture whose data ends too early.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CutShort {
    /// It is refused.
    #[default]
    Refuse,
    /// What is there is taken, with a warning. Of the rest nobody knows more than its size.
    Take,
}

/// What the channels of a picture mean.
#[derive(Clone)]
pub(super) enum Space {
    Srgb,
    /// What an ICC profile says.
    Icc(Vec<u8>),
    /// What chunks of a PNG say.
    Png(PngSpace),
}

/// The output of a decoder, and what is still to be applied to it.
#[derive(Clone)]
pub(super) struct Raw {
    pub(super) image: DynamicImage,
    pub(super) space: Space,
    pub(super) orientation: Orientation,
    /// What was ignored or mended, one sentence for each thing.
    pub(super) warnings: Vec<String>,
}

/// The picture in `bytes` as it is stored, by the decoder of `image`; `more_bytes` is what it needs for each pixel
/// besides what is usual for its format.
pub(super) fn by_image(bytes: &[u8], format: ImageFormat, cut_short: CutShort, more_bytes: u64) -> Result<Raw, String> {
    let broken = |error: ImageError| why_undecodable(format, error);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits());
    let mut decoder = reader.into_decoder().map_err(broken)?;
    let stored_bytes = u64::from(decoder.color_type().bytes_per_pixel());
    let own_bytes = match format {
        // A frame beside the screen.
        ImageFormat::Gif => 4,
        // The planes of a lossy picture, or the tables of a lossless one.
        ImageFormat::WebP => 6,
        // The samples before they are put in order.
        ImageFormat::Tiff => stored_bytes,
        _ => 0,
    };
    let size_px = decoder.dimensions();
    // A frame may be larger than the screen, and takes its own memory then.
    let largest_px = frames::largest_px(bytes, format).filter(|&frame_px| pixel_count(frame_px) > pixel_count(size_px));
    for size_px in [Some(size_px), largest_px].into_iter().flatten() {
        let need = Need { size_px, stored_bytes, own_bytes: own_bytes + more_bytes };
        need.check(format, bytes.len())?;
    }
    let mut warnings = Vec::new();
    let orientation = decoder.orientation().map_err(broken)?;
    let space = space_of(decoder.icc_profile().map_err(broken)?, &mut warnings);
    let image = match cut_short {
        CutShort::Refuse => DynamicImage::from_decoder(decoder).map_err(broken)?,
        CutShort::Take => what_is_there(decoder, format, &mut warnings)?,
    };
    Ok(Raw { image, space, orientation, warnings })
}

/// The picture, and if its data ends too early, what is there of it.
fn what_is_there<D: ImageDecoder>(
    decoder: D,
    format: ImageFormat,
    warnings: &mut Vec<String>,
) -> Result<DynamicImage, String> {
    let color = decoder.color_type();
    let (width_px, height_px) = decoder.dimensions();
    if !matches!(color, ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8) {
        return DynamicImage::from_decoder(decoder).map_err(|error| why_undecodable(format, error));
    }
    let mut samples = vec![0; usize::try_from(decoder.total_bytes()).unwrap_or(usize::MAX)];
    if let Err(error) = decoder.read_image(&mut samples) {
        if samples.iter().all(|&sample| sample == 0) {
            return Err(why_undecodable(format, error));
        }
        warnings.push(taken_in_part("black or transparent"));
    }
    let image = match color {
        ColorType::L8 => GrayImage::from_raw(width_px, height_px, samples).map(DynamicImage::from),
        ColorType::La8 => GrayAlphaImage::from_raw(width_px, height_px, samples).map(DynamicImage::from),
        ColorType::Rgb8 => RgbImage::from_raw(width_px, height_px, samples).map(DynamicImage::from),
        _ => RgbaImage::from_raw(width_px, height_px, samples).map(DynamicImage::from),
    };
    image.ok_or_else(|| broken_sentence(format, "it has not as many samples as its size says"))
}

/// How the warning about a picture that is read in part begins.
const IN_PART: &str = "is cut short; what is missing is ";

/// The warning about a picture that is read in part.
pub(super) fn taken_in_part(rest: &str) -> String {
    format!("{IN_PART}{rest}")
}

/// Whether these warnings are about a picture that is read in part.
pub(crate) fn is_in_part(warnings: &[String]) -> bool {
    warnings.iter().any(|warning| warning.starts_with(IN_PART))
}

/// What the profile of a picture says, if there is one that may be applied.
pub(super) fn space_of(icc: Option<Vec<u8>>, warnings: &mut Vec<String>) -> Space {
    match icc {
        None => Space::Srgb,
        Some(icc) if icc.len() > ICC_BYTES_MAX => {
            warnings.push(TOO_LONG_A_PROFILE.to_owned());
            Space::Srgb
        }
        Some(icc) => Space::Icc(icc),
    }
}

/// The warning about a profile over the limit.
const TOO_LONG_A_PROFILE: &str =
    "its ICC profile is ignored, so colours may be off: it is larger than 16 MiB; save the picture as sRGB";

/// What it takes to decode a picture, as far as its header tells.
pub(super) struct Need {
    pub(super) size_px: (u32, u32),
    /// Bytes of a decoded pixel.
    pub(super) stored_bytes: u64,
    /// Bytes per pixel that the decoder keeps besides these.
    pub(super) own_bytes: u64,
}

impl Need {
    /// About how many bytes it takes.
    pub(super) fn bytes(&self) -> u64 {
        let converted = if self.stored_bytes > 4 { CONVERTED_BYTES_OF_16_BITS } else { CONVERTED_BYTES };
        pixel_count(self.size_px) * (self.stored_bytes + self.own_bytes + converted)
    }

    /// Refuses a picture over the limits, one that a file of so many bytes cannot hold, and one that needs more memory
    /// than is free.
    pub(super) fn check(&self, format: impl Into<Coding>, file_bytes: usize) -> Result<(), String> {
        check_size(self.size_px)?;
        let format = format.into();
        let (width_px, height_px) = self.size_px;
        let count = pixel_count(self.size_px);
        if count > FREE_PIXEL_COUNT && count > (file_bytes as u64).saturating_mul(densest(format)) {
            let detail = format!("{file_bytes} bytes cannot hold {width_px}x{height_px} px");
            return Err(broken_sentence(format, &detail));
        }
        check_memory(self.bytes(), memory::free_bytes(), &format!("to decode {width_px}x{height_px} px"))
    }
}

/// Refuses what needs more than the free bytes, if these are known.
pub(super) fn check_memory(needed: u64, free: Option<u64>, what: &str) -> Result<(), String> {
    match free {
        Some(free) if needed > free => Err(format!(
            "it takes about {} MiB of memory {what} and {} MiB are free; save a smaller version",
            needed >> 20,
            free >> 20
        )),
        _ => Ok(()),
    }
}

/// More pixels than a byte of such a file stands for, whatever it shows. A large picture of fewer bytes was not made by
/// a camera or a program that draws, but to fill memory.
fn densest(format: Coding) -> u64 {
    match format {
        // A block of 8x8 px takes a bit at least.
        Coding::Image(ImageFormat::Jpeg) => 512,
        // A code of 12 bits stands for 4,096 px at most.
        Coding::Image(ImageFormat::Gif) => 4096,
        // A group of 1,024x1,024 px takes an entry of more than a byte in the table of contents.
        Coding::JpegXl => 1 << 20,
        // Deflate packs 1,032 bytes into one, each of them eight pixels.
        _ => 1 << 14,
    }
}

fn pixel_count((width_px, height_px): (u32, u32)) -> u64 {
    u64::from(width_px) * u64::from(height_px)
}

/// Limits that make a decoder refuse a picture before it allocates too much memory.
pub(super) fn limits() -> Limits {
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(DECODE_BYTES_MAX);
    limits
}

pub(super) fn check_size((width_px, height_px): (u32, u32)) -> Result<(), String> {
    if width_px == 0 || height_px == 0 {
        return Err(format!("the picture has no pixels ({width_px}x{height_px}); save it again"));
    }
    if width_px.max(height_px) > SIDE_MAX_PX || pixel_count((width_px, height_px)) > PIXEL_COUNT_MAX {
        return Err(format!(
            "the picture has {width_px}x{height_px} px, more than the {SIDE_MAX_PX} px a side or {PIXEL_COUNT_MAX} px \
             in all that are read; save a smaller version"
        ));
    }
    Ok(())
}

pub(super) fn why_undecodable(format: ImageFormat, error: ImageError) -> String {
    match error {
        ImageError::Limits(_) => {
            "the picture needs more memory to decode than the limit of 4 GiB; save a smaller version".to_owned()
        }
        ImageError::Unsupported(error) => {
            format!("this kind of {format:?} is not supported ({error}); convert the picture to an 8-bit RGB PNG")
        }
        error => broken_sentence(format, &error.to_string()),
    }
}

pub(super) fn broken_sentence(format: impl Into<Coding>, detail: &str) -> String {
    format!("the {} data is broken or cut short ({detail}); get the file or save it again", format.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn need(width_px: u32, height_px: u32) -> Need {
        Need { size_px: (width_px, height_px), stored_bytes: 4, own_bytes: 4 }
    }

    #[test]
    fn a_file_that_cannot_hold_its_pixels_is_refused_and_a_dense_one_is_not() {
        let refusal = need(65_535, 4_096).check(ImageFormat::Gif, 35).expect_err("35 bytes are too few");
        assert!(refusal.contains("35 bytes cannot hold 65535x4096 px"), "{refusal}");
        assert!(need(16_000, 16_000).check(ImageFormat::Jpeg, 664).is_err());
        assert!(need(16_383, 16_383).check(ImageFormat::WebP, 40).is_err());
        for format in [ImageFormat::Gif, ImageFormat::Jpeg, ImageFormat::Png] {
            let refused = need(4_096, 4_096).check(format, 35);
            assert!(refused.is_ok(), "a picture of 16 million pixels may be of one colour: {refused:?}");
        }
        let dense = need(8_192, 8_192).check(ImageFormat::Png, 8_192 * 8_192 / 8_256);
        assert!(dense.is_ok(), "{dense:?}");
    }

    #[test]
    fn a_frame_that_is_larger_than_its_screen_is_held_to_the_same_limits() {
        // A screen of 18x2 px, and a frame of 17,070x33,376 px.
        let gif = b"GIF89a\x12\0\x02\0\x80\0\0\xFF\0\0\0\0\xFF,\0\0\0\0\xAE\x42\x60\x82\0\x02\x02\x84Q\0;";
        for cut_short in [CutShort::Refuse, CutShort::Take] {
            let refused = by_image(gif, ImageFormat::Gif, cut_short, 0).err().expect("it takes 2 GiB");
            assert!(refused.contains("the picture has 17070x33376 px"), "{refused}");
        }
    }

    #[test]
    fn more_than_the_free_memory_is_refused_with_both_numbers() {
        let needed = need(1_000, 1_000).bytes();
        assert_eq!(needed, 16_000_000);
        assert!(check_memory(needed, Some(needed), "to decode it").is_ok());
        assert!(check_memory(needed, None, "to decode it").is_ok());
        let refusal = check_memory(3 << 30, Some(1 << 30), "to decode it").expect_err("there is not enough");
        assert!(refusal.contains("3072 MiB") && refusal.contains("1024 MiB"), "{refusal}");
    }

    #[test]
    fn a_profile_over_the_limit_is_ignored_with_a_warning() {
        let mut warnings = Vec::new();
        assert!(matches!(space_of(Some(vec![0; ICC_BYTES_MAX]), &mut warnings), Space::Icc(_)));
        assert!(warnings.is_empty());
        assert!(matches!(space_of(Some(vec![0; ICC_BYTES_MAX + 1]), &mut warnings), Space::Srgb));
        assert_eq!(warnings, [TOO_LONG_A_PROFILE]);
    }
}
