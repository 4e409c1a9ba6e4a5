//! Random numbers that a seed and a name decide, so that every input can be made again.

/// A stream of random numbers (SplitMix64).
pub struct Dice(u64);

impl Dice {
    /// The stream of one input.
    #[must_use]
    pub fn new(seed: u64, name: &str, index: u64) -> Self {
        // FNV-1a.
        let hash = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3);
        let named = name.bytes().chain(seed.to_le_bytes()).fold(0xCBF2_9CE4_8422_2325, hash);
        let mut dice = Self(named ^ index.wrapping_mul(0xD134_2543_DE82_EF95));
        dice.number();
        dice
    }

    /// Any number.
    pub fn number(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// A number below `limit`, and 0 if that is 0.
    pub fn below(&mut self, limit: usize) -> usize {
        (self.number() % (limit.max(1) as u64)) as usize
    }

    /// A range within `length`, rarely a long one.
    pub fn range(&mut self, length: usize) -> std::ops::Range<usize> {
        let longest = if self.one_in(4) { length } else { length.min(16) };
        let (start, count) = (self.below(length), 1 + self.below(longest));
        start..length.min(start + count)
    }

    /// One of `all`, which must not be empty.
    pub fn pick<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len())]
    }

    /// True once in `count` times.
    pub fn one_in(&mut self, count: usize) -> bool {
        self.below(count) == 0
    }
}
