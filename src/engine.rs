//! The engine: evolutions and the evaluator that serves them all.
//!
//! One generation: every evolution breeds, the evaluator refreshes what changed in one dispatch, every evolution
//! absorbs its new fitness. The engine names no backend, reads no clock and writes no file; an [`Observer`] may.

use crate::error::Result;
use crate::evolve::{Evolution, Step, StopReason};
use crate::model::{Change, Evaluator, Fly};

/// Watches an evolution and may end it.
pub trait Observer {
    /// Called once, when the first populations are evaluated and nothing was born yet.
    fn before_first_generation(&mut self, _evolutions: &[Evolution]) {}

    /// Called after every generation; a reason ends all evolutions.
    fn after_generation(&mut self, evolutions: &[Evolution]) -> Option<StopReason>;
}

/// An observer that never ends anything.
#[derive(Clone, Copy, Debug, Default)]
pub struct Undisturbed;

impl Observer for Undisturbed {
    fn after_generation(&mut self, _evolutions: &[Evolution]) -> Option<StopReason> {
        None
    }
}

/// Runs the evolutions of all lanes of an evaluator.
pub struct Engine {
    evaluator: Box<dyn Evaluator>,
    evolutions: Vec<Evolution>,
    changes: Vec<Change>,
}

impl Engine {
    /// An engine for evolutions whose lanes are those of `evaluator`.
    ///
    /// # Panics
    /// If evolution k is not for lane k.
    #[must_use]
    pub fn new(evaluator: Box<dyn Evaluator>, evolutions: Vec<Evolution>) -> Self {
        assert_eq!(evaluator.lane_count(), evolutions.len(), "one evolution per lane");
        assert!(evolutions.iter().enumerate().all(|(lane, evolution)| evolution.lane() == lane));
        Self { evaluator, evolutions, changes: Vec::new() }
    }

    /// The evolutions, in the order of their lanes.
    #[must_use]
    pub fn evolutions(&self) -> &[Evolution] {
        &self.evolutions
    }

    /// The evaluator.
    pub fn evaluator(&mut self) -> &mut dyn Evaluator {
        &mut *self.evaluator
    }

    /// Evolves all lanes until each has ended, then loads the best populations, so that the evaluator's fitness is
    /// theirs.
    ///
    /// # Errors
    /// If the evaluator's device fails.
    pub fn run(&mut self, observer: &mut dyn Observer) -> Result<()> {
        let populations: Vec<(usize, &[Fly])> = self.evolutions.iter().map(|e| (e.lane(), e.flies())).collect();
        self.evaluator.load(&populations)?;
        for evolution in &mut self.evolutions {
            evolution.absorb(&[], self.evaluator.evaluation(evolution.lane()).sae);
        }
        observer.before_first_generation(&self.evolutions);
        while self.generation()? {
            if let Some(reason) = observer.after_generation(&self.evolutions) {
                self.evolutions.iter_mut().for_each(|evolution| evolution.stop(reason));
            }
        }
        let populations: Vec<(usize, &[Fly])> = self.evolutions.iter().map(|e| (e.lane(), e.best_flies())).collect();
        self.evaluator.load(&populations)
    }

    /// Breed, evaluate, absorb; false when all evolutions have ended.
    fn generation(&mut self) -> Result<bool> {
        self.changes.clear();
        let mut shares = Vec::with_capacity(self.evolutions.len());
        let mut restarted = Vec::new();
        let mut any_alive = false;
        for evolution in &mut self.evolutions {
            let first = self.changes.len();
            match evolution.breed(&self.evaluator.evaluation(evolution.lane()), &mut self.changes) {
                Step::Replace => any_alive = true,
                Step::Restart => {
                    any_alive = true;
                    restarted.push(evolution.lane());
                }
                Step::Stop(_) => {}
            }
            shares.push(first..self.changes.len());
        }
        if !restarted.is_empty() {
            let populations: Vec<(usize, &[Fly])> =
                restarted.iter().map(|&lane| (lane, self.evolutions[lane].flies())).collect();
            self.evaluator.load(&populations)?;
        }
        if !self.changes.is_empty() {
            self.evaluator.replace(&self.changes)?;
        }
        for (evolution, share) in self.evolutions.iter_mut().zip(shares) {
            evolution.absorb(&self.changes[share], self.evaluator.evaluation(evolution.lane()).sae);
        }
        Ok(any_alive)
    }
}
