//! Takes a video apart into frames, with the programs `ffmpeg` and `ffprobe`.

use std::ffi::OsString;
use std::io::{self, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::cli::files::child::in_its_own_group;
use crate::cli::terminal::interrupt::Interrupt;
use crate::error::{Error, Result, in_words};
use crate::threads;

/// Time between two looks at whether a process has ended, or must be ended.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// What ffmpeg may open: the file itself. A playlist or a script of a demuxer could name other files, or hosts.
const PROTOCOLS: &str = "file";
/// The containers that ffmpeg may take a file for, whatever its ending. None of them names other files.
const FORMATS: &str = "mov,matroska,avi,mpegts,mpeg,mpegvideo,h264,hevc,m4v,ogg,flv,asf,gif,apng,\
                       yuv4mpegpipe,nut,mxf,dv,ivf,obu,rm,mjpeg,wtv,vc1,h261,h263";

/// Writes all frames of `video` into `folder` as PNG files that are named by their numbers. Returns the frames per
/// second, rounded, if the video tells them.
///
/// # Errors
/// [`Error::Input`] if there is no ffmpeg, or it cannot read the video; [`Error::Interrupted`].
pub(crate) fn take_apart(video: &Path, folder: &Path, interrupt: &Interrupt) -> Result<Option<u64>> {
    let mut command = Command::new("ffmpeg");
    command.args(["-hide_banner", "-nostdin", "-loglevel", "error", "-y"]);
    command.args(["-protocol_whitelist", PROTOCOLS, "-format_whitelist", FORMATS, "-i"]).arg(as_file(video));
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
    run(command.arg(pattern(folder)), video, interrupt)?;
    let mut command = Command::new("ffprobe");
    command.args([
        "-v",
        "error",
        "-protocol_whitelist",
        PROTOCOLS,
        "-format_whitelist",
        FORMATS,
        "-select_streams",
        "v:0",
        "-show_entries",
        "stream=r_frame_rate",
        "-of",
        "csv=p=0",
    ]);
    let told = run(command.arg(as_file(video)), video, interrupt)?;
    Ok(rate(&String::from_utf8_lossy(&told)))
}

/// The path in a form that ffmpeg does not take for a protocol.
fn as_file(path: &Path) -> OsString {
    let mut file = OsString::from("file:");
    file.push(path);
    file
}

/// The names of the frames in `folder`, in which ffmpeg takes a `%` for the beginning of a number.
fn pattern(folder: &Path) -> OsString {
    let mut file = as_file(folder).into_encoded_bytes();
    let mut place = 0;
    while let Some(found) = file[place..].iter().position(|&byte| byte == b'%') {
        file.insert(place + found, b'%');
        place += found + 2;
    }
    #[cfg(unix)]
    let folder: OsString = std::os::unix::ffi::OsStringExt::from_vec(file);
    #[cfg(not(unix))]
    let folder: OsString = String::from_utf8_lossy(&file).into_owned().into();
    Path::new(&folder).join("%08d.png").into_os_string()
}

/// A process that is killed if this is dropped before it has ended.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // Both calls fail only if the process has already ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs a program to its end; returns what it wrote to stdout.
fn run(command: &mut Command, video: &Path, interrupt: &Interrupt) -> Result<Vec<u8>> {
    let unusable = |error: io::Error| {
        let reason = match error.kind() {
            io::ErrorKind::NotFound => "needs the program ffmpeg, which is not installed".to_owned(),
            _ => format!("needs the program ffmpeg, which cannot be started, since {}", in_words(&error)),
        };
        Error::input(video, format!("{reason}; install the package ffmpeg, or give a folder of frames"))
    };
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = Running(in_its_own_group(command).spawn().map_err(unusable)?);
    let stdout = child.0.stdout.take().map(read_all).transpose()?;
    let stderr = child.0.stderr.take().map(read_all).transpose()?;
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
    if said.contains("not on whitelist") {
        let reason = "is no kind of video that is read, or names other files, which is not followed; give another video, \
                      or a folder of frames";
        return Err(Error::input(video, reason));
    }
    let last = said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it gave no reason").trim();
    Err(Error::input(video, format!("cannot be read by ffmpeg ({last}); give another video, or a folder of frames")))
}

/// Reads a pipe to its end, since a full pipe would block its writer.
fn read_all(mut pipe: impl Read + Send + 'static) -> Result<JoinHandle<Vec<u8>>> {
    threads::spawn("ffmpeg", move || {
        let mut bytes = Vec::new();
        // What was read before a failure may tell its reason.
        let _ = pipe.read_to_end(&mut bytes);
        bytes
    })
}

/// Frames per second, rounded, from a fraction such as `30000/1001`.
fn rate(text: &str) -> Option<u64> {
    let (frames, seconds) = text.trim().split_once('/')?;
    let (frames, seconds) = (frames.parse::<u64>().ok()?, seconds.parse::<u64>().ok()?);
    (frames > 0 && seconds > 0).then(|| ((frames + seconds / 2) / seconds).max(1))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::cli::film::apart::{pattern, rate};

    #[test]
    fn a_percent_sign_in_the_name_of_a_folder_is_no_place_for_a_number() {
        let folder = Path::new("50%").join("a%d");
        let expected = Path::new("file:50%%").join("a%%d").join("%08d.png");
        assert_eq!(pattern(&folder), expected);
    }

    #[test]
    fn a_rate_is_a_fraction_rounded() {
        assert_eq!(["25/1\n", "30000/1001", "1/3", "0/0", ""].map(rate), [Some(25), Some(30), Some(1), None, None]);
    }
}
