//! Translucent tiles: a pixel shows all tiles on it, so the change that a child makes is computed from all layers of
//! its pixels and of its victim's.
//!
//! Marginal fitness only helps to choose victims; no change is computed from it. It is exact when a round begins.
//! During a round it is updated only for flies that change.

use std::sync::atomic::Ordering;

use multiversion::multiversion;
use rayon::prelude::*;

use super::area::Area;
use super::block::{PIXELS, Plane, SIDE};
use super::cell::turn_penalty;
use super::cover::Cover;
use super::glazed::{Glazed, Pane};
use super::ground::{Coloring, Ground, Paint, Swap};
use super::laid::Laid;
use super::pixels::{Bare, Pixels};
use super::shared::Shared;
use crate::model::cells::glaze::look;
use crate::model::cells::pixel::TRANSLUCENT_DEPTH;
use crate::model::cells::rules::{ColorSource, Rules};
use crate::model::tile::pack;
use crate::model::{Fly, NO_FLY};

impl Pixels for Glazed {
    const DEPTH_MAX: usize = TRANSLUCENT_DEPTH;

    fn outside() -> Self {
        Self::outside()
    }

    fn lay_bare(&mut self, pixel: usize, bare: &Bare, _: &Rules) {
        self.target[pixel] = bare.target;
        self.weight[pixel] = bare.weight as u32;
        self.error[pixel] = bare.error as u32;
    }

    fn bare_objective(bare: &Bare, _: &Rules) -> i64 {
        i64::from(bare.error)
    }

    fn target(&self) -> &Plane<u32> {
        &self.target
    }

    fn full(&self) -> u32 {
        self.full
    }

    fn depth(&self, pixel: usize) -> usize {
        usize::from(self.depth[pixel])
    }

    fn holds(&self, pixel: usize, fly: u32) -> bool {
        self.stack(pixel).any(|(other, _)| other == fly)
    }

    fn seen(&self, pixel: usize) -> (i32, u32) {
        (self.error[pixel] as i32, self.nearest(pixel))
    }

    fn objective(&self, pixel: usize, _: &Rules) -> i64 {
        i64::from(self.error[pixel])
    }

    fn shown_error(&self, pixel: usize, _: u32) -> u64 {
        u64::from(self.error[pixel] / self.weight[pixel])
    }

    fn stack(&self, pixel: usize) -> Vec<(u32, i32)> {
        self.stack(pixel).map(|(fly, look)| (fly, look as i32)).collect()
    }

    fn renumber(&mut self, depth_of: impl Fn(u32) -> u32) {
        self.renumber(depth_of);
    }
}

impl Ground for Glazed {
    type Desk = Laid;

    fn without_victim(_: i64, penalty: i64) -> i64 {
        -penalty
    }

    fn painted(
        area: &mut Area<'_, Self>,
        desk: &mut Laid,
        shared: &Shared<'_>,
        swap: &Swap<'_>,
        Coloring { paint, picked }: Coloring,
    ) -> Option<(u32, i64)> {
        let rules = &shared.course.rules;
        let old_color = pack(swap.new.fly.color());
        desk.collect(area, swap, rules.background);
        let best = desk.color();
        if best.is_none() && paint == Paint::Birth {
            return None;
        }
        let color = match (paint, rules.color) {
            (Paint::Keep, _) | (_, ColorSource::Evolved) => old_color,
            (_, ColorSource::Pick) => picked,
            (_, ColorSource::Median | ColorSource::Mean) => best.unwrap_or(old_color),
        };
        Some((color, desk.change(color)))
    }

    fn loss(area: &mut Area<'_, Self>, desk: &mut Laid, shared: &Shared<'_>, swap: &Swap<'_>, penalty: i64) -> i64 {
        let fitness = shared.fitness[swap.index as usize].load(Ordering::Relaxed);
        if fitness > 0 {
            return fitness;
        }
        desk.collect(area, swap, shared.course.rules.background);
        desk.change(0) - penalty
    }

    fn swap(area: &mut Area<'_, Self>, shared: &Shared<'_>, _: u32, swap: &Swap<'_>, change: i64) {
        exchange(area, swap, shared.course.rules.background);
        let fitness = &shared.fitness[swap.index as usize];
        fitness.store(fitness.load(Ordering::Relaxed) - change, Ordering::Relaxed);
    }

    fn refresh(blocks: &[Self], flies: &[Fly], shared: &Shared<'_>) {
        for (fly, fitness) in flies.iter().zip(shared.fitness) {
            fitness.store(-turn_penalty(shared.course, fly), Ordering::Relaxed);
        }
        blocks.par_iter().for_each(|block| add_rises(block, shared));
    }
}

/// Moves a fly from the pixels of its old tile to those of its new one.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+bmi1+bmi2", "aarch64+neon"))]
fn exchange(area: &mut Area<'_, Glazed>, swap: &Swap<'_>, background: u32) {
    let color = pack(swap.new.fly.color());
    let covers = [swap.old, swap.new].map(|piece| Cover { footprint: piece.footprint, suit: None });
    area.exchange_rows(&covers[0], &covers[1], |block, (column, y), [was, is]| {
        if was | is == 0 {
            return;
        }
        let row = (y & 7) as usize;
        let (u, v) = swap.new.footprint.coordinates(column * 8, y);
        for lane in 0..SIDE {
            let pixel = row * SIDE + lane;
            if was >> lane & 1 != 0 {
                block.remove(pixel, swap.index);
            }
            let Some(suit) = swap.new.suit.filter(|_| is >> lane & 1 != 0) else { continue };
            let texel = suit.texel_at(swap.new.footprint, (u, v), lane as i32);
            if texel.coverage > 0 {
                block.insert(pixel, Pane { z: swap.new.fly.z, fly: swap.index, look: look(texel, color) });
            }
        }
        block.refresh_errors(row, background);
    });
}

/// Adds to the marginal fitness of each fly by how much a block's error would rise without it.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+bmi1+bmi2", "aarch64+neon"))]
fn add_rises(block: &Glazed, shared: &Shared<'_>) {
    for row in 0..PIXELS / SIDE {
        block.leave_out_each(row, shared.course.rules.background, |flies, rises| {
            for (&fly, &rise) in flies.iter().zip(rises) {
                if fly != NO_FLY && rise != 0 {
                    shared.fitness[fly as usize].fetch_add(i64::from(rise), Ordering::Relaxed);
                }
            }
        });
    }
}
