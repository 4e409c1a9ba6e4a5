//! Counts what became of the pictures of a batch.

use std::path::Path;
use std::time::{Duration, Instant};

use indicatif::HumanCount;
use serde_json::{Map, Value};

use crate::cli::jobs::row::{Row, Status};
use crate::cli::terminal;
use crate::cli::terminal::progress::{Stage, short_time};

/// How many failures are listed again at the end.
const FAILURES_LISTED: usize = 10;

/// Counts rows.
#[derive(Debug)]
pub(super) struct Summary {
    began: Instant,
    planned: usize,
    complete: usize,
    unchanged: usize,
    skipped: usize,
    /// Results of other options that were replaced.
    pub(super) replaced: usize,
    failures: Vec<String>,
    evals: u64,
    evolve_ms: f64,
}

impl Summary {
    /// A summary of this many pictures. The clock runs from now on.
    pub(super) fn begin(planned: usize) -> Self {
        Self {
            began: Instant::now(),
            planned,
            complete: 0,
            unchanged: 0,
            skipped: 0,
            replaced: 0,
            failures: Vec::new(),
            evals: 0,
            evolve_ms: 0.0,
        }
    }

    /// Counts a row.
    pub(super) fn note(&mut self, row: &Row) {
        match row.status {
            Status::Complete => {
                self.complete += 1;
                self.evals += row.evals;
                self.evolve_ms += row.evolve_ms;
            }
            Status::Unchanged => self.unchanged += 1,
            Status::Skipped => self.skipped += 1,
            Status::Failed | Status::Partial | Status::Planned => {
                self.failures.push(row.error.clone().unwrap_or_else(|| format!("{}: failed", row.input)));
            }
        }
    }

    /// How many pictures failed.
    pub(super) fn failed(&self) -> usize {
        self.failures.len()
    }

    /// How many pictures are neither done nor failed.
    pub(super) fn left(&self) -> usize {
        self.planned - self.done()
    }

    fn done(&self) -> usize {
        self.complete + self.unchanged + self.skipped + self.failed()
    }

    /// How far the batch has come.
    pub(super) fn standing(&self) -> BatchStanding {
        BatchStanding {
            elapsed: self.began.elapsed(),
            planned: self.planned,
            done: self.done(),
            failed: self.failed(),
            complete: self.complete,
        }
    }

    /// Prints the table.
    pub(super) fn print(&self, results: &Path) {
        let seconds = self.began.elapsed().as_secs_f64().max(1e-9);
        let counts = [
            ("complete", self.complete),
            ("replaced", self.replaced),
            ("unchanged", self.unchanged),
            ("skipped", self.skipped),
            ("failed", self.failed()),
            ("not done", self.left()),
        ];
        for (name, count) in counts.into_iter().filter(|&(name, count)| count > 0 || name == "complete") {
            terminal::say(&format!("{name:<10} {:>9}", HumanCount(count as u64).to_string()));
        }
        for failure in self.failures.iter().take(FAILURES_LISTED) {
            terminal::say(&format!("  {failure}"));
        }
        if self.failures.len() > FAILURES_LISTED {
            terminal::say(&format!("  and {} more", self.failures.len() - FAILURES_LISTED));
        }
        if self.complete > 0 {
            terminal::say(&format!(
                "{:.2} pictures/s, {} evals/s, {:.0} ms a picture, {} in all",
                self.complete as f64 / seconds,
                HumanCount((self.evals as f64 / seconds) as u64),
                self.evolve_ms / self.complete as f64,
                short_time(seconds)
            ));
        }
        terminal::say(&format!("results in {}", results.display()));
    }
}

/// How far a batch has come.
#[derive(Clone, Copy, Debug)]
pub(super) struct BatchStanding {
    pub elapsed: Duration,
    planned: usize,
    done: usize,
    failed: usize,
    complete: usize,
}

impl Stage for BatchStanding {
    fn elapsed(&self) -> Duration {
        self.elapsed
    }

    fn share(&self) -> f64 {
        self.done as f64 / self.planned.max(1) as f64
    }

    /// Estimated from the pictures that were evolved, since the others take no time.
    fn eta_s(&self) -> Option<f64> {
        let left = (self.planned - self.done) as f64;
        (self.complete > 0).then(|| left * self.elapsed.as_secs_f64() / self.complete as f64)
    }

    fn count(&self) -> String {
        let failed = if self.failed > 0 { format!(", {} failed", self.failed) } else { String::new() };
        format!("{}/{} pictures{failed}", HumanCount(self.done as u64), HumanCount(self.planned as u64))
    }

    fn json(&self) -> Map<String, Value> {
        Map::from_iter([
            ("pictures".to_owned(), self.done.into()),
            ("pictures_planned".to_owned(), self.planned.into()),
            ("failed".to_owned(), self.failed.into()),
        ])
    }
}
