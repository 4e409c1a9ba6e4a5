//! The files that commands read and write: where outputs go, what they contain, whether they may be replaced, and what
//! is kept beside them.

pub(crate) mod child;
pub(crate) mod curve_file;
pub(crate) mod destination;
pub(crate) mod inputs;
pub(crate) mod left_out;
pub(crate) mod memory;
pub(crate) mod outputs;
pub(crate) mod pipelines;
pub(crate) mod places;
pub(crate) mod replacing;
pub(crate) mod sheet;
pub(crate) mod snapshots;
pub(crate) mod story;
