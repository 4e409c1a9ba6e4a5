//! Translucent tiles in the search: what lies on a pixel, and the best colour for a child.
//!
//! Twin: `glsl/shared/cells_glaze.glsl`. [`crate::model::translucency`] defines how layers add up. Up to rounding, what
//! a pixel shows is linear in the colour of one of its tiles: it is the tile's share times its colour, plus the sum of
//! everything else. So in each channel the colour of least squares is a quotient of two sums.

use crate::model::mask::{Texel, shaded};
use crate::model::tile::pack;
use crate::model::translucency::{CLEAR, opacity};

/// One word for what a tile shows at a pixel: its shaded colour, packed, and its coverage in the highest byte. 0 is no
/// tile.
#[inline(always)]
#[must_use]
pub fn look(texel: Texel, color: u32) -> u32 {
    shaded(color, u32::from(texel.shade)) | u32::from(texel.coverage) << 24
}

/// Opacity of a look, 0 to [`crate::model::translucency::SOLID`].
#[inline(always)]
#[must_use]
pub const fn opacity_of(look: u32) -> u32 {
    opacity(look >> 24)
}

/// By how much the pixel changes, in 1/256, when the tile's colour changes by 1. It follows from the tile's weight
/// there, 0 to [`CLEAR`], and from its shade.
#[inline(always)]
#[must_use]
pub const fn share_q8(weight: u32, shade: u32) -> i32 {
    // At most 2^16 * 255 and a half: 32 bits.
    ((weight * shade + 255 * CLEAR / 512) / (255 * CLEAR / 256)) as i32
}

/// What one channel of the target lacks if the tile is black, with 6 fractional bits: between -2^14 and 2^14. `sum` is
/// the sum of the weighted channels of everything else, background included.
#[inline(always)]
#[must_use]
pub const fn lack_q6(target: u32, sum: u32) -> i32 {
    ((target << 16) as i32 - sum as i32 + 512) >> 10
}

/// Sums over the pixels that a tile covers, each times the pixel's weight.
///
/// With weights of at most 16, a pixel adds at most 2^26 to `lacks`, so eight rows of a block fit 32 bits in each of
/// eight lanes. It adds at most 2^20 to `squares`. A tile has at most 2^20 pixels, which makes at most 2^46 and 2^40:
/// two words on a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fit {
    /// Share times lack, by channel.
    pub lacks: [i64; 3],
    /// Share times share.
    pub squares: i64,
}

impl Fit {
    /// The colour of least squares, packed; `None` if the tile shows nowhere.
    #[must_use]
    pub fn color(&self) -> Option<u32> {
        (self.squares > 0).then(|| pack([0, 1, 2].map(|channel| self.channel(channel))))
    }

    /// `lacks / squares` in units of a channel, rounded half up and clamped to 8 bits. It is found bit by bit, so no
    /// 64-bit division is needed.
    fn channel(&self, channel: usize) -> u8 {
        let mut value = 0_u8;
        for bit in (0..8).rev() {
            let trial = value | 1 << bit;
            // (share * lack) / (share * share) has 6 - 8 fractional bits: four times it against trial - 1/2.
            if (2 * i64::from(trial) - 1) * self.squares <= 8 * self.lacks[channel] {
                value = trial;
            }
        }
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::cells::random::hash;

    #[test]
    fn the_colour_of_least_squares_is_that_of_a_search_of_all_colours() {
        for case in 0..200_u32 {
            let bits = |number: u32| hash(case << 8 | number);
            let pixels: Vec<(u32, u32)> = (0..1 + case % 9)
                .map(|number| {
                    let weight = bits(3 * number) % (CLEAR + 1);
                    let rest = (CLEAR - weight) * (bits(3 * number + 1) % 256);
                    (weight, rest)
                })
                .collect();
            let targets: Vec<u32> = (0..).map(|number| bits(1_000 + number) % 256).take(pixels.len()).collect();
            let mut fit = Fit::default();
            for (&(weight, rest), &target) in pixels.iter().zip(&targets) {
                let share = i64::from(share_q8(weight, 255));
                fit.lacks[0] += share * i64::from(lack_q6(target, rest));
                fit.squares += share * share;
            }
            let squares = |color: u32| -> f64 {
                let lack = |weight: u32, rest: u32, target: u32| {
                    f64::from(target) - (f64::from(rest) + f64::from(weight) * f64::from(color)) / f64::from(CLEAR)
                };
                pixels.iter().zip(&targets).map(|(&(w, r), &t)| lack(w, r, t).powi(2)).sum()
            };
            let Some(found) = fit.color() else { continue };
            let best = (0..256).map(squares).fold(f64::INFINITY, f64::min);
            // Shares have 8 bits: next to the best one, if not it.
            assert!(squares(found & 255) <= best * 1.01 + 1.0, "case {case}: {found}");
        }
    }

    #[test]
    fn a_tile_alone_and_solid_takes_the_mean_and_one_that_shows_nowhere_none() {
        let mut fit = Fit::default();
        assert_eq!(fit.color(), None);
        for target in [10, 20, 31] {
            let share = i64::from(share_q8(CLEAR, 255));
            assert_eq!(share, 256);
            fit.lacks[1] += share * i64::from(lack_q6(target, 0));
            fit.squares += share * share;
        }
        assert_eq!(fit.color(), Some(20 << 8));
    }

    #[test]
    fn a_shade_asks_for_a_brighter_colour() {
        let share = i64::from(share_q8(CLEAR, 51));
        let lacks = [20, 60, 0].map(|target| share * i64::from(lack_q6(target, 0)));
        let color = Fit { lacks, squares: share * share }.color().expect("it shows");
        assert_eq!(color, pack([100, 255, 0]));
    }
}
