//! From a file's bytes to a [`Photo`]: limits first, then decode, colour, orientation and size.

use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::Path;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};
use sha2::{Digest, Sha256};

use super::{Photo, color, jpeg_segments, resize};
use crate::error::{Error, Result};

/// Largest side in px of a picture that is read.
pub const SIDE_MAX_PX: u32 = 65_535;
/// Most pixels of a picture that is read: 2^28.
pub const PIXEL_COUNT_MAX: u64 = 1 << 28;
/// Most bytes that a decoder may allocate: [`PIXEL_COUNT_MAX`] pixels of four floats.
const DECODE_BYTES_MAX: u64 = PIXEL_COUNT_MAX * 16;
/// Most bytes of a file that is read.
const FILE_BYTES_MAX: u64 = 1 << 32;
/// Bytes that tell the format of every picture that is read.
const SIGNATURE_BYTES: u64 = 64;
/// The formats that are read, for messages.
const FORMATS: &str = "PNG, JPEG, WebP, TIFF, BMP and GIF";

/// What is behind a picture that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Background {
    /// This 8-bit sRGB colour, which shows through where the picture is transparent.
    Color([u8; 3]),
    /// Nothing: what is transparent stays so ([`Loaded::transparent`]).
    Transparent,
}

impl Default for Background {
    fn default() -> Self {
        Self::Color([0; 3])
    }
}

/// What is done to a picture while it is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// What shows where the picture is transparent; black unless asked otherwise.
    pub background: Background,
    /// Size in px, at least 1, that the longer side is reduced to; smaller pictures stay as they are, and with `None`
    /// all do.
    pub long_side_px: Option<u32>,
}

/// A picture that was read, and what is worth knowing about its file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loaded {
    /// The picture: upright, in sRGB, fitted to size, over its background.
    pub photo: Photo,
    /// Which pixels of `photo` are transparent, row by row: those of an alpha below 128 of 255. None if no pixel is, or if
    /// the picture was read over a colour.
    ///
    /// These pixels are black. The others are over black as far as their alpha goes, and whatever colour the transparent
    /// ones had is not in them.
    pub transparent: Option<Vec<bool>>,
    /// Width in px of the upright picture before it was fitted.
    pub original_width_px: u32,
    /// Height in px of the upright picture before it was fitted.
    pub original_height_px: u32,
    /// SHA-256 of the file's bytes, 64 lower-case hexadecimal digits.
    pub sha256: String,
    /// What was ignored in the file, one sentence each.
    pub warnings: Vec<String>,
}

/// Reads the picture at `path`; its content, not its name, tells the format.
///
/// The order of the steps: decode (of an animation the first frame), ICC profile to sRGB, alpha composited on the
/// background (on black if that is transparent), 8 bits, EXIF orientation, Lanczos3 to the size asked for. The bytes are the same on every machine,
/// but for an ICC profile that has tables and no matrix: there a processor's fused multiplications may round a channel
/// by one.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read, is not one of the formats, is broken or cut short, or exceeds
/// [`SIDE_MAX_PX`], [`PIXEL_COUNT_MAX`] or 4 GiB.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Loaded> {
    let (format, bytes) = read_picture_file(path)?;
    let mut warnings = Vec::new();
    let upright =
        decode(&bytes, format, options.background, &mut warnings).map_err(|reason| Error::input(path, reason))?;
    let (original_width_px, original_height_px) = (upright.width(), upright.height());
    let sha256 = sha256_hex(&bytes);
    drop(bytes);
    let (photo, transparent) = match upright {
        DynamicImage::ImageRgba8(cut) => resize::fit_cut(&cut, options.long_side_px),
        opaque => (resize::fit(&opaque.into_rgb8(), options.long_side_px), None),
    };
    Ok(Loaded { photo, transparent, original_width_px, original_height_px, sha256, warnings })
}

/// The last chunk of every PNG, with its checksum.
const PNG_END: [u8; 12] = [0, 0, 0, 0, b'I', b'E', b'N', b'D', 0xAE, 0x42, 0x60, 0x82];

/// Whether the file at `path` begins like a picture that can be read.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read.
pub(super) fn is_picture(path: &Path) -> Result<bool> {
    let mut signature = Vec::new();
    File::open(path)
        .and_then(|file| file.take(SIGNATURE_BYTES).read_to_end(&mut signature))
        .map_err(|error| Error::input(path, why_unreadable(&error)))?;
    Ok(known_format(&signature).is_some())
}

/// Whether the file at `path` is a whole PNG, JPEG or WebP: its pixels can be decoded, and nothing is missing after them.
#[must_use]
pub fn is_whole(path: &Path) -> bool {
    let Ok((format, bytes)) = read_picture_file(path) else { return false };
    let has_its_end = match format {
        ImageFormat::Png => bytes.ends_with(&PNG_END),
        ImageFormat::Jpeg => jpeg_segments::is_complete(&bytes),
        ImageFormat::WebP => {
            let size = bytes.get(4..8).and_then(|size| size.try_into().ok()).map(u32::from_le_bytes);
            size.is_some_and(|size| u64::from(size) + 8 == bytes.len() as u64)
        }
        _ => false,
    };
    has_its_end && decode_raw(&bytes, format).is_ok()
}

/// The bytes of the file at `path`, once its first bytes have shown that it is a picture.
pub(super) fn read_picture_file(path: &Path) -> Result<(ImageFormat, Vec<u8>)> {
    let unreadable = |error: io::Error| Error::input(path, why_unreadable(&error));
    let mut file = File::open(path).map_err(unreadable)?;
    let mut bytes = Vec::new();
    // Not the whole file yet: `/dev/zero` has no end.
    file.by_ref().take(SIGNATURE_BYTES).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.is_empty() {
        return Err(Error::input(path, "the file is empty (0 bytes); get it again"));
    }
    let format = known_format(&bytes)
        .ok_or_else(|| Error::input(path, format!("not a picture that can be read; {FORMATS} can")))?;
    file.take(FILE_BYTES_MAX).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > FILE_BYTES_MAX {
        return Err(Error::input(path, "the file has more than 4 GiB, the most that is read; save a smaller version"));
    }
    Ok((format, bytes))
}

/// Why opening or reading an input failed, and what to do.
pub(crate) fn why_unreadable(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => "there is no such file; check its name".to_owned(),
        io::ErrorKind::IsADirectory => "is a folder; name a file in it".to_owned(),
        io::ErrorKind::PermissionDenied => "may not be read; change its permissions".to_owned(),
        _ => format!("cannot be read ({error}); try a copy of it"),
    }
}

/// The format that the first bytes of a file tell, if it is one that is read.
pub(super) fn known_format(bytes: &[u8]) -> Option<ImageFormat> {
    use ImageFormat::{Bmp, Gif, Jpeg, Png, Tiff, WebP};
    image::guess_format(bytes).ok().filter(|format| matches!(format, Png | Jpeg | WebP | Tiff | Bmp | Gif))
}

/// The upright 8-bit sRGB picture in `bytes`, as [`color::to_srgb`] makes it, or a sentence that says why there is none.
fn decode(
    bytes: &[u8],
    format: ImageFormat,
    background: Background,
    warnings: &mut Vec<String>,
) -> Result<DynamicImage, String> {
    let raw = decode_raw(bytes, format)?;
    let mut image = color::to_srgb(raw.image, raw.profile.as_deref(), background, warnings);
    image.apply_orientation(raw.orientation);
    Ok(image)
}

/// What a decoder gives, and what is left to do to it.
pub(super) struct Raw {
    pub(super) image: DynamicImage,
    pub(super) profile: Option<Vec<u8>>,
    pub(super) orientation: Orientation,
}

/// The picture in `bytes` as it is stored, within the limits, or a sentence that says why there is none.
pub(super) fn decode_raw(bytes: &[u8], format: ImageFormat) -> Result<Raw, String> {
    let broken = |error: ImageError| why_undecodable(format, error);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(DECODE_BYTES_MAX);
    reader.limits(limits);
    let mut decoder = reader.into_decoder().map_err(broken)?;
    check_size(decoder.dimensions())?;
    // The JPEG decoder fills what is missing with grey and calls it a success.
    if format == ImageFormat::Jpeg && !jpeg_segments::is_complete(bytes) {
        return Err(broken_sentence(format, "its end is missing"));
    }
    let orientation = decoder.orientation().map_err(broken)?;
    let profile = decoder.icc_profile().map_err(broken)?;
    let image = DynamicImage::from_decoder(decoder).map_err(broken)?;
    Ok(Raw { image, profile, orientation })
}

/// Refuses sizes that are nothing or too much, before anything of that size is allocated.
fn check_size((width_px, height_px): (u32, u32)) -> Result<(), String> {
    if width_px == 0 || height_px == 0 {
        return Err(format!("the picture has no pixels ({width_px}x{height_px}); save it anew"));
    }
    if width_px.max(height_px) > SIDE_MAX_PX || u64::from(width_px) * u64::from(height_px) > PIXEL_COUNT_MAX {
        return Err(format!(
            "the picture has {width_px}x{height_px} px, more than the {SIDE_MAX_PX} px a side or {PIXEL_COUNT_MAX} px \
             in all that are read; save a smaller version"
        ));
    }
    Ok(())
}

fn why_undecodable(format: ImageFormat, error: ImageError) -> String {
    match error {
        ImageError::Limits(_) => {
            "the picture needs more than 4 GiB to decode, the most that is read; save a smaller version".to_owned()
        }
        ImageError::Unsupported(error) => {
            format!("this kind of {format:?} is not read ({error}); convert the picture to an 8-bit RGB PNG")
        }
        error => broken_sentence(format, &error.to_string()),
    }
}

fn broken_sentence(format: ImageFormat, detail: &str) -> String {
    format!("the {format:?} data is broken or cut short ({detail}); get the file again or save it anew")
}

fn sha256_hex(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}
