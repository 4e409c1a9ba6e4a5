//! How the work on a picture ended in either scheme, and its best population.

use super::evolution::{Evolution, Outcome, StopReason};
use super::objective;
use crate::error::{Error, Result};
use crate::model::cells::{Search, SearchState, Standing};
use crate::model::{Evaluation, Fly};

/// The counts of an evolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tally {
    /// In the paper's scheme.
    Paper {
        /// Births and restarts.
        outcome: Outcome,
        /// Births of the last run, which the clock or an interrupt may have cut short.
        births_in_last_run: u64,
        /// Whether the evolution ended before a restart at which masks change or tiles split.
        is_warming_up: bool,
    },
    /// In a search in cells.
    Cells(Standing),
}

/// How the work on a picture ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ending {
    /// Why it ended.
    pub stop: StopReason,
    /// The SAE of the mosaic, over all wanted pixels, without weights.
    pub sae: u64,
    /// What was counted.
    pub tally: Tally,
}

impl Ending {
    fn of_search(search: &mut dyn Search, stop: StopReason) -> Result<Self> {
        let (standing, sae) = (search.standing(), objective::sae(search)?);
        Ok(Self { stop, sae, tally: Tally::Cells(standing) })
    }

    /// Whether the work ran to its end, rather than being interrupted.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.stop != StopReason::Interrupted
    }

    /// The value that the work lowered: the SAE, or the objective of a search.
    #[must_use]
    pub fn objective(&self) -> i64 {
        match self.tally {
            Tally::Paper { .. } => self.sae as i64,
            Tally::Cells(standing) => standing.objective,
        }
    }

    /// Restarts that were made.
    #[must_use]
    pub fn restarts(&self) -> u32 {
        if let Tally::Paper { outcome, .. } = self.tally { outcome.restarts } else { 0 }
    }

    /// Children that took a place.
    #[must_use]
    pub fn births(&self) -> u64 {
        match self.tally {
            Tally::Paper { outcome, .. } => outcome.births,
            Tally::Cells(standing) => standing.births,
        }
    }

    /// Children that were evaluated; in the paper's scheme each is a birth.
    #[must_use]
    pub fn evals(&self) -> u64 {
        match self.tally {
            Tally::Paper { outcome, .. } => outcome.births,
            Tally::Cells(standing) => standing.evals,
        }
    }
}

/// The result of the work on a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ended {
    /// How it ended.
    pub ending: Ending,
    /// The best population.
    pub flies: Vec<Fly>,
    /// Marginal fitness of its flies.
    pub fitness: Vec<i64>,
}

impl Ended {
    /// The result of `evolution`, whose best population must have been evaluated once more.
    ///
    /// # Errors
    /// [`Error::Internal`] if that gave another SAE than before.
    pub fn of_evolution(evolution: &Evolution, evaluation: &Evaluation<'_>) -> Result<Self> {
        let (sae, scored) = (evolution.best_sae().unwrap_or_default(), evaluation.sae);
        if scored != sae {
            let sentence = format!("the best population had an SAE of {sae} and is evaluated to {scored}");
            return Err(Error::Internal(sentence));
        }
        let tally = Tally::Paper {
            outcome: evolution.outcome(),
            births_in_last_run: evolution.births_in_run(),
            is_warming_up: evolution.is_warming_up(),
        };
        let stop = evolution.stop_reason().unwrap_or(StopReason::Births);
        Ok(Self {
            ending: Ending { stop, sae, tally },
            flies: evolution.best_flies().to_vec(),
            fitness: evaluation.marginal.to_vec(),
        })
    }

    /// The result of a search that stopped for this reason.
    ///
    /// # Errors
    /// If the device fails.
    pub fn of_search(search: &mut dyn Search, stop: StopReason) -> Result<Self> {
        let ending = Ending::of_search(search, stop)?;
        search.read_back().map(|state| Self::of_state(ending, state))
    }

    /// As [`Ended::of_search`], of a search that nobody needs any more.
    ///
    /// # Errors
    /// If the device fails.
    pub fn of_last(mut search: Box<dyn Search>, stop: StopReason) -> Result<Self> {
        let ending = Ending::of_search(&mut *search, stop)?;
        search.into_state().map(|state| Self::of_state(ending, state))
    }

    fn of_state(ending: Ending, SearchState { flies, fitness, .. }: SearchState) -> Self {
        Self { ending, flies, fitness }
    }
}
