//! Who has which part of the buffers that all lanes share: neighbouring places, first fit.

use std::ops::Range;

/// A row of places, of which runs are taken and given back.
#[derive(Debug)]
pub(super) struct Slots {
    capacity: usize,
    /// The free runs, in order; none is empty and no two touch.
    free: Vec<Range<usize>>,
}

impl Slots {
    /// So many free places.
    pub fn new(capacity: usize) -> Self {
        let mut slots = Self { capacity: 0, free: Vec::new() };
        slots.grow(capacity);
        slots
    }

    /// Places, free or not.
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// Takes `count` neighbouring places, the first that are free; the first of them.
    pub fn take(&mut self, count: usize) -> Option<usize> {
        if count == 0 {
            return Some(0);
        }
        let run = self.free.iter().position(|run| run.len() >= count)?;
        let first = self.free[run].start;
        self.free[run].start += count;
        if self.free[run].is_empty() {
            self.free.remove(run);
        }
        Some(first)
    }

    /// Frees places that were taken.
    pub fn give_back(&mut self, places: Range<usize>) {
        if places.is_empty() {
            return;
        }
        let next = self.free.partition_point(|run| run.start < places.start);
        debug_assert!(next == 0 || self.free[next - 1].end <= places.start, "{places:?} were free");
        debug_assert!(self.free.get(next).is_none_or(|run| places.end <= run.start), "{places:?} were free");
        self.free.insert(next, places);
        if self.free.get(next + 1).is_some_and(|after| after.start == self.free[next].end) {
            self.free[next].end = self.free.remove(next + 1).end;
        }
        if next > 0 && self.free[next - 1].end == self.free[next].start {
            self.free[next - 1].end = self.free.remove(next).end;
        }
    }

    /// Adds free places at the end, if there are fewer than `capacity`.
    pub fn grow(&mut self, capacity: usize) {
        let end = self.capacity;
        self.capacity = end.max(capacity);
        self.give_back(end..self.capacity);
    }

    /// The least capacity with which `count` places can be taken.
    pub fn capacity_for(&self, count: usize) -> usize {
        if count == 0 || self.free.iter().any(|run| run.len() >= count) {
            return self.capacity;
        }
        let at_the_end = self.free.last().filter(|run| run.end == self.capacity).map_or(0, Range::len);
        self.capacity + count - at_the_end
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::rng::{Purpose, Stream};

    #[test]
    fn the_first_run_that_is_long_enough_is_taken_and_neighbours_become_one_run_again() {
        let mut slots = Slots::new(10);
        assert_eq!([slots.take(3), slots.take(4), slots.take(3), slots.take(1)], [Some(0), Some(3), Some(7), None]);
        slots.give_back(0..3);
        slots.give_back(7..10);
        assert_eq!([slots.take(4), slots.take(0)], [None, Some(0)]);
        slots.give_back(3..7);
        assert_eq!(slots.take(10), Some(0));
    }

    #[test]
    fn the_end_grows_by_what_is_missing() {
        let mut slots = Slots::new(4);
        assert_eq!((slots.take(3), slots.capacity_for(1), slots.capacity_for(5)), (Some(0), 4, 8));
        slots.grow(8);
        assert_eq!((slots.capacity(), slots.take(5), slots.capacity_for(2)), (8, Some(3), 10));
        slots.give_back(0..3);
        assert_eq!((slots.capacity_for(3), slots.capacity_for(4)), (8, 12));
        slots.grow(2);
        assert_eq!(slots.capacity(), 8);
    }

    #[test]
    fn whatever_is_taken_and_given_back_no_place_has_two_owners_and_all_come_back() {
        let mut stream = Stream::new(1, Purpose::Birth, 0, 0);
        let mut slots = Slots::new(0);
        let mut taken: Vec<Range<usize>> = Vec::new();
        for _ in 0..3_000 {
            if stream.below(5) < 3 {
                let count = 1 + stream.below(40) as usize;
                slots.grow(slots.capacity_for(count).min(700));
                if let Some(first) = slots.take(count) {
                    assert!(first + count <= slots.capacity());
                    assert!(taken.iter().all(|other| other.end <= first || first + count <= other.start));
                    taken.push(first..first + count);
                }
            } else if !taken.is_empty() {
                let place = stream.below(taken.len() as u32) as usize;
                slots.give_back(taken.swap_remove(place));
            }
        }
        taken.into_iter().for_each(|places| slots.give_back(places));
        assert_eq!((slots.capacity(), slots.take(700)), (700, Some(0)));
    }
}
