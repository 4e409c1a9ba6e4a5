//! Twin of `glsl/evaluate.comp`: the two nearest flies of every pixel, the marginal fitness of every fly, and the SAE.
//!
//! It is exact: `F(i) = sum over pixels whose top is i of (|t - c2| - |t - c1|)` with the colours c1 of the top and c2
//! of the under fly (paper Eq. 3, for all flies at once).

use multiversion::multiversion;

use super::block::{Block, BlockView, PIXELS, SIDE, TargetBlock, inside};
use super::coverage::{TileRows, texels};
use super::error::error;
use crate::model::blocks::index_of;
use crate::model::mask::{COVERAGE_THRESHOLD, Mask, shaded};
use crate::model::tile::{Tile, pack};

/// The number of tiles after which it pays to check whether every pixel has its top and under.
const LOOK_EVERY: u32 = 4;
/// The shade that leaves a colour as it is.
const BRIGHT: u32 = 255;

/// Buffers for one block: for each slot of its list the colour, and the part of marginal fitness. The slot after the
/// last tile is the background's.
#[derive(Default)]
pub(super) struct Palette {
    colors: Vec<u32>,
    parts: Vec<i32>,
}

/// Recomputes one block from its list.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+bmi1+bmi2", "aarch64+neon"))]
pub(super) fn refresh(view: &BlockView<'_>, block: &mut Block, palette: &mut Palette) {
    palette.colors.clear();
    let has_masks = view.lane.scene().masks.layers().len() > 1;
    let mut scan = Scan::new(view, if has_masks { 8 } else { 0 });
    block.closed_at = scan.scan_list(view, palette);
    // Of the slots that the scan does not reach, only the background's is ever read.
    palette.colors.resize(view.list.len(), 0);
    palette.colors.push(pack(view.lane.scene().background));
    palette.parts.clear();
    palette.parts.resize(palette.colors.len(), 0);
    let plain = |key: u32, palette: &Palette| palette.colors[key as usize];
    let under_shade = |key: u32, palette: &Palette| shaded(palette.colors[(key >> 8) as usize], key & 255);
    let error = if has_masks { add_up(view, &scan, palette, under_shade) } else { add_up(view, &scan, palette, plain) };
    block.parts.set(view.flies(), &palette.parts, error);
    block.top = scan.top.map(|key| view.fly(scan.slot(key)));
    block.under = scan.under.map(|key| view.fly(scan.slot(key)));
}

/// Adds up the errors of a block, and the parts of marginal fitness for each slot.
#[inline(always)]
fn add_up(view: &BlockView<'_>, scan: &Scan, palette: &mut Palette, color: impl Fn(u32, &Palette) -> u32) -> u32 {
    let (mut tops, mut unders) = ([0; PIXELS], [0; PIXELS]);
    for pixel in 0..PIXELS {
        tops[pixel] = color(scan.top[pixel], palette);
        unders[pixel] = color(scan.under[pixel], palette);
    }
    let mut sum = 0;
    for (pixel, &wanted) in view.target.iter().enumerate() {
        let (e1, e2) = (error(wanted, tops[pixel]), error(wanted, unders[pixel]));
        let inside = inside(wanted);
        sum += e1 as u32 & inside;
        palette.parts[scan.slot(scan.top[pixel]) as usize] += (e2 - e1) & inside as i32;
    }
    sum
}

/// The two nearest tiles of each pixel of a block, as keys. A key is a slot of the block's list, or `slot << 8 | shade`
/// with masks. Slots rise with depth, so the two smallest keys that cover a pixel are its top and under.
struct Scan {
    origin: (i32, i32),
    /// The key of the background, whose slot comes after the last tile: no tile has a larger key.
    background: u32,
    shade_bits: u32,
    top: [u32; PIXELS],
    under: [u32; PIXELS],
}

impl Scan {
    #[inline(always)]
    fn new(view: &BlockView<'_>, shade_bits: u32) -> Self {
        let background = square_key(view.list.len() as u32, shade_bits);
        // Pixels beyond the picture do not count, and must not keep the block open.
        let keys: TargetBlock = view.target.map(|pixel| background & inside(pixel));
        Self { origin: view.origin, background, shade_bits, top: keys, under: keys }
    }

    #[inline(always)]
    fn slot(&self, key: u32) -> u32 {
        key >> self.shade_bits
    }

    /// Finds the top and under of every pixel and fills in the palette's colours. Returns the depth key of the tile
    /// after which every pixel had both.
    #[inline(always)]
    fn scan_list(&mut self, view: &BlockView<'_>, palette: &mut Palette) -> u64 {
        for (slot, &key) in (0..).zip(view.list) {
            let tile = &view.lane.tiles()[index_of(key) as usize];
            palette.colors.push(tile.color);
            if tile.mask == 0 {
                self.add_square(tile, slot);
            } else {
                self.add_masked(tile, &view.lane.scene().masks.layers()[tile.mask as usize], slot);
            }
            if slot % LOOK_EVERY == LOOK_EVERY - 1 && self.is_closed() {
                return key;
            }
        }
        u64::MAX
    }

    /// Whether every pixel has its top and under.
    #[inline(always)]
    fn is_closed(&self) -> bool {
        self.under.iter().all(|&under| under != self.background)
    }

    /// Adds a tile without holes.
    #[inline(always)]
    fn add_square(&mut self, tile: &Tile, slot: u32) {
        // A local copy, since the compiler cannot see that the rows never overlap the field.
        let (none, key) = (self.background, square_key(slot, self.shade_bits));
        let mut rows = TileRows::new(tile, self.origin);
        for row in rows.rows.clone() {
            let (u, v) = rows.coordinates();
            let (top, under) = self.row(row);
            for i in 0..SIDE {
                let candidate = if rows.is_covered(u[i], v[i]) { key } else { none };
                under[i] = under[i].min(top[i].max(candidate));
                top[i] = top[i].min(candidate);
            }
            rows.step();
        }
    }

    /// Adds a tile with a mask.
    #[inline(always)]
    fn add_masked(&mut self, tile: &Tile, mask: &Mask, slot: u32) {
        let none = self.background;
        let mut rows = TileRows::new(tile, self.origin);
        for row in rows.rows.clone() {
            let (u, v) = rows.coordinates();
            if rows.any_covered(&u, &v) {
                let texels = texels(tile, mask, &u, &v);
                let (top, under) = self.row(row);
                for i in 0..SIDE {
                    let is_solid = rows.is_covered(u[i], v[i]) & (texels[i] & 255 >= u32::from(COVERAGE_THRESHOLD));
                    let candidate = if is_solid { slot << 8 | texels[i] >> 8 } else { none };
                    under[i] = under[i].min(top[i].max(candidate));
                    top[i] = top[i].min(candidate);
                }
            }
            rows.step();
        }
    }

    /// Top and under of a row of the block.
    #[inline(always)]
    fn row(&mut self, row: usize) -> (&mut [u32], &mut [u32]) {
        let start = row * SIDE;
        (&mut self.top[start..start + SIDE], &mut self.under[start..start + SIDE])
    }
}

/// The key of a slot whose tile is at full brightness.
#[inline(always)]
fn square_key(slot: u32, shade_bits: u32) -> u32 {
    slot << shade_bits | BRIGHT & ((1 << shade_bits) - 1)
}
