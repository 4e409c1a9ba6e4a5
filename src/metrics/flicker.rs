//! Flicker: how much a sequence changes where its reference does not.

/// Sums of the changes of 8-bit channels from frame to frame.
///
/// Let `R` be the frames of the reference and `O` those of the other sequence. A pixel is still if `|R[t] - R[t-1]|`
/// exceeds a limit in none of its channels. [`Flicker::still`] is the mean of `|O[t] - O[t-1]|` over the channels of
/// still pixels, and [`Flicker::compensated`] the mean of `|(O[t] - O[t-1]) - (R[t] - R[t-1])|` over all channels; both
/// over all pairs of neighbouring frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flicker {
    still_sum: u64,
    still_count: u64,
    compensated_sum: u64,
    count: u64,
}

impl Flicker {
    /// Adds a pair of neighbouring frames of the reference and of the other sequence. A pixel is still if no channel of
    /// the reference changes by more than `limit`.
    ///
    /// # Panics
    /// If the frames differ in their number of pixels.
    pub fn add(&mut self, reference: [&[[u8; 3]]; 2], other: [&[[u8; 3]]; 2], limit: u8) {
        let count = reference[0].len();
        assert!(reference[1].len() == count && other.iter().all(|one| one.len() == count), "frames have one size");
        for pixel in 0..count {
            let change = |frames: [&[[u8; 3]]; 2], channel: usize| {
                i32::from(frames[1][pixel][channel]) - i32::from(frames[0][pixel][channel])
            };
            let changes: [(i32, i32); 3] =
                std::array::from_fn(|channel| (change(reference, channel), change(other, channel)));
            self.compensated_sum += changes.iter().map(|(its, own)| u64::from((own - its).unsigned_abs())).sum::<u64>();
            self.count += 3;
            if changes.iter().all(|(its, _)| its.unsigned_abs() <= u32::from(limit)) {
                self.still_sum += changes.iter().map(|(_, own)| u64::from(own.unsigned_abs())).sum::<u64>();
                self.still_count += 3;
            }
        }
    }

    /// Mean absolute change per channel where the reference is still, 0 to 255; `None` if it is still nowhere.
    #[must_use]
    pub fn still(&self) -> Option<f64> {
        (self.still_count > 0).then(|| self.still_sum as f64 / self.still_count as f64)
    }

    /// Share of the pixels that are still, 0 to 1; `None` if there is no pair of frames.
    #[must_use]
    pub fn still_share(&self) -> Option<f64> {
        (self.count > 0).then(|| self.still_count as f64 / self.count as f64)
    }

    /// Mean absolute difference per channel between the changes of both sequences, 0 to 510; `None` if there is no pair
    /// of frames.
    #[must_use]
    pub fn compensated(&self) -> Option<f64> {
        (self.count > 0).then(|| self.compensated_sum as f64 / self.count as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_still_pixels_flicker_and_all_changes_are_compensated() {
        let reference = [&[[10, 10, 10], [0, 0, 0]][..], &[[12, 10, 9], [0, 50, 0]][..]];
        let other = [&[[7, 7, 7], [1, 1, 1]][..], &[[10, 7, 7], [1, 41, 4]][..]];
        let mut flicker = Flicker::default();
        assert_eq!([flicker.still(), flicker.still_share(), flicker.compensated()], [None; 3]);
        flicker.add(reference, other, 2);
        // Still: 3, 0, 0. Compensated: 1, 0, 1 and 0, 10, 3.
        assert_eq!([flicker.still(), flicker.still_share()], [Some(1.0), Some(0.5)]);
        assert_eq!(flicker.compensated(), Some(15.0 / 6.0));
        let mut strict = Flicker::default();
        strict.add(reference, other, 1);
        assert_eq!([strict.still(), strict.still_share()], [None, Some(0.0)]);
    }
}
