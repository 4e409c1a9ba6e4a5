//! Integer tables of sine, size steps and bell-shaped steps, made once on the host by a portable implementation.
//!
//! `libm` gives the same bits on every platform, so the tables and every decision made with them are the same
//! everywhere. A device gets the tables as plain numbers.

use std::sync::LazyLock;

/// Entries of the sine table: one turn.
pub const TURN_STEPS: usize = 4096;
/// Sine and cosine are multiples of 1/4096.
pub const TRIG_ONE: i32 = 4096;
/// Entries of the table of bell-shaped steps.
const NORMAL_ENTRIES: usize = 1024;
/// Steps of the size table in each direction from 1.
const SIZE_STEPS: i32 = 1024;

static SINE: LazyLock<Vec<i32>> = LazyLock::new(|| {
    let angle = |step: usize| step as f64 * (std::f64::consts::TAU / TURN_STEPS as f64);
    (0..TURN_STEPS).map(|step| libm::round(f64::from(TRIG_ONE) * libm::sin(angle(step))) as i32).collect()
});

static NORMAL: LazyLock<Vec<i32>> = LazyLock::new(|| {
    let quantile = |entry: usize| inverse_normal((entry as f64 + 0.5) / NORMAL_ENTRIES as f64);
    (0..NORMAL_ENTRIES).map(|entry| libm::round(256.0 * quantile(entry)) as i32).collect()
});

static SIZE_FACTOR: LazyLock<Vec<u64>> = LazyLock::new(|| {
    (-SIZE_STEPS..=SIZE_STEPS).map(|step| libm::round(65536.0 * libm::exp(f64::from(step) / 256.0)) as u64).collect()
});

/// Cosine and sine, in units of 1/[`TRIG_ONE`], of an angle in 1/65536 of a turn; only its top 12 bits count.
#[must_use]
pub fn cos_sin(angle: u16) -> (i32, i32) {
    let step = usize::from(angle >> 4);
    (SINE[(step + TURN_STEPS / 4) % TURN_STEPS], SINE[step])
}

/// A bell-shaped number (mean 0, standard deviation 256) from 10 uniform bits: the inverse normal distribution.
#[must_use]
pub fn normal_q8(bits: u32) -> i32 {
    NORMAL[bits as usize % NORMAL_ENTRIES]
}

/// The factor e^(step/256) in units of 1/65536; steps beyond +-1024 count as +-1024.
#[must_use]
pub fn size_factor_q16(step: i32) -> u64 {
    SIZE_FACTOR[(step.clamp(-SIZE_STEPS, SIZE_STEPS) + SIZE_STEPS) as usize]
}

/// All tables as a device reads them: the sine of every step of a turn, the bell-shaped numbers, the factors of size.
#[must_use]
pub fn device_words() -> Vec<i32> {
    let factors = SIZE_FACTOR.iter().map(|&factor| factor as i32);
    SINE.iter().chain(NORMAL.iter()).copied().chain(factors).collect()
}

/// x with P(standard normal < x) = `p`, for 0 < `p` < 1, by bisection of the error function.
fn inverse_normal(p: f64) -> f64 {
    let (mut low, mut high) = (-8.0, 8.0);
    // 16 / 2^40 is far below the table's resolution of 1/256.
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if 0.5 * libm::erfc(-middle * std::f64::consts::FRAC_1_SQRT_2) < p {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sha2::{Digest, Sha256};

    #[test]
    fn quarter_turns_are_exact() {
        assert_eq!(cos_sin(0), (TRIG_ONE, 0));
        assert_eq!(cos_sin(1 << 14), (0, TRIG_ONE));
        assert_eq!(cos_sin(2 << 14), (-TRIG_ONE, 0));
        assert_eq!(cos_sin(3 << 14), (0, -TRIG_ONE));
    }

    #[test]
    fn bell_shaped_steps_are_symmetric_with_unit_deviation() {
        let entries: Vec<i64> = (0..1024).map(|bits| i64::from(normal_q8(bits))).collect();
        assert_eq!(entries.iter().sum::<i64>(), 0);
        let variance = entries.iter().map(|g| g * g).sum::<i64>() as f64 / 1024.0 / 65536.0;
        assert!((0.98..1.0).contains(&variance), "variance {variance}");
    }

    #[test]
    fn the_tables_are_the_same_numbers_on_every_machine() {
        let mut hash = Sha256::new();
        SINE.iter().chain(NORMAL.iter()).for_each(|value| hash.update(value.to_le_bytes()));
        SIZE_FACTOR.iter().for_each(|value| hash.update(value.to_le_bytes()));
        let digest: String = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(digest, "5457e95cc171fb008e464ef573418ff32622bdc1dde383b51a2d4d47c5c5f7d3");
    }
}
