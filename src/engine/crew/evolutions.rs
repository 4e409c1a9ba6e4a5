//! Pictures in the paper's scheme on one device. Their lanes share every dispatch, and each begins and ends
//! independently of the others.

use super::{Finished, PaperTask};
use crate::engine::stepping::Stepper;
use crate::error::Result;
use crate::evolve::{Ended, Evolution};
use crate::model::Evaluator;

/// Births of one [`Evolutions::step`] in all lanes together: some milliseconds of work.
const BIRTHS_PER_STEP: u64 = 512;
/// Most generations of a step.
const GENERATIONS_PER_STEP: u64 = 64;

/// Evolves pictures as lanes of one evaluator. The result of a picture is the same as with its own
/// [`crate::engine::Engine`], whatever evolves beside it and whenever it is admitted.
pub(super) struct Evolutions {
    evaluator: Box<dyn Evaluator>,
    evolutions: Vec<Evolution>,
    /// The tickets of the evolutions, in the same order.
    tickets: Vec<u64>,
    /// How many of the first evolutions have been evaluated. The others were just admitted.
    begun: usize,
    stepper: Stepper,
}

impl Evolutions {
    /// No pictures, on an evaluator without lanes.
    ///
    /// # Panics
    /// If the evaluator has lanes already.
    pub fn new(evaluator: Box<dyn Evaluator>) -> Self {
        assert_eq!(evaluator.lane_count(), 0, "a crew begins without lanes");
        Self { evaluator, evolutions: Vec::new(), tickets: Vec::new(), begun: 0, stepper: Stepper::default() }
    }

    /// Takes in a picture. Returns false if the device has no room for it until some others have ended. Its evolution
    /// begins with the next step.
    ///
    /// # Errors
    /// If the device has no room for the picture even without the others, or fails.
    ///
    /// # Panics
    /// If the first population is not as large as the scene says, or empty.
    pub fn admit(&mut self, ticket: u64, task: PaperTask) -> Result<bool> {
        let PaperTask { scene, scheme, first_flies } = task;
        assert_eq!(first_flies.len(), scene.fly_count, "as many flies as the scene says");
        let (width_px, height_px) = (scene.target.width_px(), scene.target.height_px());
        let Some(lane) = self.evaluator.admit(scene)? else { return Ok(false) };
        self.evolutions.push(Evolution::new(scheme, lane, width_px, height_px, first_flies));
        self.tickets.push(ticket);
        Ok(true)
    }

    /// Makes some generations of all pictures, each generation in one dispatch. That is some milliseconds of work, or
    /// less if a picture ends. Returns the pictures that ended, in the order of their admission. Their lanes are free
    /// again.
    ///
    /// # Errors
    /// If the device fails.
    pub fn step(&mut self) -> Result<Vec<Finished>> {
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
    pub fn len(&self) -> usize {
        self.evolutions.len()
    }

    /// Births of all pictures.
    pub fn births(&self) -> u64 {
        self.evolutions.iter().map(|evolution| evolution.outcome().births).sum()
    }

    /// Evaluates the best populations of the evolutions that ended, and frees their lanes.
    fn take_ended(&mut self) -> Result<Vec<Finished>> {
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
            let outcome = Ended::of_evolution(&evolution, &self.evaluator.evaluation(lane));
            self.evaluator.release(lane);
            Finished { ticket, outcome }
        };
        Ok(tickets.into_iter().zip(ended).map(finished).collect())
    }
}
