//! The blocks of one cell while a task works on it, and how a child would change their pixels.

use multiversion::multiversion;

use super::block::Block;
pub(super) use super::block::SIDE;
use super::cover::{Cover, Lanes, outside, row_of};
use super::pixels::Pixels;
use crate::model::cells::color::median;
use crate::model::cells::footprint::Footprint;

/// The blocks of a cell, row by row.
pub struct Area<'a, B> {
    blocks: Vec<&'a mut B>,
    /// Blocks along the width.
    columns: usize,
    /// Column and row of the first block, counted in blocks of the picture.
    first: (i32, i32),
}

/// What the pixels need to know of a child.
#[derive(Clone, Copy, Debug)]
pub struct Child<'a> {
    /// Where it is.
    pub footprint: &'a Footprint,
    /// Its depth.
    pub z: i32,
    /// Its index in the population, which is that of its victim.
    pub fly: u32,
    /// Cost of each pixel that it covers.
    pub overlap: i32,
}

/// The pixels where a child would show.
#[derive(Debug)]
pub struct Shown {
    targets: Vec<u32>,
    channel: Vec<u8>,
    /// What all else adds to the change of the objective: the child's other pixels, and the errors of what shows now.
    rest: i64,
}

impl Default for Shown {
    fn default() -> Self {
        Self { targets: Vec::with_capacity(4096), channel: Vec::with_capacity(4096), rest: 0 }
    }
}

/// The part of a block that lies inside the box of a footprint.
pub(super) struct Rows {
    pub first: usize,
    pub last: usize,
    /// Tile coordinates of the first pixel of the first row.
    pub u: i32,
    pub v: i32,
}

impl<'a, B: Pixels> Area<'a, B> {
    /// The blocks of a cell whose first block is `first` in the picture.
    pub fn new(blocks: Vec<&'a mut B>, columns: usize, first: (i32, i32)) -> Self {
        Self { blocks, columns, first }
    }

    /// The block and the pixel in it at a place in the picture.
    #[inline(always)]
    pub fn place(&self, x: i32, y: i32) -> (usize, usize) {
        let (column, row) = ((x >> 3) - self.first.0, (y >> 3) - self.first.1);
        (row as usize * self.columns + column as usize, ((y & 7) * 8 + (x & 7)) as usize)
    }

    /// The block with the index that [`Area::place`] returned.
    #[inline(always)]
    pub fn block(&self, place: usize) -> &B {
        self.blocks[place]
    }

    /// Calls `visit` for the rows of each block that the box touches.
    #[inline(always)]
    pub(super) fn visit(&self, footprint: &Footprint, mut visit: impl FnMut(&B, &Rows)) {
        let (first_x, first_y) = (footprint.x0 >> 3, footprint.y0 >> 3);
        for row in first_y..=footprint.y1 >> 3 {
            let top = (row * 8).max(footprint.y0);
            let bottom = (row * 8 + 7).min(footprint.y1);
            let start = (row - self.first.1) as usize * self.columns;
            for column in first_x..=footprint.x1 >> 3 {
                let (u, v) = footprint.coordinates(column * 8, top);
                let block = &*self.blocks[start + (column - self.first.0) as usize];
                let rows = Rows { first: (top & 7) as usize, last: (bottom & 7) as usize, u, v };
                visit(block, &rows);
            }
        }
    }

    /// Whether any pixel in the blocks that the box touches has a full stack.
    pub fn is_full(&self, footprint: &Footprint) -> bool {
        let mut is_full = false;
        self.visit(footprint, |block, _| is_full |= block.full() > 0);
        is_full
    }

    /// Calls `visit` with the block of every pixel that one of two tiles covers, and with what [`Exchanged`] says about
    /// the pixel.
    #[inline(always)]
    pub fn exchange(&mut self, one: &Cover<'_>, other: &Cover<'_>, mut visit: impl FnMut(&mut B, &Exchanged)) {
        self.exchange_rows(one, other, |block, (column, y), rows| {
            let mut bits = rows[0] | rows[1];
            while bits != 0 {
                let lane = bits.trailing_zeros();
                let [was, is] = rows.map(|row| row >> lane & 1 != 0);
                let (pixel, x) = ((y & 7) as usize * SIDE + lane as usize, column * 8 + lane as i32);
                visit(block, &Exchanged { pixel, x, y, was, is });
                bits &= bits - 1;
            }
        });
    }

    /// Calls `visit` for every row of every block that the boxes of two tiles touch. It gets the block's first column
    /// and the row, both in the picture, and as bits which of the eight pixels each of the two tiles covers.
    #[inline(always)]
    pub fn exchange_rows(
        &mut self,
        one: &Cover<'_>,
        other: &Cover<'_>,
        mut visit: impl FnMut(&mut B, (i32, i32), [u32; 2]),
    ) {
        let (a, b) = (one.footprint, other.footprint);
        // Boxes in the same column of blocks count as one, so that no row is visited twice.
        let is_apart = a.x1 >> 3 < b.x0 >> 3 || b.x1 >> 3 < a.x0 >> 3 || a.y1 < b.y0 || b.y1 < a.y0;
        if a.is_empty() || b.is_empty() || is_apart {
            self.exchange_rows_in(a, one, &Cover::NONE, &mut visit);
            self.exchange_rows_in(b, &Cover::NONE, other, &mut visit);
        } else {
            let boxed =
                Footprint { x0: a.x0.min(b.x0), y0: a.y0.min(b.y0), x1: a.x1.max(b.x1), y1: a.y1.max(b.y1), ..*a };
            self.exchange_rows_in(&boxed, one, other, &mut visit);
        }
    }

    #[inline(always)]
    fn exchange_rows_in(
        &mut self,
        boxed: &Footprint,
        one: &Cover<'_>,
        other: &Cover<'_>,
        visit: &mut impl FnMut(&mut B, (i32, i32), [u32; 2]),
    ) {
        if boxed.is_empty() {
            return;
        }
        let columns = (boxed.x0 >> 3)..=(boxed.x1 >> 3);
        for row in boxed.y0 >> 3..=boxed.y1 >> 3 {
            let (top, bottom) = ((row * 8).max(boxed.y0), (row * 8 + 7).min(boxed.y1));
            let start = (row - self.first.1) as usize * self.columns;
            for column in columns.clone() {
                let block = &mut *self.blocks[start + (column - self.first.0) as usize];
                for y in top..=bottom {
                    let target = block.target();
                    let rows = [one.row_bits(target, (column, y)), other.row_bits(target, (column, y))];
                    visit(block, (column, y), rows);
                }
            }
        }
    }
}

/// A pixel that one of two tiles covers.
#[derive(Clone, Copy, Debug)]
pub struct Exchanged {
    /// Its index in its block.
    pub pixel: usize,
    /// Its column in the picture.
    pub x: i32,
    /// Its row in the picture.
    pub y: i32,
    /// Whether the first tile covers it.
    pub was: bool,
    /// Whether the second one does.
    pub is: bool,
}

/// For each pixel of a row: whether the child covers it (all ones), whether it would show there, and the error of what
/// shows without its victim.
#[inline(always)]
pub(super) fn compare(block: &Block, row: usize, (u, v): (i32, i32), child: &Child<'_>) -> (Lanes, Lanes, Lanes) {
    let out = outside(u, v, child.footprint);
    let (top, under) = (row_of(&block.top.fly, row), row_of(&block.under.fly, row));
    let (top_z, under_z) = (row_of(&block.top.z, row), row_of(&block.under.z, row));
    let (top_error, under_error) = (row_of(&block.top.error, row), row_of(&block.under.error, row));
    let (mut covers, mut shows, mut errors) = ([0; SIDE], [0; SIDE], [0; SIDE]);
    // Signs and masks are used, since comparisons would not stay in a vector. All numbers are below 2^31, except
    // `NO_FLY`, which makes no difference: where it stands, the background's depth alone decides.
    for lane in 0..SIDE {
        let apart = (top[lane] ^ child.fly) as i32;
        let is_other = (apart | apart.wrapping_neg()) >> 31;
        let choose = |one: i32, other: i32| (one & is_other) | (other & !is_other);
        let z = choose(top_z[lane], under_z[lane]);
        let fly = choose(top[lane] as i32, under[lane] as i32);
        let is_lower = (child.fly as i32).wrapping_sub(fly) >> 31;
        let is_front = (child.z - z + is_lower) >> 31;
        covers[lane] = !((out[lane] | z) >> 31);
        shows[lane] = is_front & !(out[lane] >> 31);
        errors[lane] = choose(top_error[lane], under_error[lane]);
    }
    (covers, shows, errors)
}

/// The change of the objective when a child of this colour takes its victim's place, without what the victim's removal
/// changes.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+bmi1+bmi2", "aarch64+neon"))]
pub fn change(area: &Area<'_, Block>, child: &Child<'_>, color: u32) -> i64 {
    let mut sums = [0_i32; SIDE];
    let f = *child.footprint;
    area.visit(child.footprint, |block, rows| {
        let (mut u, mut v) = (rows.u, rows.v);
        for row in rows.first..=rows.last {
            let (covers, shows, errors) = compare(block, row, (u, v), child);
            let target = row_of(&block.target, row);
            for lane in 0..SIDE {
                let channel = |shift: u32| ((target[lane] >> shift & 255) as i32 - (color >> shift & 255) as i32).abs();
                let error = channel(0) + channel(8) + channel(16);
                sums[lane] += ((error - errors[lane]) & shows[lane]) + (child.overlap & covers[lane]);
            }
            u = u.wrapping_add(f.sin);
            v = v.wrapping_add(f.cos);
        }
    });
    sums.iter().map(|&sum| i64::from(sum)).sum()
}

impl Shown {
    /// Collects the pixels where a child would show.
    pub fn collect(&mut self, area: &Area<'_, Block>, child: &Child<'_>) {
        collect(self, area, child);
    }

    /// Number of pixels where the child would show.
    pub fn count(&self) -> usize {
        self.targets.len()
    }

    /// The packed colour of the medians of the target's channels.
    pub fn median(&mut self) -> u32 {
        medians(self)
    }

    /// The sums of the target's channels.
    pub fn sums(&self) -> [u32; 3] {
        let mut sums = [0; 3];
        for &target in &self.targets {
            sums.iter_mut().zip(target.to_le_bytes()).for_each(|(sum, channel)| *sum += u32::from(channel));
        }
        sums
    }

    /// As [`change`], for the child that was collected.
    pub fn change(&self, color: u32) -> i64 {
        self.rest + errors(&self.targets, color)
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+bmi1+bmi2", "aarch64+neon"))]
fn collect(shown: &mut Shown, area: &Area<'_, Block>, child: &Child<'_>) {
    let boxed = child.footprint;
    let room = ((boxed.x1 - boxed.x0 + 1) * (boxed.y1 - boxed.y0 + 1)) as usize + SIDE;
    if shown.targets.len() < room {
        shown.targets.resize(room, 0);
    } else {
        shown.targets.truncate(room);
    }
    let targets = &mut shown.targets;
    let mut count = 0;
    let mut sums = [0_i32; SIDE];
    let f = *child.footprint;
    area.visit(child.footprint, |block, rows| {
        let (mut u, mut v) = (rows.u, rows.v);
        for row in rows.first..=rows.last {
            let (covers, shows, errors) = compare(block, row, (u, v), child);
            let target = row_of(&block.target, row);
            let places = &mut targets[count..count + SIDE];
            let mut filled = 0;
            for lane in 0..SIDE {
                sums[lane] += (child.overlap & covers[lane]) - (errors[lane] & shows[lane]);
                places[filled] = target[lane];
                filled += (shows[lane] & 1) as usize;
            }
            count += filled;
            u = u.wrapping_add(f.sin);
            v = v.wrapping_add(f.cos);
        }
    });
    targets.truncate(count);
    shown.rest = sums.iter().map(|&sum| i64::from(sum)).sum();
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+bmi1+bmi2", "aarch64+neon"))]
fn medians(shown: &mut Shown) -> u32 {
    let mut color = 0;
    for shift in [0, 8, 16] {
        shown.channel.clear();
        shown.channel.extend(shown.targets.iter().map(|target| (target >> shift) as u8));
        color |= u32::from(median(&shown.channel)) << shift;
    }
    color
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+bmi1+bmi2", "aarch64+neon"))]
fn errors(targets: &[u32], color: u32) -> i64 {
    let mut sum = 0_i32;
    for &target in targets {
        let channel = |shift: u32| ((target >> shift & 255) as i32 - (color >> shift & 255) as i32).abs();
        sum += channel(0) + channel(8) + channel(16);
    }
    i64::from(sum)
}
