//! The Fly algorithm: a steady-state loop of threshold selection, mutation and replacement (paper section 4, Fig. 1).
//!
//! Everything here is decided by the seed and by the fitness that an evaluator reports. Nothing here knows Vulkan, a
//! file or a clock.

mod breeder;
pub mod cells;
pub mod color;
pub mod evolution;
pub mod first;
pub mod held;
pub mod palette;
pub mod restart;
pub mod scheme;
pub mod selection;
mod showing;
pub mod spread;
pub mod style;

/// Version of the algorithm: raised whenever the same picture, options and seed lead to another result.
pub const ALGORITHM_VERSION: u32 = 1;

pub use color::{ColorMode, ColorRule};
pub use evolution::{Evolution, Outcome, Step, StopReason};
pub use first::{begin_from, first_population};
pub use palette::Palette;
pub use scheme::{OnDry, PaperScheme};
pub use spread::Spread;
