//! The files of `--curve`: where they may go, and what is in them.
//!
//! One rule: a file that is there is replaced if it is a curve of the same command, which its key tells (the last column
//! of the CSV, the last line of the SVG), but a whole curve not by a partial one; any other file only with `--force`.

use std::ffi::OsStr;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::destination::{self, Destination};
use super::interrupt::Interrupt;
use super::options::Overwrite;
use super::report::Status;
use super::{cells, curve};
use crate::archive::KEY_DIGITS;
use crate::error::{Error, Result};
use crate::output;

/// Most bytes of a file that are looked at to see whether it is a curve: many times what one has.
const BYTES_MAX: u64 = 1 << 24;

/// A curve, whatever it is of.
pub(super) trait Tabled {
    /// The points as CSV; every row ends with the `status` of the evolution and the first digits of the result's `key`.
    fn csv(&self, status: &str, key: &str) -> String;

    /// The points as a plot.
    ///
    /// # Errors
    /// If there are none.
    fn plot(&self, title: String) -> Result<String>;
}

/// What is written to the file of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Csv,
    Svg,
}

/// A file that a curve is written to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct CurveFile {
    pub path: PathBuf,
    form: Form,
}

impl CurveFile {
    /// The file at `path`, whose ending tells what is written.
    ///
    /// # Errors
    /// [`Error::Usage`] if it is another than .csv or .svg.
    pub(super) fn new(path: &Path) -> Result<Self> {
        let extension = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_lowercase();
        let form = match extension.as_str() {
            "csv" => Form::Csv,
            "svg" => Form::Svg,
            _ => {
                let path = path.display();
                return Err(Error::Usage(format!("{path}: the file of --curve must end in .csv or .svg")));
            }
        };
        Ok(Self { path: path.to_owned(), form })
    }

    /// What this curve is in this form.
    fn encode(&self, curve: &dyn Tabled, title: &str, (key, status): (&str, Status)) -> Result<Vec<u8>> {
        let end = self.form.end(key, status);
        match self.form {
            Form::Csv => Ok(curve.csv(word(status), short(key)).into_bytes()),
            Form::Svg => Ok(format!("{}\n{end}\n", curve.plot(title.to_owned())?.trim_end()).into_bytes()),
        }
    }

    /// What is there: the text of a file, as far as it matters, if it is text.
    fn found(&self) -> Option<String> {
        let mut text = String::new();
        File::open(&self.path).and_then(|file| file.take(BYTES_MAX).read_to_string(&mut text)).ok().map(|_| text)
    }

    /// Whether a curve that ended like `status` must not take the place of what is there: the whole curve of the same
    /// command, while this one was cut.
    pub(super) fn should_keep(&self, key: &str, status: Status, overwrite: Overwrite) -> bool {
        if overwrite == Overwrite::Force || status != Status::Partial || !self.path.is_file() {
            return false;
        }
        let end = self.form.end(key, Status::Complete);
        self.found().is_some_and(|text| text.lines().next_back().is_some_and(|line| line.ends_with(&end)))
    }

    /// Refuses to replace a file that is no curve of the same command.
    ///
    /// # Errors
    /// [`Error::Usage`] if it would.
    pub(super) fn check_replaceable(&self, key: &str, overwrite: Overwrite) -> Result<()> {
        if overwrite == Overwrite::Force || !self.path.is_file() {
            return Ok(());
        }
        let text = self.found().unwrap_or_default();
        let last_line = text.lines().next_back().unwrap_or_default();
        let is_curve = match self.form {
            Form::Csv => [curve::CSV_HEADER, cells::CSV_HEADER].iter().any(|header| text.starts_with(header)),
            Form::Svg => last_line.starts_with(SVG_END),
        };
        let mut ends = [Status::Complete, Status::Partial].into_iter().map(|status| self.form.end(key, status));
        let why = match (is_curve, ends.any(|end| last_line.ends_with(&end))) {
            (true, true) => return Ok(()),
            (true, false) => "made with other options",
            (false, _) => "not made by smalti",
        };
        let path = self.path.display();
        Err(Error::Usage(format!("{path} exists and was {why}; name another file, or replace it with --force")))
    }
}

/// The files that were named, checked against the other outputs and the inputs, before anything is read.
///
/// # Errors
/// [`Error::Usage`] if a file is named twice or is an input; [`Error::Output`] if it cannot be written.
pub(super) fn check_writable<'a>(
    curves: &[CurveFile],
    others: impl Iterator<Item = &'a Destination>,
    inputs: &[&Path],
) -> Result<()> {
    let mut seen: Vec<PathBuf> = others.map(|other| destination::place_of(&other.path)).collect();
    for CurveFile { path, .. } in curves {
        let place = destination::place_of(path);
        if destination::is_one_of(&place, inputs) {
            return Err(Error::Usage(format!("{} is an input; name another file for the curve", path.display())));
        }
        if seen.contains(&place) {
            return Err(Error::Usage(format!("{} is named twice as an output", path.display())));
        }
        output::check_writable(path)?;
        seen.push(place);
    }
    Ok(())
}

/// Writes a curve to its files, each in one step, and adds to `written` those that are there now; `told` are the key of its
/// result and how that ended.
///
/// # Errors
/// The first failure; the files after it are written nevertheless.
pub(super) fn write(
    files: &[&CurveFile],
    (curve, title): (&dyn Tabled, &str),
    told: (&str, Status),
    interrupt: &mut Interrupt,
    written: &mut Vec<String>,
) -> Result<()> {
    let mut outcome = Ok(());
    for file in files {
        let one = file.encode(curve, title, told).and_then(|bytes| {
            let write = || output::write_atomically(&file.path, &bytes);
            // Into a pipe it may take as long as its reader likes.
            if file.path.metadata().is_ok_and(|found| !found.is_file()) {
                write()
            } else {
                interrupt.while_writing(write)
            }
        });
        if one.is_ok() {
            written.push(file.path.display().to_string());
        }
        outcome = outcome.and(one);
    }
    outcome
}

/// How the last line of a plot begins.
const SVG_END: &str = "<!-- smalti curve ";

impl Form {
    /// How a file of this form ends, but for the line break.
    fn end(self, key: &str, status: Status) -> String {
        match self {
            Self::Csv => format!(",{},{}", word(status), short(key)),
            Self::Svg => format!("{SVG_END}{} {} -->", short(key), word(status)),
        }
    }
}

fn word(status: Status) -> &'static str {
    if status == Status::Partial { "partial" } else { "complete" }
}

fn short(key: &str) -> &str {
    key.get(..KEY_DIGITS).unwrap_or(key)
}
