//! Flags that several commands share: what they are called, and what they ask of the library.

pub(crate) mod cells;
pub(crate) mod computing;
pub(crate) mod look;
pub(crate) mod messages;
pub(crate) mod paper;
pub(crate) mod picture;
pub(crate) mod preset;
pub(crate) mod typed;
