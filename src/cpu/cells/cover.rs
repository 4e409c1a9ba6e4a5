//! Which pixels of a cell a tile covers. Twin: `footprint_covers` in `glsl/shared/cells_footprint.glsl`.

use super::block::{PIXELS, Plane, SIDE};
use crate::model::cells::footprint::Footprint;
use crate::model::cells::pixel::INSIDE;
use crate::model::cells::suit::Suit;

/// Eight pixels of a row.
pub type Lanes = [i32; SIDE];

/// What decides which pixels a tile covers.
#[derive(Clone, Copy, Debug)]
pub struct Cover<'a> {
    /// Its rectangle.
    pub footprint: &'a Footprint,
    /// What it wears; `None` if that has no holes and nobody asks for it.
    pub suit: Option<&'a Suit<'a>>,
}

impl Cover<'_> {
    /// Covers nothing.
    pub const NONE: Self = Self { footprint: &Footprint::EMPTY, suit: None };

    /// As bits, which of the eight pixels of a block's row the tile covers.
    #[inline(always)]
    pub(super) fn row_bits(&self, target: &Plane<u32>, (column, y): (i32, i32)) -> u32 {
        let f = self.footprint;
        if column < f.x0 >> 3 || column > f.x1 >> 3 || y < f.y0 || y > f.y1 {
            return 0;
        }
        let (u, v) = f.coordinates(column * 8, y);
        let out = outside(u, v, f);
        let target = row_of(target, (y & 7) as usize);
        let mut bits = 0;
        for lane in 0..SIDE {
            bits |= u32::from((out[lane] >= 0) & (target[lane] & INSIDE != 0)) << lane;
        }
        if let Some(suit) = self.suit {
            for lane in 0..SIDE as i32 {
                let is_hole = bits >> lane & 1 != 0
                    && suit.look(f, (u + f.cos * lane) as u32, (v - f.sin * lane) as u32).is_none();
                bits &= !(u32::from(is_hole) << lane);
            }
        }
        bits
    }
}

/// Negative where a lane's pixel lies outside the tile.
#[inline(always)]
pub(super) fn outside(u: i32, v: i32, f: &Footprint) -> Lanes {
    let mut out = [0; SIDE];
    for (lane, out) in (0..).zip(&mut out) {
        let (u, v) = (u.wrapping_add(f.cos.wrapping_mul(lane)), v.wrapping_sub(f.sin.wrapping_mul(lane)));
        *out = u | (f.u_end - 1).wrapping_sub(u) | v | (f.v_end - 1).wrapping_sub(v);
    }
    out
}

/// The eight values of a row.
#[inline(always)]
pub(super) fn row_of<T: Copy>(plane: &[T; PIXELS], row: usize) -> &[T; SIDE] {
    plane[row * SIDE..row * SIDE + SIDE].first_chunk().expect("a row has eight pixels")
}
