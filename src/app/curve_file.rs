//! The files of `--curve`: where they may go, and what is in them.
//!
//! One rule: a file that is there is replaced if it is a curve of the same command, which its key tells (the last column
//! of the CSV, the last line of the SVG), but not by one that got less far, as a picture
//! is not; any other file only with `--force`.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::destination::{self, Destination};
use super::interrupt::Interrupt;
use super::options::Overwrite;
use super::provenance::{Ending, Story};
use super::report::Status;
use super::{cells, curve};
use crate::archive::KEY_DIGITS;
use crate::error::{Error, Result};
use crate::output;

/// Most bytes of a file that are looked at to see whether it is a curve: many times what one has.
const BYTES_MAX: u64 = 1 << 24;

/// A curve, whatever it is of.
pub(super) trait Tabled: Send {
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
    fn encode(&self, curve: &dyn Tabled, title: &str, (key, ending): (&str, &Ending)) -> Result<Vec<u8>> {
        let status = ending.status;
        match self.form {
            Form::Csv => Ok(curve.csv(word(status), short(key)).into_bytes()),
            Form::Svg => {
                let (lowered, restarts) = ending.lowered();
                let far = format!("{SVG_FAR}{restarts} {lowered} -->");
                let end = self.form.end(key, status);
                Ok(format!("{}\n{far}\n{end}\n", curve.plot(title.to_owned())?.trim_end()).into_bytes())
            }
        }
    }

    /// What is there: the text of a file, as far as it matters, if it is text.
    fn found(&self) -> Option<String> {
        let mut text = String::new();
        File::open(&self.path).and_then(|file| file.take(BYTES_MAX).read_to_string(&mut text)).ok().map(|_| text)
    }

    /// Whether the curve of an evolution that ended like `ending` must not take the place of what is there: that of the same
    /// command, which got farther.
    pub(super) fn should_keep(&self, key: &str, ending: &Ending, overwrite: Overwrite) -> bool {
        if overwrite == Overwrite::Force || !self.path.is_file() {
            return false;
        }
        let story = self.found().and_then(|text| self.form.story(&text));
        story.is_some_and(|story| story.is_of(key) && story.is_better_than(ending))
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
/// result and how its evolution ended.
///
/// # Errors
/// The first failure; the files after it are written nevertheless.
pub(super) fn write(
    files: &[&CurveFile],
    (curve, title): (&dyn Tabled, &str),
    told: (&str, &Ending),
    interrupt: &Interrupt,
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

/// How the line before the last one of a plot begins: the restarts made, and what they were to lower.
const SVG_FAR: &str = "<!-- smalti came to ";
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

    /// What a curve of this form tells of its result, and how far that came as far as it is told.
    fn story(self, text: &str) -> Option<Story> {
        let last = text.lines().next_back()?;
        let (key, status, restarts_made, lowered) = match self {
            Self::Csv => {
                let names = text.lines().next()?.split(',');
                let values: HashMap<&str, &str> = names.zip(last.split(',')).collect();
                let value = |name: &str| values.get(name).copied();
                let lowered = value("objective").or(value("best_sae"));
                (value("key")?, value("status")?, value("run"), lowered)
            }
            Self::Svg => {
                let (key, status) = last.strip_prefix(SVG_END)?.strip_suffix(" -->")?.split_once(' ')?;
                let far = text.lines().rev().nth(1).and_then(|line| line.strip_prefix(SVG_FAR)?.strip_suffix(" -->"));
                let (restarts, lowered) = far.and_then(|far| far.split_once(' ')).unzip();
                (key, status, restarts, lowered)
            }
        };
        Some(Story {
            key: key.to_owned(),
            is_complete: status != word(Status::Partial),
            lowered: lowered.and_then(|lowered| lowered.parse().ok()),
            restarts_made: restarts_made.and_then(|restarts| restarts.parse().ok()),
        })
    }
}

fn word(status: Status) -> &'static str {
    if status == Status::Partial { "partial" } else { "complete" }
}

fn short(key: &str) -> &str {
    key.get(..KEY_DIGITS).unwrap_or(key)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::provenance::Course;
    use crate::evolve::{Outcome, StopReason};
    use crate::model::cells::Standing;

    /// A curve of one point.
    struct Short(String);

    impl Tabled for Short {
        fn csv(&self, status: &str, key: &str) -> String {
            format!("{},{status},{key}\n", self.0)
        }

        fn plot(&self, _title: String) -> Result<String> {
            Ok("<svg/>".to_owned())
        }
    }

    const KEY: &str = "0123456789abcdef0123456789abcdef";

    #[test]
    fn of_two_curves_that_were_cut_the_one_that_got_farther_stays() {
        use Status::{Complete, Partial};
        let folder = tempfile::tempdir().expect("a temporary folder");
        let searched = |status, objective| {
            let standing = Standing { objective, ..Standing::default() };
            Ending { status, ..Ending::new(StopReason::Interrupted, 7, Course::Cells(standing)) }
        };
        let evolved = |status, (restarts, sae)| {
            let course = Course::Paper { outcome: Outcome { restarts, ..Outcome::default() }, births_in_last_run: 0 };
            Ending { status, ..Ending::new(StopReason::Interrupted, sae, course) }
        };
        let of_search = |objective| Short(format!("{}0,0,0,7,{objective},9,,0,0,0,0", cells::CSV_HEADER));
        let of_run = |run, sae| Short(format!("{}{run},0,0,9,{sae},,0,0,0,0", curve::CSV_HEADER));
        for (old, new, stays) in [
            ((of_search(50), searched(Partial, 50)), searched(Partial, 60), true),
            ((of_search(50), searched(Partial, 50)), searched(Partial, 40), false),
            ((of_search(50), searched(Partial, 50)), searched(Complete, 60), false),
            ((of_search(50), searched(Complete, 50)), searched(Partial, 40), true),
            ((of_run(1, 50), evolved(Partial, (1, 50))), evolved(Partial, (0, 40)), true),
            ((of_run(1, 50), evolved(Partial, (1, 50))), evolved(Partial, (1, 40)), false),
            ((of_run(1, 50), evolved(Partial, (1, 50))), evolved(Partial, (1, 60)), true),
        ] {
            for name in ["a.csv", "a.svg"] {
                let file = CurveFile::new(&folder.path().join(name)).expect("its ending is known");
                let bytes = file.encode(&old.0, "title", (KEY, &old.1)).expect("it can be drawn");
                std::fs::write(&file.path, bytes).expect("the folder is ours");
                file.check_replaceable(KEY, Overwrite::Refuse).expect("it is of the same command");
                assert_eq!(file.should_keep(KEY, &new, Overwrite::Refuse), stays, "{name}: {:?}, {new:?}", old.1);
                assert!(!file.should_keep(KEY, &new, Overwrite::Force));
                assert!(!file.should_keep(&"f".repeat(32), &new, Overwrite::Refuse), "another command");
            }
        }
    }
}
