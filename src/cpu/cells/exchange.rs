//! What an accepted child changes: the stacks of its pixels and of its victim's, and the marginal fitness of the flies
//! that show there.

use std::sync::atomic::Ordering;

use multiversion::multiversion;

use super::area::{Area, Exchanged};
use super::block::{Block, Entry};
use super::cover::Cover;
use super::shared::Shared;
use crate::model::NO_FLY;
use crate::model::cells::NO_CELL;
use crate::model::cells::pixel::difference;

/// What the top fly of a pixel contributes to its marginal fitness there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Excess {
    fly: u32,
    gain: i64,
}

impl Excess {
    #[inline(always)]
    fn of(block: &Block, pixel: usize) -> Self {
        let gain = i64::from(block.under.error[pixel]) - i64::from(block.top.error[pixel]);
        Self { fly: block.top.fly[pixel], gain }
    }

    /// Subtracts this from the fitness of its fly, and adds `new` to the fitness of the fly on top now.
    #[inline(always)]
    fn replace(self, new: Self, shared: &Shared<'_>, cell: u32) {
        if self == new {
            return;
        }
        if self.fly == new.fly {
            if self.fly != NO_FLY {
                add(shared, cell, self.fly, new.gain - self.gain);
            }
            return;
        }
        if self.fly != NO_FLY {
            add(shared, cell, self.fly, -self.gain);
        }
        if new.fly != NO_FLY {
            add(shared, cell, new.fly, new.gain);
        }
    }
}

/// Adds to a fly's marginal fitness: with a plain store if the fly is the cell's own, atomically if it is frozen.
#[inline]
pub fn add(shared: &Shared<'_>, cell: u32, fly: u32, amount: i64) {
    let fitness = &shared.fitness[fly as usize];
    if shared.owners[fly as usize] == cell && cell != NO_CELL {
        fitness.store(fitness.load(Ordering::Relaxed) + amount, Ordering::Relaxed);
    } else {
        fitness.fetch_add(amount, Ordering::Relaxed);
    }
}

/// One fly's change of place, depth or colour.
pub struct Exchange<'a> {
    pub shared: &'a Shared<'a>,
    /// The cell at work.
    pub cell: u32,
    pub fly: u32,
    /// Its new colour.
    pub color: u32,
    pub keeps_depth: bool,
    pub keeps_color: bool,
}

/// Moves a fly from the pixels of its old tile to those of its new one.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+bmi1+bmi2", "aarch64+neon"))]
pub fn exchange(area: &mut Area<'_, Block>, [old, new]: &[Cover<'_>; 2], change: &Exchange<'_>) {
    let Exchange { shared, cell, fly, color, keeps_depth, keeps_color } = *change;
    let depth_of = |fly: u32| shared.depths[fly as usize].load(Ordering::Relaxed);
    let own_z = depth_of(fly);
    let is_behind = |other: u32| (own_z, fly) < (depth_of(other), other);
    let error_at = |block: &Block, at: &Exchanged| {
        let (target, weight) = (block.target[at.pixel], block.weight[at.pixel]);
        let Some(suit) = new.suit else { return difference(target, color) * weight };
        let (u, v) = new.footprint.coordinates(at.x, at.y);
        suit.look(new.footprint, u as u32, v as u32).map_or(0, |look| suit.error(look, color, target, weight))
    };
    let mut covered = 0;
    area.exchange(old, new, |block, at| {
        let &Exchanged { pixel, was, is, .. } = at;
        if was && is && keeps_depth && keeps_color {
            return;
        }
        let before = Excess::of(block, pixel);
        let entry = Entry { fly, error: if is { error_at(block, at) } else { 0 } };
        let mut place = usize::MAX;
        if was && is && keeps_depth {
            place = block.recolor(pixel, entry);
        } else {
            if was {
                place = block.remove(pixel, fly);
                covered -= 1;
            }
            if is {
                place = place.min(block.insert(pixel, entry, is_behind));
                covered += 1;
            }
        }
        if place < 2 {
            block.surface(pixel, |fly| depth_of(fly) as i32);
            before.replace(Excess::of(block, pixel), shared, cell);
        }
    });
    add(shared, cell, fly, -covered * i64::from(shared.course.rules.penalties.overlap));
}
