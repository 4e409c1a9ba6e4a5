//! The best population by global fitness: the start of every restart, and the result.
//!
//! When masks change or flies split, it begins anew, perhaps with a higher error, since populations from before the
//! change are not of the kind that the result will be.

use crate::model::Fly;

/// The best population since it began, kept up to date without copying whole populations.
#[derive(Clone, Debug)]
pub struct BestPopulation {
    flies: Vec<Fly>,
    sae: u64,
    /// Flies that may differ between the best and the current population, each once.
    differing: Vec<u32>,
    is_differing: Vec<bool>,
}

impl BestPopulation {
    /// Starts from an evaluated population.
    #[must_use]
    pub fn new(flies: &[Fly], sae: u64) -> Self {
        Self { flies: flies.to_vec(), sae, differing: Vec::new(), is_differing: vec![false; flies.len()] }
    }

    /// The flies of the best population.
    #[must_use]
    pub fn flies(&self) -> &[Fly] {
        &self.flies
    }

    /// Global fitness of the best population.
    #[must_use]
    pub fn sae(&self) -> u64 {
        self.sae
    }

    /// Notes that fly `index` of the current population was replaced.
    pub fn note_change(&mut self, index: u32) {
        if !std::mem::replace(&mut self.is_differing[index as usize], true) {
            self.differing.push(index);
        }
    }

    /// Offers the current population with its global fitness; keeps it and returns true if it is better.
    pub fn offer(&mut self, current: &[Fly], sae: u64) -> bool {
        if sae >= self.sae {
            return false;
        }
        self.sae = sae;
        for index in self.differing.drain(..) {
            self.flies[index as usize] = current[index as usize];
            self.is_differing[index as usize] = false;
        }
        true
    }

    /// Makes `current` the best population again (paper section 4: a restart begins from the best so far).
    pub fn restore(&mut self, current: &mut [Fly]) {
        for index in self.differing.drain(..) {
            current[index as usize] = self.flies[index as usize];
            self.is_differing[index as usize] = false;
        }
    }
}
