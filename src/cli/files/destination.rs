//! Where results go: what a path's ending asks for, and whether the path may be written to.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use super::places::{Inputs, place_of};
use crate::error::{Error, Result};
use crate::output;
use crate::photo::WEBP_SIDE_MAX_PX;
use crate::studio::{Content, Pieces};

/// What to do about existing files that the same command would not have written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Overwrite {
    Refuse,
    Force,
}

/// A file, or stdout as `-`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Destination {
    /// The path as the user wrote it.
    pub path: PathBuf,
    /// What is written to it.
    pub content: Content,
}

impl Destination {
    /// The destination of a result; the ending of `path` tells what is written.
    pub(crate) fn for_result(path: &Path) -> Result<Self> {
        let text = path.to_string_lossy();
        let parts: Vec<&str> = text.split(',').collect();
        if parts.len() > 1 && parts.iter().all(|part| content_of(Path::new(part.trim())).is_some()) {
            let each: Vec<String> = parts.iter().map(|part| format!("-o {}", part.trim())).collect();
            return Err(Error::Usage(format!("-o {text}: -o names one file; repeat it, as in {}", each.join(" "))));
        }
        if let Some(content) = content_of(path) {
            return Ok(Self { path: path.to_owned(), content });
        }
        let ending = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_lowercase();
        let path = path.display();
        Err(Error::Usage(if moves(&ending) {
            still(&path.to_string(), &path.to_string())
        } else {
            format!("{path}: an output must end in .png, .jpg, .jpeg, .webp, .svg, .ora, .npz, .json or .csv, or be -")
        }))
    }

    /// The destinations of a result; the ending of a path tells what is written to it, and `format` what to stdout.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the path or the format.
    pub(crate) fn for_results(paths: &[PathBuf], format: Option<&str>) -> Result<Vec<Self>> {
        let mut found: Vec<Self> = paths.iter().map(|path| Self::for_result(path)).collect::<Result<_>>()?;
        let Some(format) = format else { return Ok(found) };
        let is_word = format.bytes().all(|byte| byte.is_ascii_alphanumeric());
        let content = is_word.then(|| Content::of_path(&Path::new("mosaic").with_extension(format))).flatten();
        let content = content.ok_or_else(|| {
            Error::Usage(if moves(format) {
                still(&format!("--format {format}"), &format!("mosaic.{format}"))
            } else {
                format!("--format {format}: there are png, jpg, jpeg, webp, svg, ora, npz, json and csv")
            })
        })?;
        let Some(stdout) = found.iter_mut().find(|destination| destination.is_stdout()) else {
            return Err(Error::Usage(format!(
                "--format {format}: is for -o -; of a file the ending of -o decides the format, so drop the flag"
            )));
        };
        stdout.content = content;
        Ok(found)
    }

    /// The destination of the fitted picture.
    pub(crate) fn for_target(path: &Path) -> Result<Self> {
        match Self::for_result(path) {
            Ok(destination) if destination.content == Content::Png && !destination.is_stdout() => Ok(destination),
            _ => Err(Error::Usage(format!("{}: the file of --save-target must end in .png", path.display()))),
        }
    }

    /// Whether this is stdout instead of a file.
    pub(crate) fn is_stdout(&self) -> bool {
        self.path == Path::new("-")
    }

    /// Whether the bytes go to a reader, such as a device or a pipe, so that no file is replaced.
    pub(crate) fn is_stream(&self) -> bool {
        self.is_stdout() || self.path.metadata().is_ok_and(|found| !found.is_file() && !found.is_dir())
    }

    /// Whether a picture is written, which has a size, rather than a population, which can be drawn at any.
    pub(crate) fn is_picture(&self) -> bool {
        self.content.is_picture()
    }

    /// Whether pixels are written.
    pub(crate) fn is_raster(&self) -> bool {
        self.content.is_raster()
    }

    /// Whether the format has no place for transparency.
    pub(crate) fn is_flat(&self) -> bool {
        matches!(self.content, Content::Jpeg(_))
    }

    /// Whether a regular file exists that would be replaced.
    pub(super) fn replaces_file(&self) -> bool {
        // Devices and pipes are not replaced.
        !self.is_stdout() && self.path.is_file()
    }
}

/// Whether a file with this ending is an animation.
fn moves(ending: &str) -> bool {
    ["gif", "apng", "mp4", "webm"].contains(&ending)
}

/// What to do instead of writing an animation of one mosaic.
fn still(asked: &str, path: &str) -> String {
    format!(
        "{asked}: a mosaic is a still picture, such as .png; to watch it evolve, add --save-run run, and then run smalti \
         timelapse run -o {path}"
    )
}

/// What is written to a path: as its ending tells, and a PNG to stdout.
fn content_of(path: &Path) -> Option<Content> {
    Content::of_path(path).or_else(|| (path == Path::new("-")).then_some(Content::Png))
}

/// What has to be drawn for these outputs.
pub(crate) fn pieces(outputs: &[Destination]) -> Pieces {
    Pieces::of(outputs.iter().map(|output| output.content))
}

/// Refuses to write a picture to stdout if `--json` writes its row there.
pub(crate) fn check_stdout_is_free(outputs: &[Destination]) -> Result<()> {
    if outputs.iter().any(Destination::is_stdout) {
        return Err(Error::Usage("-o - and --json both write to stdout; drop one of them".to_owned()));
    }
    Ok(())
}

/// Refuses a size for pictures if no output is a picture.
pub(crate) fn check_size_has_use(outputs: &[Destination], long_side_px: Option<u32>) -> Result<()> {
    match long_side_px {
        Some(long_side_px) if !outputs.iter().any(Destination::is_picture) => Err(Error::Usage(format!(
            "--output-size {long_side_px}: a population has no size; add a picture as an output, or drop the flag"
        ))),
        _ => Ok(()),
    }
}

/// How many times the memory of one picture it takes to draw and encode the largest of `outputs`. A layer is drawn
/// twice, cut out, and encoded while the layers before it are still in memory.
pub(crate) fn memory_weight(outputs: &[Destination]) -> u64 {
    if outputs.iter().any(|output| output.content == Content::OpenRaster) { 3 } else { 1 }
}

/// Refuses pictures that are too large for the format of one of `outputs`.
pub(crate) fn check_fits_formats(outputs: &[Destination], (width_px, height_px): (u32, u32)) -> Result<()> {
    let webp = outputs.iter().find(|output| output.content == Content::WebP);
    match webp {
        Some(output) if width_px.max(height_px) > WEBP_SIDE_MAX_PX => Err(Error::Usage(format!(
            "{}: a WebP has at most {WEBP_SIDE_MAX_PX} px a side, and this is {width_px}x{height_px} px; write a .png, or \
             a smaller --output-size",
            output.path.display()
        ))),
        _ => Ok(()),
    }
}

/// Checks, before anything is read, that every destination can be written, none is named twice, and none is one of
/// `inputs`.
pub(crate) fn check_writable<'a>(destinations: impl Iterator<Item = &'a Destination>, inputs: &Inputs) -> Result<()> {
    let mut seen: Vec<PathBuf> = Vec::new();
    for destination in destinations {
        let place = place_of(&destination.path);
        if seen.contains(&place) {
            return Err(Error::Usage(format!("{} is named twice as an output", destination.path.display())));
        }
        if destination.is_stdout() {
            if std::io::stdout().is_terminal() {
                let sentence = "-o - would write its result to the terminal; redirect it to a file or a pipe";
                return Err(Error::Usage(sentence.to_owned()));
            }
            if stdout_is_closed() {
                let reason = "is closed, and -o - would lose its result; redirect it to a file or a pipe";
                return Err(Error::output(Path::new("stdout"), reason));
            }
        } else {
            inputs.refuse([destination.path.as_path()])?;
            output::check_writable(&destination.path)?;
        }
        seen.push(place);
    }
    Ok(())
}

/// Whether the program was started without a stdout.
///
/// Rust then opens the null device in its place for reading and writing. A redirection to the null device opens it for
/// writing only, which tells the two apart.
#[cfg(unix)]
fn stdout_is_closed() -> bool {
    use std::io::Read;
    use std::os::fd::AsFd;
    use std::os::unix::fs::MetadataExt;
    let Ok(descriptor) = std::io::stdout().as_fd().try_clone_to_owned() else { return true };
    let mut file = std::fs::File::from(descriptor);
    let device = |found: std::fs::Metadata| found.rdev();
    let null = std::fs::metadata("/dev/null").map(device).ok();
    null.is_some() && file.metadata().map(device).ok() == null && file.read(&mut [0]).is_ok()
}

#[cfg(not(unix))]
fn stdout_is_closed() -> bool {
    false
}

/// Removes what killed processes left in a folder, as [`output::sweep`] does.
///
/// # Errors
/// As [`output::sweep`].
pub(crate) fn sweep(folder: &Path) -> Result<()> {
    output::sweep(folder, |found| found.modified().ok()?.elapsed().ok())
}

/// Removes what killed processes left beside files that are about to be written. A failure is ignored: we may be
/// allowed to write a file in a folder but not to list it.
pub(crate) fn sweep_beside<'a>(files: impl Iterator<Item = &'a Path>) {
    let folder = |file: &'a Path| file.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folders: BTreeSet<&Path> = files.map(|file| folder(file).unwrap_or(Path::new("."))).collect();
    for folder in folders {
        let _ = sweep(folder);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_output_in_the_place_of_any_input_is_refused_by_name() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [picture, map, output] = ["picture.png", "map.png", "out.png"].map(|name| folder.path().join(name));
        for path in [&picture, &map] {
            std::fs::write(path, b"whatever").expect("the folder is ours");
        }
        let inputs = Inputs::new([picture.as_path(), map.as_path()]);
        let check = |path: &Path| {
            let destination = Destination::for_result(path).expect("it ends in .png");
            check_writable(std::iter::once(&destination), &inputs)
        };
        check(&output).expect("it is no input");
        for written in [map.clone(), folder.path().join("./map.png"), picture.clone()] {
            let refusal = check(&written).expect_err("it is an input").to_string();
            assert!(refusal.starts_with(&format!("{} is an input", written.display())), "{refusal}");
        }
    }
}
