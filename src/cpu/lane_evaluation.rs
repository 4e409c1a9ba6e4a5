//! The evaluation of one lane, kept up to date: which blocks are stale, and what each block adds to the sums.
//!
//! Unlike the shaders, the twin stores for each block the depth behind which nothing shows, and skips a block whose
//! changes all lie behind it. On a CPU, every block that is skipped saves time.

use rayon::prelude::*;

use super::block::{Block, BlockView, PIXELS, SIDE, TargetBlock};
use super::{evaluate, translucent};
use crate::model::tally::Tally;
use crate::model::{Blend, Evaluation, Fly, Lane, Layers, Scene};

/// From this many stale blocks on, it pays to share them among threads.
const PARALLEL_FROM: usize = 128;
/// Buffers that a thread reuses for each block.
#[derive(Default)]
struct Buffers {
    palette: evaluate::Palette,
    stack: translucent::Stack,
}

/// The evaluation of one lane, kept up to date.
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

    /// Evaluates a whole population.
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

    /// Refreshes the touched blocks in which a change can show: subtracts their old parts from the sums and adds the
    /// new ones.
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
