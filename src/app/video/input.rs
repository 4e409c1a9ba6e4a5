//! Which pictures a sequence is of: a folder, files in their order, or a video that ffmpeg takes apart.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::app::film;
use crate::app::inputs::{self, Depth, in_folder, is_named_like_a_picture};
use crate::app::provenance::hexadecimal;
use crate::error::{Error, Result};
use crate::{output, photo};

/// The file that tells which video the frames beside it are of; written once they are all there.
const INDEX: &str = "video.json";

/// The frames of a sequence.
#[derive(Clone, Debug)]
pub(super) struct Frames {
    pub paths: Vec<PathBuf>,
    /// Frames a second, if the sequence has a rate.
    pub frames_per_s: Option<u64>,
}

/// The frames that `inputs` stand for; those of a video are put into `folder`, where they stay for the next time.
///
/// # Errors
/// [`Error::Input`] if a folder or video cannot be read, or holds no frames; [`Error::Output`] if `folder` cannot be used.
pub(super) fn find(inputs: &[PathBuf], folder: &Path) -> Result<Frames> {
    let paths = match inputs {
        [one] if one.is_dir() => in_folder(one)?,
        [one] if one.is_file() && (!is_named_like_a_picture(one) || ending(one) == "gif") => {
            return of_video(one, folder);
        }
        many => inputs::find(many, Depth::Flat, folder)?.into_iter().map(|one| one.path).collect(),
    };
    Ok(Frames { paths, frames_per_s: None })
}

fn ending(path: &Path) -> String {
    path.extension().and_then(OsStr::to_str).unwrap_or_default().to_lowercase()
}

/// The frames of a video.
fn of_video(video: &Path, folder: &Path) -> Result<Frames> {
    let bytes = fs::read(video).map_err(|error| Error::input(video, photo::why_unreadable(&error)))?;
    let sha256 = hexadecimal(&Sha256::digest(&bytes));
    drop(bytes);
    let index = folder.join(INDEX);
    let told = fs::read(&index).ok().and_then(|text| serde_json::from_slice::<Value>(&text).ok()).unwrap_or_default();
    if told["sha256"] == sha256.as_str()
        && let Ok(paths) = in_folder(folder)
        && told["frames"].as_u64() == Some(paths.len() as u64)
    {
        return Ok(Frames { paths, frames_per_s: told["frames_per_s"].as_u64() });
    }
    let unusable = |error: std::io::Error| {
        let reason = format!("cannot be used for the frames of the video ({error}); name other --populations");
        Error::output(folder, reason)
    };
    fs::create_dir_all(folder).map_err(unusable)?;
    // Those of another video, or of one that was cut.
    in_folder(folder).unwrap_or_default().iter().try_for_each(fs::remove_file).map_err(unusable)?;
    let frames_per_s = film::take_apart(video, folder)?;
    let paths = in_folder(folder).map_err(|_| Error::input(video, "has no frames that ffmpeg could read"))?;
    let told = json!({"sha256": sha256, "frames": paths.len(), "frames_per_s": frames_per_s});
    output::write_atomically(&index, told.to_string().as_bytes())?;
    Ok(Frames { paths, frames_per_s })
}
