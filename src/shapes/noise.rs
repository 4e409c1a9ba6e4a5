//! Smooth noise from integers: bristles and the grain of paper.

use super::drawing::smooth_step;

/// 1 as a fixed-point coordinate of the noise.
pub(super) const ONE: i64 = 256;

/// Smooth noise from 0 to 255 at (x, y), in 1/[`ONE`] and not negative: random values at whole numbers, blended in
/// between.
pub(super) fn noise(seed: u32, x: i64, y: i64) -> i64 {
    let (column, row) = ((x / ONE) as u32, (y / ONE) as u32);
    let (right, down) = (smooth_step(x % ONE, 0, ONE), smooth_step(y % ONE, 0, ONE));
    let between = |a: i64, b: i64, weight: i64| (a * (255 - weight) + b * weight) / 255;
    let line = |row| between(random(seed, column, row), random(seed, column + 1, row), right);
    between(line(row), line(row + 1), down)
}

/// A value from 0 to 255 that depends on the three numbers alone: the finaliser of MurmurHash3 applied to their
/// mixture.
fn random(seed: u32, column: u32, row: u32) -> i64 {
    let mut bits = seed.wrapping_mul(0x9E37_79B9) ^ column.wrapping_mul(0x85EB_CA6B) ^ row.wrapping_mul(0xC2B2_AE35);
    bits = (bits ^ (bits >> 16)).wrapping_mul(0x85EB_CA6B);
    bits = (bits ^ (bits >> 13)).wrapping_mul(0xC2B2_AE35);
    i64::from((bits ^ (bits >> 16)) >> 24)
}
