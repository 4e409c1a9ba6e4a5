//! The observer of an evolution: the clock, the interrupt and the progress, looked at as seldom as will do, and the
//! snapshots of its course.

use std::time::{Duration, Instant};

use super::interrupt::Interrupt;
use super::progress::{Measure, Progress, Standing};
use super::recorder::Recorder;
use crate::engine::Observer;
use crate::error::Result;
use crate::evolve::{Evolution, StopReason, cells};
use crate::model::cells::Search;

/// The clock is looked at more seldom while looks are closer together than this, and more often otherwise.
const LOOK_INTERVAL: Duration = Duration::from_millis(2);
/// Most generations between two looks at the clock.
const STRIDE_MAX: u32 = 1_024;

/// What watches an evolution besides the clock.
#[derive(Debug)]
pub(super) struct Watchers<'a> {
    pub interrupt: &'a Interrupt,
    /// Keeps snapshots, if they were asked for.
    pub recorder: Option<Recorder>,
}

/// Watches an evolution, and ends it when the time is up or somebody asked for it.
#[derive(Debug)]
pub(super) struct Watch<'a> {
    interrupt: &'a Interrupt,
    recorder: Option<&'a mut Recorder>,
    time_limit: Option<Duration>,
    progress: Progress,
    began: Instant,
    last_look: Duration,
    /// Generations between two looks at the clock: they take microseconds on the CPU, and may take seconds elsewhere.
    stride: u32,
    until_look: u32,
    /// Evals that a search is to make.
    evals_planned: u64,
}

impl<'a> Watch<'a> {
    /// Begins to watch; the clock runs from now on.
    pub(super) fn begin(watchers: &'a mut Watchers<'_>, time_limit: Option<Duration>, progress: Progress) -> Self {
        Self {
            interrupt: watchers.interrupt,
            recorder: watchers.recorder.as_mut(),
            time_limit,
            progress,
            began: Instant::now(),
            last_look: Duration::ZERO,
            stride: 1,
            until_look: 0,
            evals_planned: 0,
        }
    }

    /// For a search of so many evals.
    pub(super) fn of_search(self, evals_planned: u64) -> Self {
        Self { evals_planned, ..self }
    }

    /// Ends the progress and the record of `evolution`, the only one; returns the time since the beginning.
    pub(super) fn finish(self, evolution: &Evolution) -> Duration {
        if let Some(recorder) = self.recorder {
            recorder.finish(evolution);
        }
        self.progress.finish();
        self.began.elapsed()
    }

    /// As [`Watch::finish`], of a search.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn finish_search(self, search: &mut dyn Search) -> Result<Duration> {
        self.progress.finish();
        let took = self.began.elapsed();
        self.recorder.map_or(Ok(()), |recorder| recorder.finish_search(search))?;
        Ok(took)
    }

    /// Looks at the clock; a reason ends the evolution.
    fn look(&mut self, evolutions: &[Evolution]) -> Option<StopReason> {
        let elapsed = self.began.elapsed();
        let since_last = elapsed - self.last_look;
        self.stride =
            if since_last < LOOK_INTERVAL { (self.stride * 2).min(STRIDE_MAX) } else { self.stride.div_ceil(2) };
        self.until_look = self.stride;
        self.last_look = elapsed;
        if self.progress.is_due(elapsed) {
            self.progress.show(&Standing {
                elapsed,
                unit: "births",
                count: evolutions.iter().map(|evolution| evolution.outcome().births).sum(),
                planned: evolutions.iter().map(Evolution::births_planned).fold(0, u64::saturating_add),
                measure: Measure::Sae,
                error: evolutions.iter().filter_map(Evolution::best_sae).sum(),
                time_limit: self.time_limit,
            });
        }
        self.time_limit.is_some_and(|limit| elapsed >= limit).then_some(StopReason::Time)
    }
}

impl Observer for Watch<'_> {
    fn at_start(&mut self, evolutions: &[Evolution]) {
        if let (Some(recorder), [evolution]) = (&mut self.recorder, evolutions) {
            recorder.note(evolution);
        }
    }

    fn after_generation(&mut self, evolutions: &[Evolution]) -> Option<StopReason> {
        if let (Some(recorder), [evolution]) = (&mut self.recorder, evolutions) {
            recorder.note(evolution);
        }
        if self.interrupt.is_requested() {
            return Some(StopReason::Interrupted);
        }
        if self.until_look > 0 {
            self.until_look -= 1;
            return None;
        }
        self.look(evolutions)
    }
}

impl cells::Observer for Watch<'_> {
    fn at_start(&mut self, search: &mut dyn Search) -> Result<()> {
        self.after_round(search)
    }

    fn looks_at_rounds(&self) -> bool {
        self.recorder.is_some()
    }

    fn after_round(&mut self, search: &mut dyn Search) -> Result<()> {
        self.recorder.as_mut().map_or(Ok(()), |recorder| recorder.note_search(search))
    }

    fn after_epoch(&mut self, search: &mut dyn Search) -> Result<Option<StopReason>> {
        if self.interrupt.is_requested() {
            return Ok(Some(StopReason::Interrupted));
        }
        let elapsed = self.began.elapsed();
        if self.progress.is_due(elapsed) {
            let (standing, is_sae) = (search.standing(), cells::lowers_sae_alone(search.course()));
            self.progress.show(&Standing {
                elapsed,
                unit: "evals",
                count: standing.evals,
                planned: self.evals_planned,
                measure: if is_sae { Measure::Sae } else { Measure::Objective },
                error: standing.objective.unsigned_abs(),
                time_limit: self.time_limit,
            });
        }
        Ok(self.time_limit.is_some_and(|limit| elapsed >= limit).then_some(StopReason::Time))
    }
}
