//! Which pixels a fly covers at evaluation size: a [`crate::model::Tile`] reduced to what the search needs.
//!
//! Twin: `glsl/shared/cells_footprint.glsl`. The search bakes millions of children, so this uses no division.

use crate::model::fly::{Fly, UNITS_PER_PX};
use crate::model::tables::{TRIG_ONE, cos_sin};

/// The clipped box and the affine map of a tile. It covers the same pixels as the [`crate::model::Tile`] of the fly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Footprint {
    /// Left column of the box; the box is empty if `x0 > x1` or `y0 > y1`.
    pub x0: i32,
    /// Top row of the box.
    pub y0: i32,
    /// Right column, inclusive.
    pub x1: i32,
    /// Bottom row, inclusive.
    pub y1: i32,
    /// Tile coordinate u of the pixel at the box's corner.
    pub u0: i32,
    /// Tile coordinate v of the pixel at the box's corner.
    pub v0: i32,
    /// Change of u per column and of v per row.
    pub cos: i32,
    /// Change of u per row; v changes by its negative per column.
    pub sin: i32,
    /// End of u.
    pub u_end: i32,
    /// End of v.
    pub v_end: i32,
}

impl Footprint {
    /// Covers nothing.
    pub const EMPTY: Self = Self { x0: 1, y0: 1, x1: 0, y1: 0, u0: 0, v0: 0, cos: 0, sin: 0, u_end: 0, v_end: 0 };

    /// The footprint of `fly` in a picture of `width_px` x `height_px`, with sides of at most 2,048 px so that u and v
    /// stay below 2^30 anywhere within eight pixels of the box.
    #[inline]
    #[must_use]
    pub fn of(fly: &Fly, (width_px, height_px): (u32, u32)) -> Self {
        if !fly.alive {
            return Self::EMPTY;
        }
        let unit = UNITS_PER_PX as i32;
        let (cos, sin) = cos_sin(fly.angle);
        let (half_x, half_y) = (half_extent(cos, sin, fly.w, fly.h), half_extent(sin, cos, fly.w, fly.h));
        let first = |centre: i32, half: i32| ((centre - half + unit - 1) >> 6).max(0);
        let last = |centre: i32, half: i32, side_px: u32| ((centre + half) >> 6).min(side_px as i32 - 1);
        let (x0, y0) = (first(fly.x, half_x), first(fly.y, half_y));
        let (x1, y1) = (last(fly.x, half_x, width_px), last(fly.y, half_y, height_px));
        if x0 > x1 || y0 > y1 {
            return Self::EMPTY;
        }
        let (dx, dy) = (x0 * unit - fly.x, y0 * unit - fly.y);
        let (w, h) = (fly.w as i32, fly.h as i32);
        Self {
            x0,
            y0,
            x1,
            y1,
            u0: dx * cos + dy * sin + w * (TRIG_ONE / 2),
            v0: dy * cos - dx * sin + h * (TRIG_ONE / 2),
            cos: cos * unit,
            sin: sin * unit,
            u_end: w * TRIG_ONE,
            v_end: h * TRIG_ONE,
        }
    }

    /// Whether no pixel can be covered.
    #[inline]
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.x0 > self.x1
    }

    /// Pixels of the box.
    #[inline]
    #[must_use]
    pub fn area_px(&self) -> u32 {
        ((self.x1 - self.x0 + 1) * (self.y1 - self.y0 + 1)) as u32
    }

    /// Tile coordinates of a pixel, exact inside the box and up to eight pixels around it.
    #[inline(always)]
    #[must_use]
    pub fn coordinates(&self, i: i32, j: i32) -> (i32, i32) {
        let (di, dj) = (i - self.x0, j - self.y0);
        (
            self.u0.wrapping_add(di.wrapping_mul(self.cos)).wrapping_add(dj.wrapping_mul(self.sin)),
            self.v0.wrapping_sub(di.wrapping_mul(self.sin)).wrapping_add(dj.wrapping_mul(self.cos)),
        )
    }
}

/// Half of the tile's extent along one axis in 1/64 px, as [`crate::model::Tile::bake`] rounds it.
#[inline]
fn half_extent(along: i32, across: i32, w: u32, h: u32) -> i32 {
    // Each product is below 2^30, so the sum fits 32 bits.
    let sum = along.unsigned_abs() * w + across.unsigned_abs() * h;
    ((sum >> 13) + (sum >> 23) + 2) as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::rng::{Purpose, Stream};
    use crate::model::{Canvas, Tile};

    #[test]
    fn a_footprint_is_the_tile_that_is_drawn() {
        let mut stream = Stream::new(3, Purpose::FirstPopulation, 7, 7);
        for _ in 0..20_000 {
            let (width_px, height_px) = (1 + stream.below(300), 1 + stream.below(300));
            let side = |stream: &mut Stream| {
                let bits = 4 + stream.below(12);
                16 + stream.below(1 << bits)
            };
            let fly = Fly {
                x: stream.below((width_px - 1) * 64 + 1) as i32,
                y: stream.below((height_px - 1) * 64 + 1) as i32,
                angle: stream.bits() as u16,
                w: side(&mut stream),
                h: side(&mut stream),
                alive: true,
                ..Fly::ABSENT
            };
            let tile = Tile::bake(&fly, &Canvas::evaluation(width_px, height_px));
            let footprint = Footprint::of(&fly, (width_px, height_px));
            if tile.is_empty() {
                assert!(footprint.is_empty(), "{fly:?}");
                continue;
            }
            let expected = Footprint {
                x0: tile.x0,
                y0: tile.y0,
                x1: tile.x1,
                y1: tile.y1,
                u0: tile.u0,
                v0: tile.v0,
                cos: tile.cos,
                sin: tile.sin,
                u_end: tile.u_end() as i32,
                v_end: tile.v_end() as i32,
            };
            assert_eq!(footprint, expected, "{fly:?} in {width_px}x{height_px} px");
        }
    }
}
