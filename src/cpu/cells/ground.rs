//! What a cell needs of its pixels, whatever lies on them: opaque tiles (`opaque`) or translucent ones (`translucent`).

use super::area::Area;
use super::block::Plane;
use super::cell::Shared;
use crate::model::Fly;
use crate::model::cells::footprint::Footprint;
use crate::model::cells::rules::Rules;
use crate::model::cells::suit::Suit;

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

/// A fly's tile as far as pixels go.
#[derive(Clone, Copy, Debug)]
pub struct Piece<'a> {
    pub fly: &'a Fly,
    pub footprint: &'a Footprint,
    /// What it wears; none in a plain search, and of absent flies.
    pub suit: Option<&'a Suit<'a>>,
}

/// One fly's tile in the place of another one's; one of them may be absent.
#[derive(Clone, Copy, Debug)]
pub struct Swap<'a> {
    /// The victim's place in the population, which the child takes.
    pub index: u32,
    pub old: Piece<'a>,
    pub new: Piece<'a>,
}

/// How a child comes by its colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paint {
    /// It keeps its parent's.
    Keep,
    /// It takes a new one where it shows.
    Anew,
    /// It takes one, and must show somewhere.
    Birth,
}

/// A block of pixels with the tiles on them.
pub trait Ground: Clone + Send + Sync + 'static {
    /// What a cell keeps at hand while it works.
    type Desk: Default;
    /// Most flies on a pixel.
    const DEPTH_MAX: usize;

    /// A block outside the picture.
    fn outside() -> Self;
    /// Takes all tiles off a pixel.
    fn lay_bare(&mut self, pixel: usize, bare: &Bare, rules: &Rules);
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
    /// What [`crate::model::cells::Stacks`] says of a pixel.
    fn stack(&self, pixel: usize) -> Vec<(u32, i32)>;
    /// Takes over new depths, in the same order.
    fn renumber(&mut self, depth_of: impl Fn(u32) -> u32);

    /// Change of the objective before the child's pixels are looked at, of a victim of this marginal fitness and turn penalty.
    fn without_victim(fitness: i64, penalty: i64) -> i64;
    /// The child's colour, packed, and what its pixels add to the change of the objective; none for a birth that would show
    /// nowhere. `picked` is the colour of its centre.
    fn painted(
        area: &mut Area<'_, Self>,
        desk: &mut Self::Desk,
        shared: &Shared<'_>,
        swap: &Swap<'_>,
        paint: (Paint, u32),
    ) -> Option<(u32, i64)>;
    /// Change of the objective if a fly went, whose turn penalty is given; only whether it is positive counts if it is.
    fn loss(
        area: &mut Area<'_, Self>,
        desk: &mut Self::Desk,
        shared: &Shared<'_>,
        swap: &Swap<'_>,
        penalty: i64,
    ) -> i64;
    /// Puts the child where its victim was. `cell` is the one at work, and `change` what the objective changes.
    fn swap(area: &mut Area<'_, Self>, shared: &Shared<'_>, cell: u32, swap: &Swap<'_>, change: i64);
    /// Brings marginal fitness up to date when all cells are done.
    fn refresh(blocks: &[Self], flies: &[Fly], shared: &Shared<'_>);
}
