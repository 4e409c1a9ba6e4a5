//! The file of an animation, and the format that its ending asks for.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use crate::cli::files::places::{Inputs, place_of};
use crate::error::{Error, Result};
use crate::output;

/// Most frames per second.
pub(crate) const FRAMES_PER_S_MAX: u64 = 120;

/// How an animation is encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AnimationFormat {
    Apng,
    Gif,
    /// H.264, encoded by ffmpeg.
    Mp4,
    /// VP9, encoded by ffmpeg.
    WebM,
}

impl AnimationFormat {
    /// Whether its frames may be transparent.
    pub(crate) fn has_alpha(self) -> bool {
        matches!(self, Self::Apng | Self::Gif)
    }
}

/// A file to write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct AnimationFile {
    /// The path as the user wrote it.
    pub path: PathBuf,
    pub format: AnimationFormat,
}

impl AnimationFile {
    /// The file at `path`; its ending decides the format.
    ///
    /// # Errors
    /// [`Error::Usage`] if no animation ends like that.
    pub(crate) fn new(path: &Path) -> Result<Self> {
        let extension = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_lowercase();
        let format = match extension.as_str() {
            "png" | "apng" => AnimationFormat::Apng,
            "gif" => AnimationFormat::Gif,
            "mp4" => AnimationFormat::Mp4,
            "webm" => AnimationFormat::WebM,
            _ => {
                let path = path.display();
                let sentence = format!("{path}: an animation must end in .png, .apng, .gif, .mp4 or .webm");
                return Err(Error::Usage(sentence));
            }
        };
        Ok(Self { path: path.to_owned(), format })
    }
}

/// Checks that every output can be written, that none is an input or named twice, and that none is a device or a pipe,
/// since encoders must seek in the file.
///
/// # Errors
/// [`Error::Usage`] or [`Error::Output`].
pub(crate) fn check_writable(outputs: &[AnimationFile], inputs: &Inputs) -> Result<()> {
    inputs.refuse(outputs.iter().map(|output| output.path.as_path()))?;
    for (index, output) in outputs.iter().enumerate() {
        let path = output.path.display();
        let place = place_of(&output.path);
        if outputs[..index].iter().any(|other| place_of(&other.path) == place) {
            return Err(Error::Usage(format!("{path} is named twice as an output")));
        }
        if output.path.metadata().is_ok_and(|found| !found.is_file() && !found.is_dir()) {
            return Err(Error::Usage(format!("{path} is a device or a pipe; name a file for the animation")));
        }
        output::check_writable(&output.path)?;
    }
    Ok(())
}
