//! What the search stores for 8x8 pixels under translucent tiles: all layers, in rows of eight pixels for vectors to
//! work on.

#![allow(clippy::needless_range_loop, reason = "one index for several arrays of one length makes them vectors")]

use super::block::{PIXELS, Plane, SIDE};
use super::cover::row_of;
use crate::model::NO_FLY;
use crate::model::cells::glaze::opacity_of;
use crate::model::cells::pixel::{BACKGROUND_Z, TRANSLUCENT_DEPTH, TRANSPARENT, UNWANTED_ERROR};
use crate::model::translucency::{CLEAR, channel, kept};

/// One number for each pixel of a row.
pub type Lanes = [u32; SIDE];

/// The n-th nearest tile of each pixel.
#[derive(Clone, Debug)]
struct Layer {
    /// Its depth, or [`BACKGROUND_Z`].
    z: Plane<u32>,
    /// Its fly, or [`NO_FLY`].
    fly: Plane<u32>,
    /// See [`crate::model::cells::glaze::look`].
    look: Plane<u32>,
}

/// One tile on one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Pane {
    /// Its depth, or [`BACKGROUND_Z`].
    pub z: u32,
    /// Its fly, or [`NO_FLY`].
    pub fly: u32,
    /// See [`crate::model::cells::glaze::look`].
    pub look: u32,
}

impl Layer {
    #[inline(always)]
    fn pane(&self, pixel: usize) -> Pane {
        Pane { z: self.z[pixel], fly: self.fly[pixel], look: self.look[pixel] }
    }
}

/// The state of 8x8 pixels under translucent tiles.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct Glazed {
    /// The target, packed, with the flags of `model::cells::pixel`.
    pub target: Plane<u32>,
    /// Factor of all errors; 0 outside the picture.
    pub weight: Plane<u32>,
    /// Error of what shows, times the weight.
    pub error: Plane<u32>,
    /// Pixels whose stacks are full.
    pub full: u32,
    /// Tiles on the pixel.
    pub depth: Plane<u8>,
    layers: [Layer; TRANSLUCENT_DEPTH],
}

/// A child over a row of pixels from which its victim was removed.
#[derive(Clone, Copy, Debug)]
pub struct Guest {
    /// Its index in the population, which is that of its victim.
    pub fly: u32,
    /// Its depth.
    pub z: u32,
    /// Its opacity at each pixel, 0 where it does not cover.
    pub opacity: Lanes,
}

/// A row of pixels, composited except for the guest's colour.
#[derive(Clone, Copy, Debug)]
pub struct Folded {
    /// Sums of the weighted channels of everything else, background included.
    pub sums: [Lanes; 3],
    /// The guest's weight.
    pub weight: Lanes,
    /// Weight of the background.
    pub left: Lanes,
}

/// A row of pixels between two of its layers.
#[derive(Clone, Copy, Debug)]
struct Open {
    left: Lanes,
    sums: [Lanes; 3],
}

impl Open {
    const START: Self = Self { left: [CLEAR; SIDE], sums: [[0; SIDE]; 3] };

    /// Adds the next layer at the pixels where `mask` has all bits set.
    #[inline(always)]
    fn add(&mut self, looks: &Lanes, mask: &Lanes) {
        for lane in 0..SIDE {
            let look = looks[lane];
            let left = kept(self.left[lane], opacity_of(look) & mask[lane]);
            let weight = self.left[lane] - left;
            self.left[lane] = left;
            self.sums[0][lane] += weight * (look & 255);
            self.sums[1][lane] += weight * (look >> 8 & 255);
            self.sums[2][lane] += weight * (look >> 16 & 255);
        }
    }

    /// Adds the background.
    #[inline(always)]
    fn close(&mut self, background: u32) {
        for lane in 0..SIDE {
            self.sums[0][lane] += self.left[lane] * (background & 255);
            self.sums[1][lane] += self.left[lane] * (background >> 8 & 255);
            self.sums[2][lane] += self.left[lane] * (background >> 16 & 255);
        }
    }
}

/// Errors of a row of finished pixels, times their weights; `left` is the weight of the background.
#[inline(always)]
pub fn errors(sums: &[Lanes; 3], left: &Lanes, target: &Lanes, weight: &Lanes) -> Lanes {
    let mut errors = [0; SIDE];
    for lane in 0..SIDE {
        let word = target[lane];
        let lack = |number: usize| (word >> (8 * number) & 255).abs_diff(channel(sums[number][lane]));
        let shown = lack(0) + lack(1) + lack(2);
        let unwanted = if left[lane] < CLEAR { UNWANTED_ERROR as u32 } else { 0 };
        errors[lane] = weight[lane] * if word & TRANSPARENT == 0 { shown } else { unwanted };
    }
    errors
}

impl Glazed {
    /// A block outside the picture.
    pub fn outside() -> Self {
        Self {
            target: [0; PIXELS],
            weight: [0; PIXELS],
            error: [0; PIXELS],
            full: 0,
            depth: [0; PIXELS],
            layers: [const { Layer { z: [BACKGROUND_Z; PIXELS], fly: [NO_FLY; PIXELS], look: [0; PIXELS] } };
                TRANSLUCENT_DEPTH],
        }
    }

    /// The tiles of a pixel, nearest first: fly and look.
    pub fn stack(&self, pixel: usize) -> impl Iterator<Item = (u32, u32)> {
        let depth = usize::from(self.depth[pixel]);
        self.layers[..depth].iter().map(move |layer| (layer.fly[pixel], layer.look[pixel]))
    }

    /// Depth of a pixel's nearest tile, or [`BACKGROUND_Z`].
    #[inline(always)]
    pub fn nearest(&self, pixel: usize) -> u32 {
        self.layers[0].z[pixel]
    }

    /// Sets new depths; their order must be the same as before.
    pub fn renumber(&mut self, depth_of: impl Fn(u32) -> u32) {
        for pixel in 0..PIXELS {
            for layer in &mut self.layers[..usize::from(self.depth[pixel])] {
                layer.z[pixel] = depth_of(layer.fly[pixel]);
            }
        }
    }

    /// Adds a tile to a pixel whose stack is not full.
    pub fn insert(&mut self, pixel: usize, pane: Pane) {
        let mut place = usize::from(self.depth[pixel]);
        self.depth[pixel] += 1;
        self.full += u32::from(place + 1 == TRANSLUCENT_DEPTH);
        while place > 0 {
            let nearer = self.layers[place - 1].pane(pixel);
            if (nearer.z, nearer.fly) < (pane.z, pane.fly) {
                break;
            }
            self.set(place, pixel, nearer);
            place -= 1;
        }
        self.set(place, pixel, pane);
    }

    /// Removes a fly from a pixel, if it is there.
    pub fn remove(&mut self, pixel: usize, fly: u32) {
        let depth = usize::from(self.depth[pixel]);
        let Some(place) = self.layers[..depth].iter().position(|layer| layer.fly[pixel] == fly) else { return };
        for place in place..depth - 1 {
            self.set(place, pixel, self.layers[place + 1].pane(pixel));
        }
        self.set(depth - 1, pixel, Pane { z: BACKGROUND_Z, fly: NO_FLY, look: 0 });
        self.depth[pixel] -= 1;
        self.full -= u32::from(depth == TRANSLUCENT_DEPTH);
    }

    fn set(&mut self, place: usize, pixel: usize, pane: Pane) {
        let layer = &mut self.layers[place];
        (layer.z[pixel], layer.fly[pixel], layer.look[pixel]) = (pane.z, pane.fly, pane.look);
    }

    /// Number of layers on the deepest pixel of a row.
    #[inline(always)]
    fn height(&self, row: usize) -> usize {
        usize::from(row_of(&self.depth, row).iter().copied().fold(0, u8::max))
    }

    /// Composites a row of pixels with a guest instead of its victim.
    #[inline(always)]
    pub fn fold(&self, row: usize, guest: &Guest, background: u32) -> Folded {
        let mut open = Open::START;
        let (mut weight, mut pending) = ([0; SIDE], guest.opacity);
        for layer in &self.layers[..self.height(row)] {
            let (zs, flies, looks) = (row_of(&layer.z, row), row_of(&layer.fly, row), row_of(&layer.look, row));
            let mut mask = [0; SIDE];
            for lane in 0..SIDE {
                let apart = (flies[lane] ^ guest.fly) as i32;
                mask[lane] = ((apart | apart.wrapping_neg()) >> 31) as u32;
                // The guest is in front if it is nearer, or equally near and of a lower index. Where [`NO_FLY`] stands,
                // the background's depth decides.
                let is_lower = (guest.fly as i32).wrapping_sub(flies[lane] as i32) >> 31;
                let is_front = ((guest.z as i32 - zs[lane] as i32 + is_lower) >> 31) as u32;
                let left = kept(open.left[lane], pending[lane] & is_front);
                weight[lane] += open.left[lane] - left;
                open.left[lane] = left;
                pending[lane] &= !is_front;
            }
            open.add(looks, &mask);
        }
        for lane in 0..SIDE {
            let left = kept(open.left[lane], pending[lane]);
            weight[lane] += open.left[lane] - left;
            open.left[lane] = left;
        }
        open.close(background);
        Folded { sums: open.sums, weight, left: open.left }
    }

    /// Computes the errors of a row again.
    #[inline(always)]
    pub fn refresh_errors(&mut self, row: usize, background: u32) {
        let mut open = Open::START;
        for layer in &self.layers[..self.height(row)] {
            open.add(row_of(&layer.look, row), &[u32::MAX; SIDE]);
        }
        open.close(background);
        let errors = errors(&open.sums, &open.left, row_of(&self.target, row), row_of(&self.weight, row));
        self.error[row * SIDE..][..SIDE].copy_from_slice(&errors);
    }

    /// Calls `visit` with the flies of one layer of a row, and by how much the error of each pixel rises without its
    /// fly.
    ///
    /// This is exact. Since every layer rounds, leaving one out starts from the state before it and adds the layers
    /// behind it again.
    #[inline(always)]
    pub fn leave_out_each(&self, row: usize, background: u32, mut visit: impl FnMut(&Lanes, &[i32; SIDE])) {
        let height = self.height(row);
        let (target, weight, now) = (row_of(&self.target, row), row_of(&self.weight, row), row_of(&self.error, row));
        let mut before = Open::START;
        for place in 0..height {
            let mut open = before;
            for layer in &self.layers[place + 1..height] {
                open.add(row_of(&layer.look, row), &[u32::MAX; SIDE]);
            }
            open.close(background);
            let without = errors(&open.sums, &open.left, target, weight);
            let mut rises = [0; SIDE];
            for lane in 0..SIDE {
                rises[lane] = without[lane] as i32 - now[lane] as i32;
            }
            visit(row_of(&self.layers[place].fly, row), &rises);
            before.add(row_of(&self.layers[place].look, row), &[u32::MAX; SIDE]);
        }
    }
}
