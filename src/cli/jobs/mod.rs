//! The work on one picture: its options, how it is read, evolved and drawn, and what is reported about it.

pub(crate) mod curve;
pub(crate) mod options;
pub(crate) mod prepared;
pub(crate) mod recorder;
pub(crate) mod replay;
pub(crate) mod row;
pub(crate) mod watch;
