//! Twin of `glsl/mosaic.vert` and `glsl/mosaic.frag`: draws a population at any size, painting from the farthest tile
//! to the nearest by the exact coverage rule.

use rayon::prelude::*;

use super::evaluate::tile_color;
use crate::model::blocks::{BlockLists, index_of};
use crate::model::mask::COVERAGE_THRESHOLD;
use crate::model::tile::{Tile, pack};
use crate::model::{Canvas, MaskSet, Mosaic, Patch, Population};

/// Samples along each side of a patch, before it is cut to whole pixels: 256 KiB of colours stay in a core's cache.
const PATCH_SIDE: u32 = 256;

/// Draws `population` on `canvas`, each pixel the mean of `supersampling`² samples.
pub(super) fn draw(population: &Population, canvas: &Canvas, supersampling: u32) -> Mosaic {
    let samples = canvas.supersampled(supersampling);
    let side = PATCH_SIDE / supersampling * supersampling;
    let tiles: Vec<Tile> = population.flies.iter().map(|fly| Tile::bake(fly, &samples)).collect();
    let mut lists = BlockLists::new(&samples, side);
    lists.fill(&population.flies, &tiles);
    let mut mosaic = Mosaic::new(canvas);
    // A row of patches at a time, so that memory does not grow with the number of samples.
    for first in (0..lists.block_count()).step_by(lists.columns() as usize) {
        let drawn: Vec<(Patch, Vec<u32>)> = (first..first + lists.columns() as usize)
            .into_par_iter()
            .map(|number| {
                let patch = patch_at(&lists, number, side, &samples);
                let colors = draw_patch(population, &tiles, lists.list(number), &patch);
                (patch, colors)
            })
            .collect();
        for (patch, colors) in drawn {
            mosaic.absorb(&patch, &colors, supersampling);
        }
    }
    mosaic
}

/// The part of the canvas that block `number` covers.
fn patch_at(lists: &BlockLists, number: usize, side: u32, canvas: &Canvas) -> Patch {
    let (x, y) = lists.origin(number);
    Patch { x, y, width_px: side.min(canvas.width_px - x), height_px: side.min(canvas.height_px - y) }
}

/// Packed colours of a patch, row by row.
fn draw_patch(population: &Population, tiles: &[Tile], list: &[u64], patch: &Patch) -> Vec<u32> {
    let mut colors = vec![pack(population.background); (patch.width_px * patch.height_px) as usize];
    for &key in list.iter().rev() {
        paint(&tiles[index_of(key) as usize], &population.masks, patch, &mut colors);
    }
    colors
}

/// Paints one tile over what is there.
fn paint(tile: &Tile, masks: &MaskSet, patch: &Patch, colors: &mut [u32]) {
    let (left, top) = (patch.x as i32, patch.y as i32);
    let columns = tile.x0.max(left)..tile.x1.min(left + patch.width_px as i32 - 1) + 1;
    for j in tile.y0.max(top)..=tile.y1.min(top + patch.height_px as i32 - 1) {
        let row = &mut colors[(j - top) as usize * patch.width_px as usize..][..patch.width_px as usize];
        for i in columns.clone() {
            let (u, v) = tile.coordinates(i, j);
            if u < tile.u_end() && v < tile.v_end() && is_solid(tile, masks, u, v) {
                row[(i - left) as usize] = tile_color(tile, masks, i, j, tile.color);
            }
        }
    }
}

/// Whether the tile's mask has no hole at tile coordinates `(u, v)`.
#[inline]
fn is_solid(tile: &Tile, masks: &MaskSet, u: u32, v: u32) -> bool {
    if tile.mask == 0 {
        return true;
    }
    let (column, row) = tile.texel(u, v);
    masks.layers()[tile.mask as usize].texel(column, row).coverage >= COVERAGE_THRESHOLD
}
