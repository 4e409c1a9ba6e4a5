//! How far a picture has come, for a callback that may end it.

use super::job::Job;
use super::tile::Tile;
use crate::error::Result;
use crate::evolve::{Observer, Seen, Stage, StopReason};
use crate::model::Population;

/// Births of the paper's scheme between two calls: some milliseconds of work.
const BIRTHS_PER_CALL: u64 = 256;

/// How far a picture has come.
pub struct Progress<'a, 'b> {
    seen: &'a mut Seen<'b>,
    job: &'a Job,
    stage: Stage,
}

impl<'a, 'b> Progress<'a, 'b> {
    fn new(seen: &'a mut Seen<'b>, job: &'a Job) -> Self {
        let stage = seen.stage();
        Self { seen, job, stage }
    }

    /// How much of the budget is spent, 0 to 1.
    #[must_use]
    pub fn share(&self) -> f64 {
        share(self.stage.evals, self.job)
    }

    /// Children that were evaluated; in the paper's scheme each is a birth.
    #[must_use]
    pub fn evals(&self) -> u64 {
        self.stage.evals
    }

    /// New tiles that took a place; tiles that were only changed do not count.
    #[must_use]
    pub fn births(&self) -> u64 {
        self.stage.births
    }

    /// What is lowered, of the best population so far: the SAE, with the penalties of the style and the weights if
    /// there are any.
    #[must_use]
    pub fn objective(&self) -> i64 {
        self.stage.error
    }

    /// The sum of absolute errors of the best population so far.
    ///
    /// # Errors
    /// If the device fails.
    pub fn sae(&mut self) -> Result<u64> {
        self.seen.sae()
    }

    /// The tiles of the best population so far.
    ///
    /// # Errors
    /// If the device fails.
    pub fn tiles(&mut self) -> Result<Vec<Tile>> {
        let flies = self.seen.best_flies()?;
        Ok(Tile::of(&flies, None).collect())
    }

    /// The best population so far, which can be drawn, kept, and begun from.
    ///
    /// # Errors
    /// If the device fails.
    pub fn population(&mut self) -> Result<Population> {
        let flies = self.seen.best_flies()?;
        Ok(self.job.population(flies))
    }
}

/// How much of the budget of a job so many evals are.
pub(super) fn share(evals: u64, job: &Job) -> f64 {
    (evals as f64 / job.evals_planned().max(1) as f64).min(1.0)
}

/// Calls a callback after every round, or after some births; it ends the work by returning false.
pub(super) struct Caller<'a, F> {
    job: &'a Job,
    call: F,
    due: u64,
}

impl<'a, F: FnMut(&mut Progress<'_, '_>) -> bool> Caller<'a, F> {
    pub fn new(job: &'a Job, call: F) -> Self {
        Self { job, call, due: 0 }
    }

    fn call(&mut self, seen: &mut Seen<'_>) -> bool {
        (self.call)(&mut Progress::new(seen, self.job))
    }
}

impl<F: FnMut(&mut Progress<'_, '_>) -> bool> Observer for Caller<'_, F> {
    fn looks_at_rounds(&self) -> bool {
        true
    }

    fn after_round(&mut self, seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
        if let Seen::Evolutions(evolutions) = seen {
            let births = evolutions.iter().map(|evolution| evolution.outcome().births).sum::<u64>();
            if births < self.due {
                return Ok(None);
            }
            self.due = births + BIRTHS_PER_CALL;
        }
        Ok((!self.call(seen)).then_some(StopReason::Interrupted))
    }
}
