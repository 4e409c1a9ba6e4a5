//! What a run prints while it works and at its end.

use std::time::{Duration, Instant};

use indicatif::HumanCount;
use serde::Serialize;
use serde_json::{Map, Value};

use super::plan::{Begin, Planned};
use crate::cli::jobs::row::Row;
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::progress::{Progress, Stage};
use crate::cli::terminal::{self, words};
use crate::error::Result;
use crate::evolve::{Brake, Observer, Seen, StopReason};

/// The result of a frame.
#[derive(Debug, Serialize)]
pub(super) struct FrameRow<'a> {
    #[serde(flatten)]
    pub row: &'a Row,
    /// Its number in the sequence, from 0.
    pub frame: usize,
    pub begin: Begin,
    /// The frame that its shot begins with.
    pub shot: usize,
    /// Whether it was complete already.
    pub is_kept: bool,
}

/// The result of all frames.
#[derive(Debug, Default, Serialize)]
pub(super) struct Totals {
    /// Always `total`.
    pub id: &'static str,
    pub status: &'static str,
    /// Frames that exist now, of `frames_planned`.
    pub frames: usize,
    pub frames_planned: usize,
    /// Frames that were complete already.
    pub kept: usize,
    pub shots: usize,
    /// Sum of absolute differences of all frames that exist.
    pub sae: u64,
    pub evals: u64,
    pub evolve_ms: f64,
    pub wall_ms: f64,
    /// Animations that were written.
    pub output: Vec<String>,
    pub error: Option<String>,
}

impl Totals {
    /// Counts a frame.
    pub(super) fn note(&mut self, row: &FrameRow<'_>) {
        self.frames += 1;
        self.kept += usize::from(row.is_kept);
        self.sae += row.row.sae.unwrap_or_default();
        self.evals += if row.is_kept { 0 } else { row.row.evals };
        self.evolve_ms += row.row.evolve_ms;
    }

    /// Prints what was done.
    pub(super) fn say(&self, planned: &[Planned], folder: Option<String>) {
        let pixels = planned.first().map_or(0, |frame| {
            let side = |word| frame.population.decisive(word).as_u64().unwrap_or_default();
            side("width_px") * side("height_px")
        });
        let mean = self.sae as f64 / (self.frames.max(1) as f64 * 3.0 * pixels.max(1) as f64);
        let frames = words::counted(self.frames as u64, "frame");
        let shots = words::counted(self.shots as u64, "shot");
        let kept = HumanCount(self.kept as u64);
        let kept = if self.kept > 0 { format!(", {kept} of them there already") } else { String::new() };
        let written: Vec<String> = folder.into_iter().chain(self.output.iter().cloned()).collect();
        let (written, seconds) = (written.join(", "), self.wall_ms / 1e3);
        terminal::say(&format!(
            "wrote {written}: {frames} in {shots}{kept}, mean error {mean:.2} of 255 per channel, {seconds:.1} s"
        ));
    }
}

/// Watches the searches of the frames, one after the other.
pub(super) struct Watcher<'a> {
    pub interrupt: &'a Interrupt,
    progress: Progress,
    began: Instant,
    /// Frames that are done.
    pub done: usize,
    /// The frames among them that took time.
    pub evolved: usize,
    count: usize,
    /// Evals of the frame that is being evolved.
    pub evals: u64,
}

impl<'a> Watcher<'a> {
    pub(super) fn begin(interrupt: &'a Interrupt, progress: Progress, count: usize) -> Self {
        Self { interrupt, progress, began: Instant::now(), done: 0, evolved: 0, count, evals: 1 }
    }

    pub(super) fn elapsed(&self) -> Duration {
        self.began.elapsed()
    }

    /// Removes the progress bar.
    pub(super) fn finish(&self) {
        self.progress.finish();
    }
}

impl Observer for Watcher<'_> {
    fn brake(&self) -> Brake {
        self.interrupt.brake()
    }

    fn after_epoch(&mut self, seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
        if self.interrupt.is_requested() {
            return Ok(Some(StopReason::Interrupted));
        }
        let elapsed = self.began.elapsed();
        if self.progress.is_due(elapsed) {
            let part = (seen.stage().evals as f64 / self.evals.max(1) as f64).min(1.0);
            let (done, evolved, count) = (self.done, self.evolved, self.count);
            self.progress.show(&FramesDone { elapsed, done, evolved, count, part });
        }
        Ok(None)
    }
}

/// How far the work has come.
struct FramesDone {
    elapsed: Duration,
    done: usize,
    evolved: usize,
    count: usize,
    /// The number of the next frame.
    part: f64,
}

impl Stage for FramesDone {
    fn elapsed(&self) -> Duration {
        self.elapsed
    }

    fn share(&self) -> f64 {
        (self.done as f64 + self.part) / self.count as f64
    }

    fn eta_s(&self) -> Option<f64> {
        let left = (self.count - self.done) as f64 - self.part;
        Some(self.elapsed.as_secs_f64() / (self.evolved as f64 + self.part).max(1e-3) * left)
    }

    fn count(&self) -> String {
        let count = |frames: usize| HumanCount(frames as u64);
        format!("{}/{} frames", count(self.done), count(self.count))
    }

    fn json(&self) -> Map<String, Value> {
        Map::from_iter([("frames".to_owned(), self.done.into()), ("frame_count".to_owned(), self.count.into())])
    }
}
