//! Makes new flies: children of one good fly or of two, mutated or not, random flies, and halves of flies that split.

use super::first::newcomers;
use super::scheme::{ONE_Q16, PaperScheme};
use super::selection::choose_parent;
use crate::model::operators::{Amplitudes, RandomFlies, crossed, halved, mutated};
use crate::model::rng::{Purpose, Stream};
use crate::model::{Fly, Target};

/// Makes the flies of one run.
#[derive(Clone, Debug)]
pub(super) struct Breeder {
    amplitudes: Amplitudes,
    newcomers: RandomFlies,
}

impl Breeder {
    /// The breeder of the first run, in which `living` flies live and wear the mask `layers`.
    pub(super) fn new(scheme: &PaperScheme, size_px: (u32, u32), living: usize, layers: &[u16]) -> Self {
        Self {
            amplitudes: Amplitudes::paper(size_px.0, size_px.1, living).turning(scheme.rotation),
            newcomers: newcomers(scheme, size_px, living, layers),
        }
    }

    /// The mask layers that random flies wear.
    pub(super) fn layers(&self) -> &[u16] {
        &self.newcomers.layers
    }

    /// Sets the mask layers that random flies wear from now on.
    pub(super) fn set_layers(&mut self, layers: &[u16]) {
        self.newcomers.layers = layers.to_vec();
    }

    /// Scales all mutation steps.
    pub(super) fn cool(&mut self, factor_q16: u32) {
        self.amplitudes = self.amplitudes.scaled(factor_q16);
    }

    /// A new fly. Its parents are chosen by the marginal fitness of the living `flies`. A chance at its default draws
    /// no random number.
    pub(super) fn child(&self, scheme: &PaperScheme, flies: &[Fly], marginal: &[i64], stream: &mut Stream) -> Fly {
        if scheme.new_blood_q16 > 0 && stream.chance(scheme.new_blood_q16) {
            return self.newcomers.fly(stream);
        }
        let mut child = flies[choose_parent(marginal, stream) as usize];
        if scheme.crossover_q16 > 0 && stream.chance(scheme.crossover_q16) {
            let other = &flies[choose_parent(marginal, stream) as usize];
            child = crossed(&child, other, stream.below(ONE_Q16 + 1));
        }
        child.alive = true;
        if scheme.mutation_q16 < ONE_Q16 && !stream.chance(scheme.mutation_q16) {
            return child;
        }
        scheme.color.mutated(&child, self.mutant(&child, stream), stream)
    }

    /// Mitosis: the first `living` flies, which live, split in two as long as there is room, each half with half of the
    /// area. One half is a copy. The other is mutated, and takes the next absent place.
    pub(super) fn split(&self, scheme: &PaperScheme, target: &Target, flies: &mut [Fly], living: usize, run: u32) {
        for place in living..flies.len().min(2 * living) {
            let half = halved(&flies[place - living]);
            let mut stream = Stream::new(scheme.seed, Purpose::Mitosis, run, place as u64);
            let mutant = scheme.color.mutated(&half, self.mutant(&half, &mut stream), &mut stream);
            flies[place - living] = half;
            flies[place] = scheme.color.alone(target, &mutant);
        }
    }

    fn mutant(&self, fly: &Fly, stream: &mut Stream) -> Fly {
        mutated(fly, &self.amplitudes, self.newcomers.width_px, self.newcomers.height_px, stream)
    }
}
