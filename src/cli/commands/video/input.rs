//! Finds the pictures of a sequence: those in a folder, files in order, the frames of an animation, or a video that
//! ffmpeg takes apart.

use std::path::Path;

use super::extract::{Frames, Kept};
use super::options::VideoOptions;
use crate::cli::files::inputs::{self, Depth, in_folder, is_named_like_a_picture};
use crate::cli::files::left_out::LeftOut;
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::{self, Verbosity};
use crate::error::Result;
use crate::photo;

/// The frames that the inputs stand for. Those of a video are put into `folder`, and stay there for the next time.
///
/// # Errors
/// [`Error::Input`](crate::error::Error::Input) if a folder or video cannot be read, or holds no frames; otherwise as
/// [`Kept::of_video`].
pub(super) fn find(options: &VideoOptions, folder: &Path, interrupt: &Interrupt) -> Result<Frames> {
    let mut left_out = LeftOut::default();
    let paths = match &options.inputs[..] {
        [one] if one.is_dir() => in_folder(one, &mut left_out)?,
        [one] if one.is_file() && (!is_named_like_a_picture(one) || photo::frame_count(one)? > 1) => {
            return Kept { folder, span: options.span, interrupt }.of_video(one);
        }
        many => inputs::find(many, Depth::Flat, folder, &mut left_out)?.into_iter().map(|one| one.path).collect(),
    };
    if let Some(sentence) = left_out.sentence().filter(|_| options.pictures.verbosity > Verbosity::Quiet) {
        terminal::say(&format!("smalti: {sentence}"));
    }
    Ok(Frames { paths, frames_per_s: None })
}
