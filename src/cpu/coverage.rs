//! The rows of a block that a tile's box touches, 8 pixels at a time and without branches, so that the compiler makes a
//! row a vector.

use std::ops::RangeInclusive;

use super::block::SIDE;
use crate::model::mask::{MASK_SIDE, Mask, TEXELS, Texel};
use crate::model::tile::Tile;

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
        let (mut u_steps, mut v_steps) = ([0; SIDE], [0; SIDE]);
        for i in 0..SIDE {
            u_steps[i] = tile.cos.wrapping_mul(i as i32) as u32;
            v_steps[i] = tile.sin.wrapping_mul(i as i32) as u32;
        }
        Self {
            rows: first as usize..=last as usize,
            ends: (tile.u_end(), tile.v_end()),
            u,
            v,
            steps: (tile.sin as u32, tile.cos as u32),
            u_steps,
            v_steps,
        }
    }

    /// Tile coordinates of the pixels of this row.
    #[inline(always)]
    pub(super) fn coordinates(&self) -> ([u32; SIDE], [u32; SIDE]) {
        let (mut u, mut v) = ([0; SIDE], [0; SIDE]);
        for i in 0..SIDE {
            u[i] = self.u.wrapping_add(self.u_steps[i]);
            v[i] = self.v.wrapping_sub(self.v_steps[i]);
        }
        (u, v)
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

    /// Moves to the next row.
    #[inline(always)]
    pub(super) fn step(&mut self) {
        self.u = self.u.wrapping_add(self.steps.0);
        self.v = self.v.wrapping_add(self.steps.1);
    }
}

/// The texels of a row of a tile with a mask: coverage in the lowest byte, then shade. Where the tile does not cover,
/// the texel means nothing.
#[inline(always)]
pub(super) fn texels(tile: &Tile, mask: &Mask, u: &[u32; SIDE], v: &[u32; SIDE]) -> [u32; SIDE] {
    let (mut places, mut texels) = ([0; SIDE], [0; SIDE]);
    for i in 0..SIDE {
        let (column, row) = tile.texel(u[i], v[i]);
        // The remainders keep any index inside the array, so the compiler needs no bounds check.
        places[i] = (row % MASK_SIDE as u32) * MASK_SIDE as u32 + column % MASK_SIDE as u32;
    }
    for i in 0..SIDE {
        let Texel { coverage, shade } = mask.texels()[places[i] as usize % TEXELS];
        texels[i] = u32::from(coverage) | u32::from(shade) << 8;
    }
    texels
}
