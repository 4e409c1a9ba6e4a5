//! The engine: evolutions and the evaluator that serves them all.
//!
//! One generation: every evolution breeds, the evaluator refreshes what changed in one dispatch, every evolution
//! absorbs its new fitness. The engine names no backend, reads no clock and writes no file; an [`Observer`] may.
//!
//! **Many pictures.** A device wants them as lanes, which share each dispatch: of one engine if all begin and end together,
//! else of a [`PaperCrew`]. The CPU wants an engine each, by [`side_by_side`]: a birth touches a few blocks, too little work to share among threads, while whole evolutions share
//! nothing and scale with the cores (`cargo bench --bench lanes`).

mod crew;
mod paper_crew;
mod stepping;

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use stepping::Stepper;

use crate::error::{Error, Result};
use crate::evolve::{Evolution, StopReason};
use crate::model::Evaluator;

pub use self::crew::{Ended, Finished, SearchCrew};
pub use self::paper_crew::{PaperCrew, PaperResult, PaperTask};

/// Watches an evolution and may end it.
pub trait Observer {
    /// Called once, when the first populations have been evaluated.
    fn at_start(&mut self, _evolutions: &[Evolution]) {}

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

/// Observes only if there is an observer.
impl<O: Observer> Observer for Option<O> {
    fn at_start(&mut self, evolutions: &[Evolution]) {
        if let Some(observer) = self {
            observer.at_start(evolutions);
        }
    }

    fn after_generation(&mut self, evolutions: &[Evolution]) -> Option<StopReason> {
        self.as_mut()?.after_generation(evolutions)
    }
}

/// Both observe; the first reason counts.
impl<A: Observer, B: Observer> Observer for (&mut A, &mut B) {
    fn at_start(&mut self, evolutions: &[Evolution]) {
        self.0.at_start(evolutions);
        self.1.at_start(evolutions);
    }

    fn after_generation(&mut self, evolutions: &[Evolution]) -> Option<StopReason> {
        let (one, other) = (self.0.after_generation(evolutions), self.1.after_generation(evolutions));
        one.or(other)
    }
}

/// Does `count` independent pieces of work, such as an engine each, on as many threads as the current rayon pool has; the
/// results, in order.
///
/// Each thread takes the next piece when it is done with one. What a piece itself would share among threads stays on its
/// own: waiting for a share, a thread of a common pool might begin another whole piece.
///
/// # Errors
/// The error of the first piece, in order, that has one; [`Error::Internal`] if threads cannot be started.
pub fn side_by_side<T: Send>(count: usize, piece: impl Fn(usize) -> Result<T> + Sync) -> Result<Vec<T>> {
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(count));
    let take_pieces = || loop {
        let number = next.fetch_add(1, Ordering::Relaxed);
        if number >= count {
            return;
        }
        let result = piece(number);
        done.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((number, result));
    };
    let pools: Vec<rayon::ThreadPool> = (0..rayon::current_num_threads().min(count))
        .map(|_| rayon::ThreadPoolBuilder::new().num_threads(1).build())
        .collect::<Result<_, _>>()
        .map_err(|error| Error::Internal(format!("threads cannot be started ({error})")))?;
    std::thread::scope(|scope| {
        for pool in &pools {
            scope.spawn(|| pool.install(take_pieces));
        }
    });
    let mut done = done.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    done.sort_by_key(|(number, _)| *number);
    done.into_iter().map(|(_, result)| result).collect()
}

/// Runs the evolutions of all lanes of an evaluator.
pub struct Engine {
    evaluator: Box<dyn Evaluator>,
    evolutions: Vec<Evolution>,
    stepper: Stepper,
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
        Self { evaluator, evolutions, stepper: Stepper::default() }
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
        let Self { evaluator, evolutions, stepper } = self;
        Stepper::begin(&mut **evaluator, evolutions)?;
        observer.at_start(evolutions);
        while stepper.generation(&mut **evaluator, evolutions)? > 0 {
            if let Some(reason) = observer.after_generation(evolutions) {
                evolutions.iter_mut().for_each(|evolution| evolution.stop(reason));
            }
        }
        Stepper::end(&mut **evaluator, evolutions)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_done_once_each_and_keep_their_order_and_their_threads_to_themselves() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().expect("a small pool");
        let squares = pool.install(|| {
            side_by_side(50, |number| {
                assert_eq!(rayon::current_num_threads(), 1);
                Ok(number * number)
            })
        });
        assert_eq!(squares.expect("no piece fails"), (0..50).map(|number| number * number).collect::<Vec<_>>());
        assert!(side_by_side(0, |_| Ok(())).expect("nothing to fail").is_empty());
    }

    #[test]
    fn the_first_failure_in_order_is_told() {
        let failed = side_by_side(9, |number| match number {
            0..4 => Ok(()),
            _ => Err(Error::parameter("number", number.to_string())),
        });
        assert_eq!(failed.expect_err("five pieces fail").to_string(), "number: 4");
    }
}
