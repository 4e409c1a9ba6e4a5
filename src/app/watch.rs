//! The observer of an evolution: the clock, the interrupt and the progress, looked at as seldom as will do, and the
//! snapshots of its course.

use std::time::{Duration, Instant};

use super::interrupt::Interrupt;
use super::progress::{Progress, Standing};
use super::recorder::Recorder;
use crate::engine::Observer;
use crate::evolve::{Evolution, StopReason};

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
        }
    }

    /// Ends the progress and the record of `evolution`, the only one; returns the time since the beginning.
    pub(super) fn finish(self, evolution: &Evolution) -> Duration {
        if let Some(recorder) = self.recorder {
            recorder.finish(evolution);
        }
        self.progress.finish();
        self.began.elapsed()
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
                births: evolutions.iter().map(|evolution| evolution.outcome().births).sum(),
                births_planned: evolutions.iter().map(Evolution::births_planned).fold(0, u64::saturating_add),
                sae: evolutions.iter().filter_map(Evolution::best_sae).sum(),
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
