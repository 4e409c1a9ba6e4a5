//! Makes one generation of any number of evolutions: each of them breeds, the evaluator refreshes what changed in one
//! dispatch, and each absorbs its new fitness.

use crate::error::Result;
use crate::evolve::{Evolution, Step};
use crate::model::{Change, Evaluator, Fly};

/// Steps evolutions. It reuses its buffers in each generation.
#[derive(Debug, Default)]
pub(super) struct Stepper {
    changes: Vec<Change>,
    /// For each evolution the end of its part of the changes.
    ends: Vec<usize>,
    restarted: Vec<usize>,
}

impl Stepper {
    /// Evaluates the first populations of evolutions.
    pub fn begin(evaluator: &mut dyn Evaluator, evolutions: &mut [Evolution]) -> Result<()> {
        load(evaluator, evolutions, Evolution::flies)?;
        for evolution in evolutions {
            evolution.absorb(&[], evaluator.evaluation(evolution.lane()).sae);
        }
        Ok(())
    }

    /// Breed, evaluate, absorb; returns how many evolutions have not ended.
    pub fn generation(&mut self, evaluator: &mut dyn Evaluator, evolutions: &mut [Evolution]) -> Result<usize> {
        let Self { changes, ends, restarted } = self;
        changes.clear();
        ends.clear();
        restarted.clear();
        let mut alive = 0;
        for (place, evolution) in evolutions.iter_mut().enumerate() {
            let (lane, evaluation) = (evaluator.lane(evolution.lane()), evaluator.evaluation(evolution.lane()));
            match evolution.breed(lane, &evaluation, changes) {
                Step::Replace => alive += 1,
                Step::Restart => {
                    alive += 1;
                    restarted.push(place);
                }
                Step::Stop(_) => {}
            }
            ends.push(changes.len());
        }
        if !restarted.is_empty() {
            let populations: Vec<(usize, &[Fly])> =
                restarted.iter().map(|&place| (evolutions[place].lane(), evolutions[place].flies())).collect();
            evaluator.load(&populations)?;
        }
        if !changes.is_empty() {
            evaluator.replace(changes)?;
        }
        let mut first = 0;
        for (evolution, &end) in evolutions.iter_mut().zip(&*ends) {
            evolution.absorb(&changes[first..end], evaluator.evaluation(evolution.lane()).sae);
            first = end;
        }
        Ok(alive)
    }

    /// Evaluates the best populations of evolutions, so that their lanes have that fitness.
    pub fn end(evaluator: &mut dyn Evaluator, evolutions: &[Evolution]) -> Result<()> {
        load(evaluator, evolutions, Evolution::best_flies)
    }
}

fn load(evaluator: &mut dyn Evaluator, evolutions: &[Evolution], flies: impl Fn(&Evolution) -> &[Fly]) -> Result<()> {
    if evolutions.is_empty() {
        return Ok(());
    }
    let populations: Vec<(usize, &[Fly])> =
        evolutions.iter().map(|evolution| (evolution.lane(), flies(evolution))).collect();
    evaluator.load(&populations)
}
