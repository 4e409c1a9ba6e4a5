//! Which pictures a sequence is of: a folder, files in their order, or a video that ffmpeg takes apart.

use std::cmp::Ordering;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::app::film;
use crate::app::provenance::hexadecimal;
use crate::error::{Error, Result};
use crate::{output, photo};

/// Endings of pictures.
const PICTURES: [&str; 8] = ["png", "jpg", "jpeg", "webp", "tif", "tiff", "bmp", "gif"];
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
        [one] if !is_picture(one) || ending(one) == "gif" => return of_video(one, folder),
        many => many.to_vec(),
    };
    Ok(Frames { paths, frames_per_s: None })
}

/// The pictures in a folder, in natural order.
///
/// # Errors
/// [`Error::Input`] if it cannot be read, or holds none.
pub(in crate::app) fn in_folder(folder: &Path) -> Result<Vec<PathBuf>> {
    let unreadable = |error: std::io::Error| Error::input(folder, photo::why_unreadable(&error));
    let entries = fs::read_dir(folder).map_err(unreadable)?;
    let entries = entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<Vec<_>, _>>();
    let mut paths = entries.map_err(unreadable)?;
    let is_hidden = |path: &Path| path.file_name().unwrap_or_default().as_encoded_bytes().starts_with(b".");
    paths.retain(|path| is_picture(path) && !is_hidden(path));
    paths.sort_by(|one, other| natural(one, other));
    if paths.is_empty() {
        return Err(Error::input(folder, "holds no pictures; name a folder of frames, or a video"));
    }
    Ok(paths)
}

fn ending(path: &Path) -> String {
    path.extension().and_then(OsStr::to_str).unwrap_or_default().to_lowercase()
}

fn is_picture(path: &Path) -> bool {
    PICTURES.contains(&ending(path).as_str())
}

/// Names with numbers in the order of the numbers.
fn natural(one: &Path, other: &Path) -> Ordering {
    let (one, other) = (one.to_string_lossy(), other.to_string_lossy());
    let (mut a, mut b) = (parts(&one).into_iter(), parts(&other).into_iter());
    loop {
        return match (a.next(), b.next()) {
            (Some(x), Some(y)) if x == y => continue,
            (Some((true, x)), Some((true, y))) => {
                // Of digits without zeros ahead, more are a larger number.
                let (short, long) = (x.trim_start_matches('0'), y.trim_start_matches('0'));
                short.len().cmp(&long.len()).then_with(|| short.cmp(long)).then_with(|| x.cmp(y))
            }
            (x, y) => x.map(|part| part.1).cmp(&y.map(|part| part.1)),
        };
    }
}

/// The runs of digits, which are marked, and of other characters in a text.
fn parts(text: &str) -> Vec<(bool, &str)> {
    let is_digit = |byte: &u8| byte.is_ascii_digit();
    // Digits are single bytes, so every cut is between characters.
    let runs = text.as_bytes().chunk_by(|one, other| is_digit(one) == is_digit(other));
    let mut start = 0;
    runs.map(|run| {
        let part = &text[start..start + run.len()];
        start += run.len();
        (is_digit(&run[0]), part)
    })
    .collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_come_in_the_order_of_their_numbers() {
        let mut names = ["f10.png", "f9.png", "f009.png", "a2b10.png", "f1.png", "a2b9.png", "ä.png"].map(Path::new);
        names.sort_by(|one, other| natural(one, other));
        let expected = ["a2b9.png", "a2b10.png", "f1.png", "f009.png", "f9.png", "f10.png", "ä.png"].map(Path::new);
        assert_eq!(names, expected);
    }
}
