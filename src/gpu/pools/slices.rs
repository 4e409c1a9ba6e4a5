//! Which units of a pool are free.

/// A run of units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::gpu) struct Slice {
    /// The first unit.
    pub first: u64,
    /// How many there are.
    pub count: u64,
}

impl Slice {
    fn end(self) -> u64 {
        self.first + self.count
    }
}

/// Which units are free.
#[derive(Clone, Debug, Default)]
pub(super) struct Slices {
    capacity: u64,
    /// By their first units; no two touch, and none is empty.
    free: Vec<Slice>,
}

impl Slices {
    /// All units, free or not.
    pub fn capacity(&self) -> u64 {
        self.capacity
    }

    /// By how many units the capacity has to grow before `count` of them are free side by side.
    pub fn missing(&self, count: u64) -> u64 {
        if count == 0 || self.free.iter().any(|slice| slice.count >= count) {
            return 0;
        }
        let last = self.free.last().filter(|slice| slice.end() == self.capacity);
        count - last.map_or(0, |slice| slice.count)
    }

    /// Adds free units at the end.
    pub fn grow(&mut self, capacity: u64) {
        if capacity > self.capacity {
            let added = Slice { first: self.capacity, count: capacity - self.capacity };
            self.capacity = capacity;
            self.give_back(added);
        }
    }

    /// Takes the first units side by side that are free, if there are so many.
    pub fn take(&mut self, count: u64) -> Option<Slice> {
        if count == 0 {
            return Some(Slice::default());
        }
        let place = self.free.iter().position(|slice| slice.count >= count)?;
        let slice = &mut self.free[place];
        let taken = Slice { first: slice.first, count };
        *slice = Slice { first: slice.first + count, count: slice.count - count };
        if slice.count == 0 {
            self.free.remove(place);
        }
        Some(taken)
    }

    /// Frees units that were taken.
    pub fn give_back(&mut self, slice: Slice) {
        if slice.count == 0 {
            return;
        }
        let place = self.free.partition_point(|free| free.first < slice.first);
        self.free.insert(place, slice);
        let joins = |free: &[Slice], at: usize| free.get(at + 1).is_some_and(|next| free[at].end() == next.first);
        for at in [Some(place), place.checked_sub(1)].into_iter().flatten() {
            if joins(&self.free, at) {
                self.free[at].count += self.free[at + 1].count;
                self.free.remove(at + 1);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_capacity(capacity: u64) -> Slices {
        let mut slices = Slices::default();
        slices.grow(capacity);
        slices
    }

    #[test]
    fn slices_come_from_the_first_gap_that_has_room_and_gaps_side_by_side_become_one() {
        let mut slices = with_capacity(100);
        let taken: Vec<Slice> = [30, 10, 40, 20].into_iter().filter_map(|count| slices.take(count)).collect();
        assert_eq!(taken.iter().map(|slice| slice.first).collect::<Vec<_>>(), [0, 30, 40, 80]);
        assert_eq!(slices.take(1), None);
        slices.give_back(taken[0]);
        slices.give_back(taken[3]);
        assert_eq!(slices.take(15), Some(Slice { first: 0, count: 15 }));
        assert_eq!(slices.take(16), Some(Slice { first: 80, count: 16 }));
        assert_eq!(slices.take(16), None);
        slices.give_back(Slice { first: 0, count: 15 });
        slices.give_back(taken[1]);
        assert_eq!(slices.take(40), Some(Slice { first: 0, count: 40 }));
        slices.give_back(taken[2]);
        slices.give_back(Slice { first: 80, count: 16 });
        assert_eq!(slices.free, [Slice { first: 40, count: 60 }]);
    }

    #[test]
    fn growth_needs_what_the_free_end_lacks() {
        let mut slices = with_capacity(10);
        assert_eq!(slices.take(6), Some(Slice { first: 0, count: 6 }));
        assert_eq!([slices.missing(4), slices.missing(5), slices.missing(0)], [0, 1, 0]);
        slices.grow(11);
        assert_eq!(slices.take(5), Some(Slice { first: 6, count: 5 }));
        slices.give_back(Slice { first: 0, count: 6 });
        assert_eq!((slices.missing(7), slices.capacity()), (7, 11));
        assert_eq!(slices.take(0), Some(Slice::default()));
        slices.give_back(Slice::default());
        assert_eq!(slices.take(6), Some(Slice { first: 0, count: 6 }));
    }

    #[test]
    fn no_unit_is_ever_given_out_twice() {
        let mut slices = with_capacity(64);
        let mut taken: Vec<Slice> = Vec::new();
        for step in 0..2_000_u32 {
            let bits = crate::model::cells::random::hash(step);
            if bits & 1 == 0 && !taken.is_empty() {
                let slice = taken.swap_remove((bits >> 8) as usize % taken.len());
                slices.give_back(slice);
            } else if let Some(slice) = slices.take(1 + u64::from(bits >> 8) % 12) {
                taken.push(slice);
            }
            let mut owners = [0; 64];
            for slice in taken.iter().chain(&slices.free) {
                (slice.first..slice.end()).for_each(|unit| owners[unit as usize] += 1);
            }
            assert_eq!(owners, [1; 64], "step {step}");
        }
    }
}
