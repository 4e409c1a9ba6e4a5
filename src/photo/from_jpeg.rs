//! JPEG files: which kinds are not read, whether all pixels are there, and inks that have a profile.

use std::borrow::Cow;

use image::{DynamicImage, ImageFormat, RgbImage};
use sha2::{Digest, Sha256};
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;

use super::raw::{CutShort, Raw, Space, broken_sentence, by_image, taken_in_part};
use super::{icc, jpeg_segments};

/// The marker of the end of the image.
const END: [u8; 2] = [0xFF, 0xD9];
/// Bytes that may follow a picture whose end marker is missing. They mean something else in every code of its tables.
const FOLLOWING: [u8; 3] = [0x00, 0x55, 0xAA];
/// How many of them follow.
const FOLLOWING_BYTES: usize = 64;

/// The picture as it is stored.
pub(super) fn decode(bytes: &[u8], cut_short: CutShort) -> Result<Raw, String> {
    if let Some(kind) = jpeg_segments::refused_kind(bytes) {
        return Err(format!(
            "is a kind of JPEG that is not read ({kind}); convert it first, for instance with ImageMagick"
        ));
    }
    let progressive_bytes = jpeg_segments::progressive_components(bytes).map_or(0, |components| 2 * components);
    let by_image = |bytes: &[u8]| by_image(bytes, ImageFormat::Jpeg, CutShort::Refuse, progressive_bytes);
    let mut warning = None;
    let mut whole = Cow::Borrowed(bytes);
    // The decoder fills what is missing with grey and reports success.
    if !jpeg_segments::is_complete(bytes) {
        let part = &bytes[..jpeg_segments::end_of_last_segment(bytes)];
        whole = Cow::Owned([part, &END].concat());
        // Refuses what is too large before it is decoded as often as the next question takes.
        let raw = by_image(&whole)?;
        let (width_px, height_px) = (raw.image.width(), raw.image.height());
        drop(raw);
        warning = Some(if width_px > 0 && height_px > 0 && has_all_pixels(part) {
            "its end marker is missing, and all of its pixels are there".to_owned()
        } else if cut_short == CutShort::Take {
            taken_in_part("grey")
        } else {
            return Err(broken_sentence(ImageFormat::Jpeg, "its end is missing"));
        });
    }
    let mut raw = by_image(&whole)?;
    if let Space::Icc(profile) = &raw.space
        && icc::is_of_inks(profile)
        && let Some(inks) = inks(&whole)
    {
        let (width_px, height_px) = (raw.image.width(), raw.image.height());
        let converted =
            icc::srgb_of_inks(profile, &inks).ok().and_then(|samples| RgbImage::from_raw(width_px, height_px, samples));
        if let Some(image) = converted {
            (raw.image, raw.space) = (DynamicImage::from(image), Space::Srgb);
        }
    }
    raw.warnings.extend(warning);
    Ok(raw)
}

/// Whether no pixel depends on what would follow the bytes, which have no end marker.
fn has_all_pixels(bytes: &[u8]) -> bool {
    let decoded = |following: u8| {
        let bytes = [bytes, &[following; FOLLOWING_BYTES], &END].concat();
        let mut decoder = decoder(&bytes);
        decoder.decode().ok().map(|samples| Sha256::digest(&samples))
    };
    let first = decoded(FOLLOWING[0]);
    jpeg_segments::has_every_scan(bytes)
        && first.is_some()
        && FOLLOWING[1..].iter().all(|&following| decoded(following) == first)
}

fn decoder(bytes: &[u8]) -> zune_jpeg::JpegDecoder<ZCursor<&[u8]>> {
    zune_jpeg::JpegDecoder::new_with_options(ZCursor::new(bytes), options())
}

fn options() -> DecoderOptions {
    DecoderOptions::default().set_strict_mode(false).set_max_width(usize::MAX).set_max_height(usize::MAX)
}

/// The inks of a picture of four components, cyan, magenta, yellow and black, each 255 where there is most of it.
fn inks(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut headers = decoder(bytes);
    headers.decode_headers().ok()?;
    let space = headers.input_colorspace().filter(|space| matches!(space, ColorSpace::CMYK | ColorSpace::YCCK))?;
    let mut decoder =
        zune_jpeg::JpegDecoder::new_with_options(ZCursor::new(bytes), options().jpeg_set_out_colorspace(space));
    let mut samples = decoder.decode().ok()?;
    let (inks, _) = samples.as_chunks_mut::<4>();
    if space == ColorSpace::YCCK {
        inks.iter_mut().for_each(|ink| *ink = without_luma(*ink));
    }
    // Adobe's programs store how much of an ink is not there.
    if jpeg_segments::is_of_adobe(bytes) {
        inks.as_flattened_mut().iter_mut().for_each(|ink| *ink = 255 - *ink);
    }
    Some(samples)
}

/// The inks as they are stored, from luma and chroma of the first three (ITU-T T.871, in 1/65,536), whose complement
/// they are.
fn without_luma([y, cb, cr, k]: [u8; 4]) -> [u8; 4] {
    let [y, cb, cr] = [i32::from(y) << 16, i32::from(cb) - 128, i32::from(cr) - 128];
    let complement = |value: i32| 255 - ((value + (1 << 15)) >> 16).clamp(0, 255) as u8;
    [complement(y + 91_881 * cr), complement(y - 22_554 * cb - 46_802 * cr), complement(y + 116_130 * cb), k]
}

#[cfg(test)]
mod tests {
    use super::without_luma;

    #[test]
    fn inks_without_chroma_are_the_complement_of_their_luma() {
        assert_eq!(without_luma([200, 128, 128, 9]), [55, 55, 55, 9]);
        // Pure red has this luma and chroma.
        assert_eq!(without_luma([76, 85, 255, 0]), [1, 255, 255, 0]);
    }
}
