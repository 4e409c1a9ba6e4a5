//! How long the frames of an animation are shown, as a sequence of even steps.

/// Steps a second, at most: viewers show what is shorter as a tenth of a second.
const STEPS_PER_S_MAX: u64 = 50;
/// Longest time of a step, and longest that a frame is shown, in ms.
const STEP_MAX_MS: u64 = 1_000;
const SHOWN_MAX_MS: u64 = 10_000;

/// Even steps, and for how many of them each frame is shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Rhythm {
    pub frames_per_s: u64,
    /// At least 1 for each frame.
    pub steps: Vec<usize>,
}

impl Rhythm {
    /// Of frames that are shown for so many ms each. If these times have no common step that is long enough, they are
    /// rounded so that errors do not add up.
    pub(super) fn of(shown_ms: &[u64]) -> Self {
        let shown: Vec<u64> = shown_ms.iter().map(|&ms| ms.clamp(1, SHOWN_MAX_MS)).collect();
        let common_ms = shown.iter().copied().fold(0, greatest_common_divisor);
        let least_ms = 1_000 / STEPS_PER_S_MAX;
        let shortest_ms = shown.iter().copied().min().unwrap_or(common_ms);
        let step_ms = if common_ms >= least_ms { common_ms } else { shortest_ms.max(least_ms) };
        let step_ms = step_ms.clamp(least_ms, STEP_MAX_MS);
        let (mut end_ms, mut begin) = (0, 0);
        let steps = shown.iter().map(|ms| {
            end_ms += ms;
            let end = ((end_ms + step_ms / 2) / step_ms).max(begin + 1);
            let count = end - begin;
            begin = end;
            count as usize
        });
        let steps = steps.collect();
        Self { frames_per_s: ((1_000 + step_ms / 2) / step_ms).max(1), steps }
    }
}

fn greatest_common_divisor(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_times_give_their_rate_and_others_are_kept_by_repeating_frames() {
        for (shown_ms, frames_per_s, steps) in [
            (&[100, 100, 100][..], 10, vec![1, 1, 1]),
            (&[40, 40], 25, vec![1, 1]),
            (&[100, 200, 300], 10, vec![1, 2, 3]),
            (&[2_000, 2_000], 1, vec![2, 2]),
            (&[33, 34, 33, 34], 30, vec![1, 1, 1, 1]),
            (&[5, 5, 5], 50, vec![1, 1, 1]),
            (&[60_000, 20], 50, vec![500, 1]),
        ] {
            assert_eq!(Rhythm::of(shown_ms), Rhythm { frames_per_s, steps }, "{shown_ms:?}");
        }
    }
}
