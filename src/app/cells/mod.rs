//! The `cells` scheme at the command line: its flags, what they ask for, and what of that is in the key.

mod curve;
mod work;

use clap::Args;
use serde_json::{Map, Value, json};

pub(super) use self::curve::CSV_HEADER;
pub(super) use self::work::search_job;
use super::cli::EvolveArgs;
use super::job::Job;
use super::options::in_range;
use super::scheme::ColorModeName;
use super::values;
use crate::error::{Error, Result};
use crate::evolve::cells::{Budget, CELLS_VERSION, EVALS_PER_FLY};
use crate::model::Rgb;
use crate::model::cells::Rules;
use crate::model::cells::rules::{CANDIDATES_MAX, ColorSource};

/// The flags that only the `cells` scheme has.
#[derive(Debug, Args)]
#[command(next_help_heading = "Evolution with --scheme cells")]
pub(super) struct CellsArgs {
    /// Stop after so many children were evaluated (suffixes k, M) [default: 400 for each tile]
    #[arg(long, value_name = "E", value_parser = values::count)]
    pub evals: Option<u64>,
    /// Children tried in each step, 1 to 64, of which the best one counts; more is faster on a GPU [default: 1]
    #[arg(long, value_name = "K", value_parser = values::count)]
    pub candidates: Option<u64>,
}

impl CellsArgs {
    /// The first of these flags that was given.
    pub(super) fn given(&self) -> Option<&'static str> {
        let given = [("--evals", self.evals.is_some()), ("--candidates", self.candidates.is_some())];
        given.into_iter().find(|(_, is_given)| *is_given).map(|(flag, _)| flag)
    }
}

/// What was asked for, checked.
#[derive(Clone, Debug)]
pub(super) struct CellsOptions {
    pub seed: u64,
    /// Children to evaluate; `None` leaves it to the number of flies.
    evals: Option<u64>,
    target_sae: Option<u64>,
    patience: Option<u64>,
    candidates: u32,
    color: ColorSource,
}

impl CellsOptions {
    /// Checks the flags.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the flag and what it may be.
    pub(super) fn new(args: &EvolveArgs) -> Result<Self> {
        let candidates = args.cells.candidates.unwrap_or(1);
        let patience = args.patience.map(|evals| in_range("--patience", evals, (1, u64::MAX))).transpose()?;
        Ok(Self {
            seed: args.seed,
            evals: args.cells.evals,
            target_sae: args.target_sae,
            patience,
            candidates: in_range("--candidates", candidates, (1, u64::from(CANDIDATES_MAX)))? as u32,
            color: color_source(args)?,
        })
    }

    /// When the search of so many flies ends.
    pub(super) fn budget(&self, fly_count: usize) -> Budget {
        Budget {
            evals: self.evals.unwrap_or(EVALS_PER_FLY * fly_count as u64),
            target_sae: self.target_sae,
            patience: self.patience,
        }
    }

    /// The rules for tiles of the mean side `side` (1/64 px).
    pub(super) fn rules(&self, (side, fly_count): (u32, usize), background: Rgb) -> Rules {
        Rules { candidates: self.candidates, color: self.color, ..Rules::free(self.seed, side, fly_count, background) }
    }

    /// What decides the result beyond what does in every scheme.
    pub(super) fn decisive(&self, job: &Job) -> Map<String, Value> {
        let Budget { evals, target_sae, patience } = self.budget(job.fly_count);
        let told = json!({
            "algorithm": CELLS_VERSION,
            "scheme": "cells",
            "seed": self.seed,
            "evals_planned": evals,
            "candidates": self.candidates,
            "patience": patience,
            "target_sae": target_sae,
            "color_mode": color_name(self.color),
        });
        if let Value::Object(told) = told { told } else { Map::new() }
    }

    /// What differs from the defaults, for people.
    pub(super) fn told(&self) -> Vec<String> {
        let parts = [
            (self.candidates != 1, format!("the best of {} children a step", self.candidates)),
            (self.color != ColorSource::Median, format!("colours by {}", color_name(self.color))),
        ];
        parts.into_iter().filter(|(differs, _)| *differs).map(|(_, part)| part).collect()
    }
}

/// Where colours come from. The target's own pixels are the only ones that surely are of its palette.
fn color_source(args: &EvolveArgs) -> Result<ColorSource> {
    let source = match args.color_mode {
        None if args.palette.is_some() => ColorSource::Pick,
        None | Some(ColorModeName::Median) => ColorSource::Median,
        Some(ColorModeName::Mean) => ColorSource::Mean,
        Some(ColorModeName::Pick) => ColorSource::Pick,
        Some(ColorModeName::Evolved) => ColorSource::Evolved,
    };
    if args.palette.is_some() && source != ColorSource::Pick {
        let sentence = "--palette: --scheme cells holds tiles to a palette only with --color-mode pick; drop the mode, or \
                        use --scheme paper";
        return Err(Error::Usage(sentence.to_owned()));
    }
    Ok(source)
}

fn color_name(color: ColorSource) -> &'static str {
    match color {
        ColorSource::Median => "median",
        ColorSource::Mean => "mean",
        ColorSource::Pick => "pick",
        ColorSource::Evolved => "evolved",
    }
}
