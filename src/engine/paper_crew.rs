//! Many pictures by the paper's scheme on one device: lanes that share every dispatch, and come and go by themselves.

use super::stepping::Stepper;
use crate::error::Result;
use crate::evolve::{Evolution, PaperScheme};
use crate::model::{Evaluator, Fly, Scene};

/// Births of a [`PaperCrew::step`], of all lanes together: some milliseconds of work.
const BIRTHS_PER_STEP: u64 = 512;
/// Most generations of a step.
const GENERATIONS_PER_STEP: u64 = 64;

/// What a picture evolves by, and from.
#[derive(Clone, Debug)]
pub struct PaperTask {
    /// The scheme.
    pub scheme: PaperScheme,
    /// The first population: by [`crate::evolve::first_population`] or [`crate::evolve::begin_from`].
    pub first_flies: Vec<Fly>,
}

/// A picture whose evolution ended.
#[derive(Clone, Debug)]
pub struct PaperResult {
    /// The ticket that it was admitted with.
    pub ticket: u64,
    /// What became of it: its best population, why it ended, what it counted.
    pub evolution: Evolution,
    /// Global fitness of the best population, evaluated once more.
    pub sae: u64,
    /// Marginal fitness of the flies of the best population.
    pub marginal: Vec<i64>,
}

/// Evolves pictures as lanes of one evaluator. Whatever evolves beside a picture, and whenever it is admitted, its result is
/// that of an [`super::Engine`] of its own.
pub struct PaperCrew {
    evaluator: Box<dyn Evaluator>,
    evolutions: Vec<Evolution>,
    /// Those of the evolutions, in their order.
    tickets: Vec<u64>,
    /// How many of the evolutions, from the first on, have been evaluated; the others were just admitted.
    begun: usize,
    stepper: Stepper,
}

impl PaperCrew {
    /// A crew without pictures.
    ///
    /// # Panics
    /// If the evaluator has lanes already.
    #[must_use]
    pub fn new(evaluator: Box<dyn Evaluator>) -> Self {
        assert_eq!(evaluator.lane_count(), 0, "a crew begins without lanes");
        Self { evaluator, evolutions: Vec::new(), tickets: Vec::new(), begun: 0, stepper: Stepper::default() }
    }

    /// Takes in the picture of `scene`, unless the device has no room for it beside the others: then false, until some of
    /// them have ended. Its evolution begins with the next step.
    ///
    /// # Errors
    /// If the device has no room for the picture even alone, or fails.
    ///
    /// # Panics
    /// If the first population is not as large as the scene says, or empty.
    pub fn admit(&mut self, ticket: u64, scene: &Scene, task: &PaperTask) -> Result<bool> {
        assert_eq!(task.first_flies.len(), scene.fly_count, "as many flies as the scene says");
        let Some(lane) = self.evaluator.admit(scene.clone())? else { return Ok(false) };
        let (width_px, height_px) = (scene.target.width_px(), scene.target.height_px());
        let evolution = Evolution::new(task.scheme.clone(), lane, width_px, height_px, task.first_flies.clone());
        self.evolutions.push(evolution);
        self.tickets.push(ticket);
        Ok(true)
    }

    /// Makes some generations of all pictures, each in one dispatch: some milliseconds of work, less if a picture ends.
    /// Returns those that ended, in the order of their admission; their lanes are free.
    ///
    /// # Errors
    /// If the device fails.
    pub fn step(&mut self) -> Result<Vec<PaperResult>> {
        Stepper::begin(&mut *self.evaluator, &mut self.evolutions[self.begun..])?;
        self.begun = self.evolutions.len();
        let (mut generations, mut births) = (0, 0);
        while generations < GENERATIONS_PER_STEP && births < BIRTHS_PER_STEP {
            let before = self.births();
            let alive = self.stepper.generation(&mut *self.evaluator, &mut self.evolutions)?;
            generations += 1;
            births += self.births() - before;
            if alive < self.evolutions.len() {
                break;
            }
        }
        self.take_ended()
    }

    /// Drops all pictures without a result.
    pub fn cancel_all(&mut self) {
        for evolution in self.evolutions.drain(..) {
            self.evaluator.release(evolution.lane());
        }
        self.tickets.clear();
        self.begun = 0;
    }

    /// Number of pictures.
    #[must_use]
    pub fn len(&self) -> usize {
        self.evolutions.len()
    }

    /// Whether there are no pictures.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.evolutions.is_empty()
    }

    /// The evolutions of all pictures, each with its ticket, in the order of their admission.
    pub fn evolutions(&self) -> impl Iterator<Item = (u64, &Evolution)> {
        self.tickets.iter().copied().zip(&self.evolutions)
    }

    /// The evaluator, to draw with.
    pub fn evaluator(&mut self) -> &mut dyn Evaluator {
        &mut *self.evaluator
    }

    fn births(&self) -> u64 {
        self.evolutions.iter().map(|evolution| evolution.outcome().births).sum()
    }

    /// Evaluates the best populations of those that ended, and frees their lanes.
    fn take_ended(&mut self) -> Result<Vec<PaperResult>> {
        if self.evolutions.iter().all(|evolution| evolution.stop_reason().is_none()) {
            return Ok(Vec::new());
        }
        let together = self.tickets.drain(..).zip(self.evolutions.drain(..));
        let (ended, going): (Vec<_>, Vec<_>) = together.partition(|(_, evolution)| evolution.stop_reason().is_some());
        (self.tickets, self.evolutions) = going.into_iter().unzip();
        self.begun = self.evolutions.len();
        let (tickets, ended): (Vec<u64>, Vec<Evolution>) = ended.into_iter().unzip();
        Stepper::end(&mut *self.evaluator, &ended)?;
        let finished = |(ticket, evolution): (u64, Evolution)| {
            let lane = evolution.lane();
            let evaluation = self.evaluator.evaluation(lane);
            let (sae, marginal) = (evaluation.sae, evaluation.marginal.to_vec());
            self.evaluator.release(lane);
            PaperResult { ticket, evolution, sae, marginal }
        };
        Ok(tickets.into_iter().zip(ended).map(finished).collect())
    }
}
