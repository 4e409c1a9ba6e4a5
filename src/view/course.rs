//! The moments of a run that the time slider goes back to: few enough to keep, close enough to look smooth.

use std::sync::Arc;

use super::news::Moment;
use crate::model::Population;

/// Most moments that are kept; then every second one goes.
const MOMENTS_MAX: usize = 240;
/// Most flies that are kept in all, about 300 MB.
const FLIES_MAX: usize = 8_000_000;

/// The moments, in the order of their evals.
#[derive(Default)]
pub(super) struct Course {
    moments: Arc<Vec<Moment>>,
    /// Evals between two moments.
    stride: u64,
}

impl Course {
    /// The moments of a run that is over.
    pub(super) fn of(moments: Vec<Moment>) -> Self {
        Self { moments: Arc::new(moments), stride: 0 }
    }

    pub(super) fn moments(&self) -> &Arc<Vec<Moment>> {
        &self.moments
    }

    /// Notes how far the run is, unless the last moment is near. The newest moment is always the present.
    pub(super) fn add(&mut self, evals: u64, error: f64, tiles: &Arc<Population>) {
        let moment = Moment { evals, error, tiles: Arc::clone(tiles) };
        let moments = Arc::make_mut(&mut self.moments);
        // The one before the last stays if it is far enough from what is before it.
        let before = moments.len().checked_sub(2).map(|place| moments[place].evals);
        let is_near = before.zip(moments.last()).is_some_and(|(before, last)| last.evals - before < self.stride);
        if is_near || moments.last().is_some_and(|last| last.evals == evals) {
            moments.pop();
        }
        moments.push(moment);
        let most = MOMENTS_MAX.min(FLIES_MAX / tiles.flies.len().max(1)).max(8);
        if moments.len() > most {
            let last = moments.len() - 1;
            let mut place = 0;
            moments.retain(|_| {
                place += 1;
                place % 2 == 1 || place > last
            });
            let span = moments.last().map_or(0, |moment| moment.evals) - moments[0].evals;
            self.stride = span / (most as u64 / 2).max(1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Fly, MaskSet};

    fn tiles() -> Arc<Population> {
        let (background, masks) = ([0; 3].into(), MaskSet::default());
        Arc::new(Population { width_px: 1, height_px: 1, background, grout: None, masks, flies: vec![Fly::ABSENT; 4] })
    }

    #[test]
    fn a_long_run_keeps_its_beginning_its_end_and_an_even_choice_between() {
        let mut course = Course::default();
        for evals in 0..20_000 {
            course.add(evals * 10, 1.0 / (evals + 1) as f64, &tiles());
            assert!(course.moments().len() <= MOMENTS_MAX + 1);
        }
        let evals: Vec<u64> = course.moments().iter().map(|moment| moment.evals).collect();
        assert_eq!((evals[0], *evals.last().expect("there are some")), (0, 199_990));
        assert!(evals.len() > MOMENTS_MAX / 3, "{}", evals.len());
        let gaps = evals.windows(2).map(|pair| pair[1] - pair[0]);
        assert!(gaps.clone().all(|gap| gap > 0) && gaps.max() < Some(199_990 / 40), "{evals:?}");
    }

    #[test]
    fn the_same_evals_are_one_moment() {
        let mut course = Course::default();
        course.add(5, 1.0, &tiles());
        course.add(5, 0.5, &tiles());
        assert_eq!(course.moments().iter().map(|moment| moment.error).collect::<Vec<_>>(), [0.5]);
    }
}
