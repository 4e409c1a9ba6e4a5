//! The measurements, one after the other.

use std::sync::Arc;
use std::time::{Duration, Instant};

use indicatif::HumanCount;
use serde_json::{Map, Value};

use super::measure::{Lap, Measurement, Unit, repeat};
use super::passes;
use super::workload::{self, Pictures, SIDES_PX};
use crate::cli::terminal::progress::{Progress, Stage};
use crate::cli::terminal::{self, Verbosity, advice};
use crate::cpu::cells::CpuSearch;
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::evolve::cells::{self, Budget, EVALS_PER_FLY};
use crate::evolve::evolution::random_population;
use crate::evolve::{Evolution, Observer, PaperScheme, Seen, StopReason, Undisturbed};
use crate::model::cells::{Course, Search};
use crate::model::{Canvas, Fly, Population, Target};
use crate::studio::{Device, Work};

/// Births of a lap of the published algorithm.
const BIRTHS: u64 = 2_000;
/// Births per batch in the measurement of batches: a hundredth of 5,000 tiles.
const BATCH_BIRTHS: u32 = 50;
/// Rounds that make the population from which searches are measured.
const FORMING_ROUNDS: u32 = 8;
/// Rounds of a lap with one candidate per step.
const ROUNDS: u32 = 4;

/// The measured searches in cells: style, candidates, and which of the sizes.
const SEARCHES: [(&str, u32, usize); 5] =
    [("free", 1, 0), ("free", 8, 0), ("free", 1, 1), ("free", 8, 1), ("mosaic", 1, 1)];
/// Steps of progress: evaluation and births in both sizes, births in batches, searches, passes of two of them, a whole
/// picture.
const STEPS: usize = 2 * 2 + 1 + SEARCHES.len() + 2 + 1;

/// Measures one device.
pub(super) struct Bench<'a> {
    device: &'a Device,
    pictures: &'a Pictures,
    /// Time for each measurement.
    budget: Duration,
    progress: Progress,
    began: Instant,
    steps: usize,
    rows: Vec<Measurement>,
}

impl<'a> Bench<'a> {
    pub(super) fn new(device: &'a Device, pictures: &'a Pictures, budget: Duration, progress: Progress) -> Self {
        Self { device, pictures, budget, progress, began: Instant::now(), steps: 0, rows: Vec::new() }
    }

    /// Measures everything.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn run(mut self, verbosity: Verbosity) -> Result<Vec<Measurement>> {
        let done = self.measure(verbosity);
        self.progress.finish();
        done.map(|()| self.rows)
    }

    fn measure(&mut self, verbosity: Verbosity) -> Result<()> {
        for (target, side_px) in self.pictures.targets.iter().zip(SIDES_PX) {
            self.evaluation(target, side_px)?;
            self.paper(target, 1, format!("paper, {side_px} px"))?;
        }
        self.paper(&self.pictures.targets[1], BATCH_BIRTHS, format!("paper, {} px, by {BATCH_BIRTHS}", SIDES_PX[1]))?;
        self.searches(verbosity)
    }

    fn searches(&mut self, verbosity: Verbosity) -> Result<()> {
        let mut formed: Option<(&str, usize, Vec<Fly>)> = None;
        for (name, candidates, size) in SEARCHES {
            let course = workload::search(&self.pictures.targets[size], name, candidates)?.course;
            let flies = match formed.take() {
                Some((style, of, flies)) if (style, of) == (name, size) => flies,
                _ => form(&self.pictures.targets[size], name)?,
            };
            let row = format!("cells {name}, K={candidates}, {} px", SIDES_PX[size]);
            let done = self.search(row.clone(), course.clone(), &flies);
            self.unless_unable(done, &row, verbosity)?;
            if (name, candidates) == ("free", 1) {
                let done = self.passes(course, &flies, SIDES_PX[size]);
                self.unless_unable(done, &format!("the passes of {row}"), verbosity)?;
            }
            formed = Some((name, size, flies));
        }
        let row = format!("picture, {} px", SIDES_PX[1]);
        let done = self.picture(row.clone());
        self.unless_unable(done, &row, verbosity)
    }

    /// If the device cannot make a search, its figures are missing and the others are still measured.
    fn unless_unable(&mut self, done: Result<()>, row: &str, verbosity: Verbosity) -> Result<()> {
        match done {
            Err(error @ (Error::NoSuitableDevice { .. } | Error::TooLarge { .. })) => {
                if verbosity > Verbosity::Quiet {
                    terminal::say(&format!("smalti: no figures of {row}: {}", advice::sentence(&error)));
                }
                self.note([]);
                Ok(())
            }
            done => done,
        }
    }

    /// Adds figures, and shows the progress.
    fn note(&mut self, rows: impl IntoIterator<Item = Measurement>) {
        self.rows.extend(rows);
        self.steps += 1;
        let standing = MeasurementsDone { elapsed: self.began.elapsed(), steps: self.steps };
        if self.progress.is_due(standing.elapsed) {
            self.progress.show(&standing);
        }
    }

    /// Measures the evaluation of a random population.
    fn evaluation(&mut self, target: &Arc<Target>, side_px: u32) -> Result<()> {
        let scene = workload::scene(target);
        let flies = random_population(target.width_px(), target.height_px(), scene.fly_count, 0);
        let mut evaluator = self.device.open_timed(vec![scene])?;
        let mut passes: Vec<(&'static str, Vec<Lap>)> = Vec::new();
        let laps = repeat(self.budget, || {
            let began = Instant::now();
            evaluator.load(&[(0, &flies)])?;
            let lap = Lap::since(began, 1);
            for (name, ms) in evaluator.pass_times() {
                let lap = Lap { seconds: ms / 1e3, amount: 1 };
                match passes.iter_mut().find(|(known, _)| *known == name) {
                    Some((_, laps)) => laps.push(lap),
                    None => passes.push((name, vec![lap])),
                }
            }
            Ok(lap)
        })?;
        let whole = Measurement::of(format!("full evaluation, {side_px} px"), Unit::Ms, &laps);
        let passes = passes.into_iter().map(|(name, laps)| {
            // The first lap was the warm-up.
            Measurement::of(format!("pass {name}, {side_px} px"), Unit::Ms, &laps[laps.len().min(2) - 1..])
        });
        self.note(std::iter::once(whole).chain(passes));
        Ok(())
    }

    /// Measures births of the published algorithm.
    fn paper(&mut self, target: &Arc<Target>, batch_births: u32, name: String) -> Result<()> {
        let size_px = (target.width_px(), target.height_px());
        let flies = random_population(size_px.0, size_px.1, workload::fly_count(target), 0);
        let laps = repeat(self.budget, || {
            let scheme = PaperScheme { births: BIRTHS, batch_births, ..PaperScheme::default() };
            let evolution = Evolution::new(scheme, 0, size_px.0, size_px.1, flies.clone());
            let evaluator = self.device.open_evaluator(vec![workload::scene(target)])?;
            let mut engine = Engine::new(evaluator, vec![evolution]);
            let began = Instant::now();
            engine.run(&mut Undisturbed)?;
            Ok(Lap::since(began, BIRTHS))
        })?;
        self.note([Measurement::of(name, Unit::BirthsPerS, &laps)]);
        Ok(())
    }

    /// Measures rounds that start from the same population each time.
    fn search(&mut self, name: String, course: Course, flies: &[Fly]) -> Result<()> {
        let rounds = (ROUNDS / course.rules.candidates).max(1);
        let mut search = self.device.open_search(course)?.search;
        let laps = repeat(self.budget, || {
            search.load(flies)?;
            let began = Instant::now();
            search.advance(rounds)?;
            let standing = search.standing();
            let lap = Lap::since(began, standing.evals);
            Ok([lap, Lap { amount: standing.births, ..lap }])
        })?;
        let of = |which: usize| laps.iter().map(|lap| lap[which]).collect::<Vec<Lap>>();
        let evals = Measurement::of(name.clone(), Unit::EvalsPerS, &of(0));
        self.note([evals, Measurement::of(name, Unit::BirthsPerS, &of(1))]);
        Ok(())
    }

    /// Measures rounds as [`Bench::search`] does, pass by pass.
    fn passes(&mut self, course: Course, flies: &[Fly], side_px: u32) -> Result<()> {
        let passes = passes::of_rounds(self.device, course, flies, ROUNDS, self.budget)?;
        let row =
            |(name, laps): (&str, Vec<Lap>)| Measurement::of(format!("pass {name}, {side_px} px"), Unit::Ms, &laps);
        self.note(passes.into_iter().map(row));
        Ok(())
    }

    /// Measures whole pictures, as far as the time allows.
    fn picture(&mut self, row: String) -> Result<()> {
        let began = Instant::now();
        let mut laps = Vec::new();
        while laps.is_empty() || began.elapsed() < self.budget {
            laps.push(Lap { seconds: self.make_picture()?, amount: 1 });
        }
        self.note([Measurement::of(row, Unit::PicturesPerHour, &laps)]);
        Ok(())
    }

    /// Seconds that a whole picture takes. If the time is too short for its search, the rest is extrapolated.
    fn make_picture(&self) -> Result<f64> {
        let target = &self.pictures.targets[1];
        let began = Instant::now();
        let Work { course, stage } = workload::search(target, "free", 1)?;
        let planned = EVALS_PER_FLY * course.fly_count as u64;
        let budget = Budget { evals: planned, target_sae: None, patience: None };
        let mut search = self.device.open_search(course)?.search;
        let (opened_s, searching) = (began.elapsed().as_secs_f64(), Instant::now());
        cells::run(&mut *search, None, &budget, &mut Limit { began: searching, time: self.budget })?;
        let searched_s = searching.elapsed().as_secs_f64();
        let whole_s = searched_s * (planned as f64 / search.standing().evals as f64).max(1.0);
        let drawing = Instant::now();
        let flies = search.read_back()?.flies;
        let population = Population { flies, ..stage };
        let canvas = Canvas::evaluation(target.width_px(), target.height_px());
        self.device.open_painter()?.draw(&population, &canvas, 1)?;
        Ok(opened_s + whole_s + drawing.elapsed().as_secs_f64())
    }
}

/// The population from which searches of a style are measured. The CPU twin makes it, since every device would get the
/// same.
fn form(target: &Arc<Target>, style: &str) -> Result<Vec<Fly>> {
    let mut search = CpuSearch::new(workload::search(target, style, 1)?.course);
    search.advance(FORMING_ROUNDS)?;
    Ok(search.read_back()?.flies)
}

/// Ends a search when the time is up.
struct Limit {
    began: Instant,
    time: Duration,
}

impl Observer for Limit {
    fn after_epoch(&mut self, _seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
        Ok((self.began.elapsed() >= self.time).then_some(StopReason::Time))
    }
}

/// How far the measurements have come.
struct MeasurementsDone {
    elapsed: Duration,
    steps: usize,
}

impl Stage for MeasurementsDone {
    fn elapsed(&self) -> Duration {
        self.elapsed
    }

    fn share(&self) -> f64 {
        self.steps as f64 / STEPS as f64
    }

    fn eta_s(&self) -> Option<f64> {
        Some(self.elapsed.as_secs_f64() / self.steps as f64 * (STEPS - self.steps) as f64)
    }

    fn count(&self) -> String {
        let count = |steps: usize| HumanCount(steps as u64);
        format!("{}/{} measurements", count(self.steps), count(STEPS))
    }

    fn json(&self) -> Map<String, Value> {
        Map::from_iter([("measurements".to_owned(), self.steps.into()), ("measurement_count".to_owned(), STEPS.into())])
    }
}
