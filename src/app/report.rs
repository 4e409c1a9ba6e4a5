//! What is said at the end: the summary for people, the row of JSON for programs, and failures for both.

use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use indicatif::{BinaryBytes, HumanCount};
use serde::Serialize;
use serde_json::{Map, Value};

use super::device::Selected;
use super::interrupt::EXIT_INTERRUPTED;
use super::job::Job;
use super::options::{EvolveOptions, SchemeOptions, Verbosity};
use super::picture::SchemeName;
use super::provenance::Ending;
use super::{advice, scheme};
use crate::error::{Error, Result};
use crate::evolve::Evolution;
use crate::model::Fly;
use crate::model::cells::Standing;

/// What became of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Status {
    /// Evolved to the end.
    Complete,
    /// Interrupted; the outputs hold the best so far.
    Partial,
    /// Not evolved: only a dry run.
    Planned,
    /// Not evolved: all outputs were there, whole, from the same picture and options.
    Unchanged,
    /// Not evolved: there were outputs, and nobody asked how they came to be.
    Skipped,
    /// Not all outputs were written.
    Failed,
}

/// The result of one picture; the same fields for one picture and in a batch.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    /// The input's file name without its ending; in a batch, what its manifest says, or the path below the folder that was
    /// named.
    pub id: String,
    /// The picture, as it was named.
    pub input: String,
    pub status: Status,
    /// Why the evolution ended.
    pub stop: Option<String>,
    /// The files that were written, or would be.
    pub output: Vec<String>,
    /// SHA-256 over all that decides the result.
    pub key: Option<String>,
    pub seed: u64,
    pub scheme: &'static str,
    pub sae: Option<u64>,
    /// What was minimised: the SAE, or of a search in cells that with weights and penalties.
    pub objective: Option<i64>,
    /// Peak signal-to-noise ratio in dB; none for a perfect likeness, whose ratio is infinite.
    pub psnr: Option<f64>,
    /// Index of Clark and Evans of the tiles' positions: 1 is random, less is clustered.
    pub spread: Option<f64>,
    pub tiles: Option<usize>,
    /// Tiles of the result that live: fewer than `tiles` before the last split.
    pub living: Option<usize>,
    /// Whether the evolution was cut in a run before masks change or tiles split.
    #[serde(skip)]
    pub is_warming_up: bool,
    pub births: u64,
    /// Births of the last run, which is the one that the clock or an interrupt cut.
    pub births_in_last_run: u64,
    /// Candidates that were evaluated.
    pub evals: u64,
    pub fallback_kills: u64,
    /// Restarts made.
    pub restarts: u32,
    pub load_ms: f64,
    pub evolve_ms: f64,
    pub save_ms: f64,
    pub device: Option<String>,
    /// Part of a batch that this process did.
    pub shard: Option<String>,
    pub host: Option<String>,
    pub version: &'static str,
    /// Why it failed.
    pub error: Option<String>,
}

impl Row {
    /// The row of a picture about which nothing is known yet.
    pub(super) fn new(input: &Path, seed: u64, scheme: SchemeName) -> Self {
        Self {
            id: input.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            input: input.display().to_string(),
            status: Status::Failed,
            stop: None,
            output: Vec::new(),
            key: None,
            seed,
            scheme: scheme.word(),
            sae: None,
            objective: None,
            psnr: None,
            spread: None,
            tiles: None,
            living: None,
            is_warming_up: false,
            births: 0,
            births_in_last_run: 0,
            evals: 0,
            fallback_kills: 0,
            restarts: 0,
            load_ms: 0.0,
            evolve_ms: 0.0,
            save_ms: 0.0,
            device: None,
            shard: None,
            host: host_name(),
            version: env!("CARGO_PKG_VERSION"),
            error: None,
        }
    }

    /// Takes in how an evolution ended.
    pub(super) fn note_evolution(&mut self, evolution: &Evolution) {
        let outcome = evolution.outcome();
        self.stop = evolution.stop_reason().map(|reason| reason.word().to_owned());
        self.sae = evolution.best_sae();
        self.objective = self.sae.and_then(|sae| i64::try_from(sae).ok());
        self.living = Some(evolution.best_flies().iter().filter(|fly| fly.alive).count());
        self.is_warming_up = evolution.is_warming_up();
        self.births = outcome.births;
        self.births_in_last_run = evolution.births_in_run();
        self.evals = outcome.births;
        self.fallback_kills = outcome.fallback_kills;
        self.restarts = outcome.restarts;
    }

    /// Takes in how a search ended.
    pub(super) fn note_search(&mut self, ending: &Ending, standing: &Standing, flies: &[Fly]) {
        self.stop = Some(ending.stop.word().to_owned());
        self.sae = Some(ending.sae);
        self.objective = Some(standing.objective);
        self.living = Some(flies.iter().filter(|fly| fly.alive).count());
        self.births = standing.births;
        self.births_in_last_run = standing.births;
        self.evals = standing.evals;
    }

    /// Takes in how the evolution ended that a file tells of.
    pub(super) fn note_story(&mut self, told: &Map<String, Value>) {
        let number = |key: &str| told.get(key).and_then(Value::as_u64);
        self.stop = told.get("stop").and_then(Value::as_str).map(str::to_owned);
        self.sae = number("sae");
        self.objective = told.get("objective").or(told.get("sae")).and_then(Value::as_i64);
        self.births = number("births").unwrap_or_default();
        self.births_in_last_run = number("births_in_last_run").unwrap_or(self.births);
        self.evals = number("evals").unwrap_or(self.births);
        self.fallback_kills = number("fallback_kills").unwrap_or_default();
        self.restarts = number("restarts_made").unwrap_or_default() as u32;
    }

    /// Takes in why there is no result, or not all of it.
    pub(super) fn note_failure(&mut self, error: &Error) {
        self.status = Status::Failed;
        self.error = Some(advice::sentence(error));
    }

    /// Prints the row to stdout.
    pub(super) fn print(&self) -> Result<()> {
        print_json(self)
    }

    /// The exit code of the process.
    pub(super) fn exit_code(&self) -> u8 {
        if self.status == Status::Partial { EXIT_INTERRUPTED } else { 0 }
    }
}

/// Milliseconds with three decimals.
pub(super) fn milliseconds(duration: Duration) -> f64 {
    duration.as_micros() as f64 / 1e3
}

/// The summary of a finished evolution.
pub(super) fn print_summary(row: &Row, options: &EvolveOptions, job: &Job) {
    let count = |value: u64| HumanCount(value).to_string();
    let sae = row.sae.unwrap_or_default();
    let mean_error = sae as f64 / (job.target.pixels().len() as f64 * 3.0);
    let psnr = row.psnr.map_or("infinite PSNR".to_owned(), |db| format!("PSNR {db:.2} dB"));
    let seconds = row.evolve_ms / 1e3;
    let psnr_line = format!("SAE {}, mean error {mean_error:.2} of 255 per channel, {psnr}", count(sae));
    say(&format!("{}, {} tiles", size_line(options, job), count(job.fly_count as u64)));
    let per_s = |value: u64| count((value as f64 / seconds.max(1e-6)) as u64);
    let device = row.device.as_deref().unwrap_or_default();
    match job.scheme {
        SchemeOptions::Paper(_) => {
            say(&psnr_line);
            say(&format!(
                "{} births ({} by the fallback), {} restarts, {seconds:.2} s, {} births/s on {device}",
                count(row.births),
                count(row.fallback_kills),
                count(u64::from(row.restarts)),
                per_s(row.births),
            ));
        }
        SchemeOptions::Cells(_) => {
            let objective = row.objective.filter(|&objective| u64::try_from(objective) != Ok(sae));
            let objective =
                objective.map_or(String::new(), |objective| format!(", objective {}", count(objective.unsigned_abs())));
            say(&format!("{psnr_line}{objective}"));
            say(&format!(
                "{} evals, {} births, {seconds:.2} s, {} evals/s on {device}",
                count(row.evals),
                count(row.births),
                per_s(row.evals),
            ));
        }
    }
    let warming_up = match row.living.filter(|_| row.is_warming_up) {
        Some(living) if Some(living) != row.tiles => {
            format!(" before the last split or change of masks, with {} tiles alive", count(living as u64))
        }
        Some(_) => " before the last change of masks".to_owned(),
        None => String::new(),
    };
    say(&format!("seed {}, stopped by {}{warming_up}", row.seed, row.stop.as_deref().unwrap_or_default()));
    if options.verbosity == Verbosity::Verbose {
        say(&format!("read in {:.0} ms, encoded and written in {:.0} ms", row.load_ms, row.save_ms));
        say(&format!("SHA-256 of the input {}", job.input_sha256));
        say(&format!("key of the result {}", row.key.as_deref().unwrap_or_default()));
    }
    if let Some(look) = look_line(options, job) {
        say(&look);
    }
    let partial = if row.status == Status::Partial {
        " (partial; the same command starts over, and --init goes on from a .npz)"
    } else {
        ""
    };
    let written = if row.output.is_empty() { "nothing".to_owned() } else { row.output.join(", ") };
    say(&format!("wrote {written}{partial}"));
}

/// What a dry run says.
pub(super) fn print_plan(row: &Row, options: &EvolveOptions, job: &Job, memory_bytes: u64) {
    let begin = options.init.as_ref().map(|path| path.display().to_string());
    say(&size_line(options, job));
    let fly_count = HumanCount(job.fly_count as u64);
    match &job.scheme {
        SchemeOptions::Paper(scheme) => {
            say(&format!("tiles      {fly_count} from {}", begin.as_deref().unwrap_or("random")));
            say(&format!(
                "births     {} in each of {} runs, {} at a time, scheme paper, seed {}",
                HumanCount(scheme.births),
                u64::from(scheme.restarts) + 1,
                scheme.batch_births,
                row.seed
            ));
        }
        SchemeOptions::Cells(cells) => {
            say(&format!("tiles      {fly_count} from {}", begin.as_deref().unwrap_or("none")));
            let evals = HumanCount(cells.budget(job.fly_count).evals);
            say(&format!("evals      {evals}, scheme cells, seed {}", row.seed));
        }
    }
    if let Some(look) = look_line(options, job) {
        say(&format!("looks      {look}"));
    }
    if let Some(limit) = options.time_limit {
        say(&format!("time       at most {} s", limit.as_secs_f64()));
    }
    say(&format!("memory     about {}", BinaryBytes(memory_bytes)));
    say(&format!("device     {}", row.device.as_deref().unwrap_or_default()));
    say(&format!("would write {}", row.output.join(", ")));
    say(&format!("key        {}", row.key.as_deref().unwrap_or_default()));
}

/// What was asked for beyond plain tiles in evolved colours, if anything was.
fn look_line(options: &EvolveOptions, job: &Job) -> Option<String> {
    let mut told = Vec::new();
    if job.dress.is_some() {
        told.push(options.look.describe());
    }
    told.extend(job.color_count.map(|count| format!("{count} colours")));
    told.extend(job.palette.as_ref().map(|palette| format!("palette of {}", palette.colors().len())));
    told.extend(match &job.scheme {
        SchemeOptions::Paper(scheme) => scheme::told(scheme),
        SchemeOptions::Cells(cells) => cells.told(job),
    });
    (!told.is_empty()).then(|| told.join("; "))
}

/// The input with its sizes: as read, and as evolved if that is smaller.
fn size_line(options: &EvolveOptions, job: &Job) -> String {
    let (width_px, height_px) = job.original_size_px;
    let fitted = (job.target.width_px(), job.target.height_px());
    let reduced =
        if fitted == job.original_size_px { String::new() } else { format!(", reduced to {}x{}", fitted.0, fitted.1) };
    format!("{}: {width_px}x{height_px} px{reduced}", options.input.display())
}

/// Prints a value as one line of JSON to stdout.
pub(super) fn print_json(value: &impl Serialize) -> Result<()> {
    let mut line = serde_json::to_vec(value).map_err(|error| Error::Internal(format!("no JSON: {error}")))?;
    line.push(b'\n');
    write_stdout(&line)
}

/// Writes text to stdout. That nobody reads on is no failure: the reader has what it wants.
pub(super) fn write_stdout(bytes: &[u8]) -> Result<()> {
    match write_whole(bytes) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Error::output(Path::new("stdout"), format!("cannot be written ({error})")))
        }
        _ => Ok(()),
    }
}

/// Writes a picture to stdout, all of it: a reader that goes away has no picture.
pub(super) fn write_picture_to_stdout(bytes: &[u8]) -> Result<()> {
    write_whole(bytes).map_err(|error| {
        let reason = match error.kind() {
            io::ErrorKind::BrokenPipe => {
                "its reader went away before it had the picture; name a file instead".to_owned()
            }
            _ => format!("cannot be written ({error}); name a file instead"),
        };
        Error::output(Path::new("stdout"), reason)
    })
}

fn write_whole(bytes: &[u8]) -> io::Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(bytes)?;
    out.flush()
}

/// Prints a line to stderr; if that fails there is nowhere left to say so.
pub(super) fn say(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// Says that the CPU computes, to those who did not ask for it.
pub(super) fn say_device(selected: &Selected) {
    if let Selected::Cpu { reason: Some(reason) } = selected {
        say(&format!("smalti: computing on the CPU, since {reason}"));
    }
}

/// The exit code of what was done, after a failure has been printed.
pub(super) fn exit_code(done: Result<()>) -> ExitCode {
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            error(&advice::sentence(&failure));
            ExitCode::from(advice::exit_code(&failure))
        }
    }
}

/// Prints a failure.
pub(super) fn error(sentence: &str) {
    say(&format!("smalti: {sentence}"));
}

/// The name of this machine.
pub(super) fn host_name() -> Option<String> {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").or_else(|_| std::env::var("HOSTNAME"));
    name.ok().map(|name| name.trim().to_owned()).filter(|name| !name.is_empty())
}
