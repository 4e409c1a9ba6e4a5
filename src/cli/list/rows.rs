//! Reads result rows back, and decides which one counts if there are several of the same picture.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::error::{Error, Result, in_words};

/// Most bytes of a line: more than any row has.
pub(crate) const ROW_BYTES_MAX: u64 = 1 << 20;
/// Most bytes of a file of rows: some four million pictures.
const FILE_BYTES_MAX: u64 = 1 << 32;
/// Most lines of a file that may be no rows.
const BAD_LINES_MAX: usize = 1_000;

/// A row of results.
#[derive(Clone, Debug)]
pub(crate) struct ResultRow {
    pub told: RowParts,
    /// The row as it was written, without the end of its line.
    pub line: String,
    /// The name of the file that it comes from.
    pub file_name: String,
}

/// The parts of a row that a merge looks at. All others are copied as they are.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct RowParts {
    pub id: String,
    pub status: String,
    #[serde(default)]
    pub shard: Option<String>,
    #[serde(default)]
    pub evolve_ms: f64,
    #[serde(default)]
    pub error: Option<String>,
    /// When the work ended, in UTC, so that the order of the texts is that of the times.
    #[serde(default)]
    ended_at: Option<String>,
    #[serde(default)]
    pub key: Option<String>,
    #[serde(default)]
    pub output: Vec<PathBuf>,
}

impl RowParts {
    /// Whether the picture is complete.
    pub(crate) fn is_success(&self) -> bool {
        matches!(self.status.as_str(), "complete" | "unchanged" | "skipped")
    }
}

/// The rows that count, one for each picture, by id.
#[derive(Debug, Default)]
pub(crate) struct Rows {
    by_id: HashMap<String, ResultRow>,
}

impl Rows {
    /// Adds the rows of a file. Returns a warning about each line that is not a row.
    ///
    /// If one file has several rows of a picture, the last one counts. If several files have one, the row that was
    /// written last counts; where rows do not tell when that was, a success, or else the row of the file that was read
    /// last.
    ///
    /// # Errors
    /// [`Error::Input`] if the file cannot be read, if none of its lines is a row, or if a line is neither a row nor
    /// the beginning of one.
    pub(crate) fn read(&mut self, path: &Path) -> Result<Vec<String>> {
        let file = File::open(path).map_err(|error| Error::input(path, unreadable(&error)))?;
        let mut reader = BufReader::new(file.take(FILE_BYTES_MAX));
        let file_name = path.file_name().unwrap_or_default().to_string_lossy();
        let mut last_of_id = HashMap::new();
        // Lines that are no rows: their numbers, and whether they may stand there all the same, unless they are last.
        let mut bad_lines: Vec<(usize, bool)> = Vec::new();
        let (mut line, mut last_number) = (Vec::new(), 0);
        for number in 1.. {
            line.clear();
            let mut limited = reader.by_ref().take(ROW_BYTES_MAX);
            let length =
                limited.read_until(b'\n', &mut line).map_err(|error| Error::input(path, unreadable(&error)))?;
            if length == 0 {
                break;
            }
            let line = line.trim_ascii();
            if line.is_empty() {
                continue;
            }
            last_number = number;
            if let Some((told, line)) = row(line) {
                let row = ResultRow { told, line, file_name: file_name.to_string() };
                last_of_id.insert(row.told.id.clone(), row);
            } else {
                bad_lines.push((number, is_torn(line) && length as u64 != ROW_BYTES_MAX));
            }
            if bad_lines.len() > BAD_LINES_MAX {
                let reason =
                    format!("has more than {BAD_LINES_MAX} lines that are no rows of results; name another file");
                return Err(Error::input(path, reason));
            }
        }
        if reader.get_ref().limit() == 0 {
            return Err(Error::input(path, "has more than 4 GiB, the limit for rows of results; name another file"));
        }
        let is_end_of_rows = |number: usize| number == last_number && !last_of_id.is_empty();
        let foreign = bad_lines.iter().find(|&&(number, may_be)| !may_be && !is_end_of_rows(number));
        let foreign = foreign.map(|&(number, _)| number);
        let warning = |&(number, _): &(usize, bool)| {
            let path = path.display();
            format!("{path}: line {number} is no whole row, as a killed process leaves it, and is skipped")
        };
        let warnings: Vec<String> = bad_lines.iter().map(warning).collect();
        // A process that was killed at its first picture may leave a single torn line.
        if last_of_id.is_empty() && (warnings.len() > 1 || foreign.is_some()) {
            return Err(Error::input(
                path,
                "holds no rows of results; name a file that smalti batch wrote, such as results.jsonl",
            ));
        }
        if let Some(number) = foreign {
            let reason = format!("line {number} is not a row of results; name files that smalti batch wrote");
            return Err(Error::input(path, reason));
        }
        last_of_id.into_values().for_each(|row| self.take(row));
        Ok(warnings)
    }

    /// Adds the row of a later file.
    fn take(&mut self, row: ResultRow) {
        let is_newer = |known: &ResultRow| match (&known.told.ended_at, &row.told.ended_at) {
            (Some(known), Some(new)) if known != new => new > known,
            _ => row.told.is_success() || !known.told.is_success(),
        };
        if self.by_id.get(&row.told.id).is_none_or(is_newer) {
            self.by_id.insert(row.told.id.clone(), row);
        }
    }

    /// Whether this picture has a row.
    pub(crate) fn contains(&self, id: &str) -> bool {
        self.by_id.contains_key(id)
    }

    /// All rows in the natural order of their ids: `2` before `10`.
    pub(crate) fn sorted(self) -> Vec<ResultRow> {
        let mut rows: Vec<ResultRow> = self.by_id.into_values().collect();
        rows.sort_by(|a, b| {
            let (a, b) = (&a.told.id, &b.told.id);
            natord::compare(a, b).then_with(|| a.cmp(b))
        });
        rows
    }
}

fn row(line: &[u8]) -> Option<(RowParts, String)> {
    let line = std::str::from_utf8(line).ok()?;
    let told = serde_json::from_str(line).ok()?;
    Some((told, line.to_owned()))
}

/// Whether a line is a row of results.
pub(crate) fn is_row(line: &str) -> bool {
    row(line.as_bytes()).is_some()
}

/// Whether a line is a row, or the beginning of one.
pub(crate) fn is_row_or_torn(line: &[u8]) -> bool {
    row(line).is_some() || is_torn(line)
}

/// Whether a line is the beginning of a JSON object that is cut off.
fn is_torn(line: &[u8]) -> bool {
    line.starts_with(b"{") && serde_json::from_slice::<IgnoredAny>(line).is_err()
}

fn unreadable(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => {
            "there is no such file; name results that smalti batch wrote".to_owned()
        }
        _ => format!("cannot be read, since {}", in_words(error)),
    }
}

/// Whether a file is empty or begins with a result row. The row may be torn, if a process was killed while it wrote its
/// first one.
pub(crate) fn holds_result_rows(path: &Path) -> bool {
    let mut head = Vec::new();
    let Ok(file) = File::open(path) else { return false };
    if BufReader::new(file.take(ROW_BYTES_MAX)).read_until(b'\n', &mut head).is_err() {
        return false;
    }
    head.is_empty() || is_row_or_torn(head.trim_ascii())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use tempfile::TempDir;

    use super::*;
    use crate::cli::terminal::advice;

    fn line(id: &str, status: &str, evolve_ms: f64) -> String {
        format!(r#"{{"id":"{id}","status":"{status}","evolve_ms":{evolve_ms},"anything":[1]}}"#)
    }

    /// A folder with these files, and their paths in the same order.
    fn files(contents: &[String]) -> (TempDir, Vec<PathBuf>) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let paths: Vec<PathBuf> =
            (0..contents.len()).map(|number| folder.path().join(format!("{number}.jsonl"))).collect();
        for (path, content) in paths.iter().zip(contents) {
            fs::write(path, content).expect("the folder is ours");
        }
        (folder, paths)
    }

    /// The ids, each with the status that counts, and the warnings.
    fn merged(contents: &[String]) -> (Vec<(String, String)>, Vec<String>) {
        let (_folder, paths) = files(contents);
        let mut rows = Rows::default();
        let warnings = paths.iter().flat_map(|path| rows.read(path).expect("it holds rows")).collect();
        let rows = rows.sorted().into_iter();
        (rows.map(|row| (row.told.id, row.told.status)).collect(), warnings)
    }

    fn expected(rows: &[(&str, &str)]) -> Vec<(String, String)> {
        rows.iter().map(|&(id, status)| (id.to_owned(), status.to_owned())).collect()
    }

    #[test]
    fn the_last_row_of_a_picture_counts_in_one_file() {
        let file = [
            line("a", "complete", 1.0),
            line("b", "failed", 1.0),
            line("a", "failed", 2.0),
            line("b", "complete", 3.0),
        ];
        assert_eq!(merged(&[file.join("\n")]).0, expected(&[("a", "failed"), ("b", "complete")]));
    }

    #[test]
    fn a_success_in_one_file_beats_a_failure_in_another_whichever_comes_first() {
        let (good, bad) = (line("a", "unchanged", 0.0), line("a", "failed", 0.0));
        for contents in [[good.clone(), bad.clone()], [bad.clone(), good.clone()]] {
            assert_eq!(merged(&contents).0, expected(&[("a", "unchanged")]));
        }
        // The last row of a file counts. It overrides an earlier success in the same file, but not one in another file.
        let contents = [good.clone(), [line("a", "complete", 0.0), bad.clone()].join("\n")];
        assert_eq!(merged(&contents).0, expected(&[("a", "unchanged")]));
        let contents = [line("a", "complete", 0.0), good];
        assert_eq!(merged(&contents).0, expected(&[("a", "unchanged")]), "of two successes the later file's");
        let contents = [line("a", "partial", 0.0), bad];
        assert_eq!(merged(&contents).0, expected(&[("a", "failed")]), "of two failures the later file's");
    }

    #[test]
    fn of_rows_that_tell_when_they_ended_the_newest_counts_in_whatever_order_the_files_are_read() {
        let at =
            |status: &str, time: &str| format!(r#"{{"id":"a","status":"{status}","ended_at":"2026-11-{time}.000Z"}}"#);
        let rows = [at("complete", "09T10:00:00"), at("failed", "10T09:00:00"), at("unchanged", "02T23:59:59")];
        for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2]] {
            assert_eq!(merged(&order.map(|number| rows[number].clone())).0, expected(&[("a", "failed")]));
        }
        // A row of an older version has no time.
        assert_eq!(merged(&[rows[1].clone(), line("a", "complete", 0.0)]).0, expected(&[("a", "complete")]));
    }

    #[test]
    fn ids_are_sorted_as_people_count() {
        let ids = ["b", "a10", "a9", "a01", "a1", "A"];
        let file = ids.map(|id| line(id, "complete", 0.0)).join("\n");
        let sorted: Vec<String> = merged(&[file]).0.into_iter().map(|(id, _)| id).collect();
        assert_eq!(sorted, ["A", "a01", "a1", "a9", "a10", "b"]);
    }

    #[test]
    fn a_torn_line_is_skipped_with_a_warning_and_the_others_count() {
        let whole = [line("a", "complete", 0.0), line("b", "complete", 0.0)].join("\n");
        let (rows, warnings) = merged(&[format!("{whole}\n{}", &line("c", "complete", 0.0)[..20])]);
        assert_eq!(rows, expected(&[("a", "complete"), ("b", "complete")]));
        assert_eq!(warnings.len(), 1);
        assert!(warnings[0].contains("0.jsonl: line 3 is no whole row"), "{warnings:?}");
        // What a process leaves that is killed at its first row, and an empty file.
        assert_eq!(merged(&["{\"id\":\"a".to_owned(), String::new()]).1.len(), 1);
    }

    #[test]
    fn only_the_last_line_or_one_that_begins_as_json_may_be_torn() {
        let whole = line("a", "complete", 0.0);
        assert_eq!(merged(&[format!("{whole}\n{{\"id\":\"b\n{whole}\n")]).1.len(), 1);
        assert_eq!(merged(&[format!("{whole}\n\0\0\0")]).1.len(), 1, "as some file systems leave it");
        for (text, told) in [
            (format!("{whole}\nDear diary\n{whole}\n"), "line 2 is not a row of results"),
            ("Dear diary\n".to_owned(), "holds no rows"),
            ("{\"input\": \"a.png\"}\n".to_owned(), "holds no rows"),
        ] {
            let (_folder, paths) = files(&[text]);
            let refusal = Rows::default().read(&paths[0]).expect_err("it is prose").to_string();
            assert!(refusal.contains(told), "{refusal}");
        }
    }

    #[test]
    fn a_file_without_any_row_is_refused_by_its_name() {
        let (_folder, paths) = files(&["first line\nsecond line\n".to_owned()]);
        let refusal = Rows::default().read(&paths[0]).expect_err("it is prose");
        assert_eq!(advice::exit_code(&refusal), 2);
        assert!(refusal.to_string().contains("0.jsonl: holds no rows"), "{refusal}");
        let refusal = Rows::default().read(Path::new("no/such.jsonl")).expect_err("it is not there");
        assert!(refusal.to_string().contains("there is no such file"), "{refusal}");
    }
}
