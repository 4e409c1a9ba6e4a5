//! Evolutions of several pictures, made side by side: on the CPU one per thread, on a Vulkan device one after the
//! other.

use std::sync::Arc;
use std::sync::Mutex;
use std::time::Instant;

use super::curve::{Curve, Point};
use super::device::{Opened, Selected};
use super::interrupt::Interrupt;
use super::progress::{Progress, Standing};
use crate::engine::{Engine, Observer, side_by_side};
use crate::error::{Error, Result};
use crate::evolve::{Evolution, PaperScheme, Spread, StopReason, first_population};
use crate::metrics::{Picture, Reference, Score};
use crate::model::{Canvas, MaskSet, Population, Scene, Target};
use crate::photo::Photo;

/// Generations between two looks at the clock: some milliseconds.
const STRIDE: u32 = 256;

/// One evolution to make.
#[derive(Clone, Debug)]
pub(super) struct Recipe {
    pub target: Arc<Target>,
    pub fly_count: usize,
    pub masks: Arc<MaskSet>,
    pub scheme: PaperScheme,
}

/// What became of it.
#[derive(Clone, Debug)]
pub(super) struct Evolved {
    pub population: Population,
    pub photo: Photo,
    pub score: Score,
    pub births: u64,
    /// Of the best population.
    pub spread: Spread,
    /// Fitness and spread over births.
    pub curve: Vec<Point>,
}

impl Recipe {
    /// The population before the first birth.
    pub(super) fn first(&self) -> Population {
        self.population(first_population(&self.scheme, &self.target, self.fly_count))
    }

    fn population(&self, flies: Vec<crate::model::Fly>) -> Population {
        Population {
            width_px: self.target.width_px(),
            height_px: self.target.height_px(),
            background: [0; 3],
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
}

/// Where evolutions are made, and how far they are.
pub(super) struct Study<'a> {
    device: &'a Selected,
    interrupt: &'a Interrupt,
    progress: Mutex<Progress>,
    began: Instant,
    tally: Mutex<Tally>,
}

/// Births of all evolutions of a study together.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    births: u64,
    births_planned: u64,
    sae: u64,
}

impl<'a> Study<'a> {
    pub(super) fn new(device: &'a Selected, interrupt: &'a Interrupt, progress: Progress) -> Self {
        Self {
            device,
            interrupt,
            progress: Mutex::new(progress),
            began: Instant::now(),
            tally: Mutex::new(Tally::default()),
        }
    }

    /// Makes the evolutions, in any order; the results are in the order of `recipes` and do not depend on it.
    ///
    /// # Errors
    /// If the device fails, or somebody asked for the end: then the first finished ones are lost.
    pub(super) fn evolve(&self, recipes: &[Recipe]) -> Result<Vec<Evolved>> {
        let planned = |recipe: &Recipe| recipe.scheme.births.saturating_mul(u64::from(recipe.scheme.restarts) + 1);
        self.tally().births_planned += recipes.iter().map(planned).sum::<u64>();
        match self.device {
            Selected::Cpu { .. } => side_by_side(recipes.len(), |number| self.evolve_one(&recipes[number])),
            Selected::Vulkan { .. } => recipes.iter().map(|recipe| self.evolve_one(recipe)).collect(),
        }
    }

    fn evolve_one(&self, recipe: &Recipe) -> Result<Evolved> {
        if self.interrupt.is_requested() {
            return Err(Error::Interrupted);
        }
        let Opened { evaluator, .. } = self.device.open(vec![recipe.scene()])?;
        let (width_px, height_px) = (recipe.target.width_px(), recipe.target.height_px());
        let flies = recipe.first().flies;
        let evolution = Evolution::new(recipe.scheme.clone(), 0, width_px, height_px, flies);
        let mut engine = Engine::new(evaluator, vec![evolution]);
        let mut watch = Watch { study: self, until_look: 0, births_told: 0 };
        let mut curve = Curve::new(0);
        engine.run(&mut (&mut watch, &mut curve))?;
        curve.finish(engine.evolutions());
        watch.tell(&engine.evolutions()[0]);
        let evolution = &engine.evolutions()[0];
        if evolution.stop_reason() == Some(StopReason::Interrupted) {
            return Err(Error::Interrupted);
        }
        let births = evolution.outcome().births;
        let population = recipe.population(evolution.best_flies().to_vec());
        let spread = Spread::of(&population.flies, width_px, height_px);
        let mosaic = engine.evaluator().draw(&population, &Canvas::evaluation(width_px, height_px), 1)?;
        let photo = Photo { width_px, height_px, pixels: mosaic.pixels };
        let score = score(&recipe.target, &photo)?;
        Ok(Evolved { population, photo, score, births, spread, curve: curve.into_points() })
    }

    /// Draws a population of `recipe` on a canvas, each pixel the mean of `supersampling`² samples.
    pub(super) fn draw(
        &self,
        recipe: &Recipe,
        population: &Population,
        (canvas, supersampling): (&Canvas, u32),
    ) -> Result<Photo> {
        let mosaic = self.device.open(vec![recipe.scene()])?.evaluator.draw(population, canvas, supersampling)?;
        Ok(Photo { width_px: mosaic.width_px, height_px: mosaic.height_px, pixels: mosaic.pixels })
    }

    /// Takes the progress bar away.
    pub(super) fn finish(&self) {
        self.progress.lock().unwrap_or_else(std::sync::PoisonError::into_inner).finish();
    }

    fn tally(&self) -> std::sync::MutexGuard<'_, Tally> {
        self.tally.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
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

/// Watches one evolution of a study.
struct Watch<'a> {
    study: &'a Study<'a>,
    until_look: u32,
    births_told: u64,
}

impl Watch<'_> {
    fn tell(&mut self, evolution: &Evolution) {
        let births = evolution.outcome().births;
        let standing = {
            let mut tally = self.study.tally();
            tally.births += births - std::mem::replace(&mut self.births_told, births);
            tally.sae = evolution.best_sae().unwrap_or_default();
            *tally
        };
        let elapsed = self.study.began.elapsed();
        // Whoever finds it busy leaves the telling to the other.
        if let Ok(mut progress) = self.study.progress.try_lock()
            && progress.is_due(elapsed)
        {
            let Tally { births, births_planned, sae } = standing;
            progress.show(&Standing { elapsed, births, births_planned, sae, time_limit: None });
        }
    }
}

impl Observer for Watch<'_> {
    fn after_generation(&mut self, evolutions: &[Evolution]) -> Option<StopReason> {
        if self.until_look == 0 {
            self.until_look = STRIDE;
            self.tell(&evolutions[0]);
        }
        self.until_look -= 1;
        self.study.interrupt.is_requested().then_some(StopReason::Interrupted)
    }
}
