//! Takes a video apart into frames, by processes of `ffmpeg` and `ffprobe`.

use std::ffi::OsString;
use std::io;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use crate::app::child::in_its_own_group;
use crate::error::{Error, Result};

/// Writes all frames of `video` into `folder` as PNG files whose names are their numbers; returns the frames a second, rounded,
/// if the video tells them.
///
/// # Errors
/// [`Error::Input`] if there is no ffmpeg, or it cannot read the video.
pub(in crate::app) fn take_apart(video: &Path, folder: &Path) -> Result<Option<u64>> {
    let mut command = Command::new("ffmpeg");
    command.args(["-hide_banner", "-nostdin", "-loglevel", "error", "-y", "-i"]).arg(as_file(video));
    command.args([
        "-map",
        "0:v:0",
        "-fflags",
        "+bitexact",
        "-flags:v",
        "+bitexact",
        "-pix_fmt",
        "rgb24",
        "-f",
        "image2",
    ]);
    run(command.arg(as_file(&folder.join("%08d.png"))), video)?;
    let mut command = Command::new("ffprobe");
    command.args(["-v", "error", "-select_streams", "v:0", "-show_entries", "stream=r_frame_rate", "-of", "csv=p=0"]);
    let told = run(command.arg(as_file(video)), video)?;
    Ok(rate(&String::from_utf8_lossy(&told.stdout)))
}

/// A path that ffmpeg takes for no protocol.
fn as_file(path: &Path) -> OsString {
    let mut file = OsString::from("file:");
    file.push(path);
    file
}

fn run(command: &mut Command, video: &Path) -> Result<Output> {
    command.stdin(Stdio::null());
    let output = in_its_own_group(command).output().map_err(|error| {
        let reason = match error.kind() {
            io::ErrorKind::NotFound => "needs the program ffmpeg, which is not installed".to_owned(),
            _ => format!("needs the program ffmpeg, which cannot be started ({error})"),
        };
        Error::input(video, format!("{reason}; install the package ffmpeg, or give a folder of frames"))
    })?;
    if output.status.success() {
        return Ok(output);
    }
    let said = String::from_utf8_lossy(&output.stderr);
    let last = said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it gave no reason").trim();
    Err(Error::input(video, format!("cannot be read by ffmpeg ({last}); give another video, or a folder of frames")))
}

/// Frames a second, rounded, in a fraction such as `30000/1001`.
fn rate(text: &str) -> Option<u64> {
    let (frames, seconds) = text.trim().split_once('/')?;
    let (frames, seconds) = (frames.parse::<u64>().ok()?, seconds.parse::<u64>().ok()?);
    (frames > 0 && seconds > 0).then(|| ((frames + seconds / 2) / seconds).max(1))
}

#[cfg(test)]
mod tests {
    use super::rate;

    #[test]
    fn a_rate_is_a_fraction_rounded() {
        assert_eq!(["25/1\n", "30000/1001", "1/3", "0/0", ""].map(rate), [Some(25), Some(30), Some(1), None, None]);
    }
}
