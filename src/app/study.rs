//! Evolutions of several pictures, made side by side: on the CPU one per thread, on a Vulkan device one after the
//! other.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use clap::Args;
use indicatif::HumanCount;
use rayon::prelude::*;
use serde_json::json;

use super::cli::ProgressKind;
use super::computing::ComputingArgs;
use super::curve::{Curve, Point};
use super::device::{Opened, Selected};
use super::interrupt::Interrupt;
use super::options::{Overwrite, Verbosity};
use super::progress::{Progress, Stage, short_time};
use super::{report, values};
use crate::engine::{Engine, Observer, side_by_side};
use crate::error::{Error, Result};
use crate::evolve::{Evolution, PaperScheme, Spread, StopReason, first_population};
use crate::metrics::{Picture, Reference, Score};
use crate::model::{Canvas, Fly, MaskSet, Population, Scene, Target};
use crate::photo::Photo;

/// Generations between two looks at the clock: some milliseconds.
const STRIDE: u32 = 256;

/// The flags of commands that make many mosaics.
#[derive(Clone, Debug, Args)]
pub(super) struct StudyArgs {
    /// Number that decides every random choice
    #[arg(long, value_name = "S", value_parser = values::seed, default_value_t = 0)]
    pub seed: u64,
    /// Write into a folder that holds other files, too
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub computing: ComputingArgs,
    /// How to show progress on stderr
    #[arg(long, value_enum, value_name = "KIND", default_value = "auto", help_heading = "Messages")]
    progress: ProgressKind,
    /// Say nothing but errors
    #[arg(short, long, help_heading = "Messages")]
    quiet: bool,
}

impl StudyArgs {
    pub(super) fn verbosity(&self) -> Verbosity {
        if self.quiet { Verbosity::Quiet } else { Verbosity::Normal }
    }

    pub(super) fn overwrite(&self) -> Overwrite {
        if self.force { Overwrite::Force } else { Overwrite::Refuse }
    }

    pub(super) fn progress(&self) -> Progress {
        Progress::new(self.progress.unless(self.quiet))
    }

    /// Says which page was written, and how long that took, unless nothing is to be said.
    pub(super) fn say_written(&self, page: &Path, began: Instant) {
        if !self.quiet {
            report::say(&format!("wrote {} in {:.1} s", page.display(), began.elapsed().as_secs_f64()));
        }
    }
}

/// One evolution to make.
#[derive(Clone, Debug)]
pub(super) struct Recipe {
    pub target: Arc<Target>,
    pub fly_count: usize,
    pub masks: Arc<MaskSet>,
    pub scheme: PaperScheme,
}

/// What was made by a recipe.
#[derive(Clone, Debug)]
pub(super) struct Made {
    pub population: Population,
    pub photo: Photo,
    pub births: u64,
    /// Of the best population.
    pub spread: Spread,
    /// Fitness and spread over births.
    pub curve: Vec<Point>,
    /// What each run but the last led to.
    pub runs: Vec<RunEnd>,
}

/// Where an evolution stood when a run ended.
#[derive(Clone, Debug)]
pub(super) struct RunEnd {
    /// The best population so far; wearing the masks of the next run, if those are others.
    pub population: Population,
    /// Of all runs so far.
    pub births: u64,
}

impl Recipe {
    /// The population before the first birth.
    pub(super) fn first(&self) -> Population {
        self.population(first_population(&self.scheme, &self.target, self.fly_count))
    }

    fn population(&self, flies: Vec<Fly>) -> Population {
        Population {
            width_px: self.target.width_px(),
            height_px: self.target.height_px(),
            background: [0; 3].into(),
            grout: None,
            masks: (*self.masks).clone(),
            flies,
        }
    }

    fn scene(&self) -> Scene {
        Scene {
            target: Arc::clone(&self.target),
            masks: Arc::clone(&self.masks),
            background: [0; 3],
            fly_count: self.fly_count,
        }
    }

    fn births_planned(&self) -> u64 {
        self.scheme.births.saturating_mul(u64::from(self.scheme.restarts) + 1)
    }
}

/// Where evolutions are made, and how far they are.
pub(super) struct Study<'a> {
    device: &'a Selected,
    interrupt: &'a Interrupt,
    progress: Mutex<Progress>,
    began: Instant,
    tally: Mutex<Standing>,
}

impl<'a> Study<'a> {
    pub(super) fn new(device: &'a Selected, interrupt: &'a Interrupt, progress: Progress) -> Self {
        Self {
            device,
            interrupt,
            progress: Mutex::new(progress),
            began: Instant::now(),
            tally: Mutex::new(Standing::default()),
        }
    }

    /// Makes the evolutions, in any order; the results are in the order of `recipes` and do not depend on it.
    ///
    /// # Errors
    /// If the device fails, or somebody asked for the end: then the finished ones are lost, and no other is begun.
    pub(super) fn evolve(&self, recipes: &[Recipe]) -> Result<Vec<Made>> {
        let began = self.began.elapsed();
        *self.tally() = Standing {
            began,
            elapsed: began,
            mosaics_planned: recipes.len(),
            births_planned: recipes.iter().map(Recipe::births_planned).sum(),
            ..Standing::default()
        };
        let has_failed = AtomicBool::new(false);
        let make = |recipe: &Recipe| unless(&has_failed, || self.evolve_one(recipe));
        let made = match self.device {
            Selected::Cpu { .. } => side_by_side(recipes.len(), |number| make(&recipes[number]))?,
            Selected::Vulkan { .. } => recipes.iter().map(make).collect::<Result<_>>()?,
        };
        Ok(made.into_iter().flatten().collect())
    }

    fn evolve_one(&self, recipe: &Recipe) -> Result<Made> {
        self.interrupt.check()?;
        let Opened { evaluator, .. } = self.device.open(vec![recipe.scene()])?;
        let (width_px, height_px) = (recipe.target.width_px(), recipe.target.height_px());
        let evolution = Evolution::new(recipe.scheme.clone(), 0, width_px, height_px, recipe.first().flies);
        let mut engine = Engine::new(evaluator, vec![evolution]);
        let mut follower = Follower { study: self, until_look: 0, births_told: 0 };
        let mut curve = Curve::new(0);
        let mut runs = Runs { recipe, ends: Vec::new() };
        engine.run(&mut (&mut follower, &mut (&mut curve, &mut runs)))?;
        curve.finish(engine.evolutions());
        let evolution = &engine.evolutions()[0];
        if evolution.stop_reason() == Some(StopReason::Interrupted) {
            return Err(Error::Interrupted);
        }
        follower.end(evolution);
        let births = evolution.outcome().births;
        let population = recipe.population(evolution.best_flies().to_vec());
        let spread = Spread::of(&population.flies, width_px, height_px);
        let mosaic = engine.evaluator().draw(&population, &Canvas::evaluation(width_px, height_px), 1)?;
        let photo = Photo { width_px, height_px, pixels: mosaic.pixels };
        Ok(Made { population, photo, births, spread, curve: curve.into_points(), runs: runs.ends })
    }

    /// How close each of `made` is to the target of its recipe.
    ///
    /// # Errors
    /// As [`score`], and if somebody asked for the end.
    pub(super) fn scores(&self, recipes: &[Recipe], made: &[Made]) -> Result<Vec<Score>> {
        let one = |(recipe, made): (&Recipe, &Made)| {
            self.interrupt.check()?;
            score(&recipe.target, &made.photo)
        };
        recipes.par_iter().zip(made).map(one).collect()
    }

    /// Draws a population of `recipe` on a canvas, each pixel the mean of `supersampling`² samples.
    ///
    /// # Errors
    /// If the device fails, or somebody asked for the end.
    pub(super) fn draw(
        &self,
        recipe: &Recipe,
        population: &Population,
        (canvas, supersampling): (&Canvas, u32),
    ) -> Result<Photo> {
        self.interrupt.check()?;
        let mosaic = self.device.open(vec![recipe.scene()])?.evaluator.draw(population, canvas, supersampling)?;
        Ok(Photo { width_px: mosaic.width_px, height_px: mosaic.height_px, pixels: mosaic.pixels })
    }

    /// Takes the progress bar away.
    pub(super) fn finish(&self) {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner).finish();
    }

    fn tally(&self) -> MutexGuard<'_, Standing> {
        self.tally.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes what was done, and tells it if it is time to.
    fn note(&self, births: u64, mosaics: usize) {
        let standing = {
            let mut tally = self.tally();
            tally.births += births;
            tally.mosaics += mosaics;
            tally.elapsed = self.began.elapsed();
            *tally
        };
        // Whoever finds it busy leaves the telling to the other.
        if let Ok(mut progress) = self.progress.try_lock()
            && progress.is_due(standing.elapsed)
        {
            progress.show(&standing);
        }
    }
}

/// Makes a piece of work, if none before it failed; nothing otherwise.
fn unless<T>(has_failed: &AtomicBool, make: impl FnOnce() -> Result<T>) -> Result<Option<T>> {
    if has_failed.load(Ordering::Relaxed) {
        return Ok(None);
    }
    make().map(Some).inspect_err(|_| has_failed.store(true, Ordering::Relaxed))
}

/// How close `photo` is to `target`.
///
/// # Errors
/// [`Error::Usage`] if they are too small to be compared.
pub(super) fn score(target: &Target, photo: &Photo) -> Result<Score> {
    let wanted = Picture { width_px: target.width_px(), height_px: target.height_px(), pixels: target.pixels() };
    let made = Picture { width_px: photo.width_px, height_px: photo.height_px, pixels: &photo.pixels };
    Reference::new(wanted).and_then(|reference| reference.score(made)).map_err(Error::Usage)
}

/// Follows one evolution of a study, and ends it when somebody asked for that.
struct Follower<'a> {
    study: &'a Study<'a>,
    until_look: u32,
    births_told: u64,
}

impl Follower<'_> {
    /// Births since the last time.
    fn new_births(&mut self, evolution: &Evolution) -> u64 {
        let births = evolution.outcome().births;
        births - std::mem::replace(&mut self.births_told, births)
    }

    /// Tells that the mosaic is made.
    fn end(&mut self, evolution: &Evolution) {
        let births = self.new_births(evolution);
        self.study.note(births, 1);
    }
}

impl Observer for Follower<'_> {
    fn after_generation(&mut self, evolutions: &[Evolution]) -> Option<StopReason> {
        if self.until_look == 0 {
            self.until_look = STRIDE;
            let births = self.new_births(&evolutions[0]);
            self.study.note(births, 0);
        }
        self.until_look -= 1;
        self.study.interrupt.is_requested().then_some(StopReason::Interrupted)
    }
}

/// Keeps the best population at each restart.
struct Runs<'a> {
    recipe: &'a Recipe,
    ends: Vec<RunEnd>,
}

impl Observer for Runs<'_> {
    fn after_generation(&mut self, evolutions: &[Evolution]) -> Option<StopReason> {
        let outcome = evolutions[0].outcome();
        if outcome.restarts as usize > self.ends.len() {
            let population = self.recipe.population(evolutions[0].best_flies().to_vec());
            self.ends.push(RunEnd { population, births: outcome.births });
        }
        None
    }
}

/// Where the evolutions of one call stand, all together.
#[derive(Clone, Copy, Debug, Default)]
struct Standing {
    /// Time since the study began.
    elapsed: Duration,
    /// Of that, the time before the first of these evolutions.
    began: Duration,
    mosaics: usize,
    mosaics_planned: usize,
    births: u64,
    births_planned: u64,
}

impl Standing {
    fn births_per_s(&self) -> f64 {
        self.births as f64 / (self.elapsed - self.began).as_secs_f64().max(1e-9)
    }

    /// Seconds left; unknown before the first birth.
    fn eta_s(&self) -> Option<f64> {
        let births_left = self.births_planned.saturating_sub(self.births);
        (self.births > 0).then(|| births_left as f64 / self.births_per_s())
    }
}

impl Stage for Standing {
    fn elapsed(&self) -> Duration {
        self.elapsed
    }

    fn share(&self) -> f64 {
        self.births as f64 / self.births_planned.max(1) as f64
    }

    fn line(&self) -> String {
        let left = self.eta_s().map(|eta_s| format!(", {} left", short_time(eta_s))).unwrap_or_default();
        format!(
            "{} of {} mosaics, {}/{} births, {} births/s{left}",
            self.mosaics,
            self.mosaics_planned,
            HumanCount(self.births),
            HumanCount(self.births_planned),
            HumanCount(self.births_per_s() as u64)
        )
    }

    fn json_line(&self) -> String {
        let rounded = |value: f64| (value * 10.0).round() / 10.0;
        let mut line = json!({
            "mosaics": self.mosaics,
            "mosaics_planned": self.mosaics_planned,
            "births": self.births,
            "births_planned": self.births_planned,
            "births_per_s": rounded(self.births_per_s()),
            "elapsed_s": rounded(self.elapsed.as_secs_f64()),
        });
        if let Some(eta_s) = self.eta_s() {
            line["eta_s"] = rounded(eta_s).into();
        }
        line.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_a_failure_no_other_piece_is_made_and_the_failure_is_what_is_told() {
        let has_failed = AtomicBool::new(false);
        let made = Mutex::new(Vec::new());
        let piece = |number: usize| {
            unless(&has_failed, || {
                made.lock().expect("nobody panics").push(number);
                if number == 2 { Err(Error::Usage("broken".to_owned())) } else { Ok(number) }
            })
        };
        let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("it starts");
        let failed = one_thread.install(|| side_by_side(6, piece)).expect_err("the third fails");
        assert_eq!(failed.to_string(), "broken");
        assert_eq!(made.into_inner().expect("nobody panics"), [0, 1, 2]);
    }

    #[test]
    fn the_standing_tells_mosaics_births_rate_and_time_left_of_what_is_being_made() {
        let standing = Standing {
            elapsed: Duration::from_secs(70),
            began: Duration::from_secs(60),
            mosaics: 2,
            mosaics_planned: 12,
            births: 1_000,
            births_planned: 4_000,
        };
        assert_eq!(standing.line(), "2 of 12 mosaics, 1,000/4,000 births, 100 births/s, 30s left");
        let line: serde_json::Value = serde_json::from_str(&standing.json_line()).expect("it is JSON");
        assert_eq!((&line["mosaics"], &line["eta_s"]), (&2.into(), &30.0.into()));
        let idle = Standing { births: 0, ..standing };
        assert_eq!(idle.line(), "2 of 12 mosaics, 0/4,000 births, 0 births/s");
    }
}
