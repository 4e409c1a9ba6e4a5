//! Many mosaics by the paper's scheme, made side by side: on the CPU one per thread, on a Vulkan device one after the
//! other.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use clap::Args;
use indicatif::HumanCount;
use rayon::prelude::*;
use serde_json::{Map, Value};

use crate::cli::args::computing::ComputingArgs;
use crate::cli::files::destination::Overwrite;
use crate::cli::jobs::curve::{Curve, Point};
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::progress::{Progress, ProgressKind, Stage, rounded};
use crate::cli::terminal::{self, Verbosity};
use crate::cli::values;
use crate::engine::{Engine, side_by_side};
use crate::error::{Error, Result};
use crate::evolve::{Evolution, Observer, PaperScheme, Seen, Spread, StopReason, first_population};
use crate::metrics::{Picture, Reference, Score};
use crate::model::{Canvas, Fly, MaskSet, Population, Scene, Target};
use crate::photo::Photo;
use crate::studio::Device;

/// Generations between two looks at the clock. They take some milliseconds.
const STRIDE: u32 = 256;

/// The flags of commands that make many mosaics.
#[derive(Clone, Debug, Args)]
pub(crate) struct MosaicsArgs {
    /// Number that decides every random choice
    #[arg(long, value_name = "S", value_parser = values::seed, default_value_t = 0)]
    pub seed: u64,
    /// Write into the folder even if it holds other files
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

impl MosaicsArgs {
    pub(crate) fn verbosity(&self) -> Verbosity {
        if self.quiet { Verbosity::Quiet } else { Verbosity::Normal }
    }

    pub(crate) fn overwrite(&self) -> Overwrite {
        if self.force { Overwrite::Force } else { Overwrite::Refuse }
    }

    pub(crate) fn progress(&self) -> Progress {
        Progress::new(self.progress.unless(self.quiet), self.verbosity())
    }

    /// Says which page was written and how long it took, unless `--quiet` was given.
    pub(crate) fn say_written(&self, page: &Path, began: Instant) {
        if !self.quiet {
            terminal::say(&format!("wrote {} in {:.1} s", page.display(), began.elapsed().as_secs_f64()));
        }
    }
}

/// One evolution to make.
#[derive(Clone, Debug)]
pub(crate) struct PaperRecipe {
    pub target: Arc<Target>,
    pub fly_count: usize,
    pub masks: Arc<MaskSet>,
    pub scheme: PaperScheme,
}

/// What a recipe led to.
#[derive(Clone, Debug)]
pub(crate) struct Made {
    pub population: Population,
    pub photo: Photo,
    pub births: u64,
    /// Of the best population.
    pub spread: Spread,
    /// Fitness and spread over births.
    pub curve: Vec<Point>,
    /// What each run led to, except the last.
    pub runs: Vec<RunEnd>,
}

/// Where an evolution stood when a run ended.
#[derive(Clone, Debug)]
pub(crate) struct RunEnd {
    /// The best population so far. If the next run has other masks, it already wears them.
    pub population: Population,
    /// Of all runs so far.
    pub births: u64,
}

impl PaperRecipe {
    /// The population before the first birth.
    pub(crate) fn first(&self) -> Population {
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

/// Makes evolutions, and shows how far they have come.
pub(crate) struct Workshop<'a> {
    device: &'a Device,
    interrupt: &'a Interrupt,
    progress: Mutex<Progress>,
    began: Instant,
    tally: Mutex<MosaicsDone>,
}

impl<'a> Workshop<'a> {
    pub(crate) fn new(device: &'a Device, interrupt: &'a Interrupt, progress: Progress) -> Self {
        Self {
            device,
            interrupt,
            progress: Mutex::new(progress),
            began: Instant::now(),
            tally: Mutex::new(MosaicsDone::default()),
        }
    }

    /// Makes the evolutions, in any order; the results are in the order of `recipes` and do not depend on it.
    ///
    /// # Errors
    /// If the device fails, or the user interrupts. Then the finished ones are lost, and no other is begun.
    pub(crate) fn evolve(&self, recipes: &[PaperRecipe]) -> Result<Vec<Made>> {
        let began = self.began.elapsed();
        *self.tally() = MosaicsDone {
            began,
            elapsed: began,
            mosaics_planned: recipes.len(),
            births_planned: recipes.iter().map(PaperRecipe::births_planned).sum(),
            ..MosaicsDone::default()
        };
        let has_failed = AtomicBool::new(false);
        let make = |recipe: &PaperRecipe| unless(&has_failed, || self.evolve_one(recipe));
        let made = if self.device.is_cpu() {
            side_by_side(recipes.len(), |number| make(&recipes[number]))?
        } else {
            recipes.iter().map(make).collect::<Result<_>>()?
        };
        Ok(made.into_iter().flatten().collect())
    }

    fn evolve_one(&self, recipe: &PaperRecipe) -> Result<Made> {
        self.interrupt.check()?;
        let evaluator = self.device.open_evaluator(vec![recipe.scene()])?;
        let (width_px, height_px) = (recipe.target.width_px(), recipe.target.height_px());
        let evolution = Evolution::new(recipe.scheme.clone(), 0, width_px, height_px, recipe.first().flies);
        let mut engine = Engine::new(evaluator, vec![evolution]);
        let mut follower = Follower { workshop: self, until_look: 0, births_told: 0 };
        let mut curve = Curve::new(recipe.births_planned());
        let mut runs = Runs { recipe, ends: Vec::new() };
        engine.run(&mut (&mut follower, &mut (&mut curve, &mut runs)))?;
        let evolution = &engine.evolutions()[0];
        if evolution.stop_reason() == Some(StopReason::Interrupted) {
            return Err(Error::Interrupted);
        }
        follower.end(evolution);
        let births = evolution.outcome().births;
        let population = recipe.population(evolution.best_flies().to_vec());
        let spread = Spread::of(&population.flies, width_px, height_px);
        let mosaic = self.device.open_painter()?.draw(&population, &Canvas::evaluation(width_px, height_px), 1)?;
        let photo = Photo { width_px, height_px, pixels: mosaic.pixels };
        Ok(Made { population, photo, births, spread, curve: curve.into_points(), runs: runs.ends })
    }

    /// How close each of `made` is to the target of its recipe.
    ///
    /// # Errors
    /// As [`score`], and if the user interrupts.
    pub(crate) fn scores(&self, recipes: &[PaperRecipe], made: &[Made]) -> Result<Vec<Score>> {
        let one = |(recipe, made): (&PaperRecipe, &Made)| {
            self.interrupt.check()?;
            score(&recipe.target, &made.photo)
        };
        recipes.par_iter().zip(made).map(one).collect()
    }

    /// Draws a population on a canvas. Each pixel is the mean of `supersampling`² samples.
    ///
    /// # Errors
    /// If the device fails, or the user interrupts.
    pub(crate) fn draw(&self, population: &Population, canvas: &Canvas, supersampling: u32) -> Result<Photo> {
        self.interrupt.check()?;
        let mosaic = self.device.open_painter()?.draw(population, canvas, supersampling)?;
        Ok(Photo { width_px: mosaic.width_px, height_px: mosaic.height_px, pixels: mosaic.pixels })
    }

    /// Removes the progress bar.
    pub(crate) fn finish(&self) {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner).finish();
    }

    fn tally(&self) -> MutexGuard<'_, MosaicsDone> {
        self.tally.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts what was done, and shows it if it is time to.
    fn note(&self, births: u64, mosaics: usize) {
        let standing = {
            let mut tally = self.tally();
            tally.births += births;
            tally.mosaics += mosaics;
            tally.elapsed = self.began.elapsed();
            *tally
        };
        // If another thread is showing it, this one need not.
        if let Ok(mut progress) = self.progress.try_lock()
            && progress.is_due(standing.elapsed)
        {
            progress.show(&standing);
        }
    }
}

/// Does a piece of work, unless an earlier one failed.
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
pub(crate) fn score(target: &Target, photo: &Photo) -> Result<Score> {
    let wanted = Picture { width_px: target.width_px(), height_px: target.height_px(), pixels: target.pixels() };
    let made = Picture { width_px: photo.width_px, height_px: photo.height_px, pixels: &photo.pixels };
    Reference::new(wanted).and_then(|reference| reference.score(made)).map_err(Error::Usage)
}

/// Watches one evolution of a workshop, and ends it if the user interrupts.
struct Follower<'a> {
    workshop: &'a Workshop<'a>,
    until_look: u32,
    births_told: u64,
}

impl Follower<'_> {
    /// Births since the last time.
    fn new_births(&mut self, births: u64) -> u64 {
        births - std::mem::replace(&mut self.births_told, births)
    }

    /// Counts the mosaic as made.
    fn end(&mut self, evolution: &Evolution) {
        let births = self.new_births(evolution.outcome().births);
        self.workshop.note(births, 1);
    }
}

impl Observer for Follower<'_> {
    fn after_epoch(&mut self, seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
        if self.until_look == 0 {
            self.until_look = STRIDE;
            let births = self.new_births(seen.stage().births);
            self.workshop.note(births, 0);
        }
        self.until_look -= 1;
        Ok(self.workshop.interrupt.is_requested().then_some(StopReason::Interrupted))
    }
}

/// Keeps the best population at each restart.
struct Runs<'a> {
    recipe: &'a PaperRecipe,
    ends: Vec<RunEnd>,
}

impl Observer for Runs<'_> {
    fn after_epoch(&mut self, seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
        let stage = seen.stage();
        if stage.restarts as usize > self.ends.len() {
            let population = self.recipe.population(seen.best_flies()?);
            self.ends.push(RunEnd { population, births: stage.births });
        }
        Ok(None)
    }
}

/// How far all evolutions of one call have come together.
#[derive(Clone, Copy, Debug, Default)]
struct MosaicsDone {
    /// Time since the workshop began.
    elapsed: Duration,
    /// The part of it before the first of these evolutions.
    began: Duration,
    mosaics: usize,
    mosaics_planned: usize,
    births: u64,
    births_planned: u64,
}

impl MosaicsDone {
    fn births_per_s(&self) -> f64 {
        self.births as f64 / (self.elapsed - self.began).as_secs_f64().max(1e-9)
    }
}

impl Stage for MosaicsDone {
    fn elapsed(&self) -> Duration {
        self.elapsed
    }

    fn share(&self) -> f64 {
        self.births as f64 / self.births_planned.max(1) as f64
    }

    fn eta_s(&self) -> Option<f64> {
        let births_left = self.births_planned.saturating_sub(self.births);
        (self.births > 0).then(|| births_left as f64 / self.births_per_s())
    }

    fn count(&self) -> String {
        format!("{}/{} mosaics", self.mosaics, self.mosaics_planned)
    }

    fn details(&self) -> String {
        format!(
            "{}/{} births, {} births/s",
            HumanCount(self.births),
            HumanCount(self.births_planned),
            HumanCount(self.births_per_s() as u64)
        )
    }

    fn json(&self) -> Map<String, Value> {
        Map::from_iter([
            ("mosaics".to_owned(), self.mosaics.into()),
            ("mosaics_planned".to_owned(), self.mosaics_planned.into()),
            ("births".to_owned(), self.births.into()),
            ("births_planned".to_owned(), self.births_planned.into()),
            ("births_per_s".to_owned(), rounded(self.births_per_s(), 1).into()),
        ])
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
        let one_thread = crate::threads::pools(1, 1).pop().expect("it starts");
        let failed = one_thread.install(|| side_by_side(6, piece)).expect_err("the third fails");
        assert_eq!(failed.to_string(), "broken");
        assert_eq!(made.into_inner().expect("nobody panics"), [0, 1, 2]);
    }

    #[test]
    fn the_standing_tells_mosaics_births_rate_and_time_left_of_what_is_being_made() {
        let standing = MosaicsDone {
            elapsed: Duration::from_secs(70),
            began: Duration::from_secs(60),
            mosaics: 2,
            mosaics_planned: 12,
            births: 1_000,
            births_planned: 4_000,
        };
        assert_eq!((standing.share(), standing.eta_s()), (0.25, Some(30.0)));
        assert_eq!(standing.count(), "2/12 mosaics");
        assert_eq!(standing.details(), "1,000/4,000 births, 100 births/s");
        assert_eq!(standing.json()["mosaics"], 2);
        let idle = MosaicsDone { births: 0, ..standing };
        assert_eq!((idle.share(), idle.eta_s()), (0.0, None));
    }
}
