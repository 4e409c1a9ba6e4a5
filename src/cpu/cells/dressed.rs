//! How a child would change its pixels if tiles wear masks or grout, or pixels differ in weight: the general form of
//! `area`, pixel by pixel.

use super::area::{Area, Child, SIDE, compare};
use super::block::Block;
use crate::model::cells::color::{mean, weighted_median};
use crate::model::cells::footprint::Footprint;
use crate::model::cells::pixel::{TRANSPARENT, difference};
use crate::model::cells::suit::{Look, Suit, unshaded};
use crate::model::mask::shaded;

/// Calls `visit` for each pixel that the dressed child covers, with what the child shows there, with the target and the
/// weight, and, if the child would be in front, with the error of what shows without its victim.
#[inline(always)]
fn each_covered(
    area: &Area<'_, Block>,
    child: &Child<'_>,
    suit: &Suit<'_>,
    mut visit: impl FnMut(Look, (u32, i32), Option<i32>),
) {
    let f: Footprint = *child.footprint;
    area.visit(child.footprint, |block, rows| {
        let (mut u, mut v) = (rows.u, rows.v);
        for row in rows.first..=rows.last {
            let (covers, shows, errors) = compare(block, row, (u, v), child);
            for lane in 0..SIDE {
                if covers[lane] == 0 {
                    continue;
                }
                let (lane_u, lane_v) = (u + f.cos * lane as i32, v - f.sin * lane as i32);
                let Some(look) = suit.look(&f, lane_u as u32, lane_v as u32) else { continue };
                let pixel = row * SIDE + lane;
                let shown = (shows[lane] != 0).then_some(errors[lane]);
                visit(look, (block.target[pixel], block.weight[pixel]), shown);
            }
            u = u.wrapping_add(f.sin);
            v = v.wrapping_add(f.cos);
        }
    });
}

/// As [`super::area::change`].
pub fn change(area: &Area<'_, Block>, child: &Child<'_>, suit: &Suit<'_>, color: u32) -> i64 {
    let mut sum = 0_i64;
    each_covered(area, child, suit, |look, (target, weight), shown| {
        let gain = shown.map_or(0, |shown| suit.error(look, color, target, weight) - shown);
        sum += i64::from(gain + child.overlap);
    });
    sum
}

/// The pixels where a dressed child would show its colour.
#[derive(Debug, Default)]
pub struct DressedShown {
    /// Target, shade and weight of each.
    pixels: Vec<(u32, u8, u8)>,
    channels: [Vec<u8>; 3],
    weights: Vec<u8>,
    /// What all else adds to the change of the objective: the child's other pixels, and the errors of what shows now.
    rest: i64,
    /// Whether it would show anything, even if only grout.
    shows: bool,
}

impl DressedShown {
    /// Collects the pixels where a child would show.
    pub fn collect(&mut self, area: &Area<'_, Block>, child: &Child<'_>, suit: &Suit<'_>) {
        self.pixels.clear();
        self.weights.clear();
        self.channels.iter_mut().for_each(Vec::clear);
        self.rest = 0;
        self.shows = false;
        each_covered(area, child, suit, |look, (target, weight), shown| {
            self.rest += i64::from(child.overlap);
            let Some(shown) = shown else { return };
            self.shows = true;
            self.rest -= i64::from(shown);
            match look {
                Look::Shade(shade) if target & TRANSPARENT == 0 => {
                    self.pixels.push((target, shade as u8, weight as u8));
                    self.weights.push(weight as u8);
                    let bright = unshaded(target, shade).to_le_bytes();
                    self.channels.iter_mut().zip(bright).for_each(|(channel, value)| channel.push(value));
                }
                _ => self.rest += i64::from(suit.error(look, 0, target, weight)),
            }
        });
    }

    /// Whether the child would show anything.
    pub fn shows(&self) -> bool {
        self.shows
    }

    /// Whether the child would show its colour anywhere.
    pub fn has_color(&self) -> bool {
        !self.pixels.is_empty()
    }

    /// The medians of the channels, packed. There must be a pixel.
    pub fn median(&self) -> u32 {
        u32::from_le_bytes([0, 1, 2, 3].map(|channel| match self.channels.get(channel) {
            Some(values) => weighted_median(values, &self.weights),
            None => 0,
        }))
    }

    /// The means of the channels, packed. There must be a pixel.
    pub fn mean(&self) -> u32 {
        let total = self.weights.iter().map(|&weight| u32::from(weight)).sum();
        let sum = |values: &Vec<u8>| {
            values.iter().zip(&self.weights).map(|(&value, &weight)| u32::from(value) * u32::from(weight)).sum()
        };
        u32::from_le_bytes(
            [0, 1, 2, 3].map(|channel| self.channels.get(channel).map_or(0, |values| mean(sum(values), total))),
        )
    }

    /// As [`change`], for the child that was collected.
    pub fn change(&self, color: u32) -> i64 {
        let errors = self.pixels.iter().map(|&(target, shade, weight)| {
            i64::from(difference(target, shaded(color, u32::from(shade)))) * i64::from(weight)
        });
        self.rest + errors.sum::<i64>()
    }
}
