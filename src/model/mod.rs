//! Plain data that every evaluator shares: flies, the tiles they become, targets, masks, random numbers, operators.
//!
//! Everything here is integers, so that the CPU twin and every GPU decide the same. Nothing here knows a device, a file
//! or a clock.

pub mod fly;
pub mod mask;
pub mod population;
pub mod target;

pub use fly::Fly;
pub use mask::{Mask, MaskSet};
pub use population::Population;
pub use target::{Rgb, Target};
