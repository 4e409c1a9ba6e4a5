//! The measurements, one after the other.

use std::sync::Arc;
use std::time::{Duration, Instant};

use indicatif::HumanCount;
use serde_json::json;

use super::measure::{Lap, Measurement, Unit, repeat};
use super::passes;
use super::workload::{self, Pictures, SIDES_PX};
use crate::app::advice;
use crate::app::device::Selected;
use crate::app::options::Verbosity;
use crate::app::progress::{Progress, Stage, short_time};
use crate::app::report;
use crate::cpu::cells::CpuSearch;
use crate::engine::{Engine, Undisturbed};
use crate::error::{Error, Result};
use crate::evolve::cells::{self, Budget, EVALS_PER_FLY};
use crate::evolve::evolution::random_population;
use crate::evolve::style::Style;
use crate::evolve::{Evolution, PaperScheme, StopReason};
use crate::model::cells::{Course, Search};
use crate::model::tile::unpack;
use crate::model::{Backdrop, Canvas, Fly, Grout, Population, Target};

/// Births of a lap of the published algorithm.
const BIRTHS: u64 = 2_000;
/// Births evaluated together where they are: a hundredth of 5,000 tiles.
const BATCH_BIRTHS: u32 = 50;
/// Rounds that form the population which a search is measured from.
const FORMING_ROUNDS: u32 = 8;
/// Rounds of a lap with one candidate a step.
const ROUNDS: u32 = 4;

/// What is measured of the search in cells: style, candidates, and which of the sizes.
const SEARCHES: [(&str, u32, usize); 5] =
    [("free", 1, 0), ("free", 8, 0), ("free", 1, 1), ("free", 8, 1), ("mosaic", 1, 1)];
/// Steps of progress: evaluation and births in both sizes, births in batches, searches, passes of two of them, a whole
/// picture.
const STEPS: usize = 2 * 2 + 1 + SEARCHES.len() + 2 + 1;

/// Measures one device.
pub(super) struct Bench<'a> {
    selected: &'a Selected,
    pictures: &'a Pictures,
    /// Time for each measurement.
    budget: Duration,
    progress: Progress,
    began: Instant,
    steps: usize,
    rows: Vec<Measurement>,
}

impl<'a> Bench<'a> {
    pub(super) fn new(selected: &'a Selected, pictures: &'a Pictures, budget: Duration, progress: Progress) -> Self {
        Self { selected, pictures, budget, progress, began: Instant::now(), steps: 0, rows: Vec::new() }
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
            let style = named(name)?;
            let course = workload::course(&self.pictures.targets[size], &style, candidates);
            let flies = match formed.take() {
                Some((style, of, flies)) if (style, of) == (name, size) => flies,
                _ => form(&self.pictures.targets[size], &style)?,
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

    /// A device that cannot make a search has no figures of it; whoever asked for it learns what the others are.
    fn unless_unable(&mut self, done: Result<()>, row: &str, verbosity: Verbosity) -> Result<()> {
        match done {
            Err(error @ (Error::NoSuitableDevice { .. } | Error::TooLarge { .. })) => {
                if verbosity > Verbosity::Quiet {
                    report::say(&format!("smalti: no figures of {row}: {}", advice::sentence(&error)));
                }
                self.note([]);
                Ok(())
            }
            done => done,
        }
    }

    /// Takes in figures, and shows how far it has come.
    fn note(&mut self, rows: impl IntoIterator<Item = Measurement>) {
        self.rows.extend(rows);
        self.steps += 1;
        let standing = Standing { elapsed: self.began.elapsed(), steps: self.steps };
        if self.progress.is_due(standing.elapsed) {
            self.progress.show(&standing);
        }
    }

    /// Evaluates a random population.
    fn evaluation(&mut self, target: &Arc<Target>, side_px: u32) -> Result<()> {
        let scene = workload::scene(target);
        let flies = random_population(target.width_px(), target.height_px(), scene.fly_count, 0);
        let mut evaluator = self.selected.open_timed(vec![scene])?;
        let mut passes: Vec<(&'static str, Vec<Lap>)> = Vec::new();
        let laps = repeat(self.budget, || {
            let began = Instant::now();
            evaluator.load(&[(0, &flies)])?;
            let lap = (began.elapsed().as_secs_f64(), 1);
            for (name, ms) in evaluator.pass_times() {
                match passes.iter_mut().find(|(known, _)| *known == name) {
                    Some((_, laps)) => laps.push((ms / 1e3, 1)),
                    None => passes.push((name, vec![(ms / 1e3, 1)])),
                }
            }
            Ok(lap)
        })?;
        let whole = Measurement::of(format!("full evaluation, {side_px} px"), Unit::Ms, &laps);
        let passes = passes.into_iter().map(|(name, laps)| {
            // The first one warmed up.
            Measurement::of(format!("pass {name}, {side_px} px"), Unit::Ms, &laps[laps.len().min(2) - 1..])
        });
        self.note(std::iter::once(whole).chain(passes));
        Ok(())
    }

    /// Makes births as published.
    fn paper(&mut self, target: &Arc<Target>, batch_births: u32, name: String) -> Result<()> {
        let size_px = (target.width_px(), target.height_px());
        let flies = random_population(size_px.0, size_px.1, workload::fly_count(target), 0);
        let laps = repeat(self.budget, || {
            let scheme = PaperScheme { births: BIRTHS, batch_births, ..PaperScheme::default() };
            let evolution = Evolution::new(scheme, 0, size_px.0, size_px.1, flies.clone());
            let evaluator = self.selected.open(vec![workload::scene(target)])?.evaluator;
            let mut engine = Engine::new(evaluator, vec![evolution]);
            let began = Instant::now();
            engine.run(&mut Undisturbed)?;
            Ok((began.elapsed().as_secs_f64(), BIRTHS))
        })?;
        self.note([Measurement::of(name, Unit::BirthsPerS, &laps)]);
        Ok(())
    }

    /// Makes rounds from the same population again and again.
    fn search(&mut self, name: String, course: Course, flies: &[Fly]) -> Result<()> {
        let rounds = (ROUNDS / course.rules.candidates).max(1);
        let mut search = self.selected.open_search(course)?.search;
        let laps = repeat(self.budget, || {
            search.load(flies)?;
            let began = Instant::now();
            search.advance(rounds)?;
            let (seconds, standing) = (began.elapsed().as_secs_f64(), search.standing());
            Ok([(seconds, standing.evals), (seconds, standing.births)])
        })?;
        let of = |which: usize| laps.iter().map(|lap| lap[which]).collect::<Vec<Lap>>();
        let evals = Measurement::of(name.clone(), Unit::EvalsPerS, &of(0));
        self.note([evals, Measurement::of(name, Unit::BirthsPerS, &of(1))]);
        Ok(())
    }

    /// Makes rounds as [`Bench::search`], and looks at what each pass takes.
    fn passes(&mut self, course: Course, flies: &[Fly], side_px: u32) -> Result<()> {
        let passes = passes::of_rounds(self.selected, course, (flies, ROUNDS), self.budget)?;
        let row =
            |(name, laps): (&str, Vec<Lap>)| Measurement::of(format!("pass {name}, {side_px} px"), Unit::Ms, &laps);
        self.note(passes.into_iter().map(row));
        Ok(())
    }

    /// Makes whole pictures, as far as the time allows.
    fn picture(&mut self, row: String) -> Result<()> {
        let began = Instant::now();
        let mut laps = Vec::new();
        while laps.is_empty() || began.elapsed() < self.budget {
            laps.push((self.make_picture()?, 1));
        }
        self.note([Measurement::of(row, Unit::PicturesPerHour, &laps)]);
        Ok(())
    }

    /// Seconds that a whole picture takes; what the time does not allow of its search is extrapolated.
    fn make_picture(&self) -> Result<f64> {
        let target = &self.pictures.targets[1];
        let began = Instant::now();
        let course = workload::course(target, &named("free")?, 1);
        let planned = EVALS_PER_FLY * course.fly_count as u64;
        let budget = Budget { evals: planned, target_sae: None, patience: None };
        let mut search = self.selected.open_search(course)?.search;
        let (opened_s, searching) = (began.elapsed().as_secs_f64(), Instant::now());
        cells::run(&mut *search, None, &budget, &mut Limit { began: searching, time: self.budget })?;
        let searched_s = searching.elapsed().as_secs_f64();
        let whole_s = searched_s * (planned as f64 / search.standing().evals as f64).max(1.0);
        let drawing = Instant::now();
        let flies = search.read_back()?.flies;
        let population = population(search.course(), flies);
        let canvas = Canvas::evaluation(target.width_px(), target.height_px());
        self.selected.open(vec![workload::scene(target)])?.evaluator.draw(&population, &canvas, 1)?;
        Ok(opened_s + whole_s + drawing.elapsed().as_secs_f64())
    }
}

fn named(name: &str) -> Result<Style> {
    Style::named(name).ok_or_else(|| Error::Internal(format!("no style is called {name}")))
}

/// The population that searches of a style are measured from. The twin forms it, as any device would come to the same.
fn form(target: &Arc<Target>, style: &Style) -> Result<Vec<Fly>> {
    let mut search = CpuSearch::new(workload::course(target, style, 1));
    search.advance(FORMING_ROUNDS)?;
    Ok(search.read_back()?.flies)
}

/// The flies of a search with what is needed to draw them.
fn population(course: &Course, flies: Vec<Fly>) -> Population {
    let Course { rules, target, masks, .. } = course;
    Population {
        width_px: target.width_px(),
        height_px: target.height_px(),
        background: Backdrop::Color(unpack(rules.background)),
        grout: (rules.grout > 0).then(|| Grout { width: rules.grout, color: unpack(rules.grout_color) }),
        masks: masks.as_ref().clone(),
        flies,
    }
}

/// Ends a search when its time is up.
struct Limit {
    began: Instant,
    time: Duration,
}

impl cells::Observer for Limit {
    fn after_epoch(&mut self, _search: &mut dyn Search) -> Result<Option<StopReason>> {
        Ok((self.began.elapsed() >= self.time).then_some(StopReason::Time))
    }
}

/// How far the measuring has come.
struct Standing {
    elapsed: Duration,
    steps: usize,
}

impl Standing {
    fn eta_s(&self) -> f64 {
        self.elapsed.as_secs_f64() / self.steps as f64 * (STEPS - self.steps) as f64
    }
}

impl Stage for Standing {
    fn elapsed(&self) -> Duration {
        self.elapsed
    }

    fn share(&self) -> f64 {
        self.steps as f64 / STEPS as f64
    }

    fn line(&self) -> String {
        let count = |steps: usize| HumanCount(steps as u64);
        format!("{}/{} measurements, {} left", count(self.steps), count(STEPS), short_time(self.eta_s()))
    }

    fn json_line(&self) -> String {
        let rounded = |value: f64| (value * 10.0).round() / 10.0;
        json!({
            "measurements": self.steps,
            "measurement_count": STEPS,
            "elapsed_s": rounded(self.elapsed.as_secs_f64()),
            "eta_s": rounded(self.eta_s()),
        })
        .to_string()
    }
}
