//! The frames of a video, which is taken apart once. An index beside the frames tells which video they come from, and
//! the hash of each.
//!
//! Several processes may want the same frames at the same time. Each takes the video apart for itself, and the first
//! one to finish puts its frames in place. A frame that another process may be reading is never missing.

use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::options::Span;
use super::rhythm::Rhythm;
use crate::cli::files::destination;
use crate::cli::files::inputs::in_folder;
use crate::cli::files::left_out::LeftOut;
use crate::cli::film;
use crate::cli::terminal::interrupt::Interrupt;
use crate::error::{Error, Result, in_words};
use crate::output::{self, PartialFolder};
use crate::photo;
use crate::studio::{SOFTWARE, hexadecimal};

/// The frames of a sequence.
#[derive(Clone, Debug)]
pub(super) struct Frames {
    pub paths: Vec<PathBuf>,
    /// Frames per second, if the sequence has a rate.
    pub frames_per_s: Option<u64>,
}

/// The name of the [`Index`].
const INDEX: &str = "video.json";
/// Most bytes of it; a frame takes about a hundred.
const INDEX_BYTES_MAX: u64 = 1 << 28;
/// Bytes that are read at a time to be hashed.
const CHUNK_BYTES: usize = 1 << 16;

/// Describes the frames in a folder.
#[derive(Debug, Serialize, Deserialize)]
struct Index {
    software: String,
    /// SHA-256 of the video.
    sha256: String,
    frames_per_s: Option<u64>,
    /// The frames in order.
    frames: Vec<Entry>,
    /// How often each frame comes, one after the other; none if each comes once.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    steps: Vec<usize>,
}

/// A frame as ffmpeg wrote it.
#[derive(Debug, Serialize, Deserialize)]
struct Entry {
    name: String,
    bytes: u64,
    sha256: String,
}

/// The state of the folder.
enum Found {
    /// All frames that are needed.
    Whole(Frames),
    /// Files of ours that may be replaced; none if the folder is empty or missing.
    Stale(Vec<String>),
}

/// The folder with the frames of a video.
#[derive(Clone, Copy)]
pub(super) struct Kept<'a> {
    pub folder: &'a Path,
    /// The frames that will be read. Of the others only the sizes are checked.
    pub span: Option<Span>,
    pub interrupt: &'a Interrupt,
}

impl Kept<'_> {
    /// The frames of a video. It is taken apart, unless all frames exist and are complete.
    ///
    /// # Errors
    /// [`Error::Input`] if the video cannot be read, [`Error::Output`] if the folder cannot be used, [`Error::Usage`]
    /// if it holds files that are not ours, [`Error::Interrupted`].
    pub(super) fn of_video(&self, video: &Path) -> Result<Frames> {
        let sha256 = self.sha256_of(video)?;
        if let Found::Whole(frames) = self.look(&sha256)? {
            return Ok(frames);
        }
        let parent = self.folder.parent().unwrap_or(Path::new("."));
        fs::create_dir_all(parent).map_err(|error| self.unusable(&error))?;
        destination::sweep(parent)?;
        let partial = PartialFolder::create_in(parent)?;
        let (frames_per_s, steps) = if photo::frame_count(video)? > 1 {
            let Rhythm { frames_per_s, steps } = self.take_animation_apart(video, partial.path())?;
            (Some(frames_per_s), if steps.iter().all(|&count| count == 1) { Vec::new() } else { steps })
        } else {
            (film::take_apart(video, partial.path(), self.interrupt)?, Vec::new())
        };
        let paths = in_folder(partial.path(), &mut LeftOut::default())
            .map_err(|_| Error::input(video, "has no frames that ffmpeg could read"))?;
        let frames = paths.par_iter().map(|path| self.entry(path)).collect::<Result<_>>()?;
        let index = Index { software: SOFTWARE.to_owned(), sha256, frames_per_s, frames, steps };
        self.interrupt.while_writing(|| self.settle(partial, &index))
    }

    /// Writes the frames of a GIF, APNG or WebP, which needs no ffmpeg, and tells for how long each is shown.
    fn take_animation_apart(&self, animation: &Path, folder: &Path) -> Result<Rhythm> {
        let mut shown_ms = Vec::new();
        photo::take_apart(animation, |frame| {
            self.interrupt.check()?;
            shown_ms.push(frame.shown_ms);
            let path = folder.join(format!("{:08}.png", shown_ms.len()));
            fs::write(&path, &frame.png).map_err(|error| self.unusable(&error))
        })?;
        Ok(Rhythm::of(&shown_ms))
    }

    /// The state of the folder for the video with this hash.
    fn look(&self, sha256: &str) -> Result<Found> {
        let names = match names(self.folder) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Found::Stale(Vec::new())),
            names => names.map_err(|error| self.unusable(&error))?,
        };
        let mut text = Vec::new();
        let read =
            File::open(self.folder.join(INDEX)).and_then(|file| file.take(INDEX_BYTES_MAX).read_to_end(&mut text));
        let index = read.ok().and_then(|_| serde_json::from_slice::<Index>(&text).ok());
        let index = index.filter(|index| index.software == SOFTWARE);
        let listed = index.iter().flat_map(|index| index.frames.iter().map(|entry| entry.name.as_str()));
        let ours: HashSet<&str> = listed.chain(index.iter().map(|_| INDEX)).collect();
        if let Some(foreign) = names.iter().find(|name| !ours.contains(name.as_str())) {
            return Err(Error::Usage(format!(
                "{} is where frames of the video go, and smalti did not put it there; move it away, or name other --populations",
                self.folder.join(foreign).display()
            )));
        }
        match index {
            Some(index) if index.sha256 == sha256 && self.are_whole(&index)? => Ok(Found::Whole(self.frames(&index))),
            _ => Ok(Found::Stale(names)),
        }
    }

    /// Whether all frames have the sizes in the index, and those that will be read have their hashes.
    fn are_whole(&self, index: &Index) -> Result<bool> {
        let has_size = |entry: &Entry| {
            let found = self.folder.join(&entry.name).metadata();
            found.is_ok_and(|found| found.is_file() && found.len() == entry.bytes)
        };
        if index.frames.is_empty() || !index.frames.iter().all(has_size) {
            return Ok(false);
        }
        let count = index.frames.len();
        // Where frames come more than once, a place in the sequence is none among the files.
        let span = self.span.filter(|_| index.steps.is_empty());
        let span = span.map_or(0..count, |span| span.first.min(count)..span.end.min(count));
        let is_whole = |entry: &Entry| match self.sha256_of(&self.folder.join(&entry.name)) {
            Ok(sha256) => Ok(sha256 == entry.sha256),
            Err(Error::Interrupted) => Err(Error::Interrupted),
            Err(_) => Ok(false),
        };
        let whole: Vec<bool> = index.frames[span].par_iter().map(is_whole).collect::<Result<_>>()?;
        Ok(whole.into_iter().all(|is_whole| is_whole))
    }

    /// Puts new frames in place, unless another process was first.
    fn settle(&self, partial: PartialFolder, index: &Index) -> Result<Frames> {
        let text =
            serde_json::to_vec(index).map_err(|error| Error::Internal(format!("no index of frames ({error})")))?;
        output::write_atomically(&partial.path().join(INDEX), &text)?;
        let Some(partial) = partial.commit(self.folder)? else { return Ok(self.frames(index)) };
        match self.look(&index.sha256)? {
            Found::Whole(frames) => Ok(frames),
            Found::Stale(former) => {
                self.replace(&former, partial.path(), index).map_err(|error| self.unusable(&error))?;
                Ok(self.frames(index))
            }
        }
    }

    /// Replaces the former frames by new ones, each in one step: another process may be repairing the same folder, and
    /// reading it already. Even if this is interrupted, every file is listed in an index.
    fn replace(&self, former: &[String], new: &Path, index: &Index) -> io::Result<()> {
        let kept: HashSet<&str> = index.frames.iter().map(|entry| entry.name.as_str()).chain([INDEX]).collect();
        for name in former.iter().filter(|name| !kept.contains(name.as_str())) {
            match fs::remove_file(self.folder.join(name)) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
        let names = [INDEX].into_iter().chain(index.frames.iter().map(|entry| entry.name.as_str()));
        names.into_iter().try_for_each(|name| fs::rename(new.join(name), self.folder.join(name)))
    }

    fn frames(&self, index: &Index) -> Frames {
        let steps = index.steps.iter().copied().chain(std::iter::repeat(1));
        let times = |(entry, count): (&Entry, usize)| std::iter::repeat_n(self.folder.join(&entry.name), count);
        let paths = index.frames.iter().zip(steps).flat_map(times).collect();
        Frames { paths, frames_per_s: index.frames_per_s }
    }

    fn entry(&self, path: &Path) -> Result<Entry> {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let bytes = path.metadata().map_err(|error| Error::input(path, photo::why_unreadable(&error)))?.len();
        Ok(Entry { name, bytes, sha256: self.sha256_of(path)? })
    }

    /// Hashes a file that may be larger than memory.
    fn sha256_of(&self, path: &Path) -> Result<String> {
        let unreadable = |error: io::Error| Error::input(path, photo::why_unreadable(&error));
        let mut file = File::open(path).map_err(unreadable)?;
        let (mut hash, mut chunk) = (Sha256::new(), vec![0; CHUNK_BYTES]);
        loop {
            self.interrupt.check()?;
            match file.read(&mut chunk) {
                Ok(0) => return Ok(hexadecimal(&hash.finalize())),
                Ok(count) => hash.update(&chunk[..count]),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(unreadable(error)),
            }
        }
    }

    fn unusable(&self, error: &io::Error) -> Error {
        let reason =
            format!("cannot be used for the frames of the video, since {}; name other --populations", in_words(error));
        Error::output(self.folder, reason)
    }
}

/// The files in a folder, in alphabetical order. Hidden files are never frames, so they are left out and stay.
fn names(folder: &Path) -> io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder)? {
        names.push(entry?.file_name().to_string_lossy().into_owned());
    }
    names.retain(|name| !name.starts_with('.'));
    names.sort();
    Ok(names)
}
