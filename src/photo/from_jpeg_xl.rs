//! JPEG XL files (ISO/IEC 18181), by the decoder that browsers have. Its vector code stays off: it differs between
//! processors. Lossy files still go through the powers and roots of the system's library, so another system may come to
//! a channel that is off by one.

use std::borrow::Cow;

use bytemuck::cast_slice_mut;
use image::metadata::Orientation;
use image::{DynamicImage, ImageBuffer};
use jxl::api::{
    AlphaMode, Endianness, Event, ExtraChannel, JxlBasicInfo, JxlBitDepth, JxlColorEncoding, JxlColorProfile,
    JxlColorType, JxlDataFormat, JxlDecoder, JxlDecoderOptions, JxlOutputBuffer, JxlPixelFormat, JxlPrimaries,
    JxlTransferFunction, JxlWhitePoint, ProfileLevel,
};

use super::kinds::Coding::JpegXl;
use super::raw::{CutShort, Need, Raw, Space, broken_sentence, space_of, taken_in_part};

/// Samples that a small picture may have besides those of its size, for frames that are larger than it.
const SPARE_SAMPLES: usize = 1 << 20;
/// Bytes per pixel that the decoder keeps: a photo takes next to none, since groups are decoded one by one, and a frame
/// that others refer to takes a plane of floats for each channel.
const OWN_BYTES: u64 = 16;
/// The same for each channel beside the colours.
const EXTRA_BYTES: u64 = 8;
/// Most bits of a sample that fits a byte.
const BYTE_BITS: u32 = 8;

/// The picture as it is stored, upright; of an animation the first frame.
pub(super) fn decode(bytes: &[u8], cut_short: CutShort) -> Result<Raw, String> {
    let (header, _) = opened(bytes, None)?;
    let info = info(&header)?;
    let layout = Layout::of(&header, info)?;
    let need = need(info, &layout)?;
    need.check(JpegXl, bytes.len())?;
    let size_px = need.size_px;
    // Frames may be larger than the picture, and are held to about its size.
    let samples = size_px.0 as usize * size_px.1 as usize * (3 + info.extra_channels.len());
    let (is_moving, extra_count) = (info.animation.is_some(), info.extra_channels.len());
    let (mut decoder, rest) = opened(bytes, Some(samples.saturating_add(SPARE_SAMPLES)))?;
    decoder.set_pixel_format(layout.format(extra_count)).map_err(|error| broken(&error))?;
    let mut warnings = Vec::new();
    if is_moving {
        warnings.push("the first frame of an animation is read".to_owned());
    }
    let image = match layout.depth {
        Depth::Bits8 => {
            let mut samples = vec![0_u8; layout.sample_count(size_px)];
            read(&mut decoder, rest, (&layout, size_px), &mut samples, cut_short, &mut warnings)?;
            layout.image_of_bytes(size_px, samples)
        }
        Depth::Bits16 => {
            let mut samples = vec![0_u16; layout.sample_count(size_px)];
            read(&mut decoder, rest, (&layout, size_px), cast_slice_mut(&mut samples), cut_short, &mut warnings)?;
            layout.image_of_words(size_px, samples)
        }
    };
    let image = image.ok_or_else(|| broken_sentence(JpegXl, "it has not as many samples as its size says"))?;
    let space = decoder.output_color_profile().map_or(Space::Srgb, |profile| space(profile, &mut warnings));
    Ok(Raw { image, space, orientation: Orientation::NoTransforms, warnings })
}

/// Bytes of the beginning of a file that surely hold its header, with an ICC profile.
pub(super) const HEADER_BYTES: u64 = 32 << 20;

/// What it takes to decode the picture that begins with these bytes, if that can be told.
pub(super) fn needed(beginning: &[u8]) -> Option<Need> {
    let (header, _) = opened(beginning, None).ok()?;
    let info = info(&header).ok()?;
    need(info, &Layout::of(&header, info).ok()?).ok()
}

fn need(info: &JxlBasicInfo, layout: &Layout) -> Result<Need, String> {
    let size_px = u32::try_from(info.size.0).ok().zip(u32::try_from(info.size.1).ok());
    let size_px = size_px.ok_or_else(|| broken_sentence(JpegXl, "its size is out of range"))?;
    let stored_bytes = (layout.channels() * layout.sample_bytes()) as u64;
    Ok(Need { size_px, stored_bytes, own_bytes: OWN_BYTES + EXTRA_BYTES * info.extra_channels.len() as u64 })
}

fn info(decoder: &JxlDecoder) -> Result<&JxlBasicInfo, String> {
    decoder.basic_info().ok_or_else(|| broken_sentence(JpegXl, "its header is cut short"))
}

/// A decoder that has read the header, and the bytes after that; frames of more samples are refused.
fn opened(bytes: &[u8], sample_limit: Option<usize>) -> Result<(JxlDecoder, &[u8]), String> {
    let mut options = JxlDecoderOptions::default();
    options.alpha_mode = AlphaMode::Unpremultiplied;
    options.high_precision = true;
    options.max_profile_level = ProfileLevel::Main10;
    options.sample_limit = sample_limit;
    let mut decoder = JxlDecoder::new(options);
    let mut rest = bytes;
    match decoder.process(&mut rest, None, None).map_err(|error| broken(&error))? {
        Event::BasicInfo => Ok((decoder, rest)),
        _ => Err(broken_sentence(JpegXl, "its header is cut short")),
    }
}

fn broken(error: &jxl::error::Error) -> String {
    broken_sentence(JpegXl, &error.to_string())
}

/// Decodes the first frame into `samples`.
fn read(
    decoder: &mut JxlDecoder,
    mut rest: &[u8],
    (layout, (width_px, height_px)): (&Layout, (u32, u32)),
    samples: &mut [u8],
    cut_short: CutShort,
    warnings: &mut Vec<String>,
) -> Result<(), String> {
    let row_bytes = width_px as usize * layout.channels() * layout.sample_bytes();
    let mut buffers = [JxlOutputBuffer::new(samples, height_px as usize, row_bytes)];
    loop {
        match decoder.process(&mut rest, Some(&mut buffers), None).map_err(|error| broken(&error))? {
            Event::FrameComplete { .. } | Event::Complete => return Ok(()),
            Event::BasicInfo | Event::FrameHeader => {}
            Event::NeedMoreInput { .. } if cut_short == CutShort::Take => {
                decoder.flush_pixels(&mut buffers, None).map_err(|error| broken(&error))?;
                break;
            }
            Event::NeedMoreInput { .. } => return Err(broken_sentence(JpegXl, "its end is missing")),
        }
    }
    if samples.iter().all(|&sample| sample == 0) {
        return Err(broken_sentence(JpegXl, "none of its pixels are there"));
    }
    warnings.push(taken_in_part("coarse, black or transparent"));
    Ok(())
}

/// What the channels mean.
fn space(profile: &JxlColorProfile, warnings: &mut Vec<String>) -> Space {
    if is_srgb(profile) {
        return Space::Srgb;
    }
    let icc = profile.try_as_icc();
    if icc.is_none() {
        warnings.push("its colours are of a space that is not known here, and are taken for sRGB".to_owned());
    }
    space_of(icc.map(Cow::into_owned), warnings)
}

fn is_srgb(profile: &JxlColorProfile) -> bool {
    let JxlColorProfile::Simple(encoding) = profile else { return false };
    match encoding {
        JxlColorEncoding::RgbColorSpace { white_point, primaries, transfer_function, .. } => {
            (white_point, primaries, transfer_function)
                == (&JxlWhitePoint::D65, &JxlPrimaries::SRGB, &JxlTransferFunction::SRGB)
        }
        JxlColorEncoding::GrayscaleColorSpace { transfer_function, .. } => {
            *transfer_function == JxlTransferFunction::SRGB
        }
        JxlColorEncoding::XYB { .. } => false,
    }
}

/// How samples are asked for.
struct Layout {
    is_grey: bool,
    has_alpha: bool,
    depth: Depth,
}

enum Depth {
    Bits8,
    Bits16,
}

impl Layout {
    fn of(decoder: &JxlDecoder, info: &JxlBasicInfo) -> Result<Self, String> {
        let profile = decoder.embedded_color_profile();
        if profile.is_some_and(JxlColorProfile::is_cmyk) {
            return Err(
                "this kind of JPEG XL is not supported (inks); convert the picture to an 8-bit RGB PNG".to_owned()
            );
        }
        let is_byte = matches!(info.bit_depth, JxlBitDepth::Int { bits_per_sample } if bits_per_sample <= BYTE_BITS);
        Ok(Self {
            is_grey: profile.is_some_and(|profile| profile.channels() == 1),
            has_alpha: info.extra_channels.iter().any(|channel| channel.ec_type == ExtraChannel::Alpha),
            depth: if is_byte { Depth::Bits8 } else { Depth::Bits16 },
        })
    }

    fn channels(&self) -> usize {
        usize::from(self.has_alpha) + if self.is_grey { 1 } else { 3 }
    }

    fn sample_bytes(&self) -> usize {
        match self.depth {
            Depth::Bits8 => 1,
            Depth::Bits16 => 2,
        }
    }

    fn sample_count(&self, (width_px, height_px): (u32, u32)) -> usize {
        width_px as usize * height_px as usize * self.channels()
    }

    fn format(&self, extra_count: usize) -> JxlPixelFormat {
        let color_type = match (self.is_grey, self.has_alpha) {
            (true, false) => JxlColorType::Grayscale,
            (true, true) => JxlColorType::GrayscaleAlpha,
            (false, false) => JxlColorType::Rgb,
            (false, true) => JxlColorType::Rgba,
        };
        let data_format = match self.depth {
            Depth::Bits8 => JxlDataFormat::U8 { bit_depth: 8 },
            Depth::Bits16 => JxlDataFormat::U16 { endianness: Endianness::native(), bit_depth: 16 },
        };
        JxlPixelFormat {
            color_type,
            color_data_format: Some(data_format),
            extra_channel_format: vec![None; extra_count],
        }
    }

    fn image_of_bytes(&self, (width_px, height_px): (u32, u32), samples: Vec<u8>) -> Option<DynamicImage> {
        Some(match (self.is_grey, self.has_alpha) {
            (true, false) => DynamicImage::ImageLuma8(ImageBuffer::from_raw(width_px, height_px, samples)?),
            (true, true) => DynamicImage::ImageLumaA8(ImageBuffer::from_raw(width_px, height_px, samples)?),
            (false, false) => DynamicImage::ImageRgb8(ImageBuffer::from_raw(width_px, height_px, samples)?),
            (false, true) => DynamicImage::ImageRgba8(ImageBuffer::from_raw(width_px, height_px, samples)?),
        })
    }

    fn image_of_words(&self, (width_px, height_px): (u32, u32), samples: Vec<u16>) -> Option<DynamicImage> {
        Some(match (self.is_grey, self.has_alpha) {
            (true, false) => DynamicImage::ImageLuma16(ImageBuffer::from_raw(width_px, height_px, samples)?),
            (true, true) => DynamicImage::ImageLumaA16(ImageBuffer::from_raw(width_px, height_px, samples)?),
            (false, false) => DynamicImage::ImageRgb16(ImageBuffer::from_raw(width_px, height_px, samples)?),
            (false, true) => DynamicImage::ImageRgba16(ImageBuffer::from_raw(width_px, height_px, samples)?),
        })
    }
}
