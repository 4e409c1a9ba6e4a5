//! Encodes outputs, and writes them to files.

use std::path::Path;

use super::destination::Destination;
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::{self, Verbosity};
use crate::error::Result;
use crate::model::Painter;
use crate::output;
use crate::studio::{Drawn, Pieces, Told};

/// A file that is ready to be written.
pub(crate) struct EncodedFile<'a> {
    pub destination: &'a Destination,
    pub bytes: Vec<u8>,
}

/// Draws the outputs, after saying so.
///
/// # Errors
/// If the device fails.
pub(crate) fn draw(drawn: &mut Drawn, painter: &mut dyn Painter, pieces: Pieces, verbosity: Verbosity) -> Result<()> {
    let missing = drawn.missing(pieces);
    if (missing.picture || missing.layers) && verbosity > Verbosity::Quiet {
        let layers = if missing.layers { " and its layers" } else { "" };
        let canvas = drawn.view.canvas;
        terminal::say(&format!("drawing {}x{} px{layers}", canvas.width_px, canvas.height_px));
    }
    drawn.draw(painter, pieces)
}

/// Encodes all outputs. Nothing is written before all of them are encoded.
///
/// # Errors
/// If one of them cannot hold the result.
pub(crate) fn encode<'a>(outputs: &[&'a Destination], drawn: &Drawn, told: &Told) -> Result<Vec<EncodedFile<'a>>> {
    let encode_one = |&destination: &&'a Destination| {
        Ok(EncodedFile { destination, bytes: drawn.encode(destination.content, told)? })
    };
    outputs.iter().map(encode_one).collect()
}

/// Writes the files one after the other, each in one step, and adds those that succeeded to `written`.
///
/// # Errors
/// The first failure. The files after it are written all the same, since hours of work may be in them.
pub(crate) fn write(files: &[EncodedFile<'_>], interrupt: &Interrupt, written: &mut Vec<String>) -> Result<()> {
    let mut outcome = Ok(());
    for EncodedFile { destination, bytes } in files {
        let one = if destination.is_stdout() {
            terminal::write_picture_to_stdout(bytes)
        } else if destination.is_stream() {
            output::write_atomically(&destination.path, bytes)
        } else {
            interrupt.while_writing(|| output::write_atomically(&destination.path, bytes))
        };
        if one.is_ok() {
            written.push(destination.path.display().to_string());
        }
        outcome = outcome.and(one);
    }
    outcome
}

/// Whether a file without smalti's metadata is the rest of an output that was cut short. Then it is a beginning of
/// `bytes`, which are to be written now; a file system may have padded it with zeros.
pub(crate) fn is_left_of(path: &Path, bytes: &[u8]) -> bool {
    std::fs::read(path).is_ok_and(|old| {
        let length = old.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
        bytes.starts_with(&old[..length])
    })
}
