//! `smalti merge`: merges the result rows of several shards or runs into one table, and lists what failed and what is
//! missing.

mod table;

use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, ValueEnum};

use crate::cli::files::destination::{self, Destination};
use crate::cli::files::places::{Inputs, place_of};
use crate::cli::files::story::{Story, story_of_file};
use crate::cli::list;
use crate::cli::list::rows::{self, ResultRow, RowParts, Rows};
use crate::cli::terminal;
use crate::cli::terminal::interrupt::Interrupt;
use crate::error::{Error, Result, in_words};
use crate::output;

/// Exit code when some pictures failed or are missing.
const EXIT_SOME_FAILED: u8 = 3;
/// How many pictures one message names, at most.
const NAMED_MAX: usize = 10;

const AFTER_HELP: &str = "\
Of several rows of one picture the newest counts. In one file that is the last. A row whose file holds another result
by now is told.

Exit codes: 0 every picture is there; 1 the output cannot be written; 2 wrong usage or unreadable input; 3 some pictures failed or \
are missing.

Examples:
  smalti merge out/results.*.jsonl -o all.jsonl
  smalti merge out -o all.csv --manifest plan/manifest.jsonl
  smalti merge out -o - --format csv | column -s, -t";

#[derive(Debug, Args)]
#[command(after_long_help = AFTER_HELP)]
pub(crate) struct MergeArgs {
    /// Files of result rows that `smalti batch` wrote, or folders with files named results*.jsonl
    #[arg(value_name = "RESULTS", required = true)]
    pub results: Vec<PathBuf>,
    /// File for the rows, one for each picture; - is stdout
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Manifest whose pictures should all have a row; repeat it for more
    #[arg(long = "manifest", value_name = "FILE")]
    pub manifests: Vec<PathBuf>,
    /// Format of the output [default: by its ending, else jsonl]
    #[arg(long, value_enum, value_name = "FORMAT")]
    pub format: Option<Format>,
    /// Replace an output that is not a file of merged rows
    #[arg(long)]
    pub force: bool,
    /// Say nothing but warnings and errors
    #[arg(short, long)]
    pub quiet: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// A row of JSON in each line
    Jsonl,
    /// A table with a heading
    Csv,
}

/// Merges the rows; returns the exit code of the process.
pub(crate) fn merge(args: &MergeArgs) -> ExitCode {
    match merge_all(args) {
        Ok(exit_code) => exit_code,
        failure @ Err(_) => terminal::exit_code(failure.map(|_| ())),
    }
}

fn merge_all(args: &MergeArgs) -> Result<ExitCode> {
    let expected = expected_ids(&args.manifests)?;
    let files = result_files(&args.results, &args.output)?;
    check_output(args, &files)?;
    let mut rows = Rows::default();
    for file in &files {
        rows.read(file)?.iter().for_each(|warning| terminal::error(warning));
    }
    let missing: Vec<&str> = expected.iter().map(String::as_str).filter(|id| !rows.contains(id)).collect();
    let rows = rows.sorted();
    let bytes = match format(args) {
        Format::Csv => table::csv(&rows)?,
        Format::Jsonl => rows.iter().flat_map(|row| [row.line.as_str(), "\n"]).collect::<String>().into_bytes(),
    };
    if is_stdout(&args.output) {
        terminal::write_stdout(&bytes)?;
    } else {
        destination::sweep_beside(std::iter::once(args.output.as_path()));
        Interrupt::listen()?.while_writing(|| output::write_atomically(&args.output, &bytes))?;
    }
    if !args.quiet {
        table::summary(&rows).iter().for_each(|line| terminal::say(line));
    }
    let failed: Vec<&ResultRow> = rows.iter().filter(|row| !row.told.is_success()).collect();
    tell_failed(&failed);
    tell_missing(&missing, expected.len());
    tell_stale(&rows);
    Ok(ExitCode::from(if failed.is_empty() && missing.is_empty() { 0 } else { EXIT_SOME_FAILED }))
}

fn tell_failed(failed: &[&ResultRow]) {
    for row in failed.iter().take(NAMED_MAX) {
        let told = &row.told;
        terminal::say(&format!(
            "{} {}: {}",
            told.status,
            told.id,
            told.error.as_deref().unwrap_or("no reason is given")
        ));
    }
    if failed.len() > NAMED_MAX {
        terminal::say(&format!("and {} more without a result", failed.len() - NAMED_MAX));
    }
}

fn tell_missing(missing: &[&str], expected_count: usize) {
    if missing.is_empty() {
        return;
    }
    let named = missing.iter().take(NAMED_MAX).copied().collect::<Vec<_>>().join(", ");
    let more = if missing.len() > NAMED_MAX { ", .." } else { "" };
    terminal::say(&format!("missing {} of {expected_count} pictures: {named}{more}", missing.len()));
}

/// Tells of rows whose files hold another result now, as far as the files are there.
fn tell_stale(rows: &[ResultRow]) {
    let stale: Vec<(&ResultRow, &PathBuf)> =
        rows.iter().filter_map(|row| Some((row, stale_file(&row.told)?))).collect();
    for (row, file) in stale.iter().take(NAMED_MAX) {
        let (id, file) = (&row.told.id, file.display());
        terminal::error(&format!("{id}: its row tells of another result than {file} holds; run the batch again"));
    }
    if stale.len() > NAMED_MAX {
        terminal::error(&format!("and {} more rows tell of other results than their files", stale.len() - NAMED_MAX));
    }
}

/// The first file of a row, if files of it tell of results, and none of them of that of the row.
fn stale_file(told: &RowParts) -> Option<&PathBuf> {
    let key = told.key.as_deref().filter(|_| told.is_success())?;
    let files = told.output.iter().filter_map(|path| Some((path, Destination::for_result(path).ok()?)));
    let files: Vec<(&PathBuf, Destination)> = files.collect();
    // The key of a row is that of its pictures; populations have one of their own.
    let has_picture = files.iter().any(|(_, file)| file.is_picture());
    let files = files.into_iter().filter(|(_, file)| file.is_picture() == has_picture);
    let stories = files.filter_map(|(path, file)| Some((path, story_of_file(&file)?)));
    let stories: Vec<(&PathBuf, Story)> = stories.collect();
    let is_there = stories.iter().any(|(_, story)| story.is_of(key));
    stories.first().filter(|_| !is_there).map(|(path, _)| *path)
}

/// The files to merge. A named folder stands for the files in it that are named like result rows, in natural order. An
/// earlier `output` in the folder is left out, unless it is named like the results of a batch.
fn result_files(paths: &[PathBuf], output: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let own_name = output.file_name().filter(|name| !is_stdout(output) && !is_name_of_batch(name));
    let own_place = place_of(output);
    for path in paths {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let entries = fs::read_dir(path)
            .map_err(|error| Error::input(path, format!("cannot be read, since {}", in_words(&error))))?;
        let names = entries.flatten().map(|entry| entry.file_name()).filter(|name| is_results_name(name));
        let is_own = |name: &OsString| Some(name.as_os_str()) == own_name && place_of(&path.join(name)) == own_place;
        let names = names.filter(|name| !is_own(name));
        let mut names: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
        names.sort_by(|a, b| natord::compare(a, b));
        if names.is_empty() {
            return Err(Error::input(path, "holds no results*.jsonl; name the output folder of smalti batch"));
        }
        files.extend(names.iter().map(|name| path.join(name)));
    }
    Ok(files)
}

fn is_results_name(name: &OsStr) -> bool {
    name.to_str().is_some_and(|name| name.starts_with("results") && name.ends_with(".jsonl"))
}

/// Whether `smalti batch` uses this name for its results by default: `results.jsonl`, or for a shard
/// `results.K-of-N.jsonl`.
fn is_name_of_batch(name: &OsStr) -> bool {
    let is_number = |text: &str| text.parse::<u32>().is_ok();
    let part = name.to_str().and_then(|name| name.strip_prefix("results")?.strip_suffix(".jsonl"));
    part.is_some_and(|part| {
        let shard = part.strip_prefix('.').and_then(|shard| shard.split_once("-of-"));
        part.is_empty() || shard.is_some_and(|(index, count)| is_number(index) && is_number(count))
    })
}

fn format(args: &MergeArgs) -> Format {
    let is_csv = args.output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
    args.format.unwrap_or(if is_csv { Format::Csv } else { Format::Jsonl })
}

fn is_stdout(path: &Path) -> bool {
    path == Path::new("-")
}

/// Refuses an output that is an input, or that exists and does not hold merged rows.
fn check_output(args: &MergeArgs, files: &[PathBuf]) -> Result<()> {
    let path = &args.output;
    if is_stdout(path) {
        return Ok(());
    }
    Inputs::new(files.iter().chain(&args.manifests).map(PathBuf::as_path)).refuse([path.as_path()])?;
    output::check_writable(path)?;
    if args.force || !path.is_file() || holds_rows(path) {
        return Ok(());
    }
    Err(Error::Usage(format!(
        "{} exists and holds no merged rows; name another file, or replace it with --force",
        path.display()
    )))
}

/// Whether a file is empty, or begins like a file of rows in one of the formats.
fn holds_rows(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    let first = BufReader::new(file.take(rows::ROW_BYTES_MAX)).lines().next();
    first.is_none_or(|line| line.is_ok_and(|line| table::is_heading(&line) || rows::is_row(&line)))
}

/// The ids of all pictures in these manifests, in order.
fn expected_ids(manifests: &[PathBuf]) -> Result<Vec<String>> {
    let mut ids = Vec::new();
    for path in manifests {
        ids.extend(list::ids(path)?);
    }
    Ok(ids)
}
