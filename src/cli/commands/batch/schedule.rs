//! Decides which picture comes next: in order, but a picture that must follow another waits until that one is finished.

use std::collections::{HashMap, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use crate::cli::list::Item;

/// The numbers of the pictures that are still to be read, shared by the threads that read.
pub(super) struct Schedule {
    state: Mutex<State>,
    changed: Condvar,
    /// The id of every picture.
    ids: Vec<String>,
}

#[derive(Default)]
struct State {
    /// The pictures that are ready, in order.
    ready: VecDeque<usize>,
    /// The pictures that wait, by the id that they wait for.
    waiting: HashMap<String, Vec<usize>>,
    is_ended: bool,
}

impl Schedule {
    /// Schedules all `items`. They must not wait for each other in a circle, which `check_order` makes sure of.
    pub(super) fn new(items: &[Item]) -> Self {
        let mut state = State::default();
        for (number, item) in items.iter().enumerate() {
            match &item.after {
                Some(first) => state.waiting.entry(first.clone()).or_default().push(number),
                None => state.ready.push_back(number),
            }
        }
        let ids = items.iter().map(|item| item.id.clone()).collect();
        Self { state: Mutex::new(state), changed: Condvar::new(), ids }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The next picture, as soon as one is ready; none if nothing is left to do.
    pub(super) fn next(&self) -> Option<usize> {
        let mut state = self.state();
        loop {
            if state.is_ended {
                return None;
            }
            if let Some(number) = state.ready.pop_front() {
                return Some(number);
            }
            if state.waiting.is_empty() {
                return None;
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Notes that a picture is finished. Those that waited for it are ready now, ahead of all others.
    pub(super) fn note_done(&self, id: &str) {
        let mut state = self.state();
        for number in state.waiting.remove(id).unwrap_or_default().into_iter().rev() {
            state.ready.push_front(number);
        }
        self.changed.notify_all();
    }

    /// Notes that a picture failed. Returns those that waited for it, directly or through others: they fail, too.
    pub(super) fn note_failed(&self, id: &str) -> Vec<usize> {
        let mut state = self.state();
        let mut failed = state.waiting.remove(id).unwrap_or_default();
        let mut next = 0;
        while next < failed.len() {
            failed.extend(state.waiting.remove(&self.ids[failed[next]]).unwrap_or_default());
            next += 1;
        }
        self.changed.notify_all();
        failed
    }

    /// Stops: no more pictures are given out.
    pub(super) fn end(&self) {
        self.state().is_ended = true;
        self.changed.notify_all();
    }
}
