//! Twin of `glsl/translucent.comp`: tiles composited by depth in fixed point (`model/translucency.rs`), the marginal
//! fitness of every fly, and the SAE.
//!
//! Exact: leaving out layer k starts from the state before k and composites the layers behind it again, as each layer
//! rounds. [`CHUNK`] layers are left out side by side, so that a layer is read once for all of them.

use multiversion::multiversion;

use super::lane_evaluation::{Block, BlockView, PIXELS, SIDE, error, inside};
use super::rows::{TileRows, TileTexels};
use crate::model::blocks::index_of;
use crate::model::mask::shaded;
use crate::model::tile::{Tile, pack};
use crate::model::translucency::{CLEAR, channel, kept, opacity, widest_after};

/// Pixels that are computed together: two rows of a block.
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
    /// Parts of marginal fitness by list slot; the slot after the last tile takes those of no fly.
    parts: Vec<i32>,
}

/// The layers of a group of pixels, by rank: each pixel has its own nearest, second nearest, ... layer.
#[derive(Default)]
struct Group {
    /// Colour under its shade, coverage in the highest byte; 0 past a pixel's last layer.
    layers: Vec<Lanes>,
    /// The list slots of these layers.
    slots: Vec<Lanes>,
    counts: Lanes,
    transmittance: Lanes,
    /// See [`widest_after`].
    widest: Lanes,
}

/// Recomputes one block from its list.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+bmi1+bmi2", "aarch64+neon"))]
pub(super) fn refresh(view: &BlockView<'_>, block: &mut Block, stack: &mut Stack) {
    block.closed_at = collect(view, stack);
    stack.parts.clear();
    stack.parts.resize(view.list.len() + 1, 0);
    block.parts.error = 0;
    let background = pack(view.lane.scene().background);
    let targets = view.target.as_chunks().0;
    for (number, (group, target)) in stack.groups.iter().zip(targets).enumerate() {
        block.parts.error += leave_out_each(group, target, background, &mut stack.parts);
        let fly = |rank: usize, pixel: usize| {
            let slot = if (rank as u32) < group.counts[pixel] { group.slots[rank][pixel] } else { u32::MAX };
            view.fly(slot)
        };
        for pixel in 0..LANES {
            block.top[number * LANES + pixel] = fly(0, pixel);
            block.under[number * LANES + pixel] = fly(1, pixel);
        }
    }
    block.set_parts(view.list, &stack.parts);
}

/// Collects the layers of every pixel until none shows any more, and returns the depth key of the tile at which that
/// was so.
#[inline(always)]
fn collect(view: &BlockView<'_>, stack: &mut Stack) -> u64 {
    let targets = view.target.as_chunks().0;
    stack.groups.iter_mut().zip(targets).for_each(|(group, target)| group.clear(target));
    for (slot, &key) in (0..).zip(view.list) {
        let tile = &view.lane.tiles()[index_of(key) as usize];
        let mut words = [0; PIXELS];
        let rows = draw(view, tile, &mut words);
        if rows.is_empty() {
            continue;
        }
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

/// Writes what a tile shows in a block: its colour under its shade, and its coverage in the highest byte. Returns the
/// rows that it may have written.
#[inline(always)]
fn draw(view: &BlockView<'_>, tile: &Tile, words: &mut [u32; PIXELS]) -> std::ops::RangeInclusive<usize> {
    let mut rows = TileRows::new(tile, view.origin);
    let range = rows.rows.clone();
    let texels = TileTexels::new(tile, &view.lane.scene().masks.layers()[tile.mask as usize]);
    for row in range.clone() {
        let (u, v) = rows.coordinates();
        let words = &mut words[row * SIDE..(row + 1) * SIDE];
        if tile.mask == 0 {
            for i in 0..SIDE {
                words[i] = if rows.is_covered(u[i], v[i]) { tile.color | 255 << 24 } else { 0 };
            }
        } else if rows.any_covered(&u, &v) {
            let texels = texels.row(&u, &v);
            for i in 0..SIDE {
                let is_there = rows.is_covered(u[i], v[i]) & (texels[i] & 255 != 0);
                words[i] = if is_there { shaded(tile.color, texels[i] >> 8) | texels[i] << 24 } else { 0 };
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
        self.counts = [0; LANES];
        // The overhang of a block at the edge counts nothing: nothing shows there.
        self.transmittance = target.map(|wanted| CLEAR & inside(wanted));
        self.widest = [0; LANES];
    }

    /// Whether no deeper layer shows.
    #[inline(always)]
    fn is_closed(&self) -> bool {
        (0..LANES).fold(0, |open, i| open | self.transmittance[i] | self.widest[i]) == 0
    }

    /// Adds a layer to the pixels that it covers.
    #[inline(always)]
    fn add(&mut self, words: &Lanes, slot: u32) {
        let shows = |i: usize| if self.transmittance[i] | self.widest[i] != 0 { words[i] } else { 0 };
        let words: Lanes = std::array::from_fn(shows);
        if words.iter().fold(0, |any, word| any | word) == 0 {
            return;
        }
        let deepest = self.counts.iter().fold(0, |deepest, &count| deepest.max(count)) as usize;
        if deepest == self.layers.len() {
            self.layers.push([0; LANES]);
            self.slots.push([0; LANES]);
        }
        for i in 0..LANES {
            let opacity = opacity(words[i] >> 24);
            let widest = widest_after(self.widest[i], self.transmittance[i], opacity);
            self.widest[i] = if words[i] != 0 { widest } else { self.widest[i] };
            self.transmittance[i] = kept(self.transmittance[i], opacity);
        }
        for i in 0..LANES {
            // Past the last layer stays 0, and the slot there is never asked for.
            let rank = self.counts[i] as usize;
            self.layers[rank][i] = words[i];
            self.slots[rank][i] = slot;
            self.counts[i] += u32::from(words[i] != 0);
        }
    }
}

/// Compositing of a group of pixels: transmittance and the sum of each channel.
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

    /// The error of each pixel over the background; 0 in the overhang of a block at the edge.
    #[inline(always)]
    fn errors(&self, target: &Lanes, background: u32) -> [i32; LANES] {
        std::array::from_fn(|i| {
            let over =
                |sum: u32, shift: u32| channel(sum + self.transmittance[i] * (background >> shift & 255)) << shift;
            let color = over(self.red[i], 0) | over(self.green[i], 8) | over(self.blue[i], 16);
            error(target[i], color) & inside(target[i]) as i32
        })
    }
}

/// Adds what each layer of the group changes in the error to the parts of its slot, and returns the error.
#[inline(always)]
fn leave_out_each(group: &Group, target: &Lanes, background: u32, parts: &mut [i32]) -> u32 {
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
        for (slots, state) in group.slots[first..].iter().zip(&without) {
            let errors_without = state.errors(target, background);
            for i in 0..LANES {
                parts[slots[i] as usize] += errors_without[i] - errors[i];
            }
        }
    }
    errors.iter().sum::<i32>() as u32
}
