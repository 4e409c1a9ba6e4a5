//! Random numbers of the cells search: a chain of hashes over (seed, round), cell, step, candidate and slot.
//!
//! Twin: `glsl/shared/cells_random.glsl`. A step may need dozens of numbers on a device, where a hash of two
//! multiplications is far cheaper than Philox; each number still depends on its name alone.

/// What the numbers of one round are for. Chains of different purposes share numbers only by chance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Draw {
    /// The grid's offset.
    Grid = 1,
    /// Which cell an absent fly is dealt to; the next link is the fly's index.
    Deal = 2,
    /// The steps of a cell; the next links are its number, the step and the candidate.
    Step = 3,
}

/// A link of the chain: numbers are drawn from it by slot, or it leads on to the next link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chain(u32);

/// An integer hash of 32 bits with low bias: two multiplications and three shifts.
#[inline]
#[must_use]
pub fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7FEB_352D);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846C_A68B);
    x ^ x >> 16
}

impl Chain {
    /// The chain of one purpose in one round.
    #[must_use]
    pub fn new(seed: u64, round: u32, draw: Draw) -> Self {
        Self(hash(seed as u32)).then((seed >> 32) as u32).then(round).then(draw as u32)
    }

    /// The next link, by its number.
    #[inline]
    #[must_use]
    pub fn then(self, number: u32) -> Self {
        Self(hash(self.0 ^ number.wrapping_mul(0x9E37_79B9).wrapping_add(0x7F4A_7C15)))
    }

    /// 32 uniform bits, by slot.
    #[inline]
    #[must_use]
    pub fn bits(self, slot: u32) -> u32 {
        hash(self.0.wrapping_add(slot.wrapping_add(1).wrapping_mul(0x9E37_79B9)))
    }

    /// A number below `bound`, which must not be 0.
    #[inline]
    #[must_use]
    pub fn below(self, slot: u32, bound: u32) -> u32 {
        below(self.bits(slot), bound)
    }
}

/// A number below `bound` from 32 uniform bits; the bias is at most `bound` / 2^32.
#[inline]
#[must_use]
pub fn below(bits: u32, bound: u32) -> u32 {
    ((u64::from(bits) * u64::from(bound)) >> 32) as u32
}
