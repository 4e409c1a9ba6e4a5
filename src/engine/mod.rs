//! The engine: evolutions and the evaluator that serves them all.
//!
//! One generation: every evolution breeds, the evaluator refreshes what changed in one dispatch, every evolution
//! absorbs its new fitness. The engine names no backend, reads no clock and writes no file; an [`Observer`] may.
//!
//! **Many pictures.** On a device they should be lanes, which share each dispatch: the lanes of one engine if all begin
//! and end together, else those of a [`Crew`]. On the CPU each picture should have its own engine, by [`side_by_side`].
//! A birth touches only a few blocks, too little work to share among threads, but whole evolutions share nothing and
//! scale with the cores (`cargo bench --bench lanes`).

mod crew;
mod stepping;

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use stepping::Stepper;

use crate::error::Result;
use crate::evolve::{Ended, Evolution, Observer, Seen, StopReason};
use crate::model::Evaluator;
use crate::threads;

pub use self::crew::{Crew, Finished, PaperTask, SearchTask, Task};

/// Does `count` independent pieces of work, such as an engine each, on as many threads as the current rayon pool has.
/// Returns the results in order.
///
/// Each thread takes the next piece when it has finished one. Parallel work within a piece stays on the piece's own
/// thread: in a common pool, a thread that waits for others might begin another whole piece.
///
/// # Errors
/// The error of the first piece, in order, that fails.
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
    threads::start(None)?;
    let pools = threads::pools(rayon::current_num_threads().min(count), 1);
    std::thread::scope(|scope| {
        let start = |pool| threads::spawn_in(scope, move || rayon::ThreadPool::install(pool, take_pieces)).ok();
        if pools.iter().map_while(start).count() == 0 {
            take_pieces();
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

    /// Evolves all lanes until each has ended. Then loads the best populations, so that the evaluator has their
    /// fitness.
    ///
    /// # Errors
    /// If the evaluator's device fails, or `observer`.
    pub fn run(&mut self, observer: &mut dyn Observer) -> Result<()> {
        self.begin(observer)?;
        while self.step(observer)? {}
        self.end(observer)
    }

    /// Evaluates the first populations: what [`Engine::run`] does first.
    ///
    /// # Errors
    /// If the evaluator's device fails, or `observer`.
    pub fn begin(&mut self, observer: &mut dyn Observer) -> Result<()> {
        Stepper::begin(&mut *self.evaluator, &mut self.evolutions)?;
        observer.at_start(&mut Seen::Evolutions(&self.evolutions))
    }

    /// Makes a generation; returns false if all lanes have ended.
    ///
    /// # Errors
    /// If the evaluator's device fails, or `observer`.
    pub fn step(&mut self, observer: &mut dyn Observer) -> Result<bool> {
        let Self { evaluator, evolutions, stepper } = self;
        if stepper.generation(&mut **evaluator, evolutions)? == 0 {
            return Ok(false);
        }
        let mut seen = Seen::Evolutions(evolutions);
        let (one, other) = (observer.after_round(&mut seen)?, observer.after_epoch(&mut seen)?);
        if let Some(reason) = one.or(other) {
            self.stop(reason);
        }
        Ok(true)
    }

    /// Ends all lanes that have not ended, for this reason.
    pub fn stop(&mut self, reason: StopReason) {
        self.evolutions.iter_mut().for_each(|evolution| evolution.stop(reason));
    }

    /// Evaluates the best populations: what [`Engine::run`] does last.
    ///
    /// # Errors
    /// If the evaluator's device fails, or `observer`.
    pub fn end(&mut self, observer: &mut dyn Observer) -> Result<()> {
        Stepper::end(&mut *self.evaluator, &self.evolutions)?;
        observer.at_end(&mut Seen::Evolutions(&self.evolutions))
    }

    /// The result of a lane's evolution, after [`Engine::run`].
    ///
    /// # Errors
    /// As [`Ended::of_evolution`].
    pub fn ended(&self, lane: usize) -> Result<Ended> {
        Ended::of_evolution(&self.evolutions[lane], &self.evaluator.evaluation(lane))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;

    #[test]
    fn pieces_are_done_once_each_and_keep_their_order_and_their_threads_to_themselves() {
        let pool = threads::pools(1, 3).pop().expect("a small pool");
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
