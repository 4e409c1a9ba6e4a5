//! How translucent tiles add up: composited nearest first, in fixed point, with one rounding rule everywhere.
//!
//! Twin: `glsl/shared/translucency.glsl`. A pixel begins with a transmittance of [`CLEAR`]. A layer of opacity `a`
//! keeps `kept(T, a)` of a transmittance `T`; what it takes away is the weight of its colour. What is left at the end
//! is the weight of the background. Weights always add up to [`CLEAR`], so a picture of one colour stays that colour.
//! If every opacity is 0 or [`SOLID`], the rule is that of opaque tiles.
//!
//! Because of the rounding down, the transmittance reaches 0 after at most [`LAYERS_MAX`] layers, whatever they are.
//! That is why marginal fitness can be exact at any depth: see [`widest_after`].

use super::target::Rgb;
use super::tile::pack;

/// Transmittance of a pixel before its nearest layer; a weight of 1.
pub const CLEAR: u32 = 1 << 16;
/// Opacity of a layer that hides what lies behind it.
pub const SOLID: u32 = 256;

/// Opacity, 0 to [`SOLID`], of a texel of `coverage`, 0 to 255.
#[inline]
#[must_use]
pub const fn opacity(coverage: u32) -> u32 {
    coverage + (coverage >> 7)
}

/// What a layer of `opacity` leaves of a transmittance, rounded down.
///
/// The result is never larger than the transmittance, and for an opacity above 0 always smaller. A larger transmittance
/// never leaves less.
#[inline]
#[must_use]
pub const fn kept(transmittance: u32, opacity: u32) -> u32 {
    (transmittance * (SOLID - opacity)) >> 8
}

/// The largest transmittance that the layers so far could leave if any one of them were left out. The last of them, of
/// `opacity`, met `transmittance`; `widest` is the result before that layer, and 0 before the first.
///
/// It is exact since [`kept`] is monotone: once it is 0, no deeper layer shows, even if one fly is left out.
#[inline]
#[must_use]
pub const fn widest_after(widest: u32, transmittance: u32, opacity: u32) -> u32 {
    let without_another = kept(widest, opacity);
    if without_another > transmittance { without_another } else { transmittance }
}

/// The 8-bit channel of a sum of weighted channels, whose weights add up to [`CLEAR`].
#[inline]
#[must_use]
pub const fn channel(sum: u32) -> u32 {
    (sum + CLEAR / 2) >> 16
}

/// The most layers with an opacity above 0 that a pixel can have before no deeper one shows. This follows from the
/// rounding; it is not a cap.
pub const LAYERS_MAX: usize = layers_max();

const fn layers_max() -> usize {
    // The faintest layers take longest: any other layer leaves less, and from less no layer leaves more.
    let (mut layers, mut transmittance, mut widest) = (0, CLEAR, 0);
    while layers == 0 || widest > 0 {
        widest = widest_after(widest, transmittance, 1);
        transmittance = kept(transmittance, 1);
        layers += 1;
    }
    layers
}

/// A pixel between two of its layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Compositing {
    /// Weight left for what lies behind, [`CLEAR`] at first.
    pub transmittance: u32,
    /// Sum of the weighted channels so far.
    pub sums: [u32; 3],
}

impl Compositing {
    /// A pixel before its nearest layer.
    pub const START: Self = Self { transmittance: CLEAR, sums: [0; 3] };

    /// Adds the next layer.
    #[inline]
    pub fn add(&mut self, opacity: u32, color: Rgb) {
        let left = kept(self.transmittance, opacity);
        self.weigh(self.transmittance - left, color);
        self.transmittance = left;
    }

    /// The colour that shows over `background`.
    #[inline]
    #[must_use]
    pub fn over(mut self, background: Rgb) -> Rgb {
        self.weigh(self.transmittance, background);
        self.sums.map(|sum| channel(sum) as u8)
    }

    /// The colour of the layers alone, not premultiplied, packed with their opacity in the highest byte; 0 if that is
    /// 0.
    ///
    /// The colour is the one over black, divided by the opacity. So over black, rounded, it is again exactly what
    /// [`Compositing::over`] gives, which is what a search scores.
    #[inline]
    #[must_use]
    pub fn alone(self) -> u32 {
        match channel((CLEAR - self.transmittance) * 255) {
            0 => 0,
            alpha => pack(self.sums.map(|sum| ((channel(sum) * 255 + alpha / 2) / alpha) as u8)) | alpha << 24,
        }
    }

    #[inline]
    fn weigh(&mut self, weight: u32, color: Rgb) {
        self.sums.iter_mut().zip(color).for_each(|(sum, channel)| *sum += weight * u32::from(channel));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::rng::{Purpose, Stream};

    #[test]
    fn every_layer_takes_something_and_no_layer_widens_what_it_gets() {
        for opacity in 1..=SOLID {
            for transmittance in 0..CLEAR {
                let (less, more) = (kept(transmittance, opacity), kept(transmittance + 1, opacity));
                assert!(less <= more && more <= transmittance, "{opacity} at {transmittance}");
            }
        }
    }

    #[test]
    fn the_faintest_layers_hide_what_lies_behind_1565_of_them_and_close_a_pixel_with_one_more() {
        let layers = std::iter::successors(Some(CLEAR), |&left| (left > 0).then(|| kept(left, 1)));
        assert_eq!(layers.count() - 1, 1_565);
        assert_eq!(LAYERS_MAX, 1_566);
    }

    #[test]
    fn the_widest_transmittance_is_that_of_the_best_layer_to_leave_out() {
        let mut stream = Stream::new(3, Purpose::FirstPopulation, 1, 1);
        for round in 0..300 {
            let strongest = 1 + stream.below(if round % 3 == 0 { SOLID } else { 9 });
            let (mut transmittance, mut widest, mut opacities) = (CLEAR, 0, Vec::new());
            while opacities.is_empty() || widest > 0 {
                let opacity = 1 + stream.below(strongest);
                widest = widest_after(widest, transmittance, opacity);
                transmittance = kept(transmittance, opacity);
                opacities.push(opacity);
                let without = |left_out: usize| {
                    let others = opacities.iter().enumerate().filter(|&(layer, _)| layer != left_out);
                    others.fold(CLEAR, |left, (_, &opacity)| kept(left, opacity))
                };
                if opacities.len() < 40 {
                    assert_eq!(Some(widest), (0..opacities.len()).map(without).max());
                }
                assert!(transmittance <= widest);
            }
            assert!(opacities.len() <= LAYERS_MAX);
        }
    }

    #[test]
    fn one_colour_throughout_stays_that_colour_and_solid_layers_hide() {
        let (one, other) = ([7, 0, 255], [200, 100, 3]);
        for opacity in 0..=SOLID {
            let mut pixel = Compositing::START;
            (0..5).for_each(|_| pixel.add(opacity, one));
            assert_eq!(pixel.over(one), one, "opacity {opacity}");
        }
        let mut pixel = Compositing::START;
        pixel.add(opacity(0), other);
        assert_eq!(pixel.over(one), one);
        pixel.add(opacity(255), one);
        pixel.add(opacity(255), other);
        assert_eq!(pixel.over(other), one);
    }
}
