//! A lane: one picture among those evolved together, with its population baked and sorted into blocks.
//!
//! This is the part of an evaluation that the CPU keeps for every evaluator: which tiles there are, which blocks they
//! touch, and which blocks are stale after the last replacements.

use std::sync::Arc;

use super::blocks::BlockLists;
use super::fly::Fly;
use super::mask::MaskSet;
use super::target::{Rgb, Target};
use super::tile::{Canvas, Tile, pack};

/// What stays the same while a lane evolves.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The picture to match.
    pub target: Arc<Target>,
    /// Tile shapes that the flies may wear.
    pub masks: Arc<MaskSet>,
    /// Colour behind all tiles.
    pub background: Rgb,
    /// Number of flies, absent ones included.
    pub fly_count: usize,
}

/// The population of one scene, ready to be evaluated block by block.
#[derive(Clone, Debug)]
pub struct Lane {
    scene: Scene,
    canvas: Canvas,
    flies: Vec<Fly>,
    tiles: Vec<Tile>,
    lists: BlockLists,
    touched: Vec<u32>,
    /// For each block, the nearest depth key that was added or removed since the last refresh, or [`UNTOUCHED`].
    nearest_change: Vec<u64>,
}

/// Highest byte of a target pixel inside the picture, in [`Lane::blocked_target`].
pub const INSIDE: u32 = 0xFF00_0000;

/// No depth key: the block is as it was.
const UNTOUCHED: u64 = u64::MAX;

impl Lane {
    /// A lane of absent flies, with blocks of `block_side_px`.
    #[must_use]
    pub fn new(scene: Scene, block_side_px: u32) -> Self {
        let canvas = Canvas::evaluation(scene.target.width_px(), scene.target.height_px());
        let lists = BlockLists::new(&canvas, block_side_px);
        Self {
            flies: vec![Fly::ABSENT; scene.fly_count],
            tiles: vec![Tile::EMPTY; scene.fly_count],
            touched: Vec::new(),
            nearest_change: vec![UNTOUCHED; lists.block_count()],
            scene,
            canvas,
            lists,
        }
    }

    /// What stays the same while the lane evolves.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The target's pixels block by block, rows within blocks, packed with [`INSIDE`]; where blocks reach beyond the
    /// picture it is 0.
    #[must_use]
    pub fn blocked_target(&self) -> Vec<u32> {
        let target = &self.scene.target;
        let (width, height, side) = (target.width_px(), target.height_px(), self.lists.side_px());
        let mut words = vec![0; self.lists.block_count() * (side * side) as usize];
        for (number, block) in words.chunks_exact_mut((side * side) as usize).enumerate() {
            let (x, y) = self.lists.origin(number);
            for (row, places) in (y..height).zip(block.chunks_exact_mut(side as usize)) {
                let first = row as usize * width as usize + x as usize;
                let pixels = &target.pixels()[first..][..side.min(width - x) as usize];
                places.iter_mut().zip(pixels).for_each(|(place, &color)| *place = pack(color) | INSIDE);
            }
        }
        words
    }

    /// The baked flies, by index.
    #[must_use]
    pub fn tiles(&self) -> &[Tile] {
        &self.tiles
    }

    /// The tile lists of the blocks.
    #[must_use]
    pub fn lists(&self) -> &BlockLists {
        &self.lists
    }

    /// Blocks that changed since [`Lane::clear_touched`], each once, in the order in which they were touched.
    #[must_use]
    pub fn touched(&self) -> &[u32] {
        &self.touched
    }

    /// The nearest depth key that was added to or removed from `block` since it was refreshed. Nothing in front of it
    /// changed.
    #[must_use]
    pub fn nearest_change(&self, block: usize) -> u64 {
        self.nearest_change[block]
    }

    /// Forgets which blocks changed: they have been refreshed.
    pub fn clear_touched(&mut self) {
        for block in self.touched.drain(..) {
            self.nearest_change[block as usize] = UNTOUCHED;
        }
    }

    /// Replaces the whole population. All blocks are stale, so none is marked as touched.
    ///
    /// # Panics
    /// If `flies` is not as long as the scene's `fly_count`.
    pub fn load(&mut self, flies: &[Fly]) {
        assert_eq!(flies.len(), self.scene.fly_count, "a lane keeps its number of flies");
        self.flies.copy_from_slice(flies);
        for (tile, fly) in self.tiles.iter_mut().zip(flies) {
            *tile = Tile::bake(fly, &self.canvas);
        }
        self.lists.fill(&self.flies, &self.tiles);
        self.clear_touched();
    }

    /// Replaces fly `index` by `fly`, and marks the blocks of both boxes as touched.
    pub fn replace(&mut self, index: u32, fly: &Fly) {
        let place = index as usize;
        let tile = Tile::bake(fly, &self.canvas);
        let (touched, nearest_change) = (&mut self.touched, &mut self.nearest_change);
        let mut touch = |block: usize, key: u64| {
            if nearest_change[block] == UNTOUCHED {
                touched.push(block as u32);
            }
            nearest_change[block] = nearest_change[block].min(key);
        };
        let (old_key, new_key) = (self.flies[place].depth_key(index), fly.depth_key(index));
        self.lists.remove(old_key, &self.tiles[place], |block| touch(block, old_key));
        self.lists.insert(new_key, &tile, |block| touch(block, new_key));
        self.flies[place] = *fly;
        self.tiles[place] = tile;
    }
}
