//! The running evaluation of one lane: which blocks are stale, and what each block adds to the sums.
//!
//! Unlike the shaders, the twin keeps per block the depth behind which nothing shows, and leaves a block alone whose
//! changes all lie behind it: on one core a block saved is time saved.

use rayon::prelude::*;

use super::{evaluate, translucent};
use crate::model::blocks::index_of;
use crate::model::lane::INSIDE;
use crate::model::tally::{BlockParts, Tally};
use crate::model::{Blend, Evaluation, Fly, Lane, Layers, NO_FLY, Scene};

/// Pixels along each side of a block: one vector of 8 columns a row (`cargo bench --bench full_evaluation`).
pub(super) const SIDE: usize = 8;
pub(super) const PIXELS: usize = SIDE * SIDE;
/// From this many stale blocks on, sharing them among threads pays for itself.
const PARALLEL_FROM: usize = 128;
/// Target pixels of one block, packed, with [`INSIDE`].
pub(super) type TargetBlock = [u32; PIXELS];

/// What is known of one block.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Per pixel the nearest fly that shows.
    pub top: [u32; PIXELS],
    /// Per pixel the next one.
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

/// Buffers that a thread uses again for each block.
#[derive(Default)]
struct Buffers {
    palette: evaluate::Palette,
    stack: translucent::Stack,
}

/// The running evaluation of one lane.
#[derive(Debug)]
pub(super) struct LaneEvaluation {
    lane: Lane,
    target: Vec<TargetBlock>,
    blocks: Vec<Block>,
    tally: Tally,
    /// Blocks to refresh; empty between calls.
    stale: Vec<u32>,
}

impl LaneEvaluation {
    pub(super) fn new(scene: Scene) -> Self {
        let tally = Tally::new(scene.fly_count);
        let lane = Lane::new(scene, SIDE as u32);
        let target = lane.blocked_target().as_chunks().0.to_vec();
        let blocks = vec![Block::default(); lane.lists().block_count()];
        Self { lane, target, blocks, tally, stale: Vec::new() }
    }

    pub(super) fn lane(&self) -> &Lane {
        &self.lane
    }

    /// Evaluates a whole population afresh.
    pub(super) fn load(&mut self, flies: &[Fly]) {
        self.lane.load(flies);
        let (lane, target) = (&self.lane, &self.target);
        self.blocks.par_iter_mut().enumerate().with_min_len(PARALLEL_FROM / 2).for_each_init(
            Buffers::default,
            |buffers, (number, block)| {
                refresh(&BlockView::new(lane, number, &target[number]), block, buffers);
            },
        );
        self.tally.clear();
        for block in &self.blocks {
            self.tally.add(&block.parts);
        }
    }

    /// Replaces a fly; the evaluation is stale until [`LaneEvaluation::refresh_touched`].
    pub(super) fn replace(&mut self, index: u32, fly: &Fly) {
        self.lane.replace(index, fly);
    }

    /// Refreshes the touched blocks in which a change can show: takes their old parts off the sums and adds the new ones.
    pub(super) fn refresh_touched(&mut self) {
        let (lane, target) = (&self.lane, &self.target);
        let view = |number: u32| BlockView::new(lane, number as usize, &target[number as usize]);
        let shows = |number: u32| lane.nearest_change(number as usize) <= self.blocks[number as usize].closed_at;
        self.stale.extend(lane.touched().iter().copied().filter(|&number| shows(number)));
        if self.stale.len() < PARALLEL_FROM {
            let mut buffers = Buffers::default();
            for &number in &self.stale {
                let block = &mut self.blocks[number as usize];
                self.tally.subtract(&block.parts);
                refresh(&view(number), block, &mut buffers);
                self.tally.add(&block.parts);
            }
        } else {
            let refreshed: Vec<Block> = self
                .stale
                .par_iter()
                .with_min_len(PARALLEL_FROM / 2)
                .map_init(Buffers::default, |buffers, &number| {
                    let mut block = Block::default();
                    refresh(&view(number), &mut block, buffers);
                    block
                })
                .collect();
            for (&number, new) in self.stale.iter().zip(refreshed) {
                let block = &mut self.blocks[number as usize];
                self.tally.subtract(&block.parts);
                *block = new;
                self.tally.add(&block.parts);
            }
        }
        self.stale.clear();
        self.lane.clear_touched();
    }

    pub(super) fn evaluation(&self) -> Evaluation<'_> {
        self.tally.evaluation()
    }

    pub(super) fn layers(&self) -> Layers {
        let target = &self.lane.scene().target;
        let (width, height) = (target.width_px() as usize, target.height_px() as usize);
        let columns = self.lane.lists().columns() as usize;
        let row_by_row = |layer: fn(&Block) -> &[u32; PIXELS]| {
            let pixel =
                |(i, j): (usize, usize)| layer(&self.blocks[j / SIDE * columns + i / SIDE])[j % SIDE * SIDE + i % SIDE];
            (0..height).flat_map(|j| (0..width).map(move |i| (i, j))).map(pixel).collect()
        };
        Layers { top: row_by_row(|block| &block.top), under: row_by_row(|block| &block.under) }
    }
}

/// Recomputes one block from its list.
fn refresh(view: &BlockView<'_>, block: &mut Block, buffers: &mut Buffers) {
    match view.lane.scene().masks.blend() {
        Blend::Opaque => evaluate::refresh(view, block, &mut buffers.palette),
        Blend::Translucent => translucent::refresh(view, block, &mut buffers.stack),
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
    fn new(lane: &'a Lane, number: usize, target: &'a TargetBlock) -> Self {
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

/// Sum of absolute differences of the three channels.
#[inline(always)]
pub(super) fn error(a: u32, b: u32) -> i32 {
    let channel = |shift: u32| ((a >> shift & 255) as i32 - (b >> shift & 255) as i32).abs();
    channel(0) + channel(8) + channel(16)
}

/// All bits if the target pixel lies in the picture, none in the overhang of a block at the edge.
#[inline(always)]
pub(super) fn inside(wanted: u32) -> u32 {
    if wanted & INSIDE != 0 { u32::MAX } else { 0 }
}
