//! Encodes outputs, and writes them to files.

use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::{Map, Value};

use super::destination::Destination;
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::progress::{Progress, Stage, rounded};
use crate::cli::terminal::{self, Verbosity};
use crate::error::Result;
use crate::model::Painter;
use crate::output;
use crate::studio::{Drawn, Pieces, Told};

/// Pictures of so many pixels take seconds to encode.
const LARGE_PIXEL_COUNT: u64 = 1 << 24;

/// A file that is ready to be written.
pub(crate) struct EncodedFile<'a> {
    pub destination: &'a Destination,
    pub bytes: Vec<u8>,
}

/// Draws the outputs, and shows how far that has come.
///
/// # Errors
/// If the device fails.
pub(crate) fn draw(drawn: &mut Drawn, painter: &mut dyn Painter, pieces: Pieces, mut progress: Progress) -> Result<()> {
    let canvas = drawn.view.canvas;
    let what = format!("drawing {}x{} px", canvas.width_px, canvas.height_px);
    let began = Instant::now();
    let outcome = drawn.draw_watched(painter, pieces, &mut |share| {
        let elapsed = began.elapsed();
        if progress.is_due(elapsed) {
            progress.show(&DrawingDone { what: &what, elapsed, share });
        }
    });
    progress.finish();
    outcome
}

/// Encodes all outputs, and says so of large ones. Nothing is written before all of them are encoded.
///
/// # Errors
/// If one of them cannot hold the result.
pub(crate) fn encode<'a>(
    outputs: &[&'a Destination],
    drawn: &Drawn,
    told: &Told,
    verbosity: Verbosity,
) -> Result<Vec<EncodedFile<'a>>> {
    let canvas = drawn.view.canvas;
    let is_large = u64::from(canvas.width_px) * u64::from(canvas.height_px) >= LARGE_PIXEL_COUNT;
    let encode_one = |&destination: &&'a Destination| {
        if is_large && verbosity > Verbosity::Quiet && destination.is_raster() {
            terminal::say(&format!("encoding {}", destination.path.display()));
        }
        Ok(EncodedFile { destination, bytes: drawn.encode(destination.content, told)? })
    };
    outputs.iter().map(encode_one).collect()
}

/// How far the drawing of a picture has come.
struct DrawingDone<'a> {
    what: &'a str,
    elapsed: Duration,
    share: f64,
}

impl Stage for DrawingDone<'_> {
    fn elapsed(&self) -> Duration {
        self.elapsed
    }

    fn share(&self) -> f64 {
        self.share
    }

    fn eta_s(&self) -> Option<f64> {
        (self.share > 0.0).then(|| self.elapsed.as_secs_f64() * (1.0 - self.share) / self.share)
    }

    fn count(&self) -> String {
        self.what.to_owned()
    }

    fn json(&self) -> Map<String, Value> {
        Map::from_iter([("drawn_share".to_owned(), rounded(self.share * 100.0, 1).into())])
    }
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
