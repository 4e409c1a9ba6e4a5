//! What a file is, told by its first bytes whatever its name: a picture of a format that is read, or one of those that
//! are not, which is named so that its owner knows what to do.

use std::fmt;

use image::ImageFormat;

use super::camera_raw;

/// The formats that are read, for messages.
pub(super) const READ: &str = "PNG, JPEG, JPEG XL, WebP, TIFF, BMP and GIF";
/// Bytes at the beginning of a file that are enough to recognise its kind.
pub(super) const SIGNATURE_BYTES: usize = 4096;
/// Bytes in which a text shows whether it is a drawing or a web page.
const TEXT_BYTES: usize = 1024;

/// What a file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A picture that is read.
    Read(Coding),
    /// Something that people have pictures in, and that is not read.
    Foreign(Foreign),
    /// Anything else.
    Other,
}

/// How the pixels of a file that is read are coded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coding {
    /// In a format that `image` knows.
    Image(ImageFormat),
    /// In JPEG XL.
    JpegXl,
}

impl From<ImageFormat> for Coding {
    fn from(format: ImageFormat) -> Self {
        Self::Image(format)
    }
}

impl fmt::Display for Coding {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Image(format) => write!(out, "{format:?}"),
            Self::JpegXl => out.write_str("JPEG XL"),
        }
    }
}

/// A kind of file that is not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Foreign {
    /// What people call it: `HEIC`, `a PDF`.
    pub name: &'static str,
    /// What to do about it.
    pub advice: &'static str,
}

impl Foreign {
    /// Why such a file is not read, as the end of a sentence that begins with its name.
    #[must_use]
    pub fn reason(&self) -> String {
        format!("is {}; {}", self.name, self.advice)
    }
}

const fn foreign(name: &'static str, advice: &'static str) -> Kind {
    Kind::Foreign(Foreign { name, advice })
}

const HEIF: &str = "convert it first, for instance with heif-convert";
// No crate reads it without C, is maintained, and tells how a picture is turned and what its colours mean.
const AVIF: &str = "convert it first, for instance with avifdec";
const MAGICK: &str = "convert it first, for instance with ImageMagick";
const EDITOR: &str = "export it as PNG first, for instance with GIMP";
const VIDEO: &str = "take a picture out of it first, for instance with ffmpeg";
const ARCHIVE: &str = "unpack it first";
/// What to do about camera raw, which holds what the sensor saw and no finished picture.
pub(super) const RAW: &str = "develop it first, for instance with darktable or RawTherapee";

/// Beginnings of files, each with what it shows. The first that fits counts.
const BEGINNINGS: &[(&[u8], Kind)] = &[
    (b"\xFF\xD8\xFF\xF7", foreign("JPEG-LS", MAGICK)),
    (b"\xFF\x4F\xFF\x51", foreign("JPEG 2000", MAGICK)),
    (b"\0\0\0\x0CjP  \r\n\x87\n", foreign("JPEG 2000", MAGICK)),
    (b"\0\0\0\x0CJXL \r\n\x87\n", Kind::Read(Coding::JpegXl)),
    (b"\xFF\x0A", Kind::Read(Coding::JpegXl)),
    (b"II\xBC\x01", foreign("JPEG XR", MAGICK)),
    (b"8BPS", foreign("PSD", EDITOR)),
    (b"gimp xcf", foreign("XCF", EDITOR)),
    (b"FUJIFILMCCD-RAW", foreign("camera raw (RAF)", RAW)),
    (b"IIRO", foreign("camera raw (ORF)", RAW)),
    (b"IIRS", foreign("camera raw (ORF)", RAW)),
    (b"MMOR", foreign("camera raw (ORF)", RAW)),
    (b"IIU\0", foreign("camera raw (RW2)", RAW)),
    (b"FOVb", foreign("camera raw (X3F)", RAW)),
    (b"\0MRM", foreign("camera raw (MRW)", RAW)),
    (b"II\x1A\0\0\0HEAPCCDR", foreign("camera raw (CRW)", RAW)),
    (b"\x76\x2F\x31\x01", foreign("OpenEXR", MAGICK)),
    (b"#?RADIANCE", foreign("Radiance HDR", MAGICK)),
    (b"#?RGBE", foreign("Radiance HDR", MAGICK)),
    (b"qoif", foreign("QOI", MAGICK)),
    (b"DDS ", foreign("DDS", MAGICK)),
    (b"farbfeld", foreign("farbfeld", MAGICK)),
    (b"BPG\xFB", foreign("BPG", MAGICK)),
    (b"FLIF", foreign("FLIF", MAGICK)),
    (b"AT&TFORM", foreign("DjVu", MAGICK)),
    (b"SIMPLE  =", foreign("FITS", MAGICK)),
    (b"\0\0\x01\0", foreign("an icon (ICO)", MAGICK)),
    (b"\0\0\x02\0", foreign("a cursor (CUR)", MAGICK)),
    (b"icns", foreign("an icon (ICNS)", MAGICK)),
    (b"\xD7\xCD\xC6\x9A", foreign("WMF", "open it and export it as PNG first")),
    (b"%!PS", foreign("PostScript", "convert it first, for instance with Ghostscript")),
    (b"\xC5\xD0\xD3\xC6", foreign("PostScript (EPS)", "convert it first, for instance with Ghostscript")),
    (b"\x1A\x45\xDF\xA3", foreign("a video (Matroska or WebM)", VIDEO)),
    (b"\0\0\x01\xBA", foreign("a video (MPEG)", VIDEO)),
    (b"\0\0\x01\xB3", foreign("a video (MPEG)", VIDEO)),
    (b"PK\x03\x04", foreign("a ZIP archive", ARCHIVE)),
    (b"\x1F\x8B", foreign("a gzip archive", ARCHIVE)),
    (b"7z\xBC\xAF\x27\x1C", foreign("a 7z archive", ARCHIVE)),
    (b"Rar!\x1A\x07", foreign("a RAR archive", ARCHIVE)),
];

/// Brands of ISO files (ISO/IEC 14496-12, the box `ftyp`), each with what it shows.
const BRANDS: &[(&[u8; 4], Kind)] = &[
    (b"avif", foreign("AVIF", AVIF)),
    (b"avis", foreign("AVIF (a sequence)", AVIF)),
    (b"heic", foreign("HEIC", HEIF)),
    (b"heix", foreign("HEIC", HEIF)),
    (b"heim", foreign("HEIC", HEIF)),
    (b"heis", foreign("HEIC", HEIF)),
    (b"hevc", foreign("HEIC (a sequence)", HEIF)),
    (b"hevx", foreign("HEIC (a sequence)", HEIF)),
    (b"mif1", foreign("HEIF", HEIF)),
    (b"mif2", foreign("HEIF", HEIF)),
    (b"msf1", foreign("HEIF (a sequence)", HEIF)),
    (b"crx ", foreign("camera raw (CR3)", RAW)),
];

/// What a file that begins with these bytes is: `SIGNATURE_BYTES` of them, or all. Camera raw that is stored as TIFF
/// shows in directories that may lie anywhere, so only the whole file tells it from other TIFF for certain.
#[must_use]
pub fn kind_of(bytes: &[u8]) -> Kind {
    if let Some((_, kind)) = BEGINNINGS.iter().find(|(beginning, _)| bytes.starts_with(beginning)) {
        return *kind;
    }
    if bytes.get(4..8) == Some(b"ftyp") {
        return of_brands(bytes);
    }
    if is_tiff(bytes) {
        let raw = camera_raw::name(bytes).map(|name| foreign(name, RAW));
        return raw.unwrap_or(Kind::Read(ImageFormat::Tiff.into()));
    }
    match image::guess_format(bytes) {
        Ok(
            format @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP | ImageFormat::Bmp | ImageFormat::Gif),
        ) => Kind::Read(format.into()),
        Ok(ImageFormat::Pnm) => foreign("Netpbm", MAGICK),
        _ if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"AVI ") => foreign("a video (AVI)", VIDEO),
        _ => of_text(bytes),
    }
}

/// Whether a file that begins with these bytes is TIFF, with offsets of 32 or of 64 bits.
pub(super) fn is_tiff(bytes: &[u8]) -> bool {
    [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|&beginning| bytes.starts_with(beginning))
}

/// What the brands of an ISO file show: the main one if it is known, else the first of the others that is.
fn of_brands(bytes: &[u8]) -> Kind {
    let length = bytes.first_chunk().map_or(0, |&length| u32::from_be_bytes(length) as usize);
    let listed = bytes.get(16..length.min(bytes.len())).unwrap_or_default().as_chunks::<4>().0;
    let main = bytes.get(8..12).and_then(|brand| brand.first_chunk());
    let known = |brand: &[u8; 4]| BRANDS.iter().find(|(name, _)| *name == brand).map(|(_, kind)| *kind);
    // `mif1` says only that it is HEIF: another brand says which.
    let (general, special): (Vec<&[u8; 4]>, Vec<&[u8; 4]>) =
        main.into_iter().chain(listed).partition(|brand| matches!(**brand, [b'm', b'i' | b's', b'f', _]));
    let found = special.into_iter().chain(general).find_map(known);
    found.unwrap_or(foreign("a video (MP4 or QuickTime)", VIDEO))
}

/// What a text shows, or a PDF, which may begin with other bytes.
fn of_text(bytes: &[u8]) -> Kind {
    let beginning = &bytes[..bytes.len().min(TEXT_BYTES)];
    let holds = |word: &[u8]| beginning.windows(word.len()).any(|window| window.eq_ignore_ascii_case(word));
    let is_markup = beginning.trim_ascii_start().strip_prefix(b"\xEF\xBB\xBF").unwrap_or(beginning);
    let is_markup = is_markup.trim_ascii_start().starts_with(b"<");
    if holds(b"%PDF-") {
        foreign("PDF", "convert a page of it first, for instance with pdftoppm -png")
    } else if is_markup && (holds(b"<!doctype html") || holds(b"<html")) {
        foreign("a web page", "save the picture itself")
    } else if is_markup && holds(b"<svg") {
        foreign("SVG", "draw it as PNG first, for instance with resvg or Inkscape")
    } else {
        Kind::Other
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(bytes: &[u8]) -> &'static str {
        match kind_of(bytes) {
            Kind::Foreign(Foreign { name, .. }) => name,
            other => panic!("{:?} is {other:?}", String::from_utf8_lossy(bytes)),
        }
    }

    #[test]
    fn what_is_not_read_is_named_by_its_first_bytes() {
        for (bytes, expected) in [
            (&b"\0\0\0\x18ftypheic\0\0\0\0mif1heic"[..], "HEIC"),
            (b"\0\0\0\x18ftypmif1\0\0\0\0mif1heic", "HEIC"),
            (b"\0\0\0\x18ftypmif1\0\0\0\0mif1avif", "AVIF"),
            (b"\0\0\0\x14ftypmif1\0\0\0\0mif1", "HEIF"),
            (b"\0\0\0\x18ftypavif\0\0\0\0mif1miaf", "AVIF"),
            (b"\0\0\0\x18ftypcrx \0\0\0\x01crx isom", "camera raw (CR3)"),
            (b"\0\0\0\x18ftypisom\0\0\0\x01isommp42", "a video (MP4 or QuickTime)"),
            (b"\0\0\0\x10ftypqt  \0\0\0\0", "a video (MP4 or QuickTime)"),
            (b"8BPS\0\x01", "PSD"),
            (b"%PDF-1.7 and more", "PDF"),
            (b"junk before\n%PDF-1.4", "PDF"),
            (b"<?xml version='1.0'?>\n<!-- a drawing -->\n<svg xmlns='http://www.w3.org/2000/svg'/>", "SVG"),
            (b"\xEF\xBB\xBF <svg/>", "SVG"),
            (b"<!DOCTYPE html><html><body><svg/></body></html>", "a web page"),
            (b"IIRO\x08\0\0\0", "camera raw (ORF)"),
            (b"P6\n4 4\n255\n", "Netpbm"),
            (b"PK\x03\x04\x14\0", "a ZIP archive"),
        ] {
            assert_eq!(name(bytes), expected);
        }
    }

    #[test]
    fn what_is_read_is_known_and_what_is_nothing_is_other() {
        for (bytes, format) in [
            (&b"\x89PNG\r\n\x1a\n"[..], ImageFormat::Png),
            (b"\xFF\xD8\xFF\xE0", ImageFormat::Jpeg),
            (b"II*\0\x08\0\0\0", ImageFormat::Tiff),
            (b"MM\0+\0\x08\0\0", ImageFormat::Tiff),
            (b"GIF89a", ImageFormat::Gif),
            (b"BM\x10\0", ImageFormat::Bmp),
            (b"RIFF\x10\0\0\0WEBPVP8L", ImageFormat::WebP),
        ] {
            assert_eq!(kind_of(bytes), Kind::Read(format.into()), "{format:?}");
        }
        for bytes in [&b"\xFF\x0A\xFA\x1F"[..], b"\0\0\0\x0CJXL \r\n\x87\n\0\0"] {
            assert_eq!(kind_of(bytes), Kind::Read(Coding::JpegXl));
        }
        for bytes in [&b""[..], b"hello", b"#!/bin/sh", b"ff0000\n00ff00\n", b"GIMP Palette\n", &[0; 64]] {
            assert_eq!(kind_of(bytes), Kind::Other, "{bytes:?}");
        }
    }

    #[test]
    fn no_bytes_lead_out_of_the_file() {
        let brands = b"\0\0\0\x18ftypmif1\0\0\0\0mif1heic";
        for cut in 0..brands.len() {
            let _ = kind_of(&brands[..cut]);
            for value in 0..=255 {
                let mut damaged = brands.to_vec();
                damaged[cut] = value;
                let _ = kind_of(&damaged);
            }
        }
    }
}
