//! Twin of `glsl/translucent.comp`: tiles composited by depth in fixed point (`model/translucency.rs`), the marginal
//! fitness of every fly, and the SAE.
//!
//! This is exact. Since every layer rounds, leaving out layer k starts from the state before k and composites the
//! layers behind it again. [`CHUNK`] layers are left out side by side, so that each layer is read once for all of them.

#![allow(clippy::needless_range_loop, reason = "one index for several arrays of one length makes them vectors")]

use multiversion::multiversion;

use super::block::{Block, BlockView, PIXELS, SIDE, inside};
use super::coverage::{TileRows, texels};
use super::error::error;
use crate::model::blocks::index_of;
use crate::model::mask::shaded;
use crate::model::tile::{Tile, pack};
use crate::model::translucency::{CLEAR, channel, kept, opacity, widest_after};

/// Number of pixels that are computed together: two rows of a block.
const LANES: usize = 16;
const GROUPS: usize = PIXELS / LANES;
/// Layers that are left out side by side.
const CHUNK: usize = 4;

/// One number for each pixel of a group.
type Lanes = [u32; LANES];

/// The layers of a block's pixels.
#[derive(Default)]
pub(super) struct Stack {
    groups: [Group; GROUPS],
    /// Parts of marginal fitness by list slot.
    parts: Vec<i32>,
}

/// The layers of a group of pixels, in rows. Down the rows, each pixel meets its layers from the nearest on. A tile
/// lies in a single row, the first one below all earlier layers of its pixels, so that vectors can add it and sum it
/// up.
#[derive(Default)]
struct Group {
    /// Colour under its shade, coverage in the highest byte; 0 where a pixel has no layer.
    layers: Vec<Lanes>,
    /// The list slots of these layers.
    slots: Vec<Lanes>,
    /// Row and slot of each tile.
    tiles: Vec<(u32, u32)>,
    /// By how much leaving out each layer changes the error.
    changes: Vec<Lanes>,
    /// Row after each pixel's last layer.
    ends: Lanes,
    transmittance: Lanes,
    /// See [`widest_after`].
    widest: Lanes,
    /// Slot of each pixel's nearest layer and of the next one, or [`NO_SLOT`].
    top: Lanes,
    under: Lanes,
}

/// No slot of any list.
const NO_SLOT: u32 = u32::MAX;

/// Recomputes one block from its list.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+bmi1+bmi2", "aarch64+neon"))]
pub(super) fn refresh(view: &BlockView<'_>, block: &mut Block, stack: &mut Stack) {
    block.closed_at = collect(view, stack);
    stack.parts.clear();
    stack.parts.resize(view.list.len(), 0);
    let mut error = 0;
    let background = pack(view.lane.scene().background);
    let targets = view.target.as_chunks().0;
    for (number, (group, target)) in stack.groups.iter_mut().zip(targets).enumerate() {
        error += leave_out_each(group, target, background);
        group.add_up(&mut stack.parts);
        for pixel in 0..LANES {
            block.top[number * LANES + pixel] = view.fly(group.top[pixel]);
            block.under[number * LANES + pixel] = view.fly(group.under[pixel]);
        }
    }
    block.parts.set(view.flies(), &stack.parts, error);
}

/// Collects the layers of every pixel until no deeper layer shows, and returns the depth key of the tile where that
/// happened.
#[inline(always)]
fn collect(view: &BlockView<'_>, stack: &mut Stack) -> u64 {
    let targets = view.target.as_chunks().0;
    stack.groups.iter_mut().zip(targets).for_each(|(group, target)| group.clear(target));
    for (slot, &key) in (0..).zip(view.list) {
        let tile = &view.lane.tiles()[index_of(key) as usize];
        if !tile.may_cover(view.origin, SIDE as i32) {
            continue;
        }
        let mut words = [0; PIXELS];
        let rows = draw(view, tile, &mut words);
        let words = words.as_chunks().0;
        for number in rows.start() * SIDE / LANES..=rows.end() * SIDE / LANES {
            stack.groups[number].add(&words[number], slot);
        }
        if stack.groups.iter().all(Group::is_closed) {
            return key;
        }
    }
    u64::MAX
}

/// Writes what a tile shows in a block: its shaded colour, with its coverage in the highest byte. Returns the rows that
/// it may have written.
#[inline(always)]
fn draw(view: &BlockView<'_>, tile: &Tile, words: &mut [u32; PIXELS]) -> std::ops::RangeInclusive<usize> {
    let mut rows = TileRows::new(tile, view.origin);
    let range = rows.rows.clone();
    // A local copy, so that it is not loaded again for each pixel.
    let color = tile.color;
    let mask = &view.lane.scene().masks.layers()[tile.mask as usize];
    for row in range.clone() {
        let (u, v) = rows.coordinates();
        let words = &mut words[row * SIDE..(row + 1) * SIDE];
        if tile.mask == 0 {
            for i in 0..SIDE {
                words[i] = if rows.is_covered(u[i], v[i]) { color | 255 << 24 } else { 0 };
            }
        } else if rows.any_covered(&u, &v) {
            let texels = texels(tile, mask, &u, &v);
            for i in 0..SIDE {
                let is_there = rows.is_covered(u[i], v[i]) & (texels[i] & 255 != 0);
                words[i] = if is_there { shaded(color, texels[i] >> 8) | texels[i] << 24 } else { 0 };
            }
        }
        rows.step();
    }
    range
}

impl Group {
    #[inline(always)]
    fn clear(&mut self, target: &Lanes) {
        self.layers.clear();
        self.slots.clear();
        self.tiles.clear();
        self.changes.clear();
        self.ends = [0; LANES];
        self.widest = [0; LANES];
        self.top = [NO_SLOT; LANES];
        self.under = [NO_SLOT; LANES];
        for i in 0..LANES {
            // Pixels beyond the picture do not count: nothing shows there.
            self.transmittance[i] = CLEAR & inside(target[i]);
        }
    }

    /// Whether no deeper layer shows.
    #[inline(always)]
    fn is_closed(&self) -> bool {
        (0..LANES).fold(0, |open, i| open | self.transmittance[i] | self.widest[i]) == 0
    }

    /// Adds a layer to the pixels that it covers and where it may show.
    #[inline(always)]
    fn add(&mut self, words: &Lanes, slot: u32) {
        let (mut layer, mut any, mut row) = ([0; LANES], 0, 0);
        for i in 0..LANES {
            layer[i] = if self.transmittance[i] | self.widest[i] != 0 { words[i] } else { 0 };
            any |= layer[i];
            row = row.max(if layer[i] != 0 { self.ends[i] } else { 0 });
        }
        if any == 0 {
            return;
        }
        if row as usize == self.layers.len() {
            self.layers.push([0; LANES]);
            self.slots.push([NO_SLOT; LANES]);
        }
        self.tiles.push((row, slot));
        let (layers, slots) = (&mut self.layers[row as usize], &mut self.slots[row as usize]);
        for i in 0..LANES {
            let covers = layer[i] != 0;
            let opacity = opacity(layer[i] >> 24);
            let widest = widest_after(self.widest[i], self.transmittance[i], opacity);
            self.widest[i] = if covers { widest } else { self.widest[i] };
            self.transmittance[i] = kept(self.transmittance[i], opacity);
            layers[i] = if covers { layer[i] } else { layers[i] };
            slots[i] = if covers { slot } else { slots[i] };
            self.ends[i] = if covers { row + 1 } else { self.ends[i] };
            // Slots rise with depth: the smallest two are the nearest.
            let candidate = if covers { slot } else { NO_SLOT };
            self.under[i] = self.under[i].min(self.top[i].max(candidate));
            self.top[i] = self.top[i].min(candidate);
        }
    }

    /// Adds the changes at the pixels of each tile to the part of its slot.
    #[inline(always)]
    fn add_up(&self, parts: &mut [i32]) {
        for &(row, slot) in &self.tiles {
            let (slots, changes) = (&self.slots[row as usize], &self.changes[row as usize]);
            let mut sum = 0_u32;
            for i in 0..LANES {
                sum = sum.wrapping_add(if slots[i] == slot { changes[i] } else { 0 });
            }
            parts[slot as usize] += sum as i32;
        }
    }
}

/// A group of pixels between two layers: the transmittance and the sum of each channel.
#[derive(Clone, Copy)]
struct State {
    transmittance: Lanes,
    red: Lanes,
    green: Lanes,
    blue: Lanes,
}

impl State {
    const START: Self = Self { transmittance: [CLEAR; LANES], red: [0; LANES], green: [0; LANES], blue: [0; LANES] };

    /// Adds a layer.
    #[inline(always)]
    fn add(&mut self, layer: &Lanes) {
        for i in 0..LANES {
            let left = kept(self.transmittance[i], opacity(layer[i] >> 24));
            let weight = self.transmittance[i] - left;
            self.red[i] += weight * (layer[i] & 255);
            self.green[i] += weight * (layer[i] >> 8 & 255);
            self.blue[i] += weight * (layer[i] >> 16 & 255);
            self.transmittance[i] = left;
        }
    }

    /// The error of each pixel over the background; 0 beyond the picture.
    #[inline(always)]
    fn errors(&self, target: &Lanes, background: u32) -> Lanes {
        let mut errors = [0; LANES];
        for i in 0..LANES {
            let weight = self.transmittance[i];
            let over = |sum: u32, shift: u32| channel(sum + weight * (background >> shift & 255)) << shift;
            let color = over(self.red[i], 0) | over(self.green[i], 8) | over(self.blue[i], 16);
            errors[i] = error(target[i], color) as u32 & inside(target[i]);
        }
        errors
    }
}

/// Computes by how much leaving out each layer of the group changes the error, and returns the error.
#[inline(always)]
fn leave_out_each(group: &mut Group, target: &Lanes, background: u32) -> u32 {
    let mut whole = State::START;
    group.layers.iter().for_each(|layer| whole.add(layer));
    let errors = whole.errors(target, background);

    let mut before = State::START;
    for first in (0..group.layers.len()).step_by(CHUNK) {
        let (chunk, behind) = group.layers[first..].split_at(CHUNK.min(group.layers.len() - first));
        let mut without = [before; CHUNK];
        for (own, layer) in chunk.iter().enumerate() {
            before.add(layer);
            for (left_out, state) in without.iter_mut().enumerate() {
                if left_out != own {
                    state.add(layer);
                }
            }
        }
        for layer in behind {
            without.iter_mut().for_each(|state| state.add(layer));
        }
        for state in &without[..chunk.len()] {
            let mut changes = state.errors(target, background);
            for i in 0..LANES {
                changes[i] = changes[i].wrapping_sub(errors[i]);
            }
            group.changes.push(changes);
        }
    }
    errors.iter().sum()
}
