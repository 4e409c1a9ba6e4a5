//! Takes a video apart into frames, by processes of `ffmpeg` and `ffprobe`.

use std::ffi::OsString;
use std::io::{self, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::app::child::in_its_own_group;
use crate::app::interrupt::Interrupt;
use crate::error::{Error, Result};

/// How long nobody looks whether a process has ended, or should.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// Writes all frames of `video` into `folder` as PNG files whose names are their numbers; returns the frames a second, rounded,
/// if the video tells them.
///
/// # Errors
/// [`Error::Input`] if there is no ffmpeg, or it cannot read the video; [`Error::Interrupted`].
pub(in crate::app) fn take_apart(video: &Path, folder: &Path, interrupt: &Interrupt) -> Result<Option<u64>> {
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
    run(command.arg(as_file(&folder.join("%08d.png"))), video, interrupt)?;
    let mut command = Command::new("ffprobe");
    command.args(["-v", "error", "-select_streams", "v:0", "-show_entries", "stream=r_frame_rate", "-of", "csv=p=0"]);
    let told = run(command.arg(as_file(video)), video, interrupt)?;
    Ok(rate(&String::from_utf8_lossy(&told)))
}

/// A path that ffmpeg takes for no protocol.
fn as_file(path: &Path) -> OsString {
    let mut file = OsString::from("file:");
    file.push(path);
    file
}

/// A process that is ended if it is dropped before its end.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // Both fail only for a process that has ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs a program to its end; what it wrote to stdout.
fn run(command: &mut Command, video: &Path, interrupt: &Interrupt) -> Result<Vec<u8>> {
    let unusable = |error: io::Error| {
        let reason = match error.kind() {
            io::ErrorKind::NotFound => "needs the program ffmpeg, which is not installed".to_owned(),
            _ => format!("needs the program ffmpeg, which cannot be started ({error})"),
        };
        Error::input(video, format!("{reason}; install the package ffmpeg, or give a folder of frames"))
    };
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = Running(in_its_own_group(command).spawn().map_err(unusable)?);
    let (stdout, stderr) = (child.0.stdout.take().map(read_all), child.0.stderr.take().map(read_all));
    let status = loop {
        interrupt.check()?;
        match child.0.try_wait().map_err(unusable)? {
            Some(status) => break status,
            None => std::thread::sleep(LOOK_EVERY),
        }
    };
    let said = |pipe: Option<JoinHandle<Vec<u8>>>| pipe.and_then(|pipe| pipe.join().ok()).unwrap_or_default();
    let (stdout, stderr) = (said(stdout), said(stderr));
    if status.success() {
        return Ok(stdout);
    }
    let said = String::from_utf8_lossy(&stderr);
    let last = said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it gave no reason").trim();
    Err(Error::input(video, format!("cannot be read by ffmpeg ({last}); give another video, or a folder of frames")))
}

/// Reads a pipe to its end, since a full one would stop its writer.
fn read_all(mut pipe: impl Read + Send + 'static) -> JoinHandle<Vec<u8>> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        // What came before a failure may tell why.
        let _ = pipe.read_to_end(&mut bytes);
        bytes
    })
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
