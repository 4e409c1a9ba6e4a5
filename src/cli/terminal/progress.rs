//! Progress on stderr: a bar on a terminal, else a plain line or a line of JSON now and then.

use std::io::{self, IsTerminal};
use std::time::Duration;

use clap::ValueEnum;
use indicatif::{HumanCount, ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::json;

use super::{say, shown};

/// How progress is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressKind {
    /// A bar on a terminal, else plain lines
    Auto,
    Bar,
    /// A line every few seconds
    Plain,
    /// A line of JSON every second
    Json,
    None,
}

impl ProgressKind {
    /// The kind to show. With `--quiet` it is none, unless a kind was asked for.
    pub(crate) fn unless(self, is_quiet: bool) -> Self {
        if is_quiet && self == Self::Auto { Self::None } else { self }
    }
}

/// How far some work has come, in every form that progress can take.
pub(crate) trait Stage {
    /// Time since the work began.
    fn elapsed(&self) -> Duration;
    /// How much is done, 0 to 1.
    fn share(&self) -> f64;
    /// For people.
    fn line(&self) -> String;
    /// For programs.
    fn json_line(&self) -> String;
}

/// How far an evolution has come.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EvolutionProgress {
    /// Time since it began.
    pub elapsed: Duration,
    /// What is counted: births or evals.
    pub unit: &'static str,
    pub count: u64,
    pub planned: u64,
    /// What `error` is: the SAE, or the objective of a search.
    pub measure: Measure,
    /// Of the best population.
    pub error: u64,
    /// Time after which the evolution is ended.
    pub time_limit: Option<Duration>,
}

/// What an evolution lowers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Measure {
    Sae,
    /// The SAE with weights and penalties.
    Objective,
}

/// Shows how far an evolution has come.
#[derive(Debug)]
pub(crate) struct Progress {
    form: Form,
    next: Duration,
}

#[derive(Debug)]
enum Form {
    Nothing,
    Bar(ProgressBar),
    Plain,
    Json,
}

impl Progress {
    /// Progress of the requested kind, or the nearest kind that stderr can show.
    pub(crate) fn new(kind: ProgressKind) -> Self {
        let is_terminal = io::stderr().is_terminal();
        let is_dumb = std::env::var_os("TERM").is_none_or(|term| term == "dumb");
        let form = match kind {
            ProgressKind::None => Form::Nothing,
            ProgressKind::Json => Form::Json,
            ProgressKind::Bar if is_terminal => Form::Bar(bar()),
            ProgressKind::Auto if is_terminal && !is_dumb => Form::Bar(bar()),
            ProgressKind::Auto | ProgressKind::Bar | ProgressKind::Plain => Form::Plain,
        };
        let next = form.interval();
        Self { form, next }
    }

    /// Whether it is time to show something.
    pub(crate) fn is_due(&self, elapsed: Duration) -> bool {
        elapsed >= self.next
    }

    /// Shows how far the work has come.
    pub(crate) fn show(&mut self, standing: &impl Stage) {
        self.next = standing.elapsed() + self.form.interval();
        match &self.form {
            Form::Nothing => {}
            Form::Bar(bar) => {
                bar.set_length(1000);
                bar.set_position((standing.share() * 1000.0) as u64);
                bar.set_message(shown(&standing.line()).into_owned());
            }
            Form::Plain => say(&standing.line()),
            Form::Json => say(&standing.json_line()),
        }
    }

    /// Prints a line above the bar, if there is one.
    pub(crate) fn say(&self, line: &str) {
        match &self.form {
            Form::Bar(bar) => bar.suspend(|| say(line)),
            Form::Nothing | Form::Plain | Form::Json => say(line),
        }
    }

    /// Removes the bar, so that the next output begins on a clean line.
    pub(crate) fn finish(&self) {
        if let Form::Bar(bar) = &self.form {
            bar.finish_and_clear();
        }
    }
}

impl Form {
    /// Time between two displays.
    fn interval(&self) -> Duration {
        match self {
            Self::Nothing => Duration::MAX,
            Self::Bar(_) => Duration::from_millis(100),
            Self::Plain => Duration::from_secs(5),
            Self::Json => Duration::from_secs(1),
        }
    }
}

impl EvolutionProgress {
    fn per_s(&self) -> f64 {
        self.count as f64 / self.elapsed.as_secs_f64().max(1e-9)
    }

    /// Seconds left until all is done or the time is up. Unknown without a time limit before anything was counted.
    fn eta_s(&self) -> Option<f64> {
        let left = self.planned.saturating_sub(self.count);
        let is_known = left == 0 || self.count > 0;
        let by_count = is_known.then(|| left as f64 / self.per_s().max(1e-9));
        let by_time = self.time_limit.map(|limit| limit.saturating_sub(self.elapsed).as_secs_f64());
        by_count.into_iter().chain(by_time).reduce(f64::min)
    }
}

impl Stage for EvolutionProgress {
    fn elapsed(&self) -> Duration {
        self.elapsed
    }

    fn share(&self) -> f64 {
        let elapsed_s = self.elapsed.as_secs_f64();
        self.eta_s().map_or(0.0, |eta_s| elapsed_s / (elapsed_s + eta_s).max(1e-9))
    }

    fn line(&self) -> String {
        let left = self.eta_s().map(|eta_s| format!(", {} left", short_time(eta_s))).unwrap_or_default();
        let unit = self.unit;
        let measure = match self.measure {
            Measure::Sae => "SAE",
            Measure::Objective => "objective",
        };
        format!(
            "{}/{} {unit}, {measure} {}, {} {unit}/s{left}",
            HumanCount(self.count),
            HumanCount(self.planned),
            HumanCount(self.error),
            HumanCount(self.per_s() as u64)
        )
    }

    fn json_line(&self) -> String {
        let rounded = |value: f64| (value * 10.0).round() / 10.0;
        let unit = self.unit;
        let measure = match self.measure {
            Measure::Sae => "sae",
            Measure::Objective => "objective",
        };
        let mut line = json!({
            unit: self.count,
            format!("{unit}_planned"): self.planned,
            measure: self.error,
            format!("{unit}_per_s"): rounded(self.per_s()),
            "elapsed_s": rounded(self.elapsed.as_secs_f64()),
        });
        if let Some(eta_s) = self.eta_s() {
            line["eta_s"] = rounded(eta_s).into();
        }
        line.to_string()
    }
}

/// A bar without colours, so NO_COLOR needs no check.
fn bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:14} {wide_msg}").unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::stderr()).with_style(style)
}

/// A time as `8s`, `2m10s` or `3h05m`.
pub(crate) fn short_time(seconds: f64) -> String {
    let seconds = seconds.ceil() as u64;
    match seconds {
        0..60 => format!("{seconds}s"),
        60..3_600 => format!("{}m{:02}s", seconds / 60, seconds % 60),
        _ => format!("{}h{:02}m", seconds / 3_600, seconds % 3_600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standing() -> EvolutionProgress {
        let elapsed = Duration::from_secs(10);
        let (count, planned, error) = (1_000, 4_000, 1_234_567);
        EvolutionProgress { elapsed, unit: "births", count, planned, measure: Measure::Sae, error, time_limit: None }
    }

    #[test]
    fn a_plain_line_tells_births_fitness_rate_and_time_left() {
        assert_eq!(standing().line(), "1,000/4,000 births, SAE 1,234,567, 100 births/s, 30s left");
        let searching = EvolutionProgress { unit: "evals", measure: Measure::Objective, ..standing() };
        assert_eq!(searching.line(), "1,000/4,000 evals, objective 1,234,567, 100 evals/s, 30s left");
    }

    #[test]
    fn the_time_left_ends_with_the_time_limit() {
        let limited = EvolutionProgress { time_limit: Some(Duration::from_secs(15)), ..standing() };
        assert_eq!(limited.eta_s(), Some(5.0));
        assert_eq!(standing().eta_s().map(short_time).as_deref(), Some("30s"));
        assert_eq!(short_time(129.5), "2m10s");
        assert_eq!(short_time(11_100.0), "3h05m");
    }

    #[test]
    fn before_the_first_birth_the_time_left_is_left_out() {
        let idle = EvolutionProgress { count: 0, ..standing() };
        assert_eq!(idle.line(), "0/4,000 births, SAE 1,234,567, 0 births/s");
        assert!(!idle.json_line().contains("eta_s"), "{}", idle.json_line());
        assert_eq!(EvolutionProgress { time_limit: Some(Duration::from_secs(15)), ..idle }.eta_s(), Some(5.0));
    }

    #[test]
    fn a_line_of_json_has_numbers_only() {
        let line: serde_json::Value = serde_json::from_str(&standing().json_line()).expect("it is JSON");
        assert_eq!(line["births"], 1_000);
        assert_eq!(line["eta_s"], 30.0);
    }
}
