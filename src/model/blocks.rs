//! For each block of pixels, the list of the tiles whose boxes touch it, nearest first.
//!
//! Both evaluators read these lists, so a pixel meets its tiles in depth order: the first that covers it is its top,
//! the second its under. A birth changes only the lists of the blocks that the boxes of the dead fly and of the child
//! touch.

use rayon::prelude::*;

use super::fly::Fly;
use super::mosaic::Patch;
use super::tile::{Canvas, Tile};

/// Keys from which on it is worth to sort them on all threads.
const KEYS_FOR_THREADS: usize = 1 << 16;

/// Depth-ordered tile lists of all blocks of a canvas. Blocks are numbered row by row from the top left.
#[derive(Clone, Debug)]
pub struct BlockLists {
    side_px: u32,
    columns: u32,
    /// Depth keys ([`Fly::depth_key`]) in rising order; the low 32 bits are the fly's index.
    lists: Vec<Vec<u64>>,
}

/// The fly's index in a depth key.
#[inline]
#[must_use]
pub fn index_of(depth_key: u64) -> u32 {
    depth_key as u32
}

/// The depth keys of all flies, nearest first.
#[must_use]
pub fn depth_order(flies: &[Fly]) -> Vec<u64> {
    let mut keys: Vec<u64> = (0..).zip(flies).map(|(index, fly)| fly.depth_key(index)).collect();
    // No two keys are equal, so that threads come to the same order.
    if keys.len() < KEYS_FOR_THREADS {
        keys.sort_unstable();
    } else {
        keys.par_sort_unstable();
    }
    keys
}

impl BlockLists {
    /// Empty lists for the blocks of `side_px` x `side_px` px that cover `canvas`; blocks at the right and lower edges
    /// may reach beyond it.
    #[must_use]
    pub fn new(canvas: &Canvas, side_px: u32) -> Self {
        let (columns, rows) = (canvas.width_px.div_ceil(side_px), canvas.height_px.div_ceil(side_px));
        Self { side_px, columns, lists: vec![Vec::new(); columns as usize * rows as usize] }
    }

    /// Pixels along each side of a block.
    #[must_use]
    pub fn side_px(&self) -> u32 {
        self.side_px
    }

    /// Blocks along the width.
    #[must_use]
    pub fn columns(&self) -> u32 {
        self.columns
    }

    /// Number of blocks.
    #[must_use]
    pub fn block_count(&self) -> usize {
        self.lists.len()
    }

    /// The tiles that touch `block`, as depth keys in rising order: nearest first.
    #[inline]
    #[must_use]
    pub fn list(&self, block: usize) -> &[u64] {
        &self.lists[block]
    }

    /// Left column and top row, in px, of `block`.
    #[inline]
    #[must_use]
    pub fn origin(&self, block: usize) -> (u32, u32) {
        let block = block as u32;
        (block % self.columns * self.side_px, block / self.columns * self.side_px)
    }

    /// The part of `canvas` that `block` covers. It must be the canvas that these lists were made for.
    #[must_use]
    pub fn patch(&self, block: usize, canvas: &Canvas) -> Patch {
        let (x, y) = self.origin(block);
        let (width_px, height_px) = (self.side_px.min(canvas.width_px - x), self.side_px.min(canvas.height_px - y));
        Patch { x, y, width_px, height_px }
    }

    /// Replaces all lists by those of a whole population.
    pub fn fill(&mut self, flies: &[Fly], tiles: &[Tile]) {
        self.lists.iter_mut().for_each(Vec::clear);
        for key in depth_order(flies) {
            for block in self.blocks_of(&tiles[index_of(key) as usize]) {
                self.lists[block].push(key);
            }
        }
    }

    /// Adds a tile to the lists of its blocks, and calls `touched` for each of them.
    pub fn insert(&mut self, key: u64, tile: &Tile, mut touched: impl FnMut(usize)) {
        for block in self.blocks_of(tile) {
            let list = &mut self.lists[block];
            let place = list.partition_point(|&other| other < key);
            list.insert(place, key);
            touched(block);
        }
    }

    /// Takes a tile out of the lists of its blocks, and calls `touched` for each of them.
    pub fn remove(&mut self, key: u64, tile: &Tile, mut touched: impl FnMut(usize)) {
        for block in self.blocks_of(tile) {
            let list = &mut self.lists[block];
            let place = list.partition_point(|&other| other < key);
            debug_assert_eq!(list.get(place), Some(&key), "the tile was not in the list of block {block}");
            list.remove(place);
            touched(block);
        }
    }

    /// Numbers of the blocks that the tile's box touches.
    pub fn blocks_of(&self, tile: &Tile) -> impl Iterator<Item = usize> + use<> {
        let (side, columns) = (self.side_px as i32, self.columns as usize);
        // An empty tile has x0 > x1, but both may lie in one block.
        let column_range = if tile.is_empty() { 0..0 } else { tile.x0 / side..tile.x1 / side + 1 };
        (tile.y0 / side..=tile.y1 / side)
            .flat_map(move |row| column_range.clone().map(move |column| row as usize * columns + column as usize))
    }
}
