//! A tile: the fly baked for pixels. It is all that a decision about a pixel ever reads, on the CPU and on every
//! device.
//!
//! Twin: `glsl/shared/tile.glsl`. Coverage is an integer test, so both give the same bits.

use super::fly::{Fly, SIDE_MAX, UNITS_PER_PX};
use super::mask::MASK_SIDE;
use super::tables::{TRIG_ONE, cos_sin};
use super::target::Rgb;

/// A fly baked to integers for one canvas. A pixel `(i, j)` inside the box has tile coordinates
/// `u = u0 + (i - x0) * cos + (j - y0) * sin` and `v = v0 - (i - x0) * sin + (j - y0) * cos`, both counted from the
/// tile's corner; it is covered iff `u < w * 4096` and `v < h * 4096` as unsigned 32-bit numbers.
///
/// The test is half-open in the tile's own frame, so two axis-parallel tiles that abut never double or drop a pixel.
/// Everything fits 32 bits inside the box, whatever the size of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Tile {
    /// Left column of the bounding box, clipped to the canvas; the box is empty if `x0 > x1`.
    pub x0: i32,
    /// Top row of the box.
    pub y0: i32,
    /// Right column of the box, inclusive.
    pub x1: i32,
    /// Bottom row of the box, inclusive.
    pub y1: i32,
    /// Tile coordinate u of the pixel at the box's corner, from the tile's left side.
    pub u0: i32,
    /// Tile coordinate v of the pixel at the box's corner, from the tile's top side.
    pub v0: i32,
    /// Change of u per column and of v per row.
    pub cos: i32,
    /// Change of u per row; v changes by its negative per column.
    pub sin: i32,
    /// Width, in 4096ths of the unit of u.
    pub w: u32,
    /// Height, in 4096ths of the unit of v.
    pub h: u32,
    /// 8-bit sRGB colour: red in the lowest byte, then green, then blue.
    pub color: u32,
    /// Layer of the mask set; 0 is the full square and is never looked up.
    pub mask: u32,
    /// [`inverse`] of the width, which finds texels without a division per pixel.
    pub w_inverse: u32,
    /// [`inverse`] of the height.
    pub h_inverse: u32,
    /// Width of the ring of grout, in 4096ths of the unit of u; at most the shorter side, 0 for none.
    pub ring: u32,
}

/// What a population is drawn on: its size, and how many canvas pixels one picture pixel spans.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Canvas {
    /// Width in px.
    pub width_px: u32,
    /// Height in px.
    pub height_px: u32,
    /// Scale as a fraction, `scale.0 / scale.1`; 1 / 1 at evaluation size.
    pub scale: (u32, u32),
}

impl Canvas {
    /// The canvas at evaluation size, one to one.
    #[must_use]
    pub fn evaluation(width_px: u32, height_px: u32) -> Self {
        Self { width_px, height_px, scale: (1, 1) }
    }

    /// The canvas whose longer side is `long_side_px` for a picture of `width_px` x `height_px`; the other side is
    /// rounded to the nearest whole pixel, at least 1.
    #[must_use]
    pub fn scaled(width_px: u32, height_px: u32, long_side_px: u32) -> Self {
        let long = width_px.max(height_px);
        let side = |px: u32| round_half_up(i64::from(px) * i64::from(long_side_px), i64::from(long)).max(1) as u32;
        Self { width_px: side(width_px), height_px: side(height_px), scale: (long_side_px, long) }
    }

    /// This canvas with `factor` x `factor` samples for each of its pixels.
    #[must_use]
    pub fn supersampled(self, factor: u32) -> Self {
        Self {
            width_px: self.width_px * factor,
            height_px: self.height_px * factor,
            scale: (self.scale.0 * factor, self.scale.1),
        }
    }
}

impl Tile {
    /// A tile that covers nothing.
    pub const EMPTY: Self = Self {
        x0: 1,
        y0: 1,
        x1: 0,
        y1: 0,
        u0: 0,
        v0: 0,
        cos: 0,
        sin: 0,
        w: 0,
        h: 0,
        color: 0,
        mask: 0,
        w_inverse: 0,
        h_inverse: 0,
        ring: 0,
    };

    /// The tile of `fly` on `canvas`; [`Tile::EMPTY`] if the fly is absent or its tile misses the canvas.
    ///
    /// Each tile is measured in the finest unit (1/64 px, 1/32 px, ... 1 px) in which its sides fit 18 bits; at
    /// evaluation size that is always 1/64 px. A side longer than 2^18 canvas px counts as 2^18 px.
    #[must_use]
    pub fn bake(fly: &Fly, canvas: &Canvas) -> Self {
        Self::bake_with_ring(fly, canvas, 0)
    }

    /// As [`Tile::bake`], with a ring of grout of `ring_width` in 1/64 px at evaluation size. It is scaled and rounded
    /// as the sides are.
    #[must_use]
    pub fn bake_with_ring(fly: &Fly, canvas: &Canvas, ring_width: u32) -> Self {
        if !fly.alive {
            return Self::EMPTY;
        }
        let (numerator, denominator) = (i64::from(canvas.scale.0), i64::from(canvas.scale.1));
        let longest = i64::from(fly.w.max(fly.h)) * numerator;
        let coarseness = (0..6).find(|&k| round_half_up(longest, denominator << k) <= i64::from(SIDE_MAX)).unwrap_or(6);
        let unit = i64::from(UNITS_PER_PX) >> coarseness;
        let divisor = denominator << coarseness;
        // A centre x of the picture lies at s * (x + 1/2) - 1/2 on the canvas.
        let half_px = i64::from(UNITS_PER_PX) / 2;
        let centre = |x: i32| round_half_up((i64::from(x) + half_px) * numerator - half_px * denominator, divisor);
        let side = |w: u32| round_half_up(i64::from(w) * numerator, divisor).clamp(1, i64::from(SIDE_MAX));
        let (x, y, w, h) = (centre(fly.x), centre(fly.y), side(fly.w), side(fly.h));

        let (cos, sin) = cos_sin(fly.angle);
        let (cos, sin) = (i64::from(cos), i64::from(sin));
        let (x0, x1) = clip(x, half_extent(cos, sin, w, h), unit, canvas.width_px);
        let (y0, y1) = clip(y, half_extent(sin, cos, w, h), unit, canvas.height_px);
        if x0 > x1 || y0 > y1 {
            return Self::EMPTY;
        }
        let (dx, dy) = (x0 * unit - x, y0 * unit - y);
        let half = i64::from(TRIG_ONE) / 2;
        Self {
            x0: x0 as i32,
            y0: y0 as i32,
            x1: x1 as i32,
            y1: y1 as i32,
            u0: (dx * cos + dy * sin + w * half) as i32,
            v0: (dy * cos - dx * sin + h * half) as i32,
            cos: (cos * unit) as i32,
            sin: (sin * unit) as i32,
            w: w as u32,
            h: h as u32,
            color: pack(fly.color()),
            mask: u32::from(fly.mask),
            w_inverse: inverse(w as u32),
            h_inverse: inverse(h as u32),
            ring: round_half_up(i64::from(ring_width) * numerator, divisor).min(w).min(h) as u32,
        }
    }

    /// Whether no pixel can be covered.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.x0 > self.x1
    }

    /// The width in units of u: a pixel is covered iff its u is below this, and its v below [`Tile::v_end`].
    #[inline]
    #[must_use]
    pub fn u_end(&self) -> u32 {
        self.w * TRIG_ONE as u32
    }

    /// The height in units of v.
    #[inline]
    #[must_use]
    pub fn v_end(&self) -> u32 {
        self.h * TRIG_ONE as u32
    }

    /// Whether a covered pixel at tile coordinates `(u, v)` shows the tile's own colour rather than the grout.
    ///
    /// It is inside the ring iff `ring * 4096 <= u < (w - ring) * 4096`, and v likewise. A tile with a side of at most
    /// two rings has no inside.
    #[inline(always)]
    #[must_use]
    pub fn is_inside_ring(&self, u: u32, v: u32) -> bool {
        // A side is at most 2^18 and a ring no wider, so twice the ring fits 32 bits. For a place before the ring's end
        // the difference wraps to a large number.
        let ring = self.ring * TRIG_ONE as u32;
        let within = |place: u32, end: u32| place.wrapping_sub(ring) < end.saturating_sub(2 * ring);
        within(u, self.u_end()) & within(v, self.v_end())
    }

    /// Tile coordinates `(u, v)` of pixel `(i, j)`, as the unsigned numbers that the coverage test compares.
    ///
    /// Exact inside the box and up to a few dozen pixels around it; further away the 32 bits may wrap.
    #[inline]
    #[must_use]
    pub fn coordinates(&self, i: i32, j: i32) -> (u32, u32) {
        let (di, dj) = (i.wrapping_sub(self.x0), j.wrapping_sub(self.y0));
        let u = self.u0.wrapping_add(di.wrapping_mul(self.cos)).wrapping_add(dj.wrapping_mul(self.sin));
        let v = self.v0.wrapping_sub(di.wrapping_mul(self.sin)).wrapping_add(dj.wrapping_mul(self.cos));
        (u as u32, v as u32)
    }

    /// Whether the tile may cover a pixel of a block of `side` x `side` px, at most a few dozen, that touches its box
    /// and whose upper left pixel is `(x, y)`. A turned tile may fill only half of its box, so this spares many blocks.
    #[inline(always)]
    #[must_use]
    pub fn may_cover(&self, (x, y): (i32, i32), side: i32) -> bool {
        let (u, v) = self.coordinates(x, y);
        let overlaps = |first: u32, step: i32, other_step: i32, end: u32| {
            let (first, reach) = (i64::from(first as i32), i64::from(side - 1));
            let low = first + reach * i64::from(step.min(0) + other_step.min(0));
            let high = first + reach * i64::from(step.max(0) + other_step.max(0));
            (high >= 0) & (low < i64::from(end))
        };
        overlaps(u, self.cos, self.sin, self.u_end()) & overlaps(v, -self.sin, self.cos, self.v_end())
    }

    /// The mask texel (column, row) at tile coordinates `(u, v)` of a covered pixel: `floor(u * 256 / (w * 4096))`,
    /// exactly, in 32 bits. For other pixels the result means nothing.
    #[inline(always)]
    #[must_use]
    pub fn texel(&self, u: u32, v: u32) -> (u32, u32) {
        const STEPS_PER_TEXEL: u32 = TRIG_ONE as u32 / MASK_SIDE as u32;
        (quotient(u / STEPS_PER_TEXEL, self.w, self.w_inverse), quotient(v / STEPS_PER_TEXEL, self.h, self.h_inverse))
    }
}

/// What [`quotient`] multiplies by instead of dividing by `divisor`, 1 to 2^18. The low 24 bits are `2^(23 + shift) /
/// divisor`; the bits above are the shift that leaves 16 bits of any `value < divisor << 8`.
#[must_use]
pub fn inverse(divisor: u32) -> u32 {
    let shift = 24 - divisor.leading_zeros().min(24);
    (shift << 24) | (((1_u64 << (23 + shift)) - 1) / u64::from(divisor)) as u32
}

/// `value / divisor` for `value < divisor << 8`, given the divisor's [`inverse`]. For other values the result means
/// nothing.
///
/// The quotient is below 2^8. The shift loses less than 2^-7 of it, and so does the inverse, which has at least 15
/// bits. So the estimate is the quotient or one less. All products fit 32 bits.
#[inline(always)]
#[must_use]
pub fn quotient(value: u32, divisor: u32, inverse: u32) -> u32 {
    let estimate = (value >> (inverse >> 24)).wrapping_mul(inverse & 0xFF_FFFF) >> 23;
    // 0 if the estimate is one less, else -1. A comparison would not stay in a vector.
    let is_enough = value.wrapping_sub(estimate.wrapping_mul(divisor)).wrapping_sub(divisor) as i32 >> 31;
    estimate.wrapping_add(1).wrapping_add(is_enough as u32)
}

impl Fly {
    /// The colour as stored in pictures: 8 bits a channel, rounded.
    #[must_use]
    pub fn color(&self) -> Rgb {
        [self.r, self.g, self.b].map(|channel| ((u32::from(channel) * 255 + 32_767) / 65_535) as u8)
    }

    /// The fly with this 8-bit colour; [`Fly::color`] gives the same colour back.
    #[must_use]
    pub fn with_color(&self, color: Rgb) -> Self {
        let [r, g, b] = color.map(|channel| u16::from(channel) * 257);
        Self { r, g, b, ..*self }
    }
}

/// A colour in one word: red in the lowest byte, then green, then blue; the highest byte is 0.
#[inline]
#[must_use]
pub fn pack(color: Rgb) -> u32 {
    u32::from_le_bytes([color[0], color[1], color[2], 0])
}

/// The colour that [`pack`] packed; the highest byte is ignored.
#[inline]
#[must_use]
pub fn unpack(word: u32) -> Rgb {
    let [r, g, b, _] = word.to_le_bytes();
    [r, g, b]
}

/// `value / divisor` for a positive divisor, rounded to the nearest integer, halves up.
fn round_half_up(value: i64, divisor: i64) -> i64 {
    (2 * value + divisor).div_euclid(2 * divisor)
}

/// Half of the tile's extent along one axis, rounded up. The table's sine and cosine are rounded, so the map may be up
/// to 1/2900 smaller than a rotation; the second term makes up for that.
fn half_extent(along: i64, across: i64, w: i64, h: i64) -> i64 {
    let sum = along.abs() * w + across.abs() * h;
    (sum >> 13) + (sum >> 23) + 2
}

/// First and last pixel within `half` of `centre`, clipped to `0..side_px`.
fn clip(centre: i64, half: i64, unit: i64, side_px: u32) -> (i64, i64) {
    let first = (centre - half + unit - 1).div_euclid(unit).max(0);
    let last = (centre + half).div_euclid(unit).min(i64::from(side_px) - 1);
    (first, last)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::rng::{Purpose, Stream};

    fn covered(tile: &Tile, i: i32, j: i32) -> bool {
        let (u, v) = tile.coordinates(i, j);
        u < tile.u_end() && v < tile.v_end()
    }

    fn covered_pixels(fly: &Fly, canvas: &Canvas) -> usize {
        let tile = Tile::bake(fly, canvas);
        let inside = |(i, j): &(i32, i32)| (tile.x0..=tile.x1).contains(i) && (tile.y0..=tile.y1).contains(j);
        let pixels = (0..canvas.height_px as i32).flat_map(|j| (0..canvas.width_px as i32).map(move |i| (i, j)));
        pixels.filter(inside).filter(|&(i, j)| covered(&tile, i, j)).count()
    }

    #[test]
    fn texels_without_a_division_are_those_of_the_division() {
        for divisor in 1..=SIDE_MAX {
            let inverse = inverse(divisor);
            for texel in 0..256 {
                let (first, last) = (texel * divisor, texel * divisor + divisor - 1);
                assert_eq!(quotient(first, divisor, inverse), texel, "{first} / {divisor}");
                assert_eq!(quotient(last, divisor, inverse), texel, "{last} / {divisor}");
            }
        }
    }

    #[test]
    fn a_square_of_whole_pixels_covers_its_area_at_every_scale() {
        // Centre at pixel corner (9, 6) - 1/2: twelve by six pixels, from 3 to 14 and from 3 to 8.
        let fly = Fly { x: 64 * 9 - 32, y: 64 * 6 - 32, w: 64 * 12, h: 64 * 6, alive: true, ..Fly::ABSENT };
        for (long_side_px, area) in [(8, 8), (24, 72), (48, 288), (192, 72 * 64)] {
            assert_eq!(covered_pixels(&fly, &Canvas::scaled(24, 12, long_side_px)), area, "at {long_side_px} px");
        }
        assert_eq!(covered_pixels(&fly, &Canvas::evaluation(24, 12)), 72);
    }

    #[test]
    fn at_any_scale_all_numbers_fit_and_no_covered_pixel_lies_outside_the_box() {
        let mut stream = Stream::new(1, Purpose::FirstPopulation, 9, 9);
        for round in 0..20_000_u32 {
            let (width_px, height_px) = (1 + stream.below(600), 1 + stream.below(600));
            let long_side_px = if round % 2 == 0 { width_px.max(height_px) } else { 1 + stream.below(60_000) };
            let canvas = Canvas::scaled(width_px, height_px, long_side_px);
            let mut side = || (16 << stream.below(15)).min(SIDE_MAX) - stream.below(16).min(1);
            let (w, h) = (side().max(16), side().max(16));
            let fly = Fly {
                x: stream.below((width_px - 1) * 64 + 1) as i32,
                y: stream.below((height_px - 1) * 64 + 1) as i32,
                angle: stream.bits() as u16,
                w,
                h,
                alive: true,
                ..Fly::ABSENT
            };
            check_against_wide_integers(&fly, &canvas, &mut stream);
        }
    }

    /// Compares the tile's map and box with the same rule in 128 bits and without a box, at random pixels and around
    /// the box.
    fn check_against_wide_integers(fly: &Fly, canvas: &Canvas, stream: &mut Stream) {
        let ring_width = 1 << stream.below(19) >> 1;
        let tile = Tile::bake_with_ring(fly, canvas, ring_width);
        let mut pixels: Vec<(i32, i32)> =
            (0..8).map(|_| (stream.below(canvas.width_px) as i32, stream.below(canvas.height_px) as i32)).collect();
        for (i, j) in [(tile.x0, tile.y0), (tile.x1, tile.y1), (tile.x0, tile.y1), (tile.x1, tile.y0)] {
            pixels.extend([(i, j), (i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)]);
        }
        pixels.push(((tile.x0 + tile.x1) / 2, (tile.y0 + tile.y1) / 2));
        let on_canvas = |&(i, j): &(i32, i32)| {
            (0..canvas.width_px as i32).contains(&i) && (0..canvas.height_px as i32).contains(&j)
        };
        for (i, j) in pixels.into_iter().filter(on_canvas) {
            let in_box = (tile.x0..=tile.x1).contains(&i) && (tile.y0..=tile.y1).contains(&j);
            let (u, v) = tile.coordinates(i, j);
            let found = (in_box && covered(&tile, i, j)).then(|| tile.is_inside_ring(u, v));
            let expected = inside_in_wide_integers(fly, canvas, ring_width, (i, j));
            assert_eq!(found, expected, "{fly:?} on {canvas:?} with a ring of {ring_width} at {i}, {j}");
        }
    }

    /// Whether a pixel is inside the ring; `None` if it is not covered.
    fn inside_in_wide_integers(fly: &Fly, canvas: &Canvas, ring_width: u32, (i, j): (i32, i32)) -> Option<bool> {
        let (numerator, denominator) = (i128::from(canvas.scale.0), i128::from(canvas.scale.1));
        let rounded = |value: i128, divisor: i128| (2 * value + divisor).div_euclid(2 * divisor);
        let largest = i128::from(SIDE_MAX);
        let longest = i128::from(fly.w.max(fly.h)) * numerator;
        let units_per_px =
            [64, 32, 16, 8, 4, 2].into_iter().find(|units| rounded(longest * units, denominator * 64) <= largest);
        let units_per_px = units_per_px.unwrap_or(1);
        let divisor = denominator * 64;
        let place = |x: i32| rounded(((i128::from(x) + 32) * numerator - 32 * denominator) * units_per_px, divisor);
        let side = |w: u32| rounded(i128::from(w) * numerator * units_per_px, divisor).clamp(1, largest);
        let (cos, sin) = cos_sin(fly.angle);
        let (dx, dy) = (i128::from(i) * units_per_px - place(fly.x), i128::from(j) * units_per_px - place(fly.y));
        let u = dx * i128::from(cos) + dy * i128::from(sin);
        let v = dy * i128::from(cos) - dx * i128::from(sin);
        let (half_w, half_h) = (side(fly.w) * 2048, side(fly.h) * 2048);
        let ring = rounded(i128::from(ring_width) * numerator * units_per_px, divisor) * 4096;
        let within = |inset: i128| {
            (inset - half_w..half_w - inset).contains(&u) && (inset - half_h..half_h - inset).contains(&v)
        };
        within(0).then(|| within(ring))
    }
}
