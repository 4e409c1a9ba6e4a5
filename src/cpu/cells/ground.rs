//! The interface between a cell and its pixels, on which opaque tiles (`opaque`) or translucent ones (`translucent`)
//! lie. Twin: what `glsl/shared/cells_loop.glsl` asks of its stages.

use super::area::Area;
use super::pixels::Pixels;
use super::shared::Shared;
use crate::model::Fly;
use crate::model::cells::footprint::Footprint;
use crate::model::cells::suit::Suit;

/// What the pixels need to know of a fly's tile.
#[derive(Clone, Copy, Debug)]
pub struct Piece<'a> {
    pub fly: &'a Fly,
    pub footprint: &'a Footprint,
    /// What it wears; `None` in a plain search, and for absent flies.
    pub suit: Option<&'a Suit<'a>>,
}

/// The exchange of one fly's tile for another's; one of them may be absent.
#[derive(Clone, Copy, Debug)]
pub struct Swap<'a> {
    /// The victim's index in the population, which the child takes.
    pub index: u32,
    pub old: Piece<'a>,
    pub new: Piece<'a>,
}

/// Where a child's colour comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paint {
    /// It keeps its parent's.
    Keep,
    /// It takes a new one from the pixels where it shows.
    Anew,
    /// As [`Paint::Anew`], but the child must show somewhere.
    Birth,
}

/// What decides a child's colour, apart from the pixels where it shows.
#[derive(Clone, Copy, Debug)]
pub struct Coloring {
    /// Where the colour comes from.
    pub paint: Paint,
    /// The target's pixel nearest to the child's centre, packed, if the rules take colours from there.
    pub picked: u32,
}

/// What a cell does with its blocks of pixels.
pub trait Ground: Pixels {
    /// Buffers that a cell reuses while it works.
    type Desk: Default;

    /// Change of the objective before the child's pixels are counted, for a victim with this marginal fitness and turn
    /// penalty.
    fn without_victim(fitness: i64, penalty: i64) -> i64;
    /// The child's colour, packed, and what its pixels add to the change of the objective; `None` for a birth that
    /// would show nowhere.
    fn painted(
        area: &mut Area<'_, Self>,
        desk: &mut Self::Desk,
        shared: &Shared<'_>,
        swap: &Swap<'_>,
        coloring: Coloring,
    ) -> Option<(u32, i64)>;
    /// Change of the objective if a fly with this turn penalty were removed. If it is positive, only its sign is exact.
    fn loss(
        area: &mut Area<'_, Self>,
        desk: &mut Self::Desk,
        shared: &Shared<'_>,
        swap: &Swap<'_>,
        penalty: i64,
    ) -> i64;
    /// Puts the child where its victim was. `cell` is the cell at work, and `change` the change of the objective.
    fn swap(area: &mut Area<'_, Self>, shared: &Shared<'_>, cell: u32, swap: &Swap<'_>, change: i64);
    /// Brings marginal fitness up to date when all cells are done.
    fn refresh(blocks: &[Self], flies: &[Fly], shared: &Shared<'_>);
}
