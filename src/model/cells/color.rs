//! The colour of a child from the pixels where it would show.
//!
//! Twin: `glsl/shared/cells_color.glsl`.

/// The lower median of one channel of packed colours: the smallest value `m` with more than `(count - 1) / 2` values at
/// most `m`. Found bit by bit from above, which needs no order and no table.
#[inline(always)]
#[must_use]
pub fn median(values: &[u8]) -> u8 {
    let rank = (values.len() as u32 - 1) / 2;
    let mut median = 0_u8;
    for bit in (0..8).rev() {
        let trial = median | 1 << bit;
        // As many as `rank` + 1 values below the trial: the median is below it, too.
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

/// The mean, rounded half up.
#[inline]
#[must_use]
pub fn mean(sum: u32, count: u32) -> u8 {
    ((2 * sum + count) / (2 * count)) as u8
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
}
