//! Twin of `glsl/mosaic.vert` and `glsl/mosaic.frag`, and of `glsl/compose.comp` for translucent tiles: draws a
//! population at any size by the exact coverage rule. Opaque tiles are painted from the farthest to the nearest.
//! Translucent ones are composited from the nearest to the farthest, as in the fitness.

use rayon::prelude::*;

use crate::model::blocks::{BlockLists, index_of};
use crate::model::mask::{COVERAGE_THRESHOLD, Texel, shaded};
use crate::model::tile::{Tile, pack, unpack};
use crate::model::translucency::{Compositing, opacity};
use crate::model::{Backdrop, Blend, Canvas, Mask, Mosaic, Patch, Population};

/// Samples along each side of a patch, before it is cut to whole pixels: 256 KiB of colours stay in a core's cache.
const PATCH_SIDE: u32 = 256;

/// Draws `population` on `canvas`, each pixel the mean of `supersampling`² samples.
pub(super) fn draw(population: &Population, canvas: &Canvas, supersampling: u32, watch: &mut dyn FnMut(f64)) -> Mosaic {
    let samples = canvas.supersampled(supersampling);
    let side = PATCH_SIDE / supersampling * supersampling;
    let ring_width = population.grout.map_or(0, |grout| grout.width);
    let bake = |fly| Tile::bake_with_ring(fly, &samples, ring_width);
    let tiles: Vec<Tile> = population.flies.iter().map(bake).collect();
    let mut lists = BlockLists::new(&samples, side);
    lists.fill(&population.flies, &tiles);
    let mut mosaic = Mosaic::new(canvas, population.background);
    // One row of patches at a time, so that memory does not grow with the number of samples.
    for first in (0..lists.block_count()).step_by(lists.columns() as usize) {
        let drawn: Vec<(Patch, Vec<u32>)> = (first..first + lists.columns() as usize)
            .into_par_iter()
            .map(|number| {
                let patch = lists.patch(number, &samples);
                let colors = draw_patch(population, &tiles, lists.list(number), &patch);
                (patch, colors)
            })
            .collect();
        for (patch, colors) in drawn {
            mosaic.absorb(&patch, &colors, supersampling);
        }
        watch((first + lists.columns() as usize) as f64 / lists.block_count() as f64);
    }
    mosaic
}

/// Opacity of a sample that a tile covers.
const SOLID: u32 = 255 << 24;

/// Packed colours of a patch, row by row, with their opacity in the highest byte if the backdrop is transparent.
fn draw_patch(population: &Population, tiles: &[Tile], list: &[u64], patch: &Patch) -> Vec<u32> {
    let sample_count = (patch.width_px * patch.height_px) as usize;
    let tiles = list.iter().map(|&key| &tiles[index_of(key) as usize]);
    let tiles = tiles.map(|tile| (tile, &population.masks.layers()[tile.mask as usize]));
    let background = match population.background {
        Backdrop::Color(color) => Some(color),
        Backdrop::Transparent => None,
    };
    match population.masks.blend() {
        Blend::Opaque => {
            let mut colors = vec![background.map_or(0, pack); sample_count];
            for (tile, mask) in tiles.rev() {
                let own = |texel: Texel| shaded(tile.color, u32::from(texel.shade)) | SOLID;
                // Two loops, so that drawing without grout does not test for it at every sample.
                match population.grout.map(|grout| pack(grout.color) | SOLID) {
                    None => for_each_solid(tile, mask, patch, |sample, _, texel| colors[sample] = own(texel)),
                    Some(grout) => for_each_solid(tile, mask, patch, |sample, (u, v), texel| {
                        colors[sample] = if tile.is_inside_ring(u, v) { own(texel) } else { grout };
                    }),
                }
            }
            colors
        }
        Blend::Translucent => {
            let mut samples = vec![Compositing::START; sample_count];
            for (tile, mask) in tiles {
                for_each_texel(tile, mask, patch, |sample, _, texel| {
                    let color = shaded(tile.color, u32::from(texel.shade));
                    samples[sample].add(opacity(u32::from(texel.coverage)), unpack(color));
                });
            }
            let shown =
                |sample: Compositing| background.map_or_else(|| sample.alone(), |color| pack(sample.over(color)));
            samples.into_iter().map(shown).collect()
        }
    }
}

/// The texel of a plain square, the same everywhere.
const FULL: Texel = Texel { coverage: 255, shade: 255 };

/// As [`for_each_texel`], but only where the mask is solid.
fn for_each_solid(tile: &Tile, mask: &Mask, patch: &Patch, mut visit: impl FnMut(usize, (u32, u32), Texel)) {
    for_each_texel(tile, mask, patch, |sample, place, texel| {
        if texel.coverage >= COVERAGE_THRESHOLD {
            visit(sample, place, texel);
        }
    });
}

/// Calls `visit` for each sample of the patch inside the tile's rectangle, with its index (row by row), its tile
/// coordinates and the texel there.
fn for_each_texel(tile: &Tile, mask: &Mask, patch: &Patch, mut visit: impl FnMut(usize, (u32, u32), Texel)) {
    let (left, top) = (patch.x as i32, patch.y as i32);
    let columns = tile.x0.max(left)..tile.x1.min(left + patch.width_px as i32 - 1) + 1;
    for j in tile.y0.max(top)..=tile.y1.min(top + patch.height_px as i32 - 1) {
        let row = (j - top) as usize * patch.width_px as usize;
        for i in columns.clone() {
            let (u, v) = tile.coordinates(i, j);
            if u < tile.u_end() && v < tile.v_end() {
                let (column, texel_row) = tile.texel(u, v);
                let texel = if tile.mask == 0 { FULL } else { mask.texel(column, texel_row) };
                visit(row + (i - left) as usize, (u, v), texel);
            }
        }
    }
}
