//! The Fly algorithm: a steady-state loop of threshold selection, mutation and replacement (paper section 4, Fig. 1).
//!
//! Everything here is decided by the seed and by the fitness that an evaluator reports. Nothing here knows Vulkan, a
//! file or a clock.

pub mod evolution;
pub mod restart;
pub mod scheme;
pub mod selection;

pub use evolution::{Evolution, Outcome, Step, StopReason};
pub use scheme::{OnDry, PaperScheme};
