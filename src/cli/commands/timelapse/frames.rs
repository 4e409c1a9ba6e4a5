//! Chooses the snapshots that become frames.

use clap::ValueEnum;

use crate::cli::files::snapshots::Snapshot;

/// What is even from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Spacing {
    /// The ratio of the errors: the picture changes about as much with every frame
    Error,
    /// The number of births, or of evals: fast at first, then slow
    #[value(alias = "evals")]
    Births,
    /// Nothing: every snapshot is a frame, and --frames takes every so many
    Snapshots,
}

impl Spacing {
    /// The word for it on the command line and in metadata.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Births => "births",
            Self::Snapshots => "snapshots",
        }
    }
}

/// Indices of the snapshots to show, in ascending order: the first, the last, and between them those nearest to an even
/// course of `frame_count` frames. No snapshot is shown twice, so there may be fewer frames.
///
/// Even means that the error changes by the same factor rather than by the same difference: the eye notices the last 1
/// % of it as much as the first. Where the error rises, because masks change or tiles split, the picture changes as
/// well, so a rise counts like a fall. By default there are half as many frames as snapshots: where the error falls
/// fastest, snapshots are too far apart for more.
pub(super) fn choose(snapshots: &[Snapshot], spacing: Spacing, frame_count: Option<usize>) -> Vec<usize> {
    let places: Vec<f64> = match spacing {
        Spacing::Snapshots => (0..snapshots.len()).map(|index| index as f64).collect(),
        Spacing::Births => snapshots.iter().map(|snapshot| snapshot.evals as f64).collect(),
        Spacing::Error => ways(snapshots),
    };
    let (Some(&begin), Some(&end)) = (places.first(), places.last()) else { return Vec::new() };
    let usual = match spacing {
        Spacing::Error => snapshots.len().div_ceil(2),
        Spacing::Births | Spacing::Snapshots => snapshots.len(),
    };
    let steps = frame_count.unwrap_or(usual).max(1) - 1;
    let mut chosen: Vec<usize> = Vec::new();
    for step in 0..steps {
        let wanted = begin + (end - begin) * step as f64 / steps as f64;
        let index = nearest(&places, wanted);
        if chosen.last().is_none_or(|&last| index > last) {
            chosen.push(index);
        }
    }
    // A snapshot at the same place as the last one shows the same picture.
    while chosen.last().is_some_and(|&last| places[last] >= end) && chosen.len() > 1 {
        chosen.pop();
    }
    if chosen.last() != Some(&(places.len() - 1)) {
        chosen.push(places.len() - 1);
    }
    chosen
}

/// How far the error has moved before each snapshot, up or down, in natural logarithms.
fn ways(snapshots: &[Snapshot]) -> Vec<f64> {
    // Computed by libm, since the chosen frames must be the same on every machine.
    let logs: Vec<f64> = snapshots.iter().map(|snapshot| libm::log(snapshot.sae as f64 + 1.0)).collect();
    let steps = logs.iter().enumerate().map(|(index, log)| (log - logs[index.saturating_sub(1)]).abs());
    let way = |way: &mut f64, step| {
        *way += step;
        Some(*way)
    };
    steps.scan(0.0, way).collect()
}

/// The index of the place nearest to `wanted`; of equally near ones the first. `places` must not descend.
fn nearest(places: &[f64], wanted: f64) -> usize {
    let after = places.partition_point(|&place| place < wanted).min(places.len() - 1);
    let before = after.saturating_sub(1);
    let index = if wanted - places[before] <= places[after] - wanted { before } else { after };
    places.partition_point(|&place| place < places[index])
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    fn course(saes: &[u64]) -> Vec<Snapshot> {
        let snapshot = |(evals, &sae)| Snapshot { path: PathBuf::new(), evals, sae, key: String::new() };
        (0..).zip(saes).map(snapshot).collect()
    }

    #[test]
    fn births_are_evenly_thinned_and_both_ends_stay() {
        let snapshots = course(&[9; 101]);
        assert_eq!(choose(&snapshots, Spacing::Births, Some(5)), [0, 25, 50, 75, 100]);
        assert_eq!(choose(&snapshots, Spacing::Snapshots, Some(5)), [0, 25, 50, 75, 100]);
        assert_eq!(choose(&snapshots, Spacing::Births, Some(2)), [0, 100]);
        assert_eq!(choose(&snapshots, Spacing::Births, Some(1)), [100]);
        assert_eq!(choose(&snapshots, Spacing::Births, None).len(), 101);
        assert_eq!(choose(&snapshots, Spacing::Births, Some(1000)).len(), 101);
    }

    #[test]
    fn the_error_falls_by_the_same_factor_with_every_frame() {
        let saes: Vec<u64> = (0..=1000).map(|birth| 1_000_000 / (1 + birth)).collect();
        let snapshots = course(&saes);
        let chosen = choose(&snapshots, Spacing::Error, Some(11));
        let ratios: Vec<f64> = chosen.windows(2).map(|pair| saes[pair[0]] as f64 / saes[pair[1]] as f64).collect();
        assert_eq!((chosen[0], chosen.last()), (0, Some(&1000)));
        assert!(ratios.iter().all(|ratio| (1.9..2.1).contains(ratio)), "{ratios:?}");
    }

    #[test]
    fn a_course_whose_error_rises_is_shown_from_beginning_to_end() {
        let falling = |from: u64| (0..100).map(move |birth| from / (1 + birth));
        // The masks change after a hundred births, and the final error is higher than the one before the change.
        let saes: Vec<u64> = falling(1_000_000).chain(falling(8_000_000)).collect();
        let chosen = choose(&course(&saes), Spacing::Error, Some(41));
        assert!(chosen.is_sorted_by(|one, next| one < next), "{chosen:?}");
        assert_eq!((chosen[0], chosen.last()), (0, Some(&199)));
        let (before, after): (Vec<usize>, Vec<usize>) = chosen.iter().partition(|&&index| index < 100);
        assert_eq!(
            (before.len(), after.len()),
            (12, 12),
            "the error falls by the same factor in both runs: {chosen:?}"
        );
    }

    #[test]
    fn a_picture_that_does_not_change_is_shown_once() {
        assert_eq!(choose(&course(&[9, 9, 5, 5, 5, 3, 3]), Spacing::Error, Some(7)), [0, 2, 6]);
        assert_eq!(choose(&course(&[9, 9, 9]), Spacing::Error, Some(3)), [0, 2]);
        assert_eq!(choose(&course(&[9]), Spacing::Error, Some(7)), [0]);
    }
}
