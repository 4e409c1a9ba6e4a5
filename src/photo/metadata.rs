//! Metadata of the pictures that we write: keywords and texts that say how a picture was made.
//!
//! A PNG carries each entry as a text chunk, a JPEG as a comment `keyword=text`, a WebP in an XMP packet. Reading it
//! needs no pixels, so the key of a file is known without decoding the file.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use super::decode::why_unreadable;
use super::{jpeg_segments, webp};
use crate::error::{Error, Result};
use crate::guard;

/// Keywords with their texts, in the order in which they are written.
///
/// A keyword has 1 to 79 printable ASCII characters, no `=`, and no space at either end. A text has no NUL, and at most
/// 65,532 bytes together with its keyword.
pub type Metadata = Vec<(String, String)>;

/// Metadata is searched for in this many bytes of a file; ours begins within the first hundred.
const HEADER_BYTES: u64 = 1 << 20;
const PNG_SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";
const JPEG_SIGNATURE: [u8; 3] = [0xFF, 0xD8, 0xFF];

/// Refuses entries that one of the formats could not store and return unchanged.
pub(super) fn check(metadata: &Metadata) -> Result<()> {
    for (keyword, text) in metadata {
        let printable = keyword.bytes().all(|byte| matches!(byte, b' '..=b'~') && byte != b'=');
        if !printable || !(1..=79).contains(&keyword.len()) || keyword.trim() != keyword {
            return Err(Error::parameter(
                "metadata",
                format!("{keyword:?} cannot be a keyword: 1 to 79 ASCII characters without ="),
            ));
        }
        if text.contains('\0') || keyword.len() + 1 + text.len() > jpeg_segments::PAYLOAD_BYTES_MAX {
            let reason = format!("{keyword:?} is longer than 65,532 bytes or holds a NUL");
            return Err(Error::parameter("metadata", reason));
        }
    }
    Ok(())
}

/// Gives a PNG its metadata as text chunks.
pub(super) fn add_to_png(
    encoder: &mut png::Encoder<'_, &mut Vec<u8>>,
    metadata: &Metadata,
) -> Result<(), png::EncodingError> {
    // The encoder writes all chunks of one kind before those of the other, so a single kind keeps the order of the
    // entries.
    let ascii = metadata.iter().all(|(_, text)| text.is_ascii());
    for (keyword, text) in metadata.iter().cloned() {
        if ascii {
            encoder.add_text_chunk(keyword, text)?;
        } else {
            encoder.add_itxt_chunk(keyword, text)?;
        }
    }
    Ok(())
}

/// The metadata of the PNG, JPEG or WebP file at `path`; empty for anything else, since then nothing of ours is in it.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read.
pub fn read_metadata(path: &Path) -> Result<Metadata> {
    let header = read_header(path)?;
    if webp::is_webp(&header) {
        let found = File::open(path).and_then(|file| webp::metadata(BufReader::new(file)));
        return found.map_err(|error| Error::input(path, why_unreadable(&error)));
    }
    if header.starts_with(&PNG_SIGNATURE) { Ok(png_metadata(&header)) } else { Ok(jpeg_metadata(&header)) }
}

/// The text chunks before the pixels of the PNG file at `path`; empty if it is not a PNG or has none.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read.
pub fn read_png_metadata(path: &Path) -> Result<Metadata> {
    read_header(path).map(|header| png_metadata(&header))
}

/// The comments of the form `keyword=text` in the JPEG file at `path`; empty if it is not a JPEG or has none.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read.
pub fn read_jpeg_metadata(path: &Path) -> Result<Metadata> {
    read_header(path).map(|header| jpeg_metadata(&header))
}

fn read_header(path: &Path) -> Result<Vec<u8>> {
    let mut header = Vec::new();
    File::open(path)
        .and_then(|file| BufReader::new(file).take(HEADER_BYTES).read_to_end(&mut header))
        .map_err(|error| Error::input(path, why_unreadable(&error)))?;
    Ok(header)
}

/// The text chunks before the pixels of a PNG file that begins with `header`; empty if it is not a PNG.
pub(crate) fn png_metadata(header: &[u8]) -> Metadata {
    guard::caught(|| png_texts(header)).unwrap_or_default()
}

fn png_texts(header: &[u8]) -> Metadata {
    let limits = png::Limits { bytes: HEADER_BYTES as usize };
    let Ok(reader) = png::Decoder::new_with_limits(std::io::Cursor::new(header), limits).read_info() else {
        return Metadata::new();
    };
    let info = reader.info();
    let latin1 = info.uncompressed_latin1_text.iter().map(|chunk| (chunk.keyword.clone(), chunk.text.clone()));
    let utf8 = info.utf8_text.iter().filter_map(|chunk| Some((chunk.keyword.clone(), chunk.get_text().ok()?)));
    latin1.chain(utf8).collect()
}

fn jpeg_metadata(header: &[u8]) -> Metadata {
    if !header.starts_with(&JPEG_SIGNATURE) {
        return Metadata::new();
    }
    jpeg_segments::comments(header)
        .filter_map(|comment| std::str::from_utf8(comment).ok()?.split_once('='))
        .map(|(keyword, text)| (keyword.to_owned(), text.to_owned()))
        .collect()
}
