//! Watches an evolution: it minds the clock, the interrupt and the progress as seldom as possible, and has snapshots
//! taken.

use std::time::{Duration, Instant};

use super::recorder::Recorder;
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::progress::{EvolutionProgress, Measure, Progress};
use crate::error::Result;
use crate::evolve::{Brake, Observer, Seen, Stage, StopReason};
use crate::studio::{Scheme, Settings};

/// The aimed-at time between two looks at the clock. After a shorter time the next look comes later, after a longer one
/// earlier.
const LOOK_INTERVAL: Duration = Duration::from_millis(2);
/// Most generations or epochs between two looks at the clock.
const STRIDE_MAX: u32 = 1_024;

/// What can end or record an evolution besides the clock.
#[derive(Debug)]
pub(crate) struct Watchers<'a> {
    pub interrupt: &'a Interrupt,
    /// Keeps snapshots, if they were asked for.
    pub recorder: Option<Recorder>,
}

/// Watches an evolution, and ends it when the time is up or the user interrupts.
#[derive(Debug)]
pub(crate) struct Watch<'a> {
    interrupt: &'a Interrupt,
    recorder: Option<&'a mut Recorder>,
    time_limit: Option<Duration>,
    progress: Progress,
    /// What is counted: births or evals.
    unit: &'static str,
    planned: u64,
    began: Instant,
    last_look: Duration,
    /// Generations or epochs between two looks at the clock. One takes microseconds on the CPU, and may take seconds on
    /// a device.
    stride: u32,
    until_look: u32,
}

impl<'a> Watch<'a> {
    /// Begins to watch an evolution that plans this many evals. The clock runs from now on.
    pub fn begin(watchers: &'a mut Watchers<'_>, settings: &Settings, progress: Progress, planned: u64) -> Self {
        Self {
            interrupt: watchers.interrupt,
            recorder: watchers.recorder.as_mut(),
            time_limit: settings.time_limit,
            progress,
            unit: if settings.scheme.name() == Scheme::Paper { "births" } else { "evals" },
            planned,
            began: Instant::now(),
            last_look: Duration::ZERO,
            stride: 1,
            until_look: 0,
        }
    }

    /// Removes the progress; returns the time since the beginning.
    pub fn finish(self) -> Duration {
        self.progress.finish();
        self.began.elapsed()
    }

    /// Whether work whose stage is `stage` goes on, which asks after every step.
    pub fn goes_on(&mut self, stage: impl FnOnce() -> Stage) -> bool {
        self.after_step(stage).is_none()
    }

    /// Why the work ends here, if it does; looks at the clock now and then.
    fn after_step(&mut self, stage: impl FnOnce() -> Stage) -> Option<StopReason> {
        if self.interrupt.is_requested() {
            return Some(StopReason::Interrupted);
        }
        if self.until_look > 0 {
            self.until_look -= 1;
            return None;
        }
        self.look(stage)
    }

    /// Looks at the clock. A returned reason ends the evolution.
    fn look(&mut self, stage: impl FnOnce() -> Stage) -> Option<StopReason> {
        let elapsed = self.began.elapsed();
        let since_last = elapsed - self.last_look;
        self.stride =
            if since_last < LOOK_INTERVAL { (self.stride * 2).min(STRIDE_MAX) } else { self.stride.div_ceil(2) };
        self.until_look = self.stride - 1;
        self.last_look = elapsed;
        if self.progress.is_due(elapsed) {
            let stage = stage();
            let is_heard = self.progress.show(&EvolutionProgress {
                elapsed,
                unit: self.unit,
                count: stage.evals,
                planned: self.planned,
                measure: if stage.is_sae { Measure::Sae } else { Measure::Objective },
                error: stage.error.unsigned_abs(),
                time_limit: self.time_limit,
            });
            if !is_heard {
                return Some(StopReason::Interrupted);
            }
        }
        self.time_limit.is_some_and(|limit| elapsed >= limit).then_some(StopReason::Time)
    }
}

impl Observer for Watch<'_> {
    fn at_start(&mut self, seen: &mut Seen<'_>) -> Result<()> {
        self.after_round(seen).map(|_| ())
    }

    fn looks_at_rounds(&self) -> bool {
        self.recorder.is_some()
    }

    fn brake(&self) -> Brake {
        let interrupt = self.interrupt.brake();
        let Some(limit) = self.time_limit else { return interrupt };
        let began = self.began;
        interrupt.and(Brake::new(move || (began.elapsed() >= limit).then_some(StopReason::Time)))
    }

    fn after_round(&mut self, seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
        self.recorder.as_mut().map_or(Ok(()), |recorder| recorder.note(seen))?;
        Ok(None)
    }

    fn after_epoch(&mut self, seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
        Ok(self.after_step(|| seen.stage()))
    }

    fn at_end(&mut self, seen: &mut Seen<'_>) -> Result<()> {
        self.progress.finish();
        self.recorder.as_mut().map_or(Ok(()), |recorder| recorder.finish(seen))
    }
}
