//! Pictures of a device that was lost: another device takes them. So no thread that evolves ends before all have
//! nothing left to do.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// What is to be done anew, and who could do it.
pub(super) struct Orphans<T> {
    state: Mutex<State<T>>,
    has_changed: Condvar,
}

struct State<T> {
    waiting: Vec<T>,
    /// Threads that evolve pictures.
    threads: usize,
    /// Those of them that have nothing to do.
    idle: usize,
}

impl<T> Orphans<T> {
    pub(super) fn new() -> Self {
        let state = State { waiting: Vec::new(), threads: 0, idle: 0 };
        Self { state: Mutex::new(state), has_changed: Condvar::new() }
    }

    fn state(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts a thread that evolves. It ends when [`Orphans::wait`] has nothing for it, or with [`Orphans::quit`] or
    /// [`Orphans::give`].
    pub(super) fn enter(&self) {
        self.state().threads += 1;
    }

    /// A picture that waits, if there is one now.
    pub(super) fn take(&self) -> Option<T> {
        self.state().waiting.pop()
    }

    /// The next picture for a thread that has nothing to do; none once all threads are so.
    pub(super) fn wait(&self) -> Option<T> {
        let mut state = self.state();
        state.idle += 1;
        self.has_changed.notify_all();
        let is_over = |state: &State<T>| state.idle >= state.threads;
        while state.waiting.is_empty() && !is_over(&state) {
            state = self.has_changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        let next = state.waiting.pop();
        if next.is_some() {
            state.idle -= 1;
        }
        next
    }

    /// Ends a thread that leaves its work undone.
    pub(super) fn quit(&self) {
        self.state().threads -= 1;
        self.has_changed.notify_all();
    }

    /// Leaves these pictures to the other threads, and ends; gives them back if there is no other thread.
    pub(super) fn give(&self, pictures: Vec<T>) -> Result<(), Vec<T>> {
        let mut state = self.state();
        if state.threads <= 1 {
            return Err(pictures);
        }
        state.threads -= 1;
        state.waiting.extend(pictures);
        self.has_changed.notify_all();
        Ok(())
    }
}

/// Quits for a thread that panics, so that the others need not wait for it.
pub(super) struct QuitsInPanic<'o, T>(pub &'o Orphans<T>);

impl<T> Drop for QuitsInPanic<'_, T> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.quit();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::threads;

    #[test]
    fn a_thread_without_work_takes_the_pictures_of_another_one_that_is_lost() {
        let orphans = Orphans::new();
        orphans.enter();
        orphans.enter();
        std::thread::scope(|scope| {
            let idle = threads::spawn_in(scope, || std::iter::from_fn(|| orphans.wait()).collect::<Vec<i32>>());
            assert_eq!(orphans.give(vec![1, 2]), Ok(()));
            let mut taken = idle.expect("there is room for a thread").join().expect("it ends");
            taken.sort_unstable();
            assert_eq!(taken, [1, 2]);
        });
    }

    #[test]
    fn the_last_thread_keeps_its_pictures() {
        let orphans = Orphans::new();
        orphans.enter();
        orphans.enter();
        orphans.quit();
        assert_eq!(orphans.give(vec![3]), Err(vec![3]), "nobody else is left");
        assert_eq!(orphans.wait(), None);
    }
}
