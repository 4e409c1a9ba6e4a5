//! The files of `--curve`: where they may go, and what they contain.
//!
//! A curve may replace an existing file if that is a curve of the same command and got no further. The key tells which
//! command made it: it is in the last column of the CSV and in the last line of the SVG. Any other file is replaced
//! only with `--force`.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::destination::{Destination, Overwrite};
use super::places::{Inputs, place_of};
use super::story::Story;
use crate::archive::KEY_DIGITS;
use crate::cli::terminal::interrupt::Interrupt;
use crate::error::{Error, Result};
use crate::evolve::Ending;
use crate::output;

/// The first line of a curve of the paper's scheme as CSV.
pub(crate) const PAPER_CSV_HEADER: &str =
    "run,births_in_run,births,sae,best_sae,clark_evans,z_spread,color_spread,log_size_spread,angle_spread,status,key\n";
/// The first line of a curve of a search as CSV.
pub(crate) const CELLS_CSV_HEADER: &str = "rounds,evals,births,sae,objective,living,clark_evans,z_spread,color_spread,\
                                           log_size_spread,angle_spread,status,key\n";

/// How many bytes of a file are read, at most, to see whether it is a curve. A curve is many times smaller.
const BYTES_MAX: u64 = 1 << 24;

/// A curve of any scheme.
pub(crate) trait Tabled: Send {
    /// The points as CSV; every row ends with the `status` of the evolution and the first digits of the result's `key`.
    fn csv(&self, status: &str, key: &str) -> String;

    /// The points as a plot.
    ///
    /// # Errors
    /// If there are none.
    fn plot(&self, title: String) -> Result<String>;
}

/// The format of a curve's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Csv,
    Svg,
}

/// The curve of an evolution that has ended, with what its files tell besides the points.
#[derive(Clone, Copy)]
pub(crate) struct EndedCurve<'a> {
    pub curve: &'a dyn Tabled,
    /// The title of the plot.
    pub title: &'a str,
    /// The key of the result.
    pub key: &'a str,
    pub ending: &'a Ending,
}

/// A file that a curve is written to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct CurveFile {
    pub path: PathBuf,
    form: Form,
}

impl CurveFile {
    /// The file at `path`; its ending decides the format.
    ///
    /// # Errors
    /// [`Error::Usage`] if it ends in anything but .csv or .svg.
    pub(crate) fn new(path: &Path) -> Result<Self> {
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

    /// The bytes of the file for this curve.
    fn encode(&self, ended: EndedCurve<'_>) -> Result<Vec<u8>> {
        let EndedCurve { curve, title, key, ending } = ended;
        let status = word(ending.is_complete());
        match self.form {
            Form::Csv => Ok(curve.csv(status, short(key)).into_bytes()),
            Form::Svg => {
                let far = format!("{SVG_FAR}{} {} -->", ending.restarts(), ending.objective());
                let end = self.form.end(key, status);
                Ok(format!("{}\n{far}\n{end}\n", curve.plot(title.to_owned())?.trim_end()).into_bytes())
            }
        }
    }

    /// The beginning of the existing file, up to [`BYTES_MAX`], if it is text.
    fn found(&self) -> Option<String> {
        let mut text = String::new();
        File::open(&self.path).and_then(|file| file.take(BYTES_MAX).read_to_string(&mut text)).ok().map(|_| text)
    }

    /// Whether the existing file must stay: it is a curve of the same command that got farther than an evolution that
    /// ended like `ending`.
    pub(crate) fn should_keep(&self, key: &str, ending: &Ending, overwrite: Overwrite) -> bool {
        if overwrite == Overwrite::Force || !self.path.is_file() {
            return false;
        }
        let story = self.found().and_then(|text| self.form.story(&text));
        story.is_some_and(|story| story.is_of(key) && story.is_better_than(ending))
    }

    /// Refuses to replace a file that is not a curve of the same command.
    ///
    /// # Errors
    /// [`Error::Usage`] if it would.
    pub(crate) fn check_replaceable(&self, key: &str, overwrite: Overwrite) -> Result<()> {
        if overwrite == Overwrite::Force || !self.path.is_file() {
            return Ok(());
        }
        let text = self.found().unwrap_or_default();
        let last_line = text.lines().next_back().unwrap_or_default();
        let is_curve = match self.form {
            Form::Csv => [PAPER_CSV_HEADER, CELLS_CSV_HEADER].iter().any(|header| text.starts_with(header)),
            Form::Svg => last_line.starts_with(SVG_END),
        };
        let mut ends = [true, false].into_iter().map(|is_complete| self.form.end(key, word(is_complete)));
        let why = match (is_curve, ends.any(|end| last_line.ends_with(&end))) {
            (true, true) => return Ok(()),
            (true, false) => "made with other options",
            (false, _) => "not made by smalti",
        };
        let path = self.path.display();
        Err(Error::Usage(format!("{path} exists and was {why}; name another file, or replace it with --force")))
    }
}

/// Checks the files that were named against the other outputs and the inputs, before anything is read.
///
/// # Errors
/// [`Error::Usage`] if a file is named twice or is an input; [`Error::Output`] if it cannot be written.
pub(crate) fn check_writable<'a>(
    curves: &[CurveFile],
    others: impl Iterator<Item = &'a Destination>,
    inputs: &Inputs,
) -> Result<()> {
    let mut seen: Vec<PathBuf> = others.map(|other| place_of(&other.path)).collect();
    for CurveFile { path, .. } in curves {
        let place = place_of(path);
        if inputs.has(path) {
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

/// Writes a curve to its files, each in one step, and adds those that succeeded to `written`.
///
/// # Errors
/// The first failure. The files after it are written all the same.
pub(crate) fn write(
    files: &[&CurveFile],
    ended: EndedCurve<'_>,
    interrupt: &Interrupt,
    written: &mut Vec<String>,
) -> Result<()> {
    let mut outcome = Ok(());
    for file in files {
        let one = file.encode(ended).and_then(|bytes| {
            let write = || output::write_atomically(&file.path, &bytes);
            // Writing into a pipe may take as long as the reader likes, and must stay interruptible.
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

/// How the line before the last one of a plot begins. It tells the restarts made, and the value of what the evolution
/// lowers.
const SVG_FAR: &str = "<!-- smalti came to ";
/// How the last line of a plot begins.
const SVG_END: &str = "<!-- smalti curve ";

impl Form {
    /// How a file of this form ends, without the line break.
    fn end(self, key: &str, status: &str) -> String {
        match self {
            Self::Csv => format!(",{status},{}", short(key)),
            Self::Svg => format!("{SVG_END}{} {status} -->", short(key)),
        }
    }

    /// What a curve of this form tells of its result, and how far that got, if it says so.
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
            is_complete: status != word(false),
            lowered: lowered.and_then(|lowered| lowered.parse().ok()),
            restarts_made: restarts_made.and_then(|restarts| restarts.parse().ok()),
        })
    }
}

fn word(is_complete: bool) -> &'static str {
    if is_complete { "complete" } else { "partial" }
}

fn short(key: &str) -> &str {
    key.get(..KEY_DIGITS).unwrap_or(key)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evolve::{Outcome, StopReason, Tally};
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
        use StopReason::{Evals as Complete, Interrupted as Partial};
        let folder = tempfile::tempdir().expect("a temporary folder");
        let searched = |stop, objective| {
            let standing = Standing { objective, ..Standing::default() };
            Ending { stop, sae: 7, tally: Tally::Cells(standing) }
        };
        let evolved = |stop, (restarts, sae)| {
            let outcome = Outcome { restarts, ..Outcome::default() };
            Ending { stop, sae, tally: Tally::Paper { outcome, births_in_last_run: 0, is_warming_up: false } }
        };
        let of_search = |objective| Short(format!("{CELLS_CSV_HEADER}0,0,0,7,{objective},9,,0,0,0,0"));
        let of_run = |run, sae| Short(format!("{PAPER_CSV_HEADER}{run},0,0,9,{sae},,0,0,0,0"));
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
                let bytes = file
                    .encode(EndedCurve { curve: &old.0, title: "title", key: KEY, ending: &old.1 })
                    .expect("it can be drawn");
                std::fs::write(&file.path, bytes).expect("the folder is ours");
                file.check_replaceable(KEY, Overwrite::Refuse).expect("it is of the same command");
                assert_eq!(file.should_keep(KEY, &new, Overwrite::Refuse), stays, "{name}: {:?}, {new:?}", old.1);
                assert!(!file.should_keep(KEY, &new, Overwrite::Force));
                assert!(!file.should_keep(&"f".repeat(32), &new, Overwrite::Refuse), "another command");
            }
        }
    }
}
