//! The colour of a child from the pixels where it would show.
//!
//! Twin: `glsl/shared/cells_color.glsl`.

/// The lower median of one channel of packed colours: the smallest value `m` with more than `(count - 1) / 2` values at
/// most `m`. It is found bit by bit from the highest bit down, so nothing has to be sorted or counted in a table.
#[inline(always)]
#[must_use]
pub fn median(values: &[u8]) -> u8 {
    let rank = (values.len() as u32 - 1) / 2;
    let mut median = 0_u8;
    for bit in (0..8).rev() {
        let trial = median | 1 << bit;
        // If more than `rank` values are below the trial, so is the median.
        let mut below = 0_u32;
        for chunk in values.chunks(128) {
            let mut count = 0_u8;
            for &value in chunk {
                count += u8::from(value < trial);
            }
            below += u32::from(count);
        }
        if below <= rank {
            median = trial;
        }
    }
    median
}

/// As [`median`], but each value counts as often as its weight says. It is the smallest value such that more than `(sum
/// of weights - 1) / 2` of the weight lies at or below it.
#[inline(always)]
#[must_use]
pub fn weighted_median(values: &[u8], weights: &[u8]) -> u8 {
    let total: u32 = weights.iter().map(|&weight| u32::from(weight)).sum();
    let rank = (total - 1) / 2;
    let mut median = 0_u8;
    for bit in (0..8).rev() {
        let trial = median | 1 << bit;
        let below: u32 =
            values.iter().zip(weights).map(|(&value, &weight)| u32::from(value < trial) * u32::from(weight)).sum();
        if below <= rank {
            median = trial;
        }
    }
    median
}

/// The mean, rounded half up, of `count` values with this sum; `count` may be their total weight.
#[inline]
#[must_use]
pub fn mean(sum: u32, count: u32) -> u8 {
    (sum / count + u32::from(sum % count >= count.div_ceil(2))) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_that_of_the_sorted_values() {
        let mut state = 1_u32;
        for length in 1..600 {
            let values: Vec<u8> = (0..length)
                .map(|_| {
                    state = crate::model::cells::random::hash(state);
                    (state >> 24) as u8 & if length % 3 == 0 { 7 } else { 255 }
                })
                .collect();
            let mut sorted = values.clone();
            sorted.sort_unstable();
            assert_eq!(median(&values), sorted[(length - 1) / 2], "{values:?}");
        }
    }

    #[test]
    fn the_weighted_median_is_that_of_repeated_values() {
        let values: Vec<u8> = (0..99_u32).map(|place| (crate::model::cells::random::hash(place) >> 24) as u8).collect();
        let weights: Vec<u8> =
            (0..99_u32).map(|place| 1 + (crate::model::cells::random::hash(!place) >> 28) as u8).collect();
        for count in 1..99 {
            let repeated: Vec<u8> = values[..count]
                .iter()
                .zip(&weights)
                .flat_map(|(&value, &weight)| std::iter::repeat_n(value, usize::from(weight)))
                .collect();
            assert_eq!(weighted_median(&values[..count], &weights[..count]), median(&repeated), "{count} values");
        }
    }

    #[test]
    fn means_are_rounded_half_up_and_their_sums_may_be_large() {
        assert_eq!([(5, 2), (4, 3), (7, 2), (0, 9)].map(|(sum, count)| mean(sum, count)), [3, 1, 4, 0]);
        assert_eq!(mean(255 * 16_000_000, 16_000_000), 255);
    }
}
