//! Whether a device gives what the CPU gives: small work of every kind, compared number by number.

mod numbers;
mod trials;

use std::time::{Duration, Instant};

use serde::Serialize;
use serde_json::{Map, Value};

use self::trials::Trial;
use crate::cli::terminal::progress::{Progress, Stage};
use crate::cli::terminal::{advice, milliseconds};
use crate::error::{Error, Result};
use crate::studio::Device;

/// How a check came out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Outcome {
    Equal,
    Different,
    Failed,
    /// The CPU would do the work of the device, and be compared with itself.
    Skipped,
}

impl Outcome {
    /// Whether the device is not to be trusted.
    pub(crate) fn is_wrong(self) -> bool {
        matches!(self, Self::Different | Self::Failed)
    }
}

/// What is known of a check.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Checked {
    pub name: String,
    pub outcome: Outcome,
    /// The first difference, or why it failed or was skipped.
    pub detail: Option<String>,
    /// How many numbers were compared.
    pub numbers: usize,
    pub device_ms: f64,
    pub cpu_ms: f64,
}

impl Checked {
    /// A check that is not made.
    fn skipped(name: &str, why: String) -> Self {
        let (outcome, detail) = (Outcome::Skipped, Some(why));
        Self { name: name.to_owned(), outcome, detail, numbers: 0, device_ms: 0.0, cpu_ms: 0.0 }
    }
}

/// Makes all checks. One that the device fails stops no other, unless the device is lost: then it is the last one.
///
/// # Errors
/// If the CPU fails, or `goes_on` says so.
pub(crate) fn run_all(
    device: &Device,
    mut progress: Progress,
    goes_on: impl Fn() -> Result<()>,
) -> Result<Vec<Checked>> {
    let (twin, began) = (Device::cpu(), Instant::now());
    let trials = trials::all()?;
    let mut checks = Vec::with_capacity(trials.len());
    for trial in &trials {
        goes_on()?;
        let why = if trial.needs_graphics { why_the_cpu_draws(device.missing_for_drawing()) } else { None };
        let (checked, is_lost) = match why {
            Some(why) => (Checked::skipped(&trial.name, why), false),
            None => run(trial, device, &twin)?,
        };
        checks.push(checked);
        if is_lost {
            break;
        }
        let standing = ChecksDone { elapsed: began.elapsed(), done: checks.len(), all: trials.len() };
        if progress.is_due(standing.elapsed) {
            progress.show(&standing);
        }
    }
    progress.finish();
    Ok(checks)
}

/// Why drawing is skipped on a device that lacks this for it.
fn why_the_cpu_draws(lacking: &[String]) -> Option<String> {
    let why = || format!("the CPU draws this in place of the device, which lacks {}", lacking.join(", "));
    (!lacking.is_empty()).then(why)
}

/// Makes a check; returns whether the device is lost, too.
///
/// # Errors
/// If the CPU fails.
fn run(trial: &Trial, device: &Device, twin: &Device) -> Result<(Checked, bool)> {
    let timed = |device: &Device| {
        let began = Instant::now();
        let found = trial.run(device);
        (found, milliseconds(began.elapsed()))
    };
    let ((found, device_ms), (expected, cpu_ms)) = (timed(device), timed(twin));
    let expected = expected?;
    let numbers = numbers::count(&expected);
    let is_lost = matches!(found, Err(Error::DeviceLost { .. }));
    let (outcome, detail) = match found {
        Err(error) if is_lost => (Outcome::Failed, Some(format!("{error}; no more checks were made"))),
        Err(error) => (Outcome::Failed, Some(advice::sentence(&error))),
        Ok(found) => match numbers::first_difference(&found, &expected) {
            None => (Outcome::Equal, None),
            difference => (Outcome::Different, difference),
        },
    };
    Ok((Checked { name: trial.name.clone(), outcome, detail, numbers, device_ms, cpu_ms }, is_lost))
}

/// How far the checks have come.
struct ChecksDone {
    elapsed: Duration,
    done: usize,
    all: usize,
}

impl Stage for ChecksDone {
    fn elapsed(&self) -> Duration {
        self.elapsed
    }

    fn share(&self) -> f64 {
        self.done as f64 / self.all as f64
    }

    fn eta_s(&self) -> Option<f64> {
        Some(self.elapsed.as_secs_f64() / self.done as f64 * (self.all - self.done) as f64)
    }

    fn count(&self) -> String {
        format!("{}/{} checks", self.done, self.all)
    }

    fn json(&self) -> Map<String, Value> {
        Map::from_iter([("checks".to_owned(), self.done.into()), ("check_count".to_owned(), self.all.into())])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drawing_is_skipped_only_where_the_cpu_would_be_compared_with_itself() {
        let lacking = ["a queue for graphics".to_owned()];
        assert_eq!(why_the_cpu_draws(&[]), None);
        let why = why_the_cpu_draws(&lacking).expect("the CPU draws");
        assert!(why.contains(&lacking[0]), "{why}");
        assert!(!Checked::skipped("drawing", why).outcome.is_wrong());
        assert_eq!(serde_json::to_value(Outcome::Skipped).expect("it is a word"), "skipped");
    }
}
