//! One search among those of a device: what the host knows of it.

use super::buffers::LaneSlices;
use super::layout::SearchHeader;
use super::mark::Mark;
use super::plan::Plan;
use super::shape::CellShape;
use crate::error::Error;
use crate::model::cells::{Course, Standing};

/// A search among those of the device.
pub(super) struct Lane {
    pub course: Course,
    pub plan: Plan,
    pub shape: CellShape,
    /// Number of the kin in whose buffers it lies.
    pub kin: u64,
    pub slices: LaneSlices,
    pub standing: Standing,
    /// The objective of the population that was loaded.
    pub objective: i64,
    /// Rounds that it was asked for since it was loaded.
    pub wanted: u32,
    /// Iterations that had something to do so far.
    pub iterations: u32,
    pub has_failed: bool,
    pub failure: Option<Error>,
    /// Whether the pixels still hold depths from before the last spreading.
    pub has_old_depths: bool,
    /// Where it may be taken back to.
    pub mark: Option<Mark>,
    /// Whether it was taken back, and its pixels were not.
    pub has_old_pixels: bool,
}

impl Lane {
    /// A lane that nothing was loaded into yet.
    pub fn new(course: Course, plan: Plan, shape: CellShape, (kin, slices): (u64, LaneSlices)) -> Self {
        Self {
            course,
            plan,
            shape,
            kin,
            slices,
            standing: Standing::default(),
            objective: 0,
            wanted: 0,
            iterations: 0,
            has_failed: false,
            failure: None,
            has_old_depths: false,
            mark: None,
            has_old_pixels: false,
        }
    }

    pub fn is_busy(&self) -> bool {
        self.standing.rounds < self.wanted && !self.has_failed
    }

    /// Takes what the header says after a submission.
    pub fn absorb(&mut self, header: &SearchHeader) {
        if header.overrun != 0 {
            self.has_failed = true;
            self.failure = Some(Error::Internal(format!(
                "a step of cell {} needs more than the {} turns of loops that a dispatch of the cells pass may take",
                header.overrun - 1,
                self.shape.budget
            )));
            return;
        }
        let wide = |low: u32, high: u32| u64::from(low) | u64::from(high) << 32;
        self.standing = Standing {
            rounds: header.round,
            evals: wide(header.evals_low, header.evals_high),
            births: wide(header.births_low, header.births_high),
            accepted: wide(header.accepted_low, header.accepted_high),
            objective: self.objective + wide(header.change_low, header.change_high) as i64,
        };
        self.iterations = header.iterations;
    }

    /// What the header says of a lane between two rounds.
    pub fn header(&self) -> SearchHeader {
        let Standing { rounds, evals, births, accepted, objective } = self.standing;
        let words = |wide: u64| (wide as u32, (wide >> 32) as u32);
        let (evals_low, evals_high) = words(evals);
        let (births_low, births_high) = words(births);
        let (accepted_low, accepted_high) = words(accepted);
        let (change_low, change_high) = words((objective - self.objective) as u64);
        SearchHeader {
            round: rounds,
            wanted: self.wanted,
            iterations: self.iterations,
            evals_low,
            evals_high,
            births_low,
            births_high,
            accepted_low,
            accepted_high,
            change_low,
            change_high,
            ..SearchHeader::default()
        }
    }
}
