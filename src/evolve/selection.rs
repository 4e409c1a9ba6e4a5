//! Threshold selection: a fly that does not help dies, a fly that helps breeds (paper section 4).

use super::scheme::OnDry;
use crate::model::rng::Stream;

/// How many random flies are tried before the threshold is given up.
const TRIES: u32 = 50;

/// The fly that a birth replaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Victim {
    /// A random fly with marginal fitness <= 0.
    Bad(u32),
    /// None was found; this is the lower of two random flies.
    Fallback(u32),
    /// None was found, and the scheme has no fallback.
    Dry,
}

/// Chooses flies of one population by their marginal fitness, each victim at most once a generation.
#[derive(Clone, Debug)]
pub struct Selection {
    taken: Vec<bool>,
    victims: Vec<u32>,
}

impl Selection {
    /// A selection for populations of `fly_count` flies.
    #[must_use]
    pub fn new(fly_count: usize) -> Self {
        Self { taken: vec![false; fly_count], victims: Vec::new() }
    }

    /// Begins a generation: every fly may die again.
    pub fn begin_generation(&mut self) {
        for fly in self.victims.drain(..) {
            self.taken[fly as usize] = false;
        }
    }

    /// A fly to die that has not been chosen in this generation. At least one must be left.
    pub fn choose_victim(&mut self, marginal: &[i64], on_dry: OnDry, stream: &mut Stream) -> Victim {
        let fly_count = marginal.len() as u32;
        for _ in 0..TRIES {
            let fly = stream.below(fly_count);
            if marginal[fly as usize] <= 0 && !self.taken[fly as usize] {
                self.take(fly);
                return Victim::Bad(fly);
            }
        }
        if on_dry != OnDry::Fallback {
            return Victim::Dry;
        }
        let (one, other) = (self.random_free(fly_count, stream), self.random_free(fly_count, stream));
        let fly = if marginal[other as usize] < marginal[one as usize] { other } else { one };
        self.take(fly);
        Victim::Fallback(fly)
    }

    fn random_free(&self, fly_count: u32, stream: &mut Stream) -> u32 {
        loop {
            let fly = stream.below(fly_count);
            if !self.taken[fly as usize] {
                return fly;
            }
        }
    }

    fn take(&mut self, fly: u32) {
        self.taken[fly as usize] = true;
        self.victims.push(fly);
    }
}

/// A random fly with marginal fitness > 0 to breed; if none is found, the higher of two random flies.
pub fn choose_parent(marginal: &[i64], stream: &mut Stream) -> u32 {
    let fly_count = marginal.len() as u32;
    for _ in 0..TRIES {
        let fly = stream.below(fly_count);
        if marginal[fly as usize] > 0 {
            return fly;
        }
    }
    let (one, other) = (stream.below(fly_count), stream.below(fly_count));
    if marginal[other as usize] > marginal[one as usize] { other } else { one }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::rng::Purpose;

    fn stream() -> Stream {
        Stream::new(5, Purpose::Birth, 0, 0)
    }

    #[test]
    fn only_flies_that_do_not_help_die_and_only_flies_that_help_breed() {
        let marginal: Vec<i64> = (0..100).map(|fly| fly % 5 - 2).collect();
        let mut stream = stream();
        let mut selection = Selection::new(marginal.len());
        for _ in 0..200 {
            selection.begin_generation();
            match selection.choose_victim(&marginal, OnDry::Fallback, &mut stream) {
                Victim::Bad(fly) => assert!(marginal[fly as usize] <= 0),
                other => panic!("60 of 100 flies are bad, yet {other:?}"),
            }
            assert!(marginal[choose_parent(&marginal, &mut stream) as usize] > 0);
        }
    }

    #[test]
    fn no_fly_dies_twice_in_a_generation_even_if_all_die() {
        let marginal = vec![-1, 3, 0, 7, -5, 2];
        let mut selection = Selection::new(marginal.len());
        let mut stream = stream();
        let mut dead: Vec<u32> = (0..6)
            .map(|_| match selection.choose_victim(&marginal, OnDry::Fallback, &mut stream) {
                Victim::Bad(fly) | Victim::Fallback(fly) => fly,
                Victim::Dry => panic!("the fallback always finds one"),
            })
            .collect();
        dead.sort_unstable();
        assert_eq!(dead, [0, 1, 2, 3, 4, 5]);
    }

    #[test]
    fn a_dry_population_is_reported_or_falls_back_to_the_lower_of_two() {
        let marginal: Vec<i64> = (1..=50).collect();
        let mut stream = stream();
        assert_eq!(Selection::new(50).choose_victim(&marginal, OnDry::Stop, &mut stream), Victim::Dry);
        let fallback = |_| match Selection::new(50).choose_victim(&marginal, OnDry::Fallback, &mut stream) {
            Victim::Fallback(fly) => u64::from(fly),
            other => panic!("{other:?} without a bad fly"),
        };
        let mean = (0..400).map(fallback).sum::<u64>() / 400;
        assert!((12..22).contains(&mean), "the lower of two of 0..50 is 16 on average, not {mean}");
    }
}
