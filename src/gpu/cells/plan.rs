//! How a search in cells divides a picture, and where its pixels and stacks lie in the buffers.

use crate::model::cells::grid::{BLOCK_SIDE_PX, cell_side_px};
use crate::model::cells::pixel::{STACK_DEPTH, TRANSLUCENT_DEPTH};
use crate::model::cells::rules::SEARCH_SIDE_MAX;
use crate::model::cells::{Course, Rules};
use crate::model::fly::UNITS_PER_PX;

/// Pixels of a block.
pub(super) const BLOCK_PIXELS: usize = (BLOCK_SIDE_PX * BLOCK_SIDE_PX) as usize;
/// Words of a pixel: two words of four.
pub(super) const PIXEL_WORDS: usize = 8;
/// How a picture is divided into blocks and cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    pub width_px: u32,
    pub height_px: u32,
    pub block_columns: u32,
    pub block_rows: u32,
    pub cell_side_px: u32,
    /// Most cells of a round.
    pub cell_count: u32,
    /// Most flies on a pixel.
    pub stack_depth: usize,
}

impl Plan {
    pub fn new(course: &Course) -> Self {
        let (width_px, height_px) = (course.target.width_px(), course.target.height_px());
        let side = cell_side_px(course.rules.side);
        let is_one = side >= width_px && side >= height_px;
        let most = |px: u32| if is_one { 1 } else { (px - 1 + side - BLOCK_SIDE_PX) / side + 1 };
        Self {
            width_px,
            height_px,
            block_columns: width_px.div_ceil(BLOCK_SIDE_PX),
            block_rows: height_px.div_ceil(BLOCK_SIDE_PX),
            cell_side_px: side,
            cell_count: most(width_px) * most(height_px),
            stack_depth: if course.is_translucent() { TRANSLUCENT_DEPTH } else { STACK_DEPTH },
        }
    }

    /// Blocks of 8x8 px.
    pub fn block_count(&self) -> u64 {
        u64::from(self.block_columns) * u64::from(self.block_rows)
    }

    /// Pixels of all blocks.
    pub fn pixel_count(&self) -> usize {
        self.block_count() as usize * BLOCK_PIXELS
    }

    /// Words of the stacks of all pixels: a fly and its error, or its look, for each place.
    pub fn stack_words(&self) -> usize {
        self.pixel_count() * self.stack_depth * 2
    }

    /// The first word of an entry: in each block first the nearest flies of all pixels, then the next ones.
    pub fn stack_word(&self, place: usize, entry: usize) -> usize {
        (place / BLOCK_PIXELS * self.stack_depth + entry) * 2 * BLOCK_PIXELS + place % BLOCK_PIXELS * 2
    }

    /// Columns and rows of the largest box of a child in px.
    pub fn largest_box(&self, rules: &Rules) -> (u32, u32) {
        // The diagonal of a square is below 3/2 of its side.
        let longest = side_max(rules).div_ceil(UNITS_PER_PX) * 3 / 2 + 2;
        let side = longest.min(self.cell_side_px);
        (side.min(self.width_px), side.min(self.height_px))
    }

    /// Longest side of a tile in px, with what its pixels may reach beyond.
    pub fn largest_side_px(&self, rules: &Rules) -> u32 {
        side_max(rules).div_ceil(UNITS_PER_PX) + 1
    }

    /// Where a pixel lies in the state.
    pub fn place(&self, x: u32, y: u32) -> usize {
        let block = y / BLOCK_SIDE_PX * self.block_columns + x / BLOCK_SIDE_PX;
        block as usize * BLOCK_PIXELS + (y % BLOCK_SIDE_PX * BLOCK_SIDE_PX + x % BLOCK_SIDE_PX) as usize
    }

    /// Where the pixels of the picture lie in the state, row by row.
    pub fn places(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.height_px).flat_map(move |y| (0..self.width_px).map(move |x| self.place(x, y)))
    }
}

/// Largest side that a fly may have, in 1/64 px.
pub(super) fn side_max(rules: &Rules) -> u32 {
    let classes = &rules.classes[..rules.class_count as usize];
    let scale = classes.iter().map(|class| class.scale_q12).max().unwrap_or(1 << 12);
    let local = if rules.bounds.local_size == 0 { 1 } else { 4 };
    let own = (u64::from(rules.side) * u64::from(scale) * local) >> 12;
    let side = (own.min(u64::from(SEARCH_SIDE_MAX)) * u64::from(rules.bounds.side_max_q8)) >> 8;
    side.min(u64::from(SEARCH_SIDE_MAX)) as u32
}
