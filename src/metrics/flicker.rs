//! How much a sequence changes where its reference does not: flicker.

/// What frames changed from one to the next, in sums of 8-bit channels.
///
/// For frames `R` of the reference and `O` of the other: [`Flicker::still`] is the mean of `|O[t] - O[t-1]|` over the channels of all
/// pixels of which no channel has `|R[t] - R[t-1]|` above a limit, and [`Flicker::compensated`] the mean of
/// `|(O[t] - O[t-1]) - (R[t] - R[t-1])|` over all; both over all pairs of neighbouring frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flicker {
    still_sum: u64,
    still_count: u64,
    compensated_sum: u64,
    count: u64,
}

impl Flicker {
    /// Takes in a frame and the one before, of the reference and of the other; a pixel is still where no channel of the reference
    /// changes by more than `limit`.
    ///
    /// # Panics
    /// If they have not the same number of pixels.
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

    /// Mean absolute change per channel where the reference is still, 0 to 255; none if it is nowhere.
    #[must_use]
    pub fn still(&self) -> Option<f64> {
        (self.still_count > 0).then(|| self.still_sum as f64 / self.still_count as f64)
    }

    /// Share of the pixels that are still, 0 to 1; none if there is no pair of frames.
    #[must_use]
    pub fn still_share(&self) -> Option<f64> {
        (self.count > 0).then(|| self.still_count as f64 / self.count as f64)
    }

    /// Mean absolute difference per channel of the changes of both, 0 to 510; none if there is no pair of frames.
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
