//! The leash: how far a tile may move from where it was when its population was loaded. It keeps tiles in place from
//! one frame of a sequence to the next.
//!
//! Twin: `glsl/shared/cells_leash.glsl`. A tile moves as far as its farthest-moving corner, since its centre and the
//! points of its edges lie between its corners.

use crate::model::Fly;
use crate::model::fly::UNITS_PER_PX;
use crate::model::tables::{TRIG_ONE, cos_sin};

/// Longest leash in 1/64 px; with it, and with the sides that the search makes, the movement of a corner fits 32 bits.
pub const LEASH_MAX: u32 = 512 * UNITS_PER_PX;

/// Whether every corner of `fly` lies within `leash`, in 1/64 px up to [`LEASH_MAX`], of the same corner of `origin`.
/// Movement is rounded up along both axes, so a corner never exceeds its leash. A fly with an absent origin or no leash
/// (0) may be anywhere.
#[must_use]
pub fn holds(leash: u32, origin: &Fly, fly: &Fly) -> bool {
    if leash == 0 || !origin.alive {
        return true;
    }
    let unit = 2 * i64::from(TRIG_ONE);
    let [(cos, sin), (old_cos, old_sin)] = [fly, origin].map(|fly| cos_sin(fly.angle));
    let turned = |side: u32, old_side: u32, along: i32, old_along: i32| {
        i64::from(side) * i64::from(along) - i64::from(old_side) * i64::from(old_along)
    };
    let centre = [fly.x - origin.x, fly.y - origin.y].map(|by| i64::from(by) * unit);
    let width = [turned(fly.w, origin.w, cos, old_cos), turned(fly.w, origin.w, sin, old_sin)];
    let height = [turned(fly.h, origin.h, -sin, -old_sin), turned(fly.h, origin.h, cos, old_cos)];
    [(1, 1), (1, -1), (-1, 1), (-1, -1)].into_iter().all(|(right, down)| {
        let moved = |axis: usize| (centre[axis] + right * width[axis] + down * height[axis]).unsigned_abs();
        let [x, y] = [moved(0), moved(1)].map(|by| by.div_ceil(unit as u64));
        x * x + y * y <= u64::from(leash) * u64::from(leash)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::rng::{Purpose, Stream};

    /// Corners in 1/64 px.
    fn corners(fly: &Fly) -> [(f64, f64); 4] {
        let (cos, sin) = cos_sin(fly.angle);
        let (cos, sin) = (f64::from(cos) / f64::from(TRIG_ONE), f64::from(sin) / f64::from(TRIG_ONE));
        [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].map(|(right, down)| {
            let (u, v) = (right * f64::from(fly.w) / 2.0, down * f64::from(fly.h) / 2.0);
            (f64::from(fly.x) + u * cos - v * sin, f64::from(fly.y) + u * sin + v * cos)
        })
    }

    #[test]
    fn a_leash_holds_exactly_the_tiles_whose_corners_are_near() {
        let mut stream = Stream::new(3, Purpose::FirstPopulation, 1, 1);
        let mut counts = [0; 2];
        for _ in 0..20_000 {
            let (bits, reach) = (4 + stream.below(13), 1 + stream.below(2_000));
            let mut side = || (16 + stream.below(1 << bits)).min(1 << 16);
            let (w, h) = (side(), side());
            let angle = stream.bits() as u16;
            let origin = Fly { x: 60_000, y: 50_000, w, h, angle, alive: true, ..Fly::ABSENT };
            let mut by = || stream.below(2 * reach) as i32 - reach as i32;
            let (dx, dy, dw, dh) = (by(), by(), by(), by());
            let fly = Fly {
                x: origin.x + dx,
                y: origin.y + dy,
                w: w.saturating_add_signed(dw).max(16),
                h: h.saturating_add_signed(dh).max(16),
                angle: angle.wrapping_add((stream.below(400) as u16).wrapping_sub(200)),
                ..origin
            };
            let leash = 1 + stream.below(LEASH_MAX / 16);
            let pairs = corners(&origin).into_iter().zip(corners(&fly));
            let farthest = pairs.map(|((x0, y0), (x1, y1))| (x1 - x0).hypot(y1 - y0)).fold(0.0, f64::max);
            let is_held = holds(leash, &origin, &fly);
            if is_held {
                assert!(farthest <= f64::from(leash) + 1e-6, "{fly:?} is {farthest} from {origin:?} on {leash}");
            } else {
                assert!(farthest > f64::from(leash) - 1.5, "{fly:?} is {farthest} from {origin:?} on {leash}");
            }
            counts[usize::from(is_held)] += 1;
        }
        assert!(counts.iter().all(|&count| count > 2_000), "{counts:?}");
    }

    #[test]
    fn without_a_leash_or_an_origin_a_tile_may_be_anywhere() {
        let near = Fly { alive: true, ..Fly::ABSENT };
        let far = Fly { x: 9_000, ..near };
        assert_eq!([holds(0, &near, &far), holds(64, &Fly::ABSENT, &far), holds(64, &near, &far)], [true, true, false]);
    }
}
