//! Writes MP4 and WebM with an `ffmpeg` process that reads raw frames from its stdin.

use std::ffi::OsString;
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::thread::JoinHandle;

use super::AnimationFile;
use crate::cli::files::child::in_its_own_group;
use crate::error::{Error, Result, in_words};
use crate::model::Mosaic;
use crate::photo::Frames;
use crate::threads;

/// The program, which the system finds in the user's `PATH`.
const PROGRAM: &str = "ffmpeg";
/// How many characters of ffmpeg's message an error repeats, at most.
const MESSAGE_CHARS: usize = 300;

/// How a video is encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Codec {
    H264,
    Vp9,
}

impl Codec {
    /// The container and the encoder, with a quality at which tiles keep their edges.
    fn arguments(self) -> &'static [&'static str] {
        match self {
            Self::H264 => {
                &["-c:v", "libx264", "-preset", "medium", "-crf", "18", "-movflags", "+faststart", "-f", "mp4"]
            }
            Self::Vp9 => &[
                "-c:v",
                "libvpx-vp9",
                "-crf",
                "24",
                "-b:v",
                "0",
                "-deadline",
                "good",
                "-cpu-used",
                "3",
                "-row-mt",
                "1",
                "-f",
                "webm",
            ],
        }
    }
}

/// A running ffmpeg. It is killed if this is dropped before it has ended.
pub(super) struct Ffmpeg {
    /// The output as the user wrote it, for messages.
    path: PathBuf,
    child: Child,
    /// None once all frames are written.
    frames: Option<ChildStdin>,
    /// The last line on stderr.
    complaint: Option<JoinHandle<Option<String>>>,
    /// The last frame as ffmpeg got it. It is sent again for as long as the frame is to be shown.
    last: Vec<u8>,
    hold_frames: u32,
}

impl Ffmpeg {
    /// Starts to encode frames into the file at `growing_path`. `comment` becomes the file's metadata.
    ///
    /// # Errors
    /// [`Error::Output`] if there is no ffmpeg, or it cannot be started.
    pub(super) fn start(
        output: &AnimationFile,
        codec: Codec,
        growing_path: &Path,
        frames: &Frames,
        comment: &str,
    ) -> Result<Self> {
        let Frames { size_px, timing, .. } = frames;
        let (width_px, height_px) = (size_px.0.next_multiple_of(2), size_px.1.next_multiple_of(2));
        // Without the prefix ffmpeg would take a colon in the path for the end of a protocol's name.
        let mut file = OsString::from("file:");
        file.push(growing_path);
        let mut command = Command::new(PROGRAM);
        command
            .args(["-hide_banner", "-nostdin", "-loglevel", "error", "-y"])
            .args([
                "-protocol_whitelist",
                "pipe",
                "-f",
                "rawvideo",
                "-pix_fmt",
                "rgb24",
                "-s",
                &format!("{width_px}x{height_px}"),
            ])
            .args(["-r", &timing.frames_per_s.to_string(), "-i", "pipe:0", "-an"])
            // Named explicitly, since players otherwise guess the colour matrix from the size.
            .args(["-vf", "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p"])
            .args(["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709", "-color_range", "tv"])
            .args(["-fflags", "+bitexact", "-flags:v", "+bitexact", "-metadata", &format!("comment={comment}")])
            .args(codec.arguments())
            .arg(file)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        let mut child = in_its_own_group(&mut command).spawn().map_err(|error| not_started(&output.path, &error))?;
        let (frames, stderr) = (child.stdin.take(), child.stderr.take());
        let hold_frames = (u32::from(timing.last_cs) * u32::from(timing.frames_per_s)).div_ceil(100);
        let mut ffmpeg =
            Self { path: output.path.clone(), frames, child, complaint: None, last: Vec::new(), hold_frames };
        // If no thread can be started, the process is ended.
        let read = |stderr| threads::spawn("ffmpeg", move || last_line(BufReader::new(stderr)));
        ffmpeg.complaint = stderr.map(read).transpose()?;
        Ok(ffmpeg)
    }

    /// Adds the next frame.
    ///
    /// # Errors
    /// [`Error::Output`] with what ffmpeg said, if it has ended.
    pub(super) fn add(&mut self, frame: &Mosaic) -> Result<()> {
        self.last = even(frame);
        self.write_last()
    }

    /// Repeats the last frame for as long as it is to be shown, and waits for ffmpeg.
    ///
    /// # Errors
    /// [`Error::Output`] with what ffmpeg said, if it failed.
    pub(super) fn finish(mut self) -> Result<()> {
        (1..self.hold_frames).try_for_each(|_| self.write_last())?;
        self.frames = None;
        match self.child.wait() {
            Ok(status) if status.success() => Ok(()),
            _ => Err(self.failure()),
        }
    }

    fn write_last(&mut self) -> Result<()> {
        let written = self.frames.as_mut().map_or(Ok(()), |frames| frames.write_all(&self.last));
        written.map_err(|_| self.failure())
    }

    /// Why ffmpeg failed, as it said itself.
    fn failure(&mut self) -> Error {
        self.frames = None;
        self.end();
        let complaint = self.complaint.take().and_then(|reader| reader.join().ok()).flatten();
        let complaint: String =
            complaint.unwrap_or("it gave no reason".to_owned()).chars().take(MESSAGE_CHARS).collect();
        Error::output(&self.path, format!("ffmpeg failed ({complaint}); write .png or .gif, which need no ffmpeg"))
    }

    /// Kills the process if it still runs.
    fn end(&mut self) {
        // Both calls fail only if the process has already ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Ffmpeg {
    fn drop(&mut self) {
        self.end();
    }
}

fn not_started(path: &Path, error: &io::Error) -> Error {
    let reason = match error.kind() {
        io::ErrorKind::NotFound => {
            "needs the program ffmpeg, which is not installed; install the package ffmpeg".to_owned()
        }
        _ => {
            let why = in_words(error);
            format!("needs the program ffmpeg, which cannot be started, since {why}; reinstall the package ffmpeg")
        }
    };
    Error::output(path, format!("{reason}, or write .png or .gif"))
}

/// The frame with even sides, as 4:2:0 needs them, over black where it is transparent. An odd side gets its last column
/// or row twice.
fn even(frame: &Mosaic) -> Vec<u8> {
    let width_px = frame.width_px as usize;
    let pixels = frame.over_black();
    let mut bytes = Vec::with_capacity((pixels.len() + 2 * width_px + frame.height_px as usize) * 3);
    let mut add_row = |row: &[[u8; 3]]| {
        bytes.extend_from_slice(row.as_flattened());
        if let Some(last) = row.last().filter(|_| row.len() % 2 == 1) {
            bytes.extend_from_slice(last);
        }
    };
    pixels.chunks_exact(width_px).for_each(&mut add_row);
    if frame.height_px % 2 == 1 {
        pixels.chunks_exact(width_px).last().into_iter().for_each(&mut add_row);
    }
    bytes
}

/// The last line that is not empty. Every line is read, since a full pipe would block its writer.
fn last_line(reader: impl BufRead) -> Option<String> {
    let lines = reader.split(b'\n').map_while(io::Result::ok);
    let lines = lines.map(|line| String::from_utf8_lossy(&line).trim().to_owned());
    lines.filter(|line| !line.is_empty()).last()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odd_sides_get_their_last_pixels_twice() {
        let frame = Mosaic { width_px: 3, height_px: 1, pixels: vec![[1; 3], [2; 3], [3; 3]], alpha: None };
        let row = [1, 1, 1, 2, 2, 2, 3, 3, 3, 3, 3, 3];
        assert_eq!(even(&frame), [row, row].concat());
        let frame = Mosaic { width_px: 2, height_px: 2, pixels: vec![[1; 3], [2; 3], [3; 3], [4; 3]], alpha: None };
        assert_eq!(even(&frame), [1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4]);
    }

    #[test]
    fn the_last_line_that_says_something_is_kept() {
        assert_eq!(last_line(&b"one\ntwo\r\n\n  \n"[..]).as_deref(), Some("two"));
        assert_eq!(last_line(&b"\n"[..]), None);
    }
}
