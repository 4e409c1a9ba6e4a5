//! The paper's scheme and its parameters (section 4, Tables 1 and 2).

use super::color::ColorRule;
use crate::model::operators::Rotation;

/// One, in 1/65536: a certainty, or a factor that changes nothing.
pub const ONE_Q16: u32 = 1 << 16;
/// Most splits by mitosis: 2^20 is more than the flies of the largest population.
pub const MITOSIS_MAX: u32 = 20;

/// What happens when no fly with marginal fitness <= 0 is found to die.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum OnDry {
    /// The lower of two random flies dies (the author's later code).
    #[default]
    Fallback,
    /// The run ends; the next restart begins from the best population.
    Restart,
    /// The evolution ends.
    Stop,
}

/// Default births of a run (Table 2).
pub const PAPER_BIRTHS: u64 = 40_000;

/// Parameters of the paper's scheme. The defaults are those of Table 2: mutation 100 %, no crossover, one death and one
/// birth in each generation. All flies keep the masks that they begin with.
///
/// A parameter at its default draws no random number, so parameters do not affect each other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PaperScheme {
    /// Decides every random number.
    pub seed: u64,
    /// Births of each run.
    pub births: u64,
    /// Runs after the first, each from the best population so far.
    pub restarts: u32,
    /// Factor of the mutation amplitudes at each restart, in 1/65536.
    pub cool_q16: u32,
    /// What to do when no bad fly is left.
    pub on_dry: OnDry,
    /// Ends a run after this many births without a better population.
    pub patience: Option<u64>,
    /// Ends the evolution when the global fitness is at most this. Before the last change of masks or split, it ends
    /// only the run.
    pub target_sae: Option<u64>,
    /// Births evaluated together in one generation; 1 in the paper.
    pub batch_births: u32,
    /// Probability, in 1/65536, that a child mutates; otherwise it is a plain copy, or plainly crossed.
    pub mutation_q16: u32,
    /// Probability, in 1/65536, that a child is the arithmetic crossover of two flies that help, rather than a copy of
    /// one.
    pub crossover_q16: u32,
    /// Probability, in 1/65536, that a fresh random fly is born instead of a child (immigration).
    pub new_blood_q16: u32,
    /// Number of first restarts at which every living fly splits in two; the evolution begins with N / 2^mitosis.
    pub mitosis: u32,
    /// Whether tiles turn (Fig. 8d).
    pub rotation: Rotation,
    /// First sides over those of Eq. 1, in 1/65536 (Fig. 8c).
    pub tile_scale_q16: u32,
    /// Mask layers that the flies wear in each run, all equally likely. The last entry is also for all later runs. An
    /// empty entry names none: flies keep what they wear, and random ones wear the square.
    pub masks: Vec<Vec<u16>>,
    /// Where colours come from (Fig. 6), and the palette.
    pub color: ColorRule,
}

impl PaperScheme {
    /// The mask layers that are named for `run`; empty if none are.
    #[must_use]
    pub fn layers(&self, run: u32) -> &[u16] {
        let last = self.masks.len().saturating_sub(1);
        self.masks.get(last.min(run as usize)).map_or(&[], Vec::as_slice)
    }

    /// Whether masks change or flies split in a run after `run`. Then its populations are not yet of the kind that the
    /// result will be.
    #[must_use]
    pub fn is_warm_up(&self, run: u32) -> bool {
        let last_change = u32::try_from(self.masks.len()).unwrap_or(u32::MAX).saturating_sub(1).min(self.restarts);
        let now = self.layers(run);
        let changes_masks = (run.saturating_add(1)..=last_change).map(|later| self.layers(later));
        let changes_masks = changes_masks.into_iter().any(|later| !later.is_empty() && later != now);
        run < self.mitosis.min(self.restarts) || changes_masks
    }

    /// Flies that live in `run`, of a population with room for `fly_count`: N / 2^mitosis, rounded up, and twice as
    /// many after each split.
    #[must_use]
    pub fn living(&self, run: u32, fly_count: usize) -> usize {
        let first = fly_count.div_ceil(1 << self.mitosis.min(MITOSIS_MAX));
        (first << run.min(self.mitosis).min(MITOSIS_MAX)).min(fly_count)
    }
}

impl Default for PaperScheme {
    fn default() -> Self {
        Self {
            seed: 0,
            births: PAPER_BIRTHS,
            restarts: 0,
            cool_q16: ONE_Q16,
            on_dry: OnDry::default(),
            patience: None,
            target_sae: None,
            batch_births: 1,
            mutation_q16: ONE_Q16,
            crossover_q16: 0,
            new_blood_q16: 0,
            mitosis: 0,
            rotation: Rotation::Free,
            tile_scale_q16: ONE_Q16,
            masks: Vec::new(),
            color: ColorRule::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mitosis_begins_with_a_share_of_the_flies_and_ends_with_all() {
        let living = |mitosis, fly_count| {
            let scheme = PaperScheme { mitosis, ..PaperScheme::default() };
            (0..5).map(|run| scheme.living(run, fly_count)).collect::<Vec<_>>()
        };
        assert_eq!(living(0, 2_500), [2_500; 5]);
        assert_eq!(living(2, 5_000), [1_250, 2_500, 5_000, 5_000, 5_000]);
        assert_eq!(living(3, 2_500), [313, 626, 1_252, 2_500, 2_500]);
    }

    #[test]
    fn runs_warm_up_until_the_last_change_of_masks_and_the_last_split_that_are_made() {
        let warm_ups = |scheme: PaperScheme| (0..5).map(|run| scheme.is_warm_up(run)).collect::<Vec<_>>();
        let plain = PaperScheme { restarts: 4, ..PaperScheme::default() };
        assert_eq!(warm_ups(plain.clone()), [false; 5]);
        assert_eq!(warm_ups(PaperScheme { mitosis: 2, ..plain.clone() }), [true, true, false, false, false]);
        assert_eq!(
            warm_ups(PaperScheme { mitosis: 2, restarts: 1, ..plain.clone() }),
            [true, false, false, false, false]
        );
        let masks = vec![vec![0], vec![0], vec![1]];
        assert_eq!(warm_ups(PaperScheme { masks: masks.clone(), ..plain.clone() }), [true, true, false, false, false]);
        assert_eq!(warm_ups(PaperScheme { masks, restarts: 1, ..plain.clone() }), [false; 5]);
        assert_eq!(warm_ups(PaperScheme { masks: vec![vec![1]], ..plain }), [false; 5]);
    }

    #[test]
    fn runs_beyond_the_last_entry_wear_its_masks() {
        let scheme = PaperScheme { masks: vec![vec![0], vec![1, 2]], ..PaperScheme::default() };
        assert_eq!([0, 1, 2, 9].map(|run| scheme.layers(run)), [&[0][..], &[1, 2], &[1, 2], &[1, 2]]);
        assert!(PaperScheme::default().layers(3).is_empty());
    }
}
