//! The objective that a search in cells lowers, and the SAE of the mosaic, which may differ from it.

use crate::error::Result;
use crate::model::cells::{Course, Search};

/// Whether the objective of a course is the SAE: all pixels are wanted and have the same weight, and nothing is
/// penalised.
#[must_use]
pub fn lowers_sae_alone(course: &Course) -> bool {
    let penalties = &course.rules.penalties;
    let is_plain = course.target.weights().is_none() && course.target.transparent().is_none();
    is_plain && (penalties.overlap, penalties.hole, penalties.turn) == (0, 0, 0)
}

/// The SAE of a search's current mosaic, over all wanted pixels, without weights.
///
/// # Errors
/// If the device fails.
pub fn sae(search: &mut dyn Search) -> Result<u64> {
    if lowers_sae_alone(search.course()) {
        return Ok(search.standing().objective.unsigned_abs());
    }
    search.sae()
}
