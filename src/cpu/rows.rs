//! The rows of a block that a tile's box touches, 8 pixels at a time and without branches, so that a row is a vector.

use std::ops::RangeInclusive;

use super::lane_evaluation::SIDE;
use crate::model::mask::{MASK_SIDE, Mask, TEXELS, Texel};
use crate::model::tile::{TexelMap, Tile};

/// The part of a tile in one block, row by row.
pub(super) struct TileRows {
    /// Rows of the block that the box touches.
    pub rows: RangeInclusive<usize>,
    ends: (u32, u32),
    u: u32,
    v: u32,
    steps: (u32, u32),
    u_steps: [u32; SIDE],
    v_steps: [u32; SIDE],
}

impl TileRows {
    /// The part of `tile` in the block whose upper left pixel is `origin`.
    #[inline(always)]
    pub(super) fn new(tile: &Tile, (x, y): (i32, i32)) -> Self {
        let (first, last) = ((tile.y0 - y).max(0), (tile.y1 - y).min(SIDE as i32 - 1));
        let (u, v) = tile.coordinates(x, y + first);
        Self {
            rows: first as usize..=last as usize,
            ends: (tile.u_end(), tile.v_end()),
            u,
            v,
            steps: (tile.sin as u32, tile.cos as u32),
            u_steps: std::array::from_fn(|i| tile.cos.wrapping_mul(i as i32) as u32),
            v_steps: std::array::from_fn(|i| tile.sin.wrapping_mul(i as i32) as u32),
        }
    }

    /// Tile coordinates of the pixels of this row.
    #[inline(always)]
    pub(super) fn coordinates(&self) -> ([u32; SIDE], [u32; SIDE]) {
        (
            std::array::from_fn(|i| self.u.wrapping_add(self.u_steps[i])),
            std::array::from_fn(|i| self.v.wrapping_sub(self.v_steps[i])),
        )
    }

    /// Whether the square covers a pixel.
    #[inline(always)]
    pub(super) fn is_covered(&self, u: u32, v: u32) -> bool {
        (u < self.ends.0) & (v < self.ends.1)
    }

    /// Whether the square covers any of the pixels.
    #[inline(always)]
    pub(super) fn any_covered(&self, u: &[u32; SIDE], v: &[u32; SIDE]) -> bool {
        (0..SIDE).fold(false, |any, i| any | self.is_covered(u[i], v[i]))
    }

    /// Goes on to the next row.
    #[inline(always)]
    pub(super) fn step(&mut self) {
        self.u = self.u.wrapping_add(self.steps.0);
        self.v = self.v.wrapping_add(self.steps.1);
    }
}

/// The texels of a tile's mask by tile coordinates.
pub(super) struct TileTexels<'a> {
    texels: &'a [Texel; TEXELS],
    map: TexelMap,
}

impl<'a> TileTexels<'a> {
    #[inline(always)]
    pub(super) fn new(tile: &Tile, mask: &'a Mask) -> Self {
        Self { texels: mask.texels(), map: tile.texel_map() }
    }

    /// The texels of a row: coverage in the lowest byte, then shade. Any texel where the tile does not cover.
    #[inline(always)]
    pub(super) fn row(&self, u: &[u32; SIDE], v: &[u32; SIDE]) -> [u32; SIDE] {
        let places: [u32; SIDE] = std::array::from_fn(|i| {
            let (column, row) = self.map.texel(u[i], v[i]);
            // Within the array for any number, so that no check is left.
            (row % MASK_SIDE as u32) * MASK_SIDE as u32 + column % MASK_SIDE as u32
        });
        places.map(|place| {
            let Texel { coverage, shade } = self.texels[place as usize];
            u32::from(coverage) | u32::from(shade) << 8
        })
    }
}
