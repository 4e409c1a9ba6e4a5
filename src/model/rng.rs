//! The counter-based generator: Philox 4x32-10 (Salmon et al., SC 2011).
//!
//! Every decision draws from its own [`Stream`], named by (seed, purpose, round, slot). What a stream yields depends on
//! its name alone: never on threads, other streams, or the number of pictures that evolve together.

use std::convert::Infallible;

use rand::TryRng;

/// What a stream of random numbers is for; streams of different purposes never share numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Genes of the first population; slot = fly.
    FirstPopulation = 1,
    /// One birth of the paper's scheme (selection and mutation); round = run, slot = birth.
    Birth = 2,
    /// The mask that a fly wears from a run on; round = run, slot = fly.
    Mask = 3,
    /// The mutated half of a fly that splits; round = run, slot = its place.
    Mitosis = 4,
}

/// An endless sequence of 32-bit numbers, named by (seed, purpose, round, slot).
#[derive(Clone, Debug)]
pub struct Stream {
    key: [u32; 2],
    counter: [u32; 4],
    words: [u32; 4],
    used: usize,
}

impl Stream {
    /// The stream of this name, at its start.
    #[must_use]
    pub fn new(seed: u64, purpose: Purpose, round: u32, slot: u64) -> Self {
        // 32 bits of position, 56 of slot, 32 of round, 8 of purpose: no two names share a counter.
        let top = ((slot >> 32) as u32) << 8 | purpose as u32;
        Self { key: [seed as u32, (seed >> 32) as u32], counter: [0, slot as u32, round, top], words: [0; 4], used: 4 }
    }

    /// The next 32 uniform bits.
    pub fn bits(&mut self) -> u32 {
        if self.used == self.words.len() {
            self.words = philox(self.counter, self.key);
            self.counter[0] = self.counter[0].wrapping_add(1);
            self.used = 0;
        }
        self.used += 1;
        self.words[self.used - 1]
    }

    /// A number below `bound`, which must not be 0. The bias is at most `bound` / 2^32.
    pub fn below(&mut self, bound: u32) -> u32 {
        ((u64::from(self.bits()) * u64::from(bound)) >> 32) as u32
    }

    /// True with a probability of `probability_q16` / 65536; always true from 65,536 on.
    pub fn chance(&mut self, probability_q16: u32) -> bool {
        self.bits() >> 16 < probability_q16
    }
}

impl TryRng for Stream {
    type Error = Infallible;

    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        Ok(self.bits())
    }

    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        let low = u64::from(self.bits());
        Ok(u64::from(self.bits()) << 32 | low)
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
        for chunk in bytes.chunks_mut(4) {
            let word = self.bits().to_le_bytes();
            chunk.copy_from_slice(&word[..chunk.len()]);
        }
        Ok(())
    }
}

/// Philox 4x32 with 10 rounds: a bijection of the counter for each key.
fn philox(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    for _ in 0..10 {
        let even = u64::from(counter[0]) * 0xD251_1F53;
        let odd = u64::from(counter[2]) * 0xCD9E_8D57;
        counter = [
            (odd >> 32) as u32 ^ counter[1] ^ key[0],
            odd as u32,
            (even >> 32) as u32 ^ counter[3] ^ key[1],
            even as u32,
        ];
        key = [key[0].wrapping_add(0x9E37_79B9), key[1].wrapping_add(0xBB67_AE85)];
    }
    counter
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known answers of the Random123 distribution, `kat_vectors`.
    #[test]
    fn philox_gives_the_published_known_answers() {
        assert_eq!(philox([0; 4], [0; 2]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(philox([u32::MAX; 4], [u32::MAX; 2]), [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]);
        assert_eq!(
            philox([0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344], [0xa409_3822, 0x299f_31d0]),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }

    #[test]
    fn streams_of_different_names_differ() {
        let first = |seed, purpose, round, slot| Stream::new(seed, purpose, round, slot).bits();
        let base = first(7, Purpose::Birth, 3, 5);
        assert_ne!(base, first(8, Purpose::Birth, 3, 5));
        assert_ne!(base, first(7 | 1 << 32, Purpose::Birth, 3, 5));
        assert_ne!(base, first(7, Purpose::FirstPopulation, 3, 5));
        assert_ne!(base, first(7, Purpose::Birth, 4, 5));
        assert_ne!(base, first(7, Purpose::Birth, 3, 5 | 1 << 32));
    }

    #[test]
    fn numbers_below_a_bound_reach_every_value_about_equally() {
        let mut stream = Stream::new(1, Purpose::Birth, 0, 0);
        let mut counts = [0_u32; 7];
        (0..70_000).for_each(|_| counts[stream.below(7) as usize] += 1);
        assert!(counts.iter().all(|count| (9_600..10_400).contains(count)), "{counts:?}");
    }

    #[test]
    fn chances_are_as_likely_as_they_say() {
        let mut stream = Stream::new(2, Purpose::Birth, 0, 0);
        assert!((0..10_000).all(|_| stream.chance(1 << 16) && !stream.chance(0)));
        let hits = (0..10_000).filter(|_| stream.chance(1 << 14)).count();
        assert!((2_300..2_700).contains(&hits), "{hits} of 10,000 at 1/4");
    }
}
