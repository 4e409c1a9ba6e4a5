//! Files of text that people write, read up to a limit: a file may be anything, even endless.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;

use crate::error::{Error, Result};
use crate::photo;

/// Most bytes of a file of settings, such as a preset: 1 MiB.
pub(crate) const SETTINGS_BYTES_MAX: u64 = 1 << 20;
/// Longest message about a text, in characters.
const MESSAGE_CHARS_MAX: usize = 1_000;

/// The text in the file at `path`, which is a `what` in the words of a refusal and has at most `bytes_max`.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read, is larger, or is not text.
pub(crate) fn read_text(path: &Path, what: &str, bytes_max: u64) -> Result<String> {
    let file = File::open(path).map_err(|error| Error::input(path, photo::why_unreadable(&error)))?;
    text_of(file, path, what, bytes_max)
}

/// As [`read_text`], of what `reader` gives, which is called `path`.
///
/// # Errors
/// As [`read_text`].
pub(crate) fn text_of(reader: impl Read, path: &Path, what: &str, bytes_max: u64) -> Result<String> {
    let mut bytes = Vec::new();
    let read = reader.take(bytes_max + 1).read_to_end(&mut bytes);
    read.map_err(|error| match error.kind() {
        ErrorKind::OutOfMemory => Error::input(path, "is too large for the memory; name a smaller file"),
        _ => Error::input(path, photo::why_unreadable(&error)),
    })?;
    if bytes.len() as u64 > bytes_max {
        let limit_mib = bytes_max >> 20;
        return Err(Error::input(
            path,
            format!("has more than {limit_mib} MiB, the limit for {what}; name another file"),
        ));
    }
    String::from_utf8(bytes)
        .map_err(|_| Error::input(path, format!("is not text in UTF-8, and {what} is; name another file")))
}

/// What is wrong with a text of TOML, on one line that is no longer than people read.
pub(crate) fn toml_mistake(text: &str, error: &toml::de::Error) -> String {
    let line = error
        .span()
        .map(|span| text.as_bytes()[..span.start.min(text.len())].iter().filter(|&&b| b == b'\n').count() + 1);
    let place = line.map_or(String::new(), |line| format!("line {line}: "));
    let message = error.message().split_whitespace().collect::<Vec<_>>().join(" ");
    place + &brief(&message)
}

/// The beginning of a message, which may repeat a word of any length.
pub(super) fn brief(message: &str) -> String {
    match message.char_indices().nth(MESSAGE_CHARS_MAX) {
        Some((end, _)) => format!("{}..", &message[..end]),
        None => message.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mistake_in_toml_is_told_with_its_line_and_never_at_length() {
        let told = |text: &str| toml_mistake(text, &text.parse::<toml::Table>().expect_err("it is wrong"));
        let duplicate = told("a = 1\nb = 2\na = 3\n");
        assert!(duplicate.starts_with("line 3: "), "{duplicate}");
        let long = told(&format!("a = 1\n{0} = 1\n{0} = 1\n", "x".repeat(100_000)));
        assert!(long.len() < 1_100 && !long.contains('\n'), "{}", long.len());
    }

    #[test]
    fn a_text_has_a_limit_and_is_utf_8() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a.toml");
        std::fs::write(&path, "x".repeat(1 << 20)).expect("the folder is ours");
        let read = |path: &Path| read_text(path, "a preset", SETTINGS_BYTES_MAX).map_err(|error| error.to_string());
        assert_eq!(read(&path).map(|text| text.len()), Ok(1 << 20));
        std::fs::write(&path, "x".repeat((1 << 20) + 1)).expect("the folder is ours");
        assert!(read(&path).is_err_and(|told| told.contains("a.toml: has more than 1 MiB, the limit for a preset")));
        std::fs::write(&path, b"\xff").expect("the folder is ours");
        assert!(read(&path).is_err_and(|told| told.contains("a.toml: is not text in UTF-8")));
        assert!(read(&folder.path().join("b.toml")).is_err_and(|told| told.contains("there is no such file")));
        assert!(read(folder.path()).is_err_and(|told| told.contains("is a folder")));
    }
}
