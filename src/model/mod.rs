//! Plain data that every evaluator shares: flies, the tiles they become, targets, masks, random numbers, operators.
//!
//! Everything here is integers, so the CPU twin and every GPU decide alike. Nothing here knows a device, a file or a
//! clock.

pub mod blocks;
pub mod cells;
pub mod evaluation;
pub mod fly;
pub mod grout;
pub mod guide;
pub mod lane;
pub mod mask;
pub mod mosaic;
pub mod operators;
pub mod painter;
pub mod population;
pub mod rng;
pub mod tables;
pub mod tally;
pub mod target;
pub mod tile;
pub mod translucency;

pub use evaluation::{Change, Evaluation, Evaluator, Layers, NO_FLY};
pub use fly::Fly;
pub use grout::Grout;
pub use guide::{Guide, GuideSample};
pub use lane::{Lane, Scene};
pub use mask::{Blend, Mask, MaskSet};
pub use mosaic::{Mosaic, Patch};
pub use painter::Painter;
pub use population::{Backdrop, Population};
pub use target::{Rgb, Target};
pub use tile::{Canvas, Tile};
