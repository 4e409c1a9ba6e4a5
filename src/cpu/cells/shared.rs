//! What the cells of a round share.

use std::sync::atomic::{AtomicI64, AtomicU32};

use crate::model::cells::{Course, Grid};

/// What the cells of a round share.
pub struct Shared<'a> {
    pub course: &'a Course,
    pub grid: &'a Grid,
    /// The cell of each fly in this round, or [`NO_CELL`](crate::model::cells::NO_CELL) if it is frozen.
    pub owners: &'a [u32],
    /// Marginal fitness. Only a cell itself writes that of its own flies. To that of frozen flies, every cell only
    /// adds.
    pub fitness: &'a [AtomicI64],
    /// Depths; frozen ones do not change.
    pub depths: &'a [AtomicU32],
    /// Whether no tile wears a mask or grout, and all pixels count the same.
    pub is_plain: bool,
}
