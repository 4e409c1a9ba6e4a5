//! The metadata of an animation, and whether it may replace an existing file.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::cli::files::destination::Overwrite;
use crate::error::{Error, Result};
use crate::photo::Metadata;
use crate::studio::KEYWORD;

/// Keyword of the text that holds nothing but the key.
const KEY_KEYWORD: &str = "smalti-key";
/// Bytes of a file that are searched at a time.
const WINDOW_BYTES: usize = 1 << 20;

/// The provenance of an animation.
#[derive(Clone, Debug)]
pub(crate) struct AnimationProvenance {
    /// SHA-256 over everything that decides the animation, hexadecimal.
    pub key: String,
    /// The metadata as one JSON object.
    pub text: String,
}

impl AnimationProvenance {
    /// The metadata of the file.
    pub(crate) fn metadata(&self) -> Metadata {
        // In a GIF a long text is cut into blocks, and the cut may go through the key. So the key has a text of its
        // own.
        vec![(KEY_KEYWORD.to_owned(), self.key.clone()), (KEYWORD.to_owned(), self.text.clone())]
    }
}

/// Refuses to replace a file that the same command would not have written. Such a file does not contain the key,
/// whatever its format.
///
/// # Errors
/// [`Error::Usage`].
pub(crate) fn check_replaceable(path: &Path, key: &str, overwrite: Overwrite) -> Result<()> {
    if overwrite == Overwrite::Force
        || !path.is_file()
        || File::open(path).is_ok_and(|file| holds(file, key.as_bytes()))
    {
        return Ok(());
    }
    let path = path.display();
    Err(Error::Usage(format!(
        "{path} exists and is not what this command writes; name another file, or replace it with --force"
    )))
}

/// Whether `bytes` occur in a file.
fn holds(mut file: impl Read, bytes: &[u8]) -> bool {
    let mut window = Vec::new();
    loop {
        // A match may begin at the end of one window and go on in the next.
        let kept = window.len().min(bytes.len() - 1);
        window.drain(..window.len() - kept);
        match file.by_ref().take(WINDOW_BYTES as u64).read_to_end(&mut window) {
            Ok(1..) if window.windows(bytes.len()).any(|part| part == bytes) => return true,
            Ok(1..) => {}
            _ => return false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_found_wherever_it_lies() {
        for place in [0, 1, WINDOW_BYTES - 3, WINDOW_BYTES, 2 * WINDOW_BYTES - 5] {
            let mut bytes = vec![b'.'; 2 * WINDOW_BYTES];
            bytes[place..place + 5].copy_from_slice(b"smalt");
            assert!(holds(&bytes[..], b"smalt"), "{place}");
            assert!(!holds(&bytes[..place + 4], b"smalt"), "{place}");
        }
    }
}
