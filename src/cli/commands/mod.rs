//! The commands. They use the floors below, and never each other.

pub(crate) mod batch;
pub(crate) mod bench;
pub(crate) mod check;
pub(crate) mod devices;
pub(crate) mod evolve;
pub(crate) mod gallery;
pub(crate) mod manual;
pub(crate) mod merge;
pub(crate) mod paper;
pub(crate) mod plan;
pub(crate) mod plugins;
pub(crate) mod render;
pub(crate) mod score;
pub(crate) mod show;
pub(crate) mod timelapse;
pub(crate) mod video;
#[cfg(feature = "view")]
pub(crate) mod view;
