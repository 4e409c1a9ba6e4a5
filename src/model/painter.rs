//! What a painter answers: the drawn mosaic.

use super::mosaic::Mosaic;
use super::population::Population;
use super::tile::Canvas;
use crate::error::Result;

/// Draws populations. A painter keeps no population and needs no target, so that one serves pictures of every size.
///
/// Every implementation gives the same pixels.
pub trait Painter: Send {
    /// Draws a population on `canvas` with `supersampling`² samples per pixel.
    ///
    /// # Errors
    /// If the device fails, or has no memory for the population.
    fn draw(&mut self, population: &Population, canvas: &Canvas, supersampling: u32) -> Result<Mosaic>;
}
