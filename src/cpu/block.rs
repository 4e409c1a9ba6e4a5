//! A block of pixels: what it is computed from, and what is known of it.

use crate::model::blocks::index_of;
use crate::model::lane::INSIDE;
use crate::model::tally::BlockParts;
use crate::model::{Lane, NO_FLY};

/// Pixels along each side of a block: one vector of 8 columns a row (`cargo bench --bench full_evaluation`).
pub(super) const SIDE: usize = 8;
pub(super) const PIXELS: usize = SIDE * SIDE;
/// Target pixels of one block, packed, with [`INSIDE`].
pub(super) type TargetBlock = [u32; PIXELS];

/// What is known of one block.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// For each pixel, the nearest fly that shows.
    pub top: [u32; PIXELS],
    /// For each pixel, the next fly.
    pub under: [u32; PIXELS],
    /// What the block adds to the fitness.
    pub parts: BlockParts,
    /// Depth key of the tile behind which nothing shows in any pixel, with or without any one fly.
    pub closed_at: u64,
}

impl Default for Block {
    fn default() -> Self {
        Self { top: [NO_FLY; PIXELS], under: [NO_FLY; PIXELS], parts: BlockParts::default(), closed_at: u64::MAX }
    }
}

/// What a block is computed from.
pub(super) struct BlockView<'a> {
    pub lane: &'a Lane,
    /// Depth keys of the tiles that touch the block, nearest first.
    pub list: &'a [u64],
    pub target: &'a TargetBlock,
    /// Column and row of the upper left pixel.
    pub origin: (i32, i32),
}

impl<'a> BlockView<'a> {
    pub(super) fn new(lane: &'a Lane, number: usize, target: &'a TargetBlock) -> Self {
        let (x, y) = lane.lists().origin(number);
        Self { lane, list: lane.lists().list(number), target, origin: (x as i32, y as i32) }
    }

    /// The flies of the list, nearest first.
    pub(super) fn flies(&self) -> impl Iterator<Item = u32> {
        self.list.iter().map(|&key| index_of(key))
    }

    /// The fly in a slot of the list; [`NO_FLY`] in the one after the last.
    #[inline(always)]
    pub(super) fn fly(&self, slot: u32) -> u32 {
        self.list.get(slot as usize).map_or(NO_FLY, |&key| index_of(key))
    }
}

/// All bits set if the target pixel lies inside the picture, 0 if a block at the edge reaches beyond it.
#[inline(always)]
pub(super) fn inside(wanted: u32) -> u32 {
    if wanted & INSIDE != 0 { u32::MAX } else { 0 }
}
