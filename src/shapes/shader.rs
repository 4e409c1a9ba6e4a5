//! Shaders turn templates into masks. One template can have several looks (paper, Figs 8a and 8b).

use std::fmt;
use std::str::FromStr;

use super::depth::{DEPTH_PER_TEXEL, Depth};
use super::drawing::{ramp, rounded, smooth_step};
use super::ink::Ink;
use super::noise::{ONE, noise};
use super::template::Template;
use crate::error::{Error, Result};
use crate::model::Mask;
use crate::model::mask::{MASK_SIDE, Texel};

/// A way to turn a template into a mask.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Shader {
    /// Coverage from alpha, evenly bright.
    #[default]
    Flat,
    /// Shade from intensity.
    Template,
    /// A dark contour inside the edge.
    Outline,
    /// A bevel, lit from the upper left.
    Emboss,
    /// Opacity falls off towards the edge.
    Soft,
    /// Only the rim is covered.
    Hollow,
    /// Shade from inverted intensity.
    Negative,
    /// Opacity falls along the height.
    Fade,
    /// Thin in the middle, with a dense rim.
    Wash,
}

impl Shader {
    /// All of them, in the order in which they are listed.
    pub const ALL: [Self; 9] = [
        Self::Flat,
        Self::Template,
        Self::Outline,
        Self::Emboss,
        Self::Soft,
        Self::Hollow,
        Self::Negative,
        Self::Fade,
        Self::Wash,
    ];

    /// The name that users type.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Flat => "flat",
            Self::Template => "template",
            Self::Outline => "outline",
            Self::Emboss => "emboss",
            Self::Soft => "soft",
            Self::Hollow => "hollow",
            Self::Negative => "negative",
            Self::Fade => "fade",
            Self::Wash => "wash",
        }
    }

    /// Whether it is meant for translucent tiles: its coverage is mostly neither 0 nor 255.
    #[must_use]
    pub fn is_translucent(self) -> bool {
        matches!(self, Self::Soft | Self::Fade | Self::Wash)
    }

    /// What it makes of a template, in one line without a full stop.
    #[must_use]
    pub fn description(self) -> &'static str {
        match self {
            Self::Flat => "the outline alone, in one even colour",
            Self::Template => "the drawing as it is: its intensity shades the colour",
            Self::Outline => "an even colour inside a dark contour",
            Self::Emboss => "raised from the ground, with a bevel that is lit from the upper left",
            Self::Soft => "opaque in the middle and fading towards the edge, like spray paint; for translucent tiles",
            Self::Hollow => "only the rim, so that what lies behind shows through the middle",
            Self::Negative => "the drawing's relief inverted: what was dark is light",
            Self::Fade => {
                "opaque at the top and thinning towards the bottom, like a loaded brush; for translucent tiles"
            }
            Self::Wash => "watercolour: thin and grainy, with pigment gathered at the edge; for translucent tiles",
        }
    }

    /// The mask that this shader makes of a template. It is computed with integers, so it is the same on every machine.
    ///
    /// The distances that shaders use are meant for the full square. In a drawing without room for them, such as a
    /// narrow stripe, they shrink with its greatest depth.
    #[must_use]
    pub fn mask(self, template: &Template) -> Mask {
        let ink = template.ink();
        let texels = match self {
            Self::Flat => each(ink, |ink| Texel { coverage: ink.alpha, shade: 255 }),
            Self::Template => each(ink, |ink| Texel { coverage: ink.alpha, shade: ink.intensity }),
            Self::Negative => negative(ink),
            Self::Outline => outline(ink),
            Self::Emboss => emboss(ink),
            Self::Soft => soft(ink),
            Self::Hollow => hollow(ink),
            Self::Fade => fade(ink),
            Self::Wash => wash(ink),
        };
        Mask::new(texels).expect("a template has as many texels as a mask")
    }
}

impl fmt::Display for Shader {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl FromStr for Shader {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|shader| shader.name().eq_ignore_ascii_case(name.trim())).ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            Error::UnknownName { what: "shader", name: name.to_owned(), known }
        })
    }
}

fn each(ink: &[Ink], texel: impl Fn(&Ink) -> Texel) -> Vec<Texel> {
    ink.iter().map(texel).collect()
}

/// As [`each`], but the texel also depends on its depth.
fn each_with_depth(ink: &[Ink], depth: &Depth, texel: impl Fn(&Ink, i64) -> Texel) -> Vec<Texel> {
    ink.iter().zip(depth.texels()).map(|(ink, &depth)| texel(ink, depth)).collect()
}

/// An alpha times `opacity` / 255, rounded.
fn thinned(alpha: u8, opacity: i64) -> u8 {
    rounded(i64::from(alpha) * opacity, 255) as u8
}

/// `texels` as a depth, or a third of the drawing's greatest depth if that is less.
fn width(texels: i64, depth: &Depth) -> i64 {
    (texels * DEPTH_PER_TEXEL).min(depth.greatest() / 3).max(1)
}

/// The darkest parts become fully bright. The brightest parts keep enough light for evolution to make up for it.
fn negative(ink: &[Ink]) -> Vec<Texel> {
    const DARKEST: i64 = 120;
    let drawn = || ink.iter().filter(|ink| ink.alpha > 0).map(|ink| i64::from(ink.intensity));
    let (low, high) = (drawn().min().unwrap_or(255), drawn().max().unwrap_or(255));
    let shade = |intensity: u8| {
        let above = i64::from(intensity) - low;
        255 - above.min(rounded(above * (255 - DARKEST), (high - low).max(1)))
    };
    each(ink, |ink| Texel { coverage: ink.alpha, shade: if ink.alpha == 0 { 255 } else { shade(ink.intensity) as u8 } })
}

fn outline(ink: &[Ink]) -> Vec<Texel> {
    let depth = Depth::of(ink);
    let width = width(12, &depth);
    each_with_depth(ink, &depth, |ink, depth| Texel {
        coverage: ink.alpha,
        shade: ramp(depth, (width * 3 / 4, width * 5 / 4 + 1), (64, 255)) as u8,
    })
}

/// The depth is blurred, since that of a square has creases along its diagonals.
fn soft(ink: &[Ink]) -> Vec<Texel> {
    let depth = Depth::of(ink);
    let greatest = depth.greatest();
    let reach = (greatest / DEPTH_PER_TEXEL / 6).max(1);
    let heights = blurred(&blurred(depth.texels(), reach), reach);
    let opacity = |height: i64| smooth_step(height, greatest / 16, greatest * 3 / 4);
    let texel = |(ink, &height): (&Ink, &i64)| Texel { coverage: thinned(ink.alpha, opacity(height)), shade: 255 };
    ink.iter().zip(&heights).map(texel).collect()
}

fn hollow(ink: &[Ink]) -> Vec<Texel> {
    let depth = Depth::of(ink);
    let width = width(32, &depth);
    each_with_depth(ink, &depth, |ink, depth| Texel {
        coverage: thinned(ink.alpha, ramp(depth, (width - DEPTH_PER_TEXEL, width + DEPTH_PER_TEXEL), (255, 0))),
        shade: 255,
    })
}

fn fade(ink: &[Ink]) -> Vec<Texel> {
    let side = MASK_SIDE as i64;
    let opacity = |index: usize| ramp((index / MASK_SIDE) as i64, (side / 8, side), (255, 20));
    (0..).zip(ink).map(|(index, ink)| Texel { coverage: thinned(ink.alpha, opacity(index)), shade: 255 }).collect()
}

/// Pigment settles in the paper's grain and along the edge, where a puddle dries last.
fn wash(ink: &[Ink]) -> Vec<Texel> {
    let depth = Depth::of(ink);
    let width = width(16, &depth);
    let side = MASK_SIDE as i64;
    let texel = |(index, (ink, &depth)): (i64, (&Ink, &i64))| {
        let (x, y) = (index % side * ONE, index / side * ONE);
        let grain = (noise(9, x / 5, y / 5) + noise(10, x / 50, y / 50)) / 2;
        let pigment = smooth_step(2 * width - depth, 0, 2 * width);
        Texel {
            coverage: thinned(ink.alpha, ramp(pigment, (0, 255), (128 + grain * 56 / 255, 255))),
            shade: ramp(pigment, (0, 255), (255, 205)) as u8,
        }
    };
    (0..).zip(ink.iter().zip(depth.texels())).map(texel).collect()
}

/// A bevel along the edge. Light comes from the upper left, so slopes that rise to the right or downwards are lit.
fn emboss(ink: &[Ink]) -> Vec<Texel> {
    const LEVEL: i64 = 222;
    let depth = Depth::of(ink);
    let bevel = (32 * DEPTH_PER_TEXEL).min(depth.greatest() / 2 + 1);
    let heights: Vec<i64> = depth.texels().iter().map(|&depth| depth.min(bevel)).collect();
    let heights = blurred(&blurred(&heights, 3), 3);
    let side = MASK_SIDE as i64;
    let at = |column: i64, row: i64| {
        let is_inside = (0..side).contains(&column) && (0..side).contains(&row);
        if is_inside { heights[(row * side + column) as usize] } else { 0 }
    };
    let shade = |index: i64| {
        let (column, row) = (index % side, index / side);
        let rise = at(column + 1, row) - at(column - 1, row) + at(column, row + 1) - at(column, row - 1);
        (LEVEL + rise * 66 / (2 * DEPTH_PER_TEXEL)).clamp(128, 255) as u8
    };
    (0..).zip(ink).map(|(index, ink)| Texel { coverage: ink.alpha, shade: shade(index) }).collect()
}

/// The mean of the heights within `reach` texels along both axes; outside, heights are 0.
fn blurred(heights: &[i64], reach: i64) -> Vec<i64> {
    let along_rows = blurred_in_lines(heights, reach, 1);
    blurred_in_lines(&along_rows, reach, MASK_SIDE)
}

/// The mean of the heights within `reach` texels along lines whose neighbours are `step` apart, rows or columns.
fn blurred_in_lines(heights: &[i64], reach: i64, step: usize) -> Vec<i64> {
    let (side, stride) = (MASK_SIDE, MASK_SIDE / step);
    let mut means = vec![0; heights.len()];
    for line in 0..side {
        let at = |place: i64| line * stride + place as usize * step;
        let height = |place: i64| if (0..side as i64).contains(&place) { heights[at(place)] } else { 0 };
        let mut sum: i64 = (0..reach).map(height).sum();
        for place in 0..side as i64 {
            sum += height(place + reach) - height(place - reach - 1);
            means[at(place)] = rounded(sum, 2 * reach + 1);
        }
    }
    means
}
