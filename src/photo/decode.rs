//! From a file's bytes to a [`Photo`]: check limits, decode, convert colours, turn upright and fit to size.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use image::metadata::Orientation;
use image::{DynamicImage, ImageFormat, ImageReader, RgbImage, RgbaImage};
use sha2::{Digest, Sha256};

use super::kinds::{Coding, Kind, READ, SIGNATURE_BYTES, kind_of};
use super::raw::{CutShort, Raw, Space, by_image, check_memory, check_size, limits};
use super::{Photo, color, frames, from_jpeg, from_jpeg_xl, from_png, from_tiff, jpeg_segments, resize};
use crate::error::{Error, Result, in_words};
use crate::{guard, memory};

/// Bytes per pixel while a picture is decoded. A pixel takes up to eight as it is stored; copies of it are in sRGB and
/// turned upright.
const BYTES_PER_DECODED_PIXEL: u64 = 16;
/// Most bytes of a file that is read.
const FILE_BYTES_MAX: u64 = 1 << 32;

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
    /// What is done about a file that ends too early.
    pub cut_short: CutShort,
}

/// A picture that was read, and facts about its file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loaded {
    /// The picture: upright, in sRGB, fitted to size, over its background.
    pub photo: Photo,
    /// Which pixels of `photo` are transparent, row by row: those with an alpha below 128 of 255. `None` if no pixel
    /// is, or if the picture was read over a colour.
    ///
    /// These pixels are black. The others have their own colours, as if they were opaque, and no colour of a
    /// transparent pixel spills into them.
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
/// background (unless that is transparent), 8 bits, EXIF orientation, Lanczos3 to the size asked for. The pixels
/// are the same on every machine, except under an ICC profile that has tables and no matrix: there a processor's fused
/// multiplications may change a channel by one. So may another system's powers and roots, in a lossy JPEG XL.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read, is not one of the formats, is broken or cut short, exceeds
/// [`super::SIDE_MAX_PX`], [`super::PIXEL_COUNT_MAX`] or 4 GiB, or takes more memory to decode than is free.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Loaded> {
    let decoded = Decoded::read(path, options.cut_short)?;
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
    pub fn read(path: &Path, cut_short: CutShort) -> Result<Self> {
        let (format, bytes) = read_picture_file(path)?;
        Self::decode(&bytes, format, cut_short).map_err(|reason| Error::input(path, reason))
    }

    /// Decodes the picture that a file of these bytes would hold.
    ///
    /// # Errors
    /// A sentence without the picture's name, in the cases of [`read`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        if bytes.is_empty() {
            return Err("is empty (0 bytes)".to_owned());
        }
        Self::decode(bytes, known_format(bytes)?, CutShort::Refuse)
    }

    /// A picture of 8-bit sRGB pixels, `channels` bytes each (3, or 4 with alpha that is not premultiplied), row by row
    /// from the top. Its SHA-256 is that of the text `smalti CHANNELS WIDTHxHEIGHT`, a line break, and the bytes.
    ///
    /// # Errors
    /// A sentence, if there are not as many bytes as the size says, or the size is none or exceeds
    /// [`super::SIDE_MAX_PX`] or [`super::PIXEL_COUNT_MAX`].
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
        let raw = Raw { image, space: Space::Srgb, orientation: Orientation::NoTransforms, warnings: Vec::new() };
        Ok(Self { raw, sha256 })
    }

    fn decode(bytes: &[u8], format: Coding, cut_short: CutShort) -> Result<Self, String> {
        Ok(Self { raw: decode_raw(bytes, format, cut_short)?, sha256: hex(&Sha256::digest(bytes)) })
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

    /// What was ignored or mended so far, one sentence for each thing.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.raw.warnings
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
        let mut warnings = raw.warnings;
        let mut upright = color::to_srgb(raw.image, &raw.space, options.background, &mut warnings);
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
    let of_jpeg_xl = || {
        let mut beginning = Vec::new();
        File::open(path).ok()?.take(from_jpeg_xl::HEADER_BYTES).read_to_end(&mut beginning).ok()?;
        from_jpeg_xl::needed(&beginning).filter(|need| check_size(need.size_px).is_ok())
    };
    if kind_of_file(path).is_ok_and(|kind| kind == Kind::Read(Coding::JpegXl)) {
        return guard::caught(of_jpeg_xl).ok().flatten().map_or(0, |need| need.bytes());
    }
    let size = || {
        let mut reader = ImageReader::open(path).ok()?.with_guessed_format().ok()?;
        reader.limits(limits());
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

/// What the file at `path` is, told by its content.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read.
pub fn kind_of_file(path: &Path) -> Result<Kind> {
    let mut beginning = Vec::new();
    let read = File::open(path).and_then(|file| file.take(DIRECTORY_BYTES).read_to_end(&mut beginning));
    read.map_err(|error| Error::input(path, why_unreadable(&error)))?;
    Ok(kind_of(&beginning))
}

/// Bytes of a file that show its kind, which of camera raw lies in directories somewhere in it.
const DIRECTORY_BYTES: u64 = 1 << 20;

/// Whether the file at `path` begins like a picture that can be read.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read, or holds a picture in a format that is not read.
pub(super) fn is_picture(path: &Path) -> Result<bool> {
    match kind_of_file(path)? {
        Kind::Read(_) => Ok(true),
        Kind::Foreign(foreign) => Err(Error::input(path, foreign.reason())),
        Kind::Other => Ok(false),
    }
}

/// Whether the file at `path` is a whole PNG, JPEG or WebP: its pixels can be decoded, and nothing is missing after
/// them.
#[must_use]
pub fn is_whole(path: &Path) -> bool {
    let Ok((format, bytes)) = read_picture_file(path) else { return false };
    let has_its_end = match format {
        Coding::Image(ImageFormat::Png) => bytes.ends_with(&PNG_END),
        Coding::Image(ImageFormat::Jpeg) => jpeg_segments::is_complete(&bytes),
        Coding::Image(ImageFormat::WebP) => {
            let size = bytes.get(4..8).and_then(|size| size.try_into().ok()).map(u32::from_le_bytes);
            size.is_some_and(|size| u64::from(size) + 8 == bytes.len() as u64)
        }
        _ => false,
    };
    has_its_end && decode_raw(&bytes, format, CutShort::Refuse).is_ok()
}

/// The format and the bytes of the file at `path`, if its first bytes show that it is a picture.
pub(super) fn read_picture_file(path: &Path) -> Result<(Coding, Vec<u8>)> {
    let unreadable = |error: io::Error| Error::input(path, why_unreadable(&error));
    let mut file = File::open(path).map_err(unreadable)?;
    let mut bytes = Vec::new();
    // Only the beginning: `/dev/zero` has no end.
    file.by_ref().take(SIGNATURE_BYTES as u64).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.is_empty() {
        return Err(Error::input(path, "the file is empty (0 bytes); get it again"));
    }
    let refused = |reason: String| Error::input(path, reason);
    known_format(&bytes).map_err(refused)?;
    let file_bytes = file.metadata().map_or(0, |found| found.len());
    check_memory(file_bytes, memory::free_bytes(), "to read the file").map_err(refused)?;
    file.take(FILE_BYTES_MAX).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > FILE_BYTES_MAX {
        return Err(Error::input(path, "the file is larger than the limit of 4 GiB; save a smaller version"));
    }
    // Only now: where the directories of camera raw lie, the beginning does not tell.
    Ok((known_format(&bytes).map_err(refused)?, bytes))
}

/// Why opening or reading an input failed, and what to do.
pub(crate) fn why_unreadable(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => "there is no such file; check its name".to_owned(),
        io::ErrorKind::IsADirectory => "is a folder; name a file in it".to_owned(),
        // Windows does not tell the two apart.
        io::ErrorKind::PermissionDenied if cfg!(windows) => {
            "is a folder, or may not be read; name a file, or change its permissions".to_owned()
        }
        io::ErrorKind::PermissionDenied => "may not be read; change its permissions".to_owned(),
        io::ErrorKind::InvalidFilename => "its name is too long; shorten it".to_owned(),
        _ => format!("cannot be read, since {}; try a copy of it", in_words(error)),
    }
}

/// The picture in `bytes` as it is stored, within the limits, or a sentence that says why there is none.
pub(super) fn decode_raw(bytes: &[u8], format: Coding, cut_short: CutShort) -> Result<Raw, String> {
    guard::decoded(|| decode_unguarded(bytes, format, cut_short))
}

fn decode_unguarded(bytes: &[u8], format: Coding, cut_short: CutShort) -> Result<Raw, String> {
    let Coding::Image(format) = format else { return from_jpeg_xl::decode(bytes, cut_short) };
    let mut raw = match format {
        ImageFormat::Jpeg => from_jpeg::decode(bytes, cut_short),
        ImageFormat::Png => from_png::decode(bytes, cut_short),
        ImageFormat::Tiff => from_tiff::decode(bytes, cut_short),
        _ => by_image(bytes, format, cut_short, 0),
    }?;
    let (count, plural) = frames::count(bytes, format);
    if count > 1 {
        raw.warnings.push(format!("the first of {count} {plural} is read"));
    }
    Ok(raw)
}

/// The format that the bytes of a file show, or a sentence if it is none that is read.
fn known_format(bytes: &[u8]) -> Result<Coding, String> {
    match kind_of(bytes) {
        Kind::Read(format) => Ok(format),
        Kind::Foreign(foreign) => Err(foreign.reason()),
        Kind::Other => Err(format!("not a picture that can be read; {READ} can")),
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
