//! Fitness as a running sum over blocks: when a block is evaluated again, its old parts are subtracted and its new ones
//! added.

use super::evaluation::Evaluation;

/// What one block of pixels adds to the fitness of its lane.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BlockParts {
    /// What it adds to the marginal fitness of flies: index and part, zeroes left out.
    pub marginal: Vec<(u32, i32)>,
    /// What it adds to the SAE.
    pub error: u32,
}

impl BlockParts {
    /// Replaces the parts by `error` and a part of marginal fitness for each fly.
    pub fn set(&mut self, flies: impl Iterator<Item = u32>, marginal: &[i32], error: u32) {
        self.error = error;
        self.marginal.clear();
        self.marginal.extend(flies.zip(marginal.iter().copied()).filter(|&(_, part)| part != 0));
    }
}

/// The fitness of a lane, summed up from its blocks.
#[derive(Clone, Debug)]
pub struct Tally {
    sae: u64,
    marginal: Vec<i64>,
}

impl Tally {
    /// The tally of `fly_count` flies before any block is added.
    #[must_use]
    pub fn new(fly_count: usize) -> Self {
        Self { sae: 0, marginal: vec![0; fly_count] }
    }

    /// Subtracts all blocks.
    pub fn clear(&mut self) {
        self.sae = 0;
        self.marginal.fill(0);
    }

    /// Adds a block.
    pub fn add(&mut self, block: &BlockParts) {
        self.sae += u64::from(block.error);
        for &(fly, part) in &block.marginal {
            self.marginal[fly as usize] += i64::from(part);
        }
    }

    /// Subtracts a block that was added before.
    pub fn subtract(&mut self, block: &BlockParts) {
        self.sae -= u64::from(block.error);
        for &(fly, part) in &block.marginal {
            self.marginal[fly as usize] -= i64::from(part);
        }
    }

    /// The sums.
    #[must_use]
    pub fn evaluation(&self) -> Evaluation<'_> {
        Evaluation { sae: self.sae, marginal: &self.marginal }
    }
}
