//! Opaque tiles: the nearest one shows, so the change that a child makes follows from the marginal fitness of its
//! victim.

use std::sync::atomic::Ordering;

use super::area::{self, Area, Child, Shown};
use super::block::{Block, Plane};
use super::cell::turn_penalty;
use super::cover::Cover;
use super::dressed::{self, DressedShown};
use super::exchange::{Exchange, add, exchange};
use super::ground::{Coloring, Ground, Paint, Swap};
use super::pixels::{Bare, Pixels};
use super::shared::Shared;
use crate::model::cells::color::mean;
use crate::model::cells::pixel::{BACKGROUND_Z, STACK_DEPTH, TRANSPARENT, difference};
use crate::model::cells::rules::{ColorSource, Rules};
use crate::model::tile::pack;
use crate::model::{Fly, NO_FLY};

/// The pixels where a child would show, plain or dressed.
#[derive(Debug, Default)]
pub struct Desk {
    shown: Shown,
    dressed: DressedShown,
}

impl Pixels for Block {
    const DEPTH_MAX: usize = STACK_DEPTH;

    fn outside() -> Self {
        Self::outside()
    }

    fn lay_bare(&mut self, pixel: usize, bare: &Bare, rules: &Rules) {
        self.target[pixel] = bare.target;
        self.weight[pixel] = bare.weight;
        self.ground[pixel] = bare.error + hole(bare, rules) + rules.penalties.overlap as i32;
        self.surface(pixel, |_| BACKGROUND_Z as i32);
    }

    fn bare_objective(bare: &Bare, rules: &Rules) -> i64 {
        i64::from(bare.error + hole(bare, rules))
    }

    fn target(&self) -> &Plane<u32> {
        &self.target
    }

    #[inline(always)]
    fn full(&self) -> u32 {
        self.full
    }

    fn depth(&self, pixel: usize) -> usize {
        usize::from(self.depth[pixel])
    }

    fn holds(&self, pixel: usize, fly: u32) -> bool {
        self.stack[pixel][..usize::from(self.depth[pixel])].iter().any(|entry| entry.fly == fly)
    }

    #[inline(always)]
    fn seen(&self, pixel: usize) -> (i32, u32) {
        (self.top.error[pixel], self.top.z[pixel] as u32)
    }

    fn objective(&self, pixel: usize, rules: &Rules) -> i64 {
        i64::from(self.top.error[pixel]) + i64::from(rules.penalties.overlap) * (i64::from(self.depth[pixel]) - 1)
    }

    fn shown_error(&self, pixel: usize, background: u32) -> u64 {
        match self.depth[pixel] {
            0 => difference(self.target[pixel], background) as u64,
            _ => (self.stack[pixel][0].error / self.weight[pixel]) as u64,
        }
    }

    fn stack(&self, pixel: usize) -> Vec<(u32, i32)> {
        self.stack[pixel][..usize::from(self.depth[pixel])].iter().map(|entry| (entry.fly, entry.error)).collect()
    }

    fn renumber(&mut self, depth_of: impl Fn(u32) -> u32) {
        for layer in [&mut self.top, &mut self.under] {
            for (z, &fly) in layer.z.iter_mut().zip(&layer.fly) {
                if fly != NO_FLY {
                    *z = depth_of(fly) as i32;
                }
            }
        }
    }
}

/// What a pixel costs as long as no tile covers it.
fn hole(bare: &Bare, rules: &Rules) -> i32 {
    if bare.target & TRANSPARENT == 0 { rules.penalties.hole as i32 } else { 0 }
}

impl Ground for Block {
    type Desk = Desk;

    #[inline]
    fn without_victim(fitness: i64, _: i64) -> i64 {
        fitness
    }

    fn painted(
        area: &mut Area<'_, Self>,
        desk: &mut Desk,
        shared: &Shared<'_>,
        swap: &Swap<'_>,
        Coloring { paint, picked }: Coloring,
    ) -> Option<(u32, i64)> {
        let rules = &shared.course.rules;
        let child = Child {
            footprint: swap.new.footprint,
            z: swap.new.fly.z as i32,
            fly: swap.index,
            overlap: rules.penalties.overlap as i32,
        };
        let has_new_color = paint != Paint::Keep && rules.color != ColorSource::Evolved;
        let old_color = pack(swap.new.fly.color());
        let Some(suit) = swap.new.suit else {
            if !has_new_color {
                return Some((old_color, area::change(area, &child, old_color)));
            }
            desk.shown.collect(area, &child);
            let count = desk.shown.count() as u32;
            if count == 0 && paint == Paint::Birth {
                return None;
            }
            let color = match rules.color {
                _ if count == 0 => old_color,
                ColorSource::Median => desk.shown.median(),
                ColorSource::Mean => pack(desk.shown.sums().map(|sum| mean(sum, count))),
                ColorSource::Pick | ColorSource::Evolved => picked,
            };
            return Some((color, desk.shown.change(color)));
        };
        if !has_new_color {
            return Some((old_color, dressed::change(area, &child, suit, old_color)));
        }
        desk.dressed.collect(area, &child, suit);
        if !desk.dressed.shows() && paint == Paint::Birth {
            return None;
        }
        let color = match rules.color {
            _ if !desk.dressed.has_color() => old_color,
            ColorSource::Median => desk.dressed.median(),
            ColorSource::Mean => desk.dressed.mean(),
            ColorSource::Pick | ColorSource::Evolved => picked,
        };
        Some((color, desk.dressed.change(color)))
    }

    fn loss(_: &mut Area<'_, Self>, _: &mut Desk, shared: &Shared<'_>, swap: &Swap<'_>, _: i64) -> i64 {
        shared.fitness[swap.index as usize].load(Ordering::Relaxed)
    }

    fn swap(area: &mut Area<'_, Self>, shared: &Shared<'_>, cell: u32, swap: &Swap<'_>, _: i64) {
        let &Swap { index, old, new } = swap;
        let change = Exchange {
            shared,
            cell,
            fly: index,
            color: pack(new.fly.color()),
            keeps_depth: old.fly.z == new.fly.z,
            // Where a dressed tile shows its colour depends on its edges, too.
            keeps_color: shared.is_plain && old.fly.color() == new.fly.color(),
        };
        let covers = [old, new].map(|piece| Cover { footprint: piece.footprint, suit: piece.suit });
        exchange(area, &covers, &change);
        if shared.course.rules.penalties.turn > 0 {
            let penalty = |fly| turn_penalty(shared.course, fly);
            add(shared, cell, index, penalty(old.fly) - penalty(new.fly));
        }
    }

    fn refresh(_: &[Self], _: &[Fly], _: &Shared<'_>) {}
}
