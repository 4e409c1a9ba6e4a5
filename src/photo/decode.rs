//! From a file's bytes to a [`Photo`]: check limits, decode, convert colours, turn upright and fit to size.

use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::Path;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits, RgbImage, RgbaImage};
use sha2::{Digest, Sha256};

use super::{Photo, color, jpeg_segments, resize};
use crate::error::{Error, Result};
use crate::guard;

/// Largest side in px of a picture that is read.
pub const SIDE_MAX_PX: u32 = 65_535;
/// Most pixels of a picture that is read: 2^28.
pub const PIXEL_COUNT_MAX: u64 = 1 << 28;
/// Most bytes that a decoder may allocate: [`PIXEL_COUNT_MAX`] pixels of four floats.
const DECODE_BYTES_MAX: u64 = PIXEL_COUNT_MAX * 16;
/// Bytes per pixel while a picture is decoded. A pixel takes up to eight as it is stored; copies of it are in sRGB and
/// turned upright.
const BYTES_PER_DECODED_PIXEL: u64 = 16;
/// Most bytes of a file that is read.
const FILE_BYTES_MAX: u64 = 1 << 32;
/// Bytes at the beginning of a file that are enough to recognise its format.
const SIGNATURE_BYTES: u64 = 64;
/// The formats that are read, for messages.
const FORMATS: &str = "PNG, JPEG, WebP, TIFF, BMP and GIF";

/// What lies behind a picture that is read.
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
    /// Size in px, at least 1, to which the longer side is reduced. Smaller pictures keep their size, and with `None`
    /// all do.
    pub long_side_px: Option<u32>,
}

/// A picture that was read, and facts about its file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loaded {
    /// The picture: upright, in sRGB, fitted to size, over its background.
    pub photo: Photo,
    /// Which pixels of `photo` are transparent, row by row: those with an alpha below 128 of 255. `None` if no pixel
    /// is, or if the picture was read over a colour.
    ///
    /// These pixels are black. The others are composited on black, and no colour of a transparent pixel spills into
    /// them.
    pub transparent: Option<Vec<bool>>,
    /// Width in px of the upright picture before it was fitted.
    pub original_width_px: u32,
    /// Height in px of the upright picture before it was fitted.
    pub original_height_px: u32,
    /// SHA-256 of the file's bytes, 64 lower-case hexadecimal digits.
    pub sha256: String,
    /// What was ignored in the file, one sentence for each thing.
    pub warnings: Vec<String>,
}

/// Reads the picture at `path`. Its content decides the format, not its name.
///
/// The order of the steps: decode (of an animation the first frame), ICC profile to sRGB, alpha composited on the
/// background (on black if that is transparent), 8 bits, EXIF orientation, Lanczos3 to the size asked for. The pixels
/// are the same on every machine, except under an ICC profile that has tables and no matrix: there a processor's fused
/// multiplications may change a channel by one.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read, is not one of the formats, is broken or cut short, or exceeds
/// [`SIDE_MAX_PX`], [`PIXEL_COUNT_MAX`] or 4 GiB.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Loaded> {
    let decoded = Decoded::read(path)?;
    // Colours are brought to sRGB by what the file says, too.
    guard::decoded(|| Ok(decoded.into_fitted(options))).map_err(|reason| Error::input(path, reason))
}

/// A picture as it is stored, from which it can be fitted more than once.
#[derive(Clone)]
pub struct Decoded {
    raw: Raw,
    sha256: String,
}

impl Decoded {
    /// Decodes the picture at `path`.
    ///
    /// # Errors
    /// As [`read`].
    pub fn read(path: &Path) -> Result<Self> {
        let (format, bytes) = read_picture_file(path)?;
        Self::decode(&bytes, format).map_err(|reason| Error::input(path, reason))
    }

    /// Decodes the picture that a file of these bytes would hold.
    ///
    /// # Errors
    /// A sentence without the picture's name, in the cases of [`read`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        if bytes.is_empty() {
            return Err("is empty (0 bytes)".to_owned());
        }
        let format = known_format(bytes).ok_or_else(|| format!("not a picture that can be read; {FORMATS} can"))?;
        Self::decode(bytes, format)
    }

    /// A picture of 8-bit sRGB pixels, `channels` bytes each (3, or 4 with alpha that is not premultiplied), row by row
    /// from the top. Its SHA-256 is that of the text `smalti CHANNELS WIDTHxHEIGHT`, a line break, and the bytes.
    ///
    /// # Errors
    /// A sentence, if there are not as many bytes as the size says, or the size is none or exceeds [`SIDE_MAX_PX`] or
    /// [`PIXEL_COUNT_MAX`].
    pub fn from_pixels(width_px: u32, height_px: u32, channels: u8, bytes: &[u8]) -> Result<Self, String> {
        check_size((width_px, height_px))?;
        let expected = u64::from(width_px) * u64::from(height_px) * u64::from(channels);
        if bytes.len() as u64 != expected {
            let found = bytes.len();
            return Err(format!("{width_px}x{height_px} px of {channels} channels are {expected} bytes, not {found}"));
        }
        let header = format!("smalti {channels} {width_px}x{height_px}\n");
        let sha256 = hex(&Sha256::new().chain_update(header).chain_update(bytes).finalize());
        let image = if channels == 4 {
            RgbaImage::from_raw(width_px, height_px, bytes.to_vec()).map(DynamicImage::from)
        } else {
            RgbImage::from_raw(width_px, height_px, bytes.to_vec()).map(DynamicImage::from)
        };
        let image = image.ok_or_else(|| format!("pixels have 3 or 4 channels, not {channels}"))?;
        Ok(Self { raw: Raw { image, profile: None, orientation: Orientation::NoTransforms }, sha256 })
    }

    fn decode(bytes: &[u8], format: ImageFormat) -> Result<Self, String> {
        Ok(Self { raw: decode_raw(bytes, format)?, sha256: hex(&Sha256::digest(bytes)) })
    }

    /// Width and height in px of the upright picture.
    #[must_use]
    pub fn size_px(&self) -> (u32, u32) {
        use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
        let (width_px, height_px) = (self.raw.image.width(), self.raw.image.height());
        match self.raw.orientation {
            Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH => (height_px, width_px),
            _ => (width_px, height_px),
        }
    }

    /// SHA-256 of the file's bytes, or of the pixels, 64 lower-case hexadecimal digits.
    #[must_use]
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    /// The picture as [`read`] gives it.
    #[must_use]
    pub fn fitted(&self, options: &ReadOptions) -> Loaded {
        self.clone().into_fitted(options)
    }

    /// As [`Decoded::fitted`], in less memory.
    #[must_use]
    pub fn into_fitted(self, options: &ReadOptions) -> Loaded {
        let Self { raw, sha256 } = self;
        let mut warnings = Vec::new();
        let mut upright = color::to_srgb(raw.image, raw.profile.as_deref(), options.background, &mut warnings);
        upright.apply_orientation(raw.orientation);
        let (original_width_px, original_height_px) = (upright.width(), upright.height());
        let (photo, transparent) = match upright {
            DynamicImage::ImageRgba8(cut) => resize::fit_cut(&cut, options.long_side_px),
            opaque => (resize::fit(&opaque.into_rgb8(), options.long_side_px), None),
        };
        Loaded { photo, transparent, original_width_px, original_height_px, sha256, warnings }
    }
}

/// About how many bytes it takes to decode the picture at `path`, judged by the size in its header. 0 if there is no
/// size, or if it is over the limits.
#[must_use]
pub fn decoding_bytes(path: &Path) -> u64 {
    let size = || {
        let mut reader = ImageReader::open(path).ok()?.with_guessed_format().ok()?;
        reader.limits(limits());
        reader.format().filter(|&format| is_read(format))?;
        reader.into_dimensions().ok()
    };
    guard::caught(size)
        .ok()
        .flatten()
        .filter(|&size| check_size(size).is_ok())
        .map_or(0, |(width_px, height_px)| u64::from(width_px) * u64::from(height_px) * BYTES_PER_DECODED_PIXEL)
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

/// Whether the file at `path` is a whole PNG, JPEG or WebP: its pixels can be decoded, and nothing is missing after
/// them.
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

/// The format and the bytes of the file at `path`, if its first bytes show that it is a picture.
pub(super) fn read_picture_file(path: &Path) -> Result<(ImageFormat, Vec<u8>)> {
    let unreadable = |error: io::Error| Error::input(path, why_unreadable(&error));
    let mut file = File::open(path).map_err(unreadable)?;
    let mut bytes = Vec::new();
    // Only the beginning: `/dev/zero` has no end.
    file.by_ref().take(SIGNATURE_BYTES).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.is_empty() {
        return Err(Error::input(path, "the file is empty (0 bytes); get it again"));
    }
    let format = known_format(&bytes)
        .ok_or_else(|| Error::input(path, format!("not a picture that can be read; {FORMATS} can")))?;
    file.take(FILE_BYTES_MAX).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > FILE_BYTES_MAX {
        return Err(Error::input(path, "the file is larger than the limit of 4 GiB; save a smaller version"));
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

/// The format that the first bytes of a file show, if it is one that is read.
pub(super) fn known_format(bytes: &[u8]) -> Option<ImageFormat> {
    image::guess_format(bytes).ok().filter(|&format| is_read(format))
}

fn is_read(format: ImageFormat) -> bool {
    use ImageFormat::{Bmp, Gif, Jpeg, Png, Tiff, WebP};
    matches!(format, Png | Jpeg | WebP | Tiff | Bmp | Gif)
}

/// The output of a decoder, and what is still to be applied to it.
#[derive(Clone)]
pub(super) struct Raw {
    pub(super) image: DynamicImage,
    pub(super) profile: Option<Vec<u8>>,
    pub(super) orientation: Orientation,
}

/// The picture in `bytes` as it is stored, within the limits, or a sentence that says why there is none.
pub(super) fn decode_raw(bytes: &[u8], format: ImageFormat) -> Result<Raw, String> {
    guard::decoded(|| decode_unguarded(bytes, format))
}

fn decode_unguarded(bytes: &[u8], format: ImageFormat) -> Result<Raw, String> {
    let broken = |error: ImageError| why_undecodable(format, error);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits());
    let mut decoder = reader.into_decoder().map_err(broken)?;
    check_size(decoder.dimensions())?;
    // The JPEG decoder fills what is missing with grey and reports success.
    if format == ImageFormat::Jpeg && !jpeg_segments::is_complete(bytes) {
        return Err(broken_sentence(format, "its end is missing"));
    }
    let orientation = decoder.orientation().map_err(broken)?;
    let profile = decoder.icc_profile().map_err(broken)?;
    let image = DynamicImage::from_decoder(decoder).map_err(broken)?;
    Ok(Raw { image, profile, orientation })
}

/// Limits that make a decoder refuse a picture before it allocates too much memory.
fn limits() -> Limits {
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(DECODE_BYTES_MAX);
    limits
}

fn check_size((width_px, height_px): (u32, u32)) -> Result<(), String> {
    if width_px == 0 || height_px == 0 {
        return Err(format!("the picture has no pixels ({width_px}x{height_px}); save it again"));
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
            "the picture needs more memory to decode than the limit of 4 GiB; save a smaller version".to_owned()
        }
        ImageError::Unsupported(error) => {
            format!("this kind of {format:?} is not supported ({error}); convert the picture to an 8-bit RGB PNG")
        }
        error => broken_sentence(format, &error.to_string()),
    }
}

fn broken_sentence(format: ImageFormat, detail: &str) -> String {
    format!("the {format:?} data is broken or cut short ({detail}); get the file or save it again")
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
