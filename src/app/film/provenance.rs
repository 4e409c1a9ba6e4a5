//! What the metadata of an animation tell, and whether a file may make room for it.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::app::options::Overwrite;
use crate::app::provenance::KEYWORD;
use crate::error::{Error, Result};
use crate::photo::Metadata;

/// Keyword of the key by itself.
const KEY_KEYWORD: &str = "smalti-key";
/// Bytes of a file that are looked through at a time.
const WINDOW_BYTES: usize = 1 << 20;

/// The provenance of an animation.
#[derive(Clone, Debug)]
pub(in crate::app) struct AnimationProvenance {
    /// SHA-256 over all that decides the animation, hexadecimal.
    pub key: String,
    /// The metadata as one JSON object.
    pub text: String,
}

impl AnimationProvenance {
    /// The metadata of the file.
    pub(in crate::app) fn metadata(&self) -> Metadata {
        // The blocks of a GIF would cut a key in the midst of a long text.
        vec![(KEY_KEYWORD.to_owned(), self.key.clone()), (KEYWORD.to_owned(), self.text.clone())]
    }
}

/// Refuses to replace a file that the same command would not have written: one without its key, whatever the format.
///
/// # Errors
/// [`Error::Usage`].
pub(in crate::app) fn check_replaceable(path: &Path, key: &str, overwrite: Overwrite) -> Result<()> {
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
        // What begins at the end of one window goes on in the next.
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
