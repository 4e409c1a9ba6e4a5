//! A translucent child over its own pixels and those of its victim: its best colour, and the change that it makes.

#![allow(clippy::needless_range_loop, reason = "one index for several arrays of one length makes them vectors")]

use multiversion::multiversion;

use super::area::Area;
use super::block::SIDE;
use super::cover::{Cover, row_of};
use super::glazed::{Folded, Glazed, Guest, Lanes, errors};
use super::ground::Swap;
use crate::model::cells::glaze::{Fit, lack_q6, share_q8};
use crate::model::cells::pixel::TRANSPARENT;
use crate::model::mask::shaded;
use crate::model::translucency::opacity;

/// The rows of pixels that change when a child takes its victim's place.
#[derive(Debug, Default)]
pub struct Laid {
    rows: Vec<Row>,
    /// Their error before the change.
    before: i64,
    fit: Fit,
}

/// A row of pixels, composited except for the child's colour.
#[derive(Clone, Copy, Debug)]
struct Row {
    folded: Folded,
    /// Shade of the child's colour.
    shade: Lanes,
    target: Lanes,
    weight: Lanes,
}

impl Laid {
    /// Composites the pixels of a child and of its victim.
    pub fn collect(&mut self, area: &mut Area<'_, Glazed>, swap: &Swap<'_>, background: u32) {
        collect(self, area, swap, background);
    }

    /// The child's colour of least squares, packed; `None` if it shows nowhere.
    pub fn color(&self) -> Option<u32> {
        self.fit.color()
    }

    /// The change of the error with a child of this colour.
    pub fn change(&self, color: u32) -> i64 {
        change(self, color)
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+bmi1+bmi2", "aarch64+neon"))]
fn collect(laid: &mut Laid, area: &mut Area<'_, Glazed>, swap: &Swap<'_>, background: u32) {
    laid.rows.clear();
    laid.before = 0;
    laid.fit = Fit::default();
    let covers = [swap.old, swap.new].map(|piece| Cover { footprint: piece.footprint, suit: None });
    let mut guest = Guest { fly: swap.index, z: swap.new.fly.z, opacity: [0; SIDE] };
    area.exchange_rows(&covers[0], &covers[1], |block, (column, y), [was, is]| {
        if was | is == 0 {
            return;
        }
        let row = (y & 7) as usize;
        let shade;
        (guest.opacity, shade) = worn(swap, (column * 8, y), is);
        let folded = block.fold(row, &guest, background);
        let (target, weight) = (*row_of(&block.target, row), *row_of(&block.weight, row));
        laid.before += i64::from(row_of(&block.error, row).iter().sum::<u32>());
        let row = Row { folded, shade, target, weight };
        if is != 0 {
            fit(&mut laid.fit, &row);
        }
        laid.rows.push(row);
    });
}

/// Opacity and shade of the new tile at eight pixels from `(x, y)` on; `bits` says which of them its rectangle covers.
#[inline(always)]
fn worn(swap: &Swap<'_>, (x, y): (i32, i32), bits: u32) -> (Lanes, Lanes) {
    let (mut opacities, mut shades) = ([0; SIDE], [0; SIDE]);
    let Some(suit) = swap.new.suit.filter(|_| bits != 0) else { return (opacities, shades) };
    let footprint = swap.new.footprint;
    let (u, v) = footprint.coordinates(x, y);
    for lane in 0..SIDE {
        let texel = suit.texel_at(footprint, (u, v), lane as i32);
        let mask = 0_u32.wrapping_sub(bits >> lane & 1);
        opacities[lane] = opacity(u32::from(texel.coverage)) & mask;
        shades[lane] = u32::from(texel.shade);
    }
    (opacities, shades)
}

/// Adds what a row of pixels contributes to the best colour.
#[inline(always)]
fn fit(fit: &mut Fit, row: &Row) {
    let (mut lacks, mut squares) = ([0_i32; 3], 0_i32);
    for lane in 0..SIDE {
        let wanted = if row.target[lane] & TRANSPARENT == 0 { row.weight[lane] as i32 } else { 0 };
        let share = share_q8(row.folded.weight[lane], row.shade[lane]);
        squares += share * share * wanted;
        for channel in 0..3 {
            let target = row.target[lane] >> (8 * channel) & 255;
            lacks[channel] += share * wanted * lack_q6(target, row.folded.sums[channel][lane]);
        }
    }
    fit.squares += i64::from(squares);
    fit.lacks.iter_mut().zip(lacks).for_each(|(sum, lack)| *sum += i64::from(lack));
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+bmi1+bmi2", "aarch64+neon"))]
fn change(laid: &Laid, color: u32) -> i64 {
    let mut after = 0_i64;
    for row in &laid.rows {
        let mut sums = row.folded.sums;
        for lane in 0..SIDE {
            let (weight, shown) = (row.folded.weight[lane], shaded(color, row.shade[lane]));
            sums[0][lane] += weight * (shown & 255);
            sums[1][lane] += weight * (shown >> 8 & 255);
            sums[2][lane] += weight * (shown >> 16 & 255);
        }
        after += i64::from(errors(&sums, &row.folded.left, &row.target, &row.weight).iter().sum::<u32>());
    }
    after - laid.before
}
