//! The cells of one round: a grid of squares at a random offset, and which of them holds a fly.
//!
//! Twin: `glsl/shared/cells_grid.glsl`.

use super::footprint::Footprint;
use super::random::{Chain, Draw};

/// Side of the blocks of pixels in which state is stored, and to which cells are aligned.
pub const BLOCK_SIDE_PX: u32 = 8;
/// Smallest side of a cell.
const CELL_SIDE_MIN_PX: u32 = 64;
/// A cell is at least this many mean tile sides wide, so that most flies lie inside one.
const CELL_SIDE_TILES: u32 = 11;
/// Not in any cell.
pub const NO_CELL: u32 = u32::MAX;

/// Cells of a picture in one round, numbered row by row. Each holds the pixels `(i, j)` with
/// `(i + offset_x) / side = column` and likewise its row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Width of the picture.
    pub width_px: u32,
    /// Height of the picture.
    pub height_px: u32,
    /// Side of a cell, a power of two.
    pub side_px: u32,
    /// How far the first column reaches beyond the left edge; a multiple of [`BLOCK_SIDE_PX`].
    pub offset_x: u32,
    /// How far the first row reaches beyond the upper edge.
    pub offset_y: u32,
    /// Cells along the width.
    pub columns: u32,
    /// Cells along the height.
    pub rows: u32,
}

/// Side of a cell for tiles of the mean side `side` (1/64 px): the smallest power of two that is at least 11 such sides
/// and at least 64 px.
#[must_use]
pub fn cell_side_px(side: u32) -> u32 {
    (side * CELL_SIDE_TILES).div_ceil(super::super::fly::UNITS_PER_PX).next_power_of_two().max(CELL_SIDE_MIN_PX)
}

impl Grid {
    /// The grid of a round. If a cell is larger than the picture, one cell holds all of it.
    #[must_use]
    pub fn new(seed: u64, round: u32, (width_px, height_px): (u32, u32), side_px: u32) -> Self {
        let chain = Chain::new(seed, round, Draw::Grid);
        let is_one = side_px >= width_px && side_px >= height_px;
        let offset = |slot| if is_one { 0 } else { chain.below(slot, side_px / BLOCK_SIDE_PX) * BLOCK_SIDE_PX };
        let (offset_x, offset_y) = (offset(0), offset(1));
        Self {
            width_px,
            height_px,
            side_px,
            offset_x,
            offset_y,
            columns: (width_px - 1 + offset_x) / side_px + 1,
            rows: (height_px - 1 + offset_y) / side_px + 1,
        }
    }

    /// One cell that holds the whole picture.
    #[must_use]
    pub fn whole(width_px: u32, height_px: u32) -> Self {
        let side_px = width_px.max(height_px);
        Self { width_px, height_px, side_px, offset_x: 0, offset_y: 0, columns: 1, rows: 1 }
    }

    /// Number of cells.
    #[must_use]
    pub fn cell_count(&self) -> u32 {
        self.columns * self.rows
    }

    /// The cell of a pixel.
    #[inline]
    #[must_use]
    pub fn cell_at(&self, x: u32, y: u32) -> u32 {
        (y + self.offset_y) / self.side_px * self.columns + (x + self.offset_x) / self.side_px
    }

    /// The cell that holds the whole box of a tile, clipped to the picture, or [`NO_CELL`].
    #[inline]
    #[must_use]
    pub fn cell_of(&self, footprint: &Footprint) -> u32 {
        if footprint.is_empty() {
            return NO_CELL;
        }
        let first = self.cell_at(footprint.x0 as u32, footprint.y0 as u32);
        let last = self.cell_at(footprint.x1 as u32, footprint.y1 as u32);
        if first == last { first } else { NO_CELL }
    }

    /// The pixels of a cell inside the picture: left, top, and the first column and row beyond.
    #[must_use]
    pub fn bounds(&self, cell: u32) -> [u32; 4] {
        let (column, row) = (cell % self.columns, cell / self.columns);
        let first = |place: u32, offset: u32| (place * self.side_px).saturating_sub(offset);
        let end = |place: u32, offset: u32, size: u32| ((place + 1) * self.side_px - offset).min(size);
        [
            first(column, self.offset_x),
            first(row, self.offset_y),
            end(column, self.offset_x, self.width_px),
            end(row, self.offset_y, self.height_px),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Fly;

    #[test]
    fn the_cells_of_every_round_tile_the_picture_and_hold_their_own_pixels() {
        for (size_px, side_px) in [((200, 90), 64), ((7, 300), 128), ((64, 64), 64), ((1, 1), 64)] {
            for round in 0..40 {
                let grid = Grid::new(5, round, size_px, side_px);
                let mut area = 0;
                for cell in 0..grid.cell_count() {
                    let [x0, y0, x1, y1] = grid.bounds(cell);
                    assert!(x0 < x1 && y0 < y1 && x0 % BLOCK_SIDE_PX == 0 && y0 % BLOCK_SIDE_PX == 0, "{grid:?}");
                    assert!(x1 - x0 <= side_px && y1 - y0 <= side_px);
                    for (x, y) in [(x0, y0), (x1 - 1, y0), (x0, y1 - 1), (x1 - 1, y1 - 1)] {
                        assert_eq!(grid.cell_at(x, y), cell, "{grid:?} at {x}, {y}");
                    }
                    area += (x1 - x0) * (y1 - y0);
                }
                assert_eq!(area, size_px.0 * size_px.1, "{grid:?}");
            }
        }
    }

    #[test]
    fn a_fly_belongs_to_a_cell_only_with_its_whole_box() {
        let grid = Grid { offset_x: 0, offset_y: 0, columns: 2, rows: 2, ..Grid::new(0, 0, (128, 128), 64) };
        let at = |x: i32, side: u32| {
            let fly = Fly { x: x * 64, y: 20 * 64, w: side * 64, h: side * 64, alive: true, ..Fly::ABSENT };
            grid.cell_of(&Footprint::of(&fly, (128, 128)))
        };
        assert_eq!([at(30, 10), at(90, 10), at(62, 10)], [0, 1, NO_CELL]);
        assert_eq!(at(2, 30), 0, "what hangs over the border does not count");
        assert_eq!(grid.cell_of(&Footprint::EMPTY), NO_CELL);
    }

    #[test]
    fn a_cell_is_eleven_tiles_wide_or_more_and_offsets_differ_from_round_to_round() {
        assert_eq!([64, 5 * 64, 6 * 64, 12 * 64, 500 * 64].map(cell_side_px), [64, 64, 128, 256, 8_192]);
        let offsets: std::collections::BTreeSet<_> = (0..50)
            .map(|round| Grid::new(0, round, (512, 512), 64))
            .map(|grid| (grid.offset_x, grid.offset_y))
            .collect();
        assert!(offsets.len() > 25, "only {} offsets", offsets.len());
    }
}
