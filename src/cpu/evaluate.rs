//! Twin of `glsl/evaluate.comp`: the two nearest flies of every pixel, the marginal fitness of every fly, and the SAE.
//!
//! Exact by construction: `F(i) = sum over pixels whose top is i of (|t - c2| - |t - c1|)` with the colours c1 of the
//! top and c2 of the under fly (paper Eq. 3, for all flies at once).
//!
//! Unlike the shader, the twin keeps per block the depth at which every pixel had both flies, and leaves a block alone
//! whose changes all lie behind it: on one core a block saved is time saved.

use multiversion::multiversion;
use rayon::prelude::*;

use crate::model::blocks::index_of;
use crate::model::lane::INSIDE;
use crate::model::mask::{COVERAGE_THRESHOLD, Mask, MaskSet, shaded};
use crate::model::tile::{Tile, pack, unpack};
use crate::model::{Evaluation, Fly, Lane, Layers, NO_FLY, Scene};

/// Pixels along each side of a block: one vector of 8 columns a row (`cargo bench --bench full_evaluation`).
const SIDE: usize = 8;
const PIXELS: usize = SIDE * SIDE;
/// From this many stale blocks on, sharing them among threads pays for itself.
const PARALLEL_FROM: usize = 128;
/// After so many tiles it is worth a look whether every pixel has its top and under.
const LOOK_EVERY: u32 = 4;
/// Target pixels of one block, packed, with [`INSIDE`].
type TargetBlock = [u32; PIXELS];

/// What the pixels of one block add up to.
#[derive(Clone, Debug)]
struct Block {
    top: [u32; PIXELS],
    under: [u32; PIXELS],
    /// What the block adds to the marginal fitness of each fly that shows in it.
    parts: Vec<(u32, i32)>,
    /// What the block adds to the SAE.
    error: u32,
    /// Depth key of the tile with which every pixel had its top and under; what lies behind it changes nothing.
    closed_at: u64,
}

impl Default for Block {
    fn default() -> Self {
        Self { top: [NO_FLY; PIXELS], under: [NO_FLY; PIXELS], parts: Vec::new(), error: 0, closed_at: u64::MAX }
    }
}

/// The running evaluation of one lane.
#[derive(Debug)]
pub(super) struct LaneEvaluation {
    lane: Lane,
    target: Vec<TargetBlock>,
    blocks: Vec<Block>,
    marginal: Vec<i64>,
    sae: u64,
    /// Blocks to refresh; empty between calls.
    stale: Vec<u32>,
}

impl LaneEvaluation {
    pub(super) fn new(scene: Scene) -> Self {
        let fly_count = scene.fly_count;
        let lane = Lane::new(scene, SIDE as u32);
        let target = lane.blocked_target().as_chunks().0.to_vec();
        let blocks = vec![Block::default(); lane.lists().block_count()];
        Self { lane, target, blocks, marginal: vec![0; fly_count], sae: 0, stale: Vec::new() }
    }

    pub(super) fn lane(&self) -> &Lane {
        &self.lane
    }

    /// Evaluates a whole population afresh.
    pub(super) fn load(&mut self, flies: &[Fly]) {
        self.lane.load(flies);
        let (lane, target) = (&self.lane, &self.target);
        self.blocks.par_iter_mut().enumerate().with_min_len(PARALLEL_FROM / 2).for_each_init(
            Palette::default,
            |palette, (number, block)| {
                refresh(lane, number, &target[number], block, palette);
            },
        );
        self.marginal.fill(0);
        self.sae = 0;
        for block in &self.blocks {
            add_parts(block, &mut self.marginal, &mut self.sae);
        }
    }

    /// Replaces a fly; the evaluation is stale until [`LaneEvaluation::refresh_touched`].
    pub(super) fn replace(&mut self, index: u32, fly: &Fly) {
        self.lane.replace(index, fly);
    }

    /// Refreshes the touched blocks in which a change can show: takes their old parts off the sums and adds the new ones.
    pub(super) fn refresh_touched(&mut self) {
        let (lane, target) = (&self.lane, &self.target);
        let shows = |number: u32| lane.nearest_change(number as usize) <= self.blocks[number as usize].closed_at;
        self.stale.extend(lane.touched().iter().copied().filter(|&number| shows(number)));
        if self.stale.len() < PARALLEL_FROM {
            let mut palette = Palette::default();
            for &number in &self.stale {
                let block = &mut self.blocks[number as usize];
                subtract_parts(block, &mut self.marginal, &mut self.sae);
                refresh(lane, number as usize, &target[number as usize], block, &mut palette);
                add_parts(block, &mut self.marginal, &mut self.sae);
            }
        } else {
            let refreshed: Vec<Block> = self
                .stale
                .par_iter()
                .with_min_len(PARALLEL_FROM / 2)
                .map_init(Palette::default, |palette, &number| {
                    let mut block = Block::default();
                    refresh(lane, number as usize, &target[number as usize], &mut block, palette);
                    block
                })
                .collect();
            for (&number, new) in self.stale.iter().zip(refreshed) {
                let block = &mut self.blocks[number as usize];
                subtract_parts(block, &mut self.marginal, &mut self.sae);
                *block = new;
                add_parts(block, &mut self.marginal, &mut self.sae);
            }
        }
        self.stale.clear();
        self.lane.clear_touched();
    }

    pub(super) fn evaluation(&self) -> Evaluation<'_> {
        Evaluation { sae: self.sae, marginal: &self.marginal }
    }

    pub(super) fn layers(&self) -> Layers {
        let target = &self.lane.scene().target;
        let (width, height) = (target.width_px() as usize, target.height_px() as usize);
        let columns = self.lane.lists().columns() as usize;
        let row_by_row = |layer: fn(&Block) -> &[u32; PIXELS]| {
            let pixel =
                |(i, j): (usize, usize)| layer(&self.blocks[j / SIDE * columns + i / SIDE])[j % SIDE * SIDE + i % SIDE];
            (0..height).flat_map(|j| (0..width).map(move |i| (i, j))).map(pixel).collect()
        };
        Layers { top: row_by_row(|block| &block.top), under: row_by_row(|block| &block.under) }
    }
}

fn add_parts(block: &Block, marginal: &mut [i64], sae: &mut u64) {
    *sae += u64::from(block.error);
    for &(fly, part) in &block.parts {
        marginal[fly as usize] += i64::from(part);
    }
}

fn subtract_parts(block: &Block, marginal: &mut [i64], sae: &mut u64) {
    *sae -= u64::from(block.error);
    for &(fly, part) in &block.parts {
        marginal[fly as usize] -= i64::from(part);
    }
}

/// Buffers that a thread uses again for each block: per list slot the colour, and the part of marginal fitness. The
/// slot after the last tile is the background.
#[derive(Default)]
struct Palette {
    colors: Vec<u32>,
    parts: Vec<i32>,
}

/// Recomputes one block from its list.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+bmi1+bmi2", "aarch64+neon"))]
fn refresh(lane: &Lane, number: usize, target: &TargetBlock, block: &mut Block, palette: &mut Palette) {
    let list = lane.lists().list(number);
    let scan = scan_list(lane, number, target, palette);
    block.closed_at = scan.closed_at;
    add_up(lane, number, target, &scan, block, palette);
    block.parts.clear();
    for (&key, &part) in list.iter().zip(&palette.parts) {
        if part != 0 {
            block.parts.push((index_of(key), part));
        }
    }
    let fly = |slot: u32| list.get(slot as usize).map_or(NO_FLY, |&key| index_of(key));
    block.top = scan.top.map(fly);
    block.under = scan.under.map(fly);
}

/// Finds the top and under slots of a block's pixels, and fills the palette's colours.
#[inline(always)]
fn scan_list(lane: &Lane, number: usize, target: &TargetBlock, palette: &mut Palette) -> Scan {
    let list = lane.lists().list(number);
    let (x, y) = lane.lists().origin(number);
    let mut scan = Scan::new((x as i32, y as i32), list.len() as u32, target);
    palette.colors.clear();
    for (slot, &key) in (0..).zip(list) {
        let tile = &lane.tiles()[index_of(key) as usize];
        palette.colors.push(tile.color);
        if tile.mask == 0 {
            scan.add_square(tile, slot);
        } else {
            scan.add_masked(tile, &lane.scene().masks.layers()[tile.mask as usize], slot);
        }
        if slot % LOOK_EVERY == LOOK_EVERY - 1 && scan.is_closed() {
            scan.closed_at = key;
            break;
        }
    }
    // Of the slots that nobody looked at only the background's is ever asked for.
    palette.colors.resize(list.len(), 0);
    palette.colors.push(pack(lane.scene().background));
    palette.parts.clear();
    palette.parts.resize(palette.colors.len(), 0);
    scan
}

/// Adds up the errors of a block, and per slot the parts of marginal fitness.
#[inline(always)]
fn add_up(lane: &Lane, number: usize, target: &TargetBlock, scan: &Scan, block: &mut Block, palette: &mut Palette) {
    let list = lane.lists().list(number);
    block.error = 0;
    for (pixel, &wanted) in target.iter().enumerate() {
        let is_inside = wanted & INSIDE != 0;
        let (slot, next) = (scan.top[pixel], scan.under[pixel]);
        let (mut c1, mut c2) = (palette.colors[slot as usize], palette.colors[next as usize]);
        if scan.any_mask && is_inside {
            let at = scan.pixel(pixel);
            c1 = shaded_color(lane, list, slot, at, c1);
            c2 = shaded_color(lane, list, next, at, c2);
        }
        let (e1, e2) = (error(wanted, c1), error(wanted, c2));
        block.error += if is_inside { e1 as u32 } else { 0 };
        palette.parts[slot as usize] += if is_inside { e2 - e1 } else { 0 };
    }
}

/// The two nearest tiles of a block's pixels, as slots of its list. Slots rise with depth, so the smallest two that cover
/// a pixel are its top and under.
struct Scan {
    origin: (i32, i32),
    /// The slot of the background, after the last tile.
    background: u32,
    top: [u32; PIXELS],
    under: [u32; PIXELS],
    any_mask: bool,
    closed_at: u64,
}

impl Scan {
    #[inline(always)]
    fn new(origin: (i32, i32), background: u32, target: &TargetBlock) -> Self {
        // The overhang of a block at the edge counts nothing, and must not keep the block open.
        let slots = target.map(|pixel| if pixel & INSIDE != 0 { background } else { 0 });
        Self { origin, background, top: slots, under: slots, any_mask: false, closed_at: u64::MAX }
    }

    /// Picture coordinates of a pixel of the block.
    #[inline(always)]
    fn pixel(&self, number: usize) -> (i32, i32) {
        (self.origin.0 + (number % SIDE) as i32, self.origin.1 + (number / SIDE) as i32)
    }

    /// Whether every pixel has its top and under.
    #[inline(always)]
    fn is_closed(&self) -> bool {
        self.under.iter().all(|&under| under != self.background)
    }

    /// Adds a tile without holes; there are no branches, so a row of 8 pixels is one vector.
    #[inline(always)]
    fn add_square(&mut self, tile: &Tile, slot: u32) {
        // A local, since the compiler cannot see that the rows never overlap the field.
        let (none, (x, y)) = (self.background, self.origin);
        let (first, last) = ((tile.y0 - y).max(0), (tile.y1 - y).min(SIDE as i32 - 1));
        let (u_end, v_end) = (tile.u_end(), tile.v_end());
        let (mut u, mut v) = tile.coordinates(x, y + first);
        let u_steps: [u32; SIDE] = std::array::from_fn(|i| tile.cos.wrapping_mul(i as i32) as u32);
        let v_steps: [u32; SIDE] = std::array::from_fn(|i| tile.sin.wrapping_mul(i as i32) as u32);
        for row in first..=last {
            let start = row as usize * SIDE;
            let (top, under) = (&mut self.top[start..start + SIDE], &mut self.under[start..start + SIDE]);
            for i in 0..SIDE {
                let covered = (u.wrapping_add(u_steps[i]) < u_end) & (v.wrapping_sub(v_steps[i]) < v_end);
                let candidate = if covered { slot } else { none };
                under[i] = under[i].min(top[i].max(candidate));
                top[i] = top[i].min(candidate);
            }
            u = u.wrapping_add(tile.sin as u32);
            v = v.wrapping_add(tile.cos as u32);
        }
    }

    /// Adds a tile with a mask, pixel by pixel.
    #[inline(always)]
    fn add_masked(&mut self, tile: &Tile, mask: &Mask, slot: u32) {
        self.any_mask = true;
        for number in 0..PIXELS {
            let (i, j) = self.pixel(number);
            let (u, v) = tile.coordinates(i, j);
            if u < tile.u_end() && v < tile.v_end() {
                let (column, row) = tile.texel(u, v);
                let is_solid = mask.texel(column, row).coverage >= COVERAGE_THRESHOLD;
                let candidate = if is_solid { slot } else { self.background };
                self.under[number] = self.under[number].min(self.top[number].max(candidate));
                self.top[number] = self.top[number].min(candidate);
            }
        }
    }
}

/// The colour that the tile in `slot` shows at pixel `(i, j)`: `plain`, or `plain` under its mask's shade.
fn shaded_color(lane: &Lane, list: &[u64], slot: u32, (i, j): (i32, i32), plain: u32) -> u32 {
    let Some(&key) = list.get(slot as usize) else { return plain };
    tile_color(&lane.tiles()[index_of(key) as usize], &lane.scene().masks, i, j, plain)
}

/// The colour of a tile at pixel `(i, j)`, which it covers.
pub(super) fn tile_color(tile: &Tile, masks: &MaskSet, i: i32, j: i32, plain: u32) -> u32 {
    if tile.mask == 0 {
        return plain;
    }
    let (u, v) = tile.coordinates(i, j);
    let (column, row) = tile.texel(u, v);
    pack(shaded(unpack(plain), masks.layers()[tile.mask as usize].texel(column, row).shade))
}

/// Sum of absolute differences of the three channels.
#[inline(always)]
fn error(a: u32, b: u32) -> i32 {
    let channel = |shift: u32| ((a >> shift & 255) as i32 - (b >> shift & 255) as i32).abs();
    channel(0) + channel(8) + channel(16)
}
