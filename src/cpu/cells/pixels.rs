//! What any block of pixels tells of the tiles on it, be they opaque or translucent.

use super::block::Plane;
use crate::model::cells::rules::Rules;

/// A pixel without tiles.
#[derive(Clone, Copy, Debug)]
pub struct Bare {
    /// The target, packed, with the flags of `model::cells::pixel`.
    pub target: u32,
    /// Factor of its error.
    pub weight: i32,
    /// Error of the background, times the weight.
    pub error: i32,
}

/// A block of pixels with the tiles on them.
pub trait Pixels: Clone + Send + Sync + 'static {
    /// Most flies on a pixel.
    const DEPTH_MAX: usize;

    /// A block outside the picture.
    fn outside() -> Self;
    /// Removes all tiles from a pixel.
    fn lay_bare(&mut self, pixel: usize, bare: &Bare, rules: &Rules);
    /// What a pixel without tiles adds to the objective.
    fn bare_objective(bare: &Bare, rules: &Rules) -> i64;
    /// The target, packed, with flags.
    fn target(&self) -> &Plane<u32>;
    /// Number of pixels whose stacks are full.
    fn full(&self) -> u32;
    /// Number of flies on a pixel.
    fn depth(&self, pixel: usize) -> usize;
    /// Whether a fly is on a pixel.
    fn holds(&self, pixel: usize, fly: u32) -> bool;
    /// Error of a pixel, and the depth of its nearest fly.
    fn seen(&self, pixel: usize) -> (i32, u32);
    /// A pixel's part of the objective.
    fn objective(&self, pixel: usize, rules: &Rules) -> i64;
    /// Error of what a wanted pixel shows over this background, without its weight.
    fn shown_error(&self, pixel: usize, background: u32) -> u64;
    /// What [`crate::model::cells::Stacks`] holds for a pixel.
    fn stack(&self, pixel: usize) -> Vec<(u32, i32)>;
    /// Sets new depths; their order must be the same as before.
    fn renumber(&mut self, depth_of: impl Fn(u32) -> u32);
}
