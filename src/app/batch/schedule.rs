//! Which picture comes next: in order, but none before the one that it comes after is there.

use std::collections::{HashMap, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use super::items::Item;

/// The pictures that are still to be read, by their numbers, for all threads that read them.
pub(super) struct Schedule {
    state: Mutex<State>,
    changed: Condvar,
    /// The id of every picture.
    ids: Vec<String>,
}

#[derive(Default)]
struct State {
    /// In order.
    ready: VecDeque<usize>,
    /// By the id that they wait for.
    waiting: HashMap<String, Vec<usize>>,
    is_ended: bool,
}

impl Schedule {
    /// All of `items`, which `check_order` found no circle in.
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

    /// The next picture, as soon as one is ready; none if no more is to be done.
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

    /// Notes that a picture is there: those that come after it are ready, ahead of all others.
    pub(super) fn note_done(&self, id: &str) {
        let mut state = self.state();
        for number in state.waiting.remove(id).unwrap_or_default().into_iter().rev() {
            state.ready.push_front(number);
        }
        self.changed.notify_all();
    }

    /// Notes that a picture failed; returns those that came after it, which now fail, too, and those after them.
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

    /// Gives out no picture any more.
    pub(super) fn end(&self) {
        self.state().is_ended = true;
        self.changed.notify_all();
    }
}
