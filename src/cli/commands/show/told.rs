//! What a file tells of how it was made, whatever its kind; the content decides, not the name.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use serde_json::{Deserializer, Map, Value};

use crate::cli::files::destination::Destination;
use crate::cli::files::story::told_by_file;
use crate::error::{Error, Result};
use crate::photo;
use crate::studio::{Content, SOFTWARE};

/// Bytes at the beginning of a file that tell its kind.
const SIGNATURE_BYTES: u64 = 16;
/// Bytes of a file that are searched at a time.
const WINDOW_BYTES: usize = 1 << 20;
/// Most bytes of the metadata of a file (see [`crate::photo::Metadata`]).
const TOLD_BYTES_MAX: usize = 1 << 16;
/// The label of a comment in a GIF, whose text follows in blocks of up to 255 bytes.
const GIF_COMMENT: [u8; 2] = [0x21, 0xFE];

/// The metadata of the file at `path`; none if nothing in it is of smalti.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read.
pub(super) fn told_by(path: &Path) -> Result<Option<Map<String, Value>>> {
    let unreadable = |error: io::Error| Error::input(path, photo::why_unreadable(&error));
    let mut signature = Vec::new();
    let file = File::open(path).map_err(unreadable)?;
    file.take(SIGNATURE_BYTES).read_to_end(&mut signature).map_err(unreadable)?;
    let of = |content| told_by_file(&Destination { path: path.to_owned(), content });
    let found = match signature.as_slice() {
        [0x89, b'P', b'N', b'G', ..] => of(Content::Png),
        [0xFF, 0xD8, 0xFF, ..] => of(Content::JPEG),
        [b'R', b'I', b'F', b'F', ..] => of(Content::WebP),
        [b'P', b'K', ..] => of(Content::Population).or_else(|| of(Content::OpenRaster)),
        [b'G', b'I', b'F', ..] => told_by_gif(path).map_err(unreadable)?,
        [b'<', ..] => of(Content::Svg),
        [b'{', ..] => of(Content::Json),
        [_, _, _, _, b'f', b't', b'y', b'p', ..] | [0x1A, 0x45, 0xDF, 0xA3, ..] => {
            searched(BufReader::new(File::open(path).map_err(unreadable)?)).map_err(unreadable)?
        }
        _ => of(Content::Csv),
    };
    Ok(found)
}

/// The metadata in the comments of a GIF.
fn told_by_gif(path: &Path) -> io::Result<Option<Map<String, Value>>> {
    let mut head = Vec::new();
    File::open(path)?.take(WINDOW_BYTES as u64).read_to_end(&mut head)?;
    let comments = head.windows(GIF_COMMENT.len()).enumerate().filter(|(_, bytes)| *bytes == GIF_COMMENT);
    let texts = comments.map(|(place, _)| joined_blocks(&head[place + GIF_COMMENT.len()..]));
    Ok(texts.into_iter().find_map(|text| last_told(&text)))
}

/// The blocks at the beginning of `bytes`, each of which begins with its length, up to one without any.
fn joined_blocks(mut bytes: &[u8]) -> Vec<u8> {
    let mut text = Vec::new();
    while let Some((&length @ 1.., rest)) = bytes.split_first() {
        let Some((block, rest)) = rest.split_at_checked(usize::from(length)) else { break };
        text.extend_from_slice(block);
        bytes = rest;
    }
    text
}

/// The metadata somewhere in a file. Containers of films keep a comment as it is.
fn searched(mut file: impl Read) -> io::Result<Option<Map<String, Value>>> {
    let mut window = Vec::new();
    loop {
        // The metadata may begin in one window and end in the next.
        let kept = window.len().min(2 * TOLD_BYTES_MAX);
        window.drain(..window.len() - kept);
        if file.by_ref().take(WINDOW_BYTES as u64).read_to_end(&mut window)? == 0 {
            return Ok(None);
        }
        if let Some(told) = last_told(&window) {
            return Ok(Some(told));
        }
    }
}

/// The JSON object around the name of our program in `bytes`.
fn last_told(bytes: &[u8]) -> Option<Map<String, Value>> {
    let mark = format!("\"software\":\"{SOFTWARE}\"");
    let end = bytes.windows(mark.len()).position(|part| part == mark.as_bytes())?;
    let begins = (end.saturating_sub(TOLD_BYTES_MAX)..end).rev().filter(|&place| bytes[place] == b'{');
    begins.into_iter().find_map(|begin| {
        let told = Deserializer::from_slice(&bytes[begin..]).into_iter::<Map<String, Value>>().next()?.ok()?;
        (told.get("software").and_then(Value::as_str) == Some(SOFTWARE)).then_some(told)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLD: &str = r#"{"key":"ab","recipe":{"mask":["{"]},"software":"smalti","version":"1"}"#;

    #[test]
    fn metadata_are_found_wherever_they_lie_in_a_film() {
        for place in [0, 1, WINDOW_BYTES - 30, WINDOW_BYTES, 3 * WINDOW_BYTES - 7] {
            let mut film = vec![b'{'; place];
            film.extend_from_slice(TOLD.as_bytes());
            film.extend_from_slice(&[b'}'; 100]);
            let told = searched(&film[..]).expect("bytes can be read");
            assert_eq!(told.and_then(|told| told.get("key").cloned()), Some("ab".into()), "{place}");
        }
        assert_eq!(searched(&TOLD.as_bytes()[..40]).expect("bytes can be read"), None);
    }

    #[test]
    fn the_text_of_a_comment_is_put_together_from_its_blocks() {
        assert_eq!(joined_blocks(b"\x02ab\x01c\x00rest"), b"abc");
        assert_eq!(joined_blocks(b"\x02ab\x09c"), b"ab");
    }
}
