//! Progress on stderr: a bar on a terminal, else a plain line or a line of JSON now and then.

use std::io::{self, IsTerminal};
use std::time::Duration;

use clap::ValueEnum;
use indicatif::{HumanCount, ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::{Map, Value};

use super::{Verbosity, say, say_to_reader, shown};

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
    /// Seconds that are left, once they can be estimated.
    fn eta_s(&self) -> Option<f64>;
    /// What people count, such as pictures; empty if the share says enough.
    fn count(&self) -> String {
        String::new()
    }
    /// Figures for those who want to know more.
    fn details(&self) -> String {
        String::new()
    }
    /// Figures for programs, besides the time.
    fn json(&self) -> Map<String, Value>;
}

/// The line for people: how much is done and what is left to wait come first, so that no narrow window cuts them off.
fn line(stage: &impl Stage, verbosity: Verbosity) -> String {
    let share = format!("{} %", (stage.share() * 100.0).clamp(0.0, 100.0) as u64);
    let left = stage.eta_s().map(|eta_s| format!("{} left", short_time(eta_s)));
    let details = Some(stage.details()).filter(|_| verbosity == Verbosity::Verbose);
    let parts = [Some(share), left, Some(stage.count()), details];
    parts.into_iter().flatten().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" \u{b7} ")
}

/// The line for programs: one object.
fn json_line(stage: &impl Stage) -> String {
    let mut line = stage.json();
    line.insert("elapsed_s".to_owned(), rounded(stage.elapsed().as_secs_f64(), 1).into());
    if let Some(eta_s) = stage.eta_s() {
        line.insert("eta_s".to_owned(), rounded(eta_s, 1).into());
    }
    Value::Object(line).to_string()
}

/// A number with so many decimals.
pub(crate) fn rounded(value: f64, decimals: i32) -> f64 {
    let scale = 10_f64.powi(decimals);
    (value * scale).round() / scale
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
    verbosity: Verbosity,
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
    pub(crate) fn new(kind: ProgressKind, verbosity: Verbosity) -> Self {
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
        Self { form, verbosity, next }
    }

    /// Whether it is time to show something.
    pub(crate) fn is_due(&self, elapsed: Duration) -> bool {
        elapsed >= self.next
    }

    /// Shows how far the work has come. False if a program has asked for it, and has gone away since: then nobody waits
    /// for the work any more.
    pub(crate) fn show(&mut self, standing: &impl Stage) -> bool {
        self.next = standing.elapsed() + self.form.interval();
        match &self.form {
            Form::Nothing => {}
            Form::Bar(bar) => {
                bar.set_length(1000);
                bar.set_position((standing.share() * 1000.0) as u64);
                bar.set_message(shown(&line(standing, self.verbosity)).into_owned());
            }
            Form::Plain => say(&line(standing, self.verbosity)),
            Form::Json => return say_to_reader(&json_line(standing)),
        }
        true
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
}

impl Stage for EvolutionProgress {
    fn elapsed(&self) -> Duration {
        self.elapsed
    }

    fn share(&self) -> f64 {
        let elapsed_s = self.elapsed.as_secs_f64();
        self.eta_s().map_or(0.0, |eta_s| elapsed_s / (elapsed_s + eta_s).max(1e-9))
    }

    /// Seconds left until all is done or the time is up. Unknown without a time limit before anything was counted.
    fn eta_s(&self) -> Option<f64> {
        let left = self.planned.saturating_sub(self.count);
        let is_known = left == 0 || self.count > 0;
        let by_count = is_known.then(|| left as f64 / self.per_s().max(1e-9));
        let by_time = self.time_limit.map(|limit| limit.saturating_sub(self.elapsed).as_secs_f64());
        by_count.into_iter().chain(by_time).reduce(f64::min)
    }

    fn details(&self) -> String {
        let unit = self.unit;
        let measure = match self.measure {
            Measure::Sae => "SAE",
            Measure::Objective => "objective",
        };
        format!(
            "{}/{} {unit}, {measure} {}, {} {unit}/s",
            HumanCount(self.count),
            HumanCount(self.planned),
            HumanCount(self.error),
            HumanCount(self.per_s() as u64)
        )
    }

    fn json(&self) -> Map<String, Value> {
        let unit = self.unit;
        let measure = match self.measure {
            Measure::Sae => "sae",
            Measure::Objective => "objective",
        };
        Map::from_iter([
            (unit.to_owned(), self.count.into()),
            (format!("{unit}_planned"), self.planned.into()),
            (measure.to_owned(), self.error.into()),
            (format!("{unit}_per_s"), rounded(self.per_s(), 1).into()),
        ])
    }
}

/// A bar without colours, so NO_COLOR needs no check.
fn bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {wide_bar}").unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::stderr()).with_style(style)
}

/// A time as `8 s`, `2 min 10 s` or `3 h 05 min`.
pub(crate) fn short_time(seconds: f64) -> String {
    let seconds = seconds.ceil() as u64;
    match seconds {
        0..60 => format!("{seconds} s"),
        60..3_600 => format!("{} min {:02} s", seconds / 60, seconds % 60),
        _ => format!("{} h {:02} min", seconds / 3_600, seconds % 3_600 / 60),
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
    fn a_line_for_people_begins_with_the_share_and_the_time_left() {
        assert_eq!(line(&standing(), Verbosity::Normal), "25 % · 30 s left");
        let more = line(&standing(), Verbosity::Verbose);
        assert_eq!(more, "25 % · 30 s left · 1,000/4,000 births, SAE 1,234,567, 100 births/s");
        let searching = EvolutionProgress { unit: "evals", measure: Measure::Objective, ..standing() };
        let more = line(&searching, Verbosity::Verbose);
        assert_eq!(more, "25 % · 30 s left · 1,000/4,000 evals, objective 1,234,567, 100 evals/s");
    }

    #[test]
    fn the_time_left_ends_with_the_time_limit() {
        let limited = EvolutionProgress { time_limit: Some(Duration::from_secs(15)), ..standing() };
        assert_eq!(limited.eta_s(), Some(5.0));
        assert_eq!(standing().eta_s().map(short_time).as_deref(), Some("30 s"));
        assert_eq!(short_time(129.5), "2 min 10 s");
        assert_eq!(short_time(11_100.0), "3 h 05 min");
    }

    #[test]
    fn before_the_first_birth_the_time_left_is_left_out() {
        let idle = EvolutionProgress { count: 0, ..standing() };
        assert_eq!(line(&idle, Verbosity::Normal), "0 %");
        assert!(!json_line(&idle).contains("eta_s"), "{}", json_line(&idle));
        assert_eq!(EvolutionProgress { time_limit: Some(Duration::from_secs(15)), ..idle }.eta_s(), Some(5.0));
    }

    #[test]
    fn a_line_of_json_has_numbers_only() {
        let line: Value = serde_json::from_str(&json_line(&standing())).expect("it is JSON");
        assert_eq!((&line["births"], &line["births_per_s"]), (&1_000.into(), &100.0.into()));
        assert_eq!((&line["elapsed_s"], &line["eta_s"]), (&10.0.into(), &30.0.into()));
        assert!(line.as_object().is_some_and(|line| line.values().all(Value::is_number)), "{line}");
    }
}
