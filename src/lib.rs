//! Turns pictures into mosaics by evolving thousands of tiles with the Fly algorithm.
//!
//! Axes: pixel `(i, j)` has its centre at `x = i`, `y = j`; y points down and angles turn from +x towards +y.
//! Positions and sides are in 1/64 px. Colours and errors are on stored 8-bit sRGB values. Global fitness is the sum of
//! absolute errors (SAE, lower is better); the marginal fitness of a fly is the SAE without it minus the SAE with it, so
//! a positive value means that the fly helps.

pub mod app;
pub mod archive;
pub mod cpu;
pub mod engine;
pub mod error;
pub mod evolve;
pub mod gpu;
pub mod guide;
pub mod metrics;
pub mod model;
pub mod openraster;
pub mod output;
pub mod photo;
pub mod plot;
pub mod shapes;
pub mod vector;
pub mod vk;

pub use error::{Error, Result};
