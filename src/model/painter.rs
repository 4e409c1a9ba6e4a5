//! What a painter answers: the drawn mosaic.

use super::mosaic::Mosaic;
use super::population::Population;
use super::tile::Canvas;
use crate::error::Result;

/// Draws populations. A painter keeps no population and needs no target, so that one serves pictures of every size.
///
/// Every implementation gives the same pixels.
pub trait Painter: Send {
    /// Draws a population on `canvas` with `supersampling`² samples per pixel, and now and then tells `watch` which
    /// share of it is done, 0 to 1.
    ///
    /// # Errors
    /// If the device fails, or has no memory for the population.
    fn draw_watched(
        &mut self,
        population: &Population,
        canvas: &Canvas,
        supersampling: u32,
        watch: &mut dyn FnMut(f64),
    ) -> Result<Mosaic>;

    /// As [`Painter::draw_watched`], with nobody to tell.
    ///
    /// # Errors
    /// As there.
    fn draw(&mut self, population: &Population, canvas: &Canvas, supersampling: u32) -> Result<Mosaic> {
        self.draw_watched(population, canvas, supersampling, &mut |_| {})
    }
}
