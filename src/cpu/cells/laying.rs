//! Lays the blocks of pixels. That takes time for a large picture, so it is done when they are needed, and in parts.

use rayon::prelude::*;

use super::Cells;
use super::block::PIXELS;
use super::cell::turn_penalty;
use super::ground::Ground;
use super::halt::Halt;
use super::pixels::Bare;
use crate::model::cells::Course;
use crate::model::cells::grid::BLOCK_SIDE_PX;
use crate::model::cells::pixel::{INSIDE, TRANSPARENT, difference};
use crate::model::tile::pack;

/// Blocks between two looks: some milliseconds of work.
const BLOCKS_AT_ONCE: usize = 1_024;

impl<G: Ground> Cells<G> {
    /// Number of blocks.
    fn block_count(&self) -> usize {
        let (width, height) = self.size_px();
        (width.div_ceil(BLOCK_SIDE_PX) * height.div_ceil(BLOCK_SIDE_PX)) as usize
    }

    /// Lays the blocks that are missing; returns false if it was halted before the last one.
    pub(super) fn lay(&mut self, halt: &Halt<'_>) -> bool {
        let block_count = self.block_count();
        let (course, columns) = (&self.course, self.columns);
        self.blocks.reserve_exact(block_count - self.blocks.len());
        while self.blocks.len() < block_count {
            if halt.is_called() {
                return false;
            }
            let first = self.blocks.len();
            let numbers = first..(first + BLOCKS_AT_ONCE).min(block_count);
            self.blocks.par_extend(numbers.into_par_iter().map(|number| laid(course, number as u32, columns)));
        }
        true
    }

    /// Whether no block was laid yet, which nothing but absent flies allow.
    pub(super) fn is_bare(&self) -> bool {
        self.blocks.len() < self.block_count()
    }

    /// The objective without flies.
    pub(super) fn bare_objective(&self) -> i64 {
        let places = (0..self.course.target.pixels().len()).into_par_iter().with_min_len(1 << 14);
        places.map(|place| G::bare_objective(&bare(&self.course, place), &self.course.rules)).sum()
    }

    /// The objective, summed over pixels and flies.
    pub(super) fn objective(&self) -> i64 {
        let rules = &self.course.rules;
        let of_block = |block: &G| -> i64 {
            let inside = (0..PIXELS).filter(|&pixel| block.target()[pixel] & INSIDE != 0);
            inside.map(|pixel| block.objective(pixel, rules)).sum()
        };
        let of_pixels: i64 = self.blocks.par_iter().with_min_len(64).map(of_block).sum();
        let of_flies: i64 = self.flies.iter().map(|fly| turn_penalty(&self.course, fly)).sum();
        of_pixels + of_flies
    }

    /// The SAE of what the pixels show, over all wanted pixels, without weights.
    pub(super) fn shown_sae(&self) -> u64 {
        let background = self.course.rules.background;
        if self.is_bare() {
            let target = &self.course.target;
            let is_wanted = |place: usize| target.transparent().is_none_or(|transparent| !transparent[place]);
            let places = (0..target.pixels().len()).into_par_iter().with_min_len(1 << 14);
            let of_place = |place: usize| difference(pack(target.pixels()[place]), background) as u64;
            return places.filter(|&place| is_wanted(place)).map(of_place).sum();
        }
        let of_block = |block: &G| -> u64 {
            let is_wanted = |&pixel: &usize| block.target()[pixel] & (INSIDE | TRANSPARENT) == INSIDE;
            (0..PIXELS).filter(is_wanted).map(|pixel| block.shown_error(pixel, background)).sum()
        };
        self.blocks.par_iter().with_min_len(64).map(of_block).sum()
    }
}

/// A block without tiles.
fn laid<G: Ground>(course: &Course, number: u32, columns: u32) -> G {
    let (width, height) = (course.target.width_px(), course.target.height_px());
    let mut block = G::outside();
    let (x, y) = (number % columns * BLOCK_SIDE_PX, number / columns * BLOCK_SIDE_PX);
    for row in 0..BLOCK_SIDE_PX.min(height - y) {
        for column in 0..BLOCK_SIDE_PX.min(width - x) {
            let place = ((y + row) * width + x + column) as usize;
            block.lay_bare((row * BLOCK_SIDE_PX + column) as usize, &bare(course, place), &course.rules);
        }
    }
    block
}

/// A pixel of the target, without tiles.
fn bare(course: &Course, place: usize) -> Bare {
    let Course { target, rules, .. } = course;
    let color = pack(target.pixels()[place]);
    let weight = target.weights().map_or(1, |weights| i32::from(weights[place]));
    let is_unwanted = target.transparent().is_some_and(|transparent| transparent[place]);
    let (flag, error) = if is_unwanted { (TRANSPARENT, 0) } else { (0, difference(color, rules.background) * weight) };
    Bare { target: color | INSIDE | flag, weight, error }
}
