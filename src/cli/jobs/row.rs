//! The result of a picture as a row that programs can read.

use std::path::Path;
use std::time::SystemTime;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::cli::terminal::interrupt::EXIT_INTERRUPTED;
use crate::cli::terminal::{advice, host_name, print_json};
use crate::error::{Error, Result};
use crate::evolve::{Ending, Spread, Tally};
use crate::model::Population;
use crate::studio::Scheme;

/// The outcome of the work on a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Status {
    /// Evolved to the end.
    Complete,
    /// Interrupted: the outputs hold the best population so far.
    Partial,
    /// Not evolved: this was a dry run.
    Planned,
    /// Not evolved: all outputs existed already, complete and made from the same picture and options.
    Unchanged,
    /// Not evolved: outputs existed already, and they were kept without a look at how they were made.
    Skipped,
    /// Not all outputs were written.
    Failed,
}

/// The result of one picture. A single picture and a batch have the same fields.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Row {
    /// The input's file name without its ending. In a batch: the id in the manifest, or the path below the named
    /// folder.
    pub id: String,
    /// The path of the picture, as the user wrote it.
    pub input: String,
    pub status: Status,
    /// Why the evolution ended.
    pub stop: Option<String>,
    /// The files that were written; in a dry run, those that would be.
    pub output: Vec<String>,
    /// SHA-256 over everything that decides the result.
    pub key: Option<String>,
    pub seed: u64,
    pub scheme: &'static str,
    pub sae: Option<u64>,
    /// What was minimised: the SAE or, for a search in cells, the SAE with weights and penalties.
    pub objective: Option<i64>,
    /// Peak signal-to-noise ratio in dB; none for a perfect likeness, whose ratio is infinite.
    pub psnr: Option<f64>,
    /// Clark-Evans index of the tiles' positions: 1 is random, less is clustered.
    pub spread: Option<f64>,
    pub tiles: Option<usize>,
    /// Tiles of the result that live. With mitosis there are fewer than `tiles` before the last split.
    pub living: Option<usize>,
    /// Whether the evolution was interrupted before a restart at which masks change or tiles split.
    #[serde(skip)]
    pub is_warming_up: bool,
    pub births: u64,
    /// Births of the last run, which the clock or an interrupt may have cut short.
    pub births_in_last_run: u64,
    /// Candidates that were evaluated.
    pub evals: u64,
    pub fallback_kills: u64,
    /// Restarts made.
    pub restarts: u32,
    pub load_ms: f64,
    pub evolve_ms: f64,
    pub save_ms: f64,
    /// When the work on the picture ended, in UTC.
    pub ended_at: Option<String>,
    pub device: Option<String>,
    /// The part of a batch that this process did.
    pub shard: Option<String>,
    pub host: Option<String>,
    pub version: &'static str,
    /// Why the picture failed.
    pub error: Option<String>,
}

/// What an earlier row tells of a result that its files do not.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Figures {
    pub psnr: Option<f64>,
    pub spread: Option<f64>,
    pub living: Option<usize>,
    pub evolve_ms: f64,
    pub device: Option<String>,
    pub host: Option<String>,
}

impl Row {
    /// The row of a picture before anything else is known about it.
    pub fn new(input: &Path, seed: u64, scheme: Scheme) -> Self {
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
            ended_at: None,
            device: None,
            shard: None,
            host: host_name(),
            version: env!("CARGO_PKG_VERSION"),
            error: None,
        }
    }

    /// Notes how tiles are spread, and how many live.
    pub fn note_population(&mut self, population: &Population) {
        let Population { width_px, height_px, flies, .. } = population;
        self.spread = Spread::of(flies, *width_px, *height_px).clark_evans;
        self.living = Some(flies.iter().filter(|fly| fly.alive).count());
    }

    /// Notes how the evolution ended, and its counts.
    pub fn note_ending(&mut self, ending: &Ending) {
        self.stop = Some(ending.stop.word().to_owned());
        self.sae = Some(ending.sae);
        self.objective = Some(ending.objective());
        self.births = ending.births();
        self.births_in_last_run = self.births;
        self.evals = ending.evals();
        if let Tally::Paper { outcome, births_in_last_run, is_warming_up } = ending.tally {
            self.births_in_last_run = births_in_last_run;
            self.is_warming_up = is_warming_up;
            self.fallback_kills = outcome.fallback_kills;
            self.restarts = outcome.restarts;
        }
    }

    /// Notes how an evolution ended, from the metadata of its file.
    pub fn note_story(&mut self, told: &Map<String, Value>) {
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

    /// Notes that the work has ended now.
    pub fn note_end(&mut self) {
        self.ended_at = Some(humantime::format_rfc3339_millis(SystemTime::now()).to_string());
    }

    /// Notes the figures of an earlier row of the same result, which its files do not tell.
    pub fn note_figures(&mut self, figures: Figures) {
        let Figures { psnr, spread, living, evolve_ms, device, host } = figures;
        (self.psnr, self.spread, self.living, self.evolve_ms, self.device, self.host) =
            (psnr, spread, living, evolve_ms, device, host);
    }

    /// Notes why the result is missing or incomplete.
    pub fn note_failure(&mut self, error: &Error) {
        self.status = Status::Failed;
        self.error = Some(advice::sentence(error));
    }

    /// Prints the row to stdout.
    pub fn print(&self) -> Result<()> {
        print_json(self)
    }

    /// The exit code of the process.
    pub fn exit_code(&self) -> u8 {
        if self.status == Status::Partial { EXIT_INTERRUPTED } else { 0 }
    }
}
