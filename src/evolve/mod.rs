//! The Fly algorithm: a steady-state loop of threshold selection, mutation and replacement (paper section 4, Fig. 1).
//!
//! Everything here is decided by the seed and by the fitness that an evaluator reports. Nothing here knows Vulkan, a
//! file or a clock.

pub mod brake;
mod breeder;
pub mod cells;
pub mod color;
pub mod ended;
pub mod evolution;
pub mod first;
pub mod held;
pub mod objective;
pub mod observer;
pub mod palette;
pub mod restart;
pub mod scheme;
pub mod selection;
mod showing;
pub mod spread;
pub mod style;

/// Version of the algorithm, for both schemes. Raise it whenever the same picture, options and seed lead to another
/// result. It is in every key, so raising it makes every existing output out of date.
pub const ALGORITHM_VERSION: u32 = 2;

pub use brake::Brake;
pub use color::{ColorMode, ColorRule};
pub use ended::{Ended, Ending, Tally};
pub use evolution::{Evolution, Outcome, Step, StopReason};
pub use first::{begin_from, first_population};
pub use observer::{Observer, Seen, Stage, Undisturbed};
pub use palette::Palette;
pub use scheme::{OnDry, PaperScheme};
pub use spread::Spread;
