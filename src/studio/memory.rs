//! About how much memory the work takes, known before it begins.

use crate::model::{Backdrop, Blend, Canvas, Population, Tile};

// The first two are about twice what the CPU twin takes for a random population of 50,000 flies at 4096x4096, and of
// 1,000,000 at 512x512, since lists grow while tiles gather.
/// Bytes per pixel of the evolved picture: its layers, its share of block lists, target and mosaic.
const BYTES_PER_PIXEL: u64 = 40;
/// Bytes per pixel of a picture that is searched: two layers, errors, and a stack of 16 flies with theirs.
const BYTES_PER_SEARCHED_PIXEL: u64 = 176;
/// The same with translucent tiles, of which every pixel keeps more, with what they let through.
const BYTES_PER_GLAZED_PIXEL: u64 = 301;
/// Bytes per fly: genes in the current and best population, tile, fitness, and its entries in block lists.
const BYTES_PER_FLY: u64 = 512;
/// Bytes per pixel of the written picture: the mosaic, the encoder's copy, and the encoded file.
const BYTES_PER_OUTPUT_PIXEL: u64 = 10;
/// What alpha adds to that: its byte, pixels of four channels for the encoder, and the file's fourth channel.
const BYTES_PER_ALPHA: u64 = 6;

/// Bytes per block that a tile touches: an entry of 8 in a list that grows by doubling.
const BYTES_PER_ENTRY: u64 = 16;
/// Least side in px of a block.
const BLOCK_SIDE_PX: i32 = 8;
/// Least side in samples of a patch that is drawn at once.
const PATCH_SIDE_PX: i32 = 240;

/// About how many bytes the block lists of a population take. The estimate per fly knows tiles of the usual size only,
/// and a population from a file may hold others.
pub(crate) fn list_bytes(population: &Population) -> u64 {
    let canvas = Canvas::evaluation(population.width_px, population.height_px);
    let blocks = |first: i32, last: i32| (last / BLOCK_SIDE_PX - first / BLOCK_SIDE_PX + 1) as u64;
    let tiles = population.flies.iter().map(|fly| Tile::bake(fly, &canvas)).filter(|tile| tile.x0 <= tile.x1);
    tiles.map(|tile| blocks(tile.x0, tile.x1) * blocks(tile.y0, tile.y1)).sum::<u64>() * BYTES_PER_ENTRY
}

/// About how many bytes it takes to draw a population: the list of each patch of `samples`, the flies, and the picture
/// of `pixel_count` pixels.
pub(crate) fn drawing_bytes(population: &Population, samples: &Canvas, pixel_count: u64) -> u64 {
    let patches = |first: i32, last: i32| (last / PATCH_SIDE_PX - first / PATCH_SIDE_PX + 1) as u64;
    let tiles = population.flies.iter().map(|fly| Tile::bake(fly, samples)).filter(|tile| !tile.is_empty());
    let entries: u64 = tiles.map(|tile| patches(tile.x0, tile.x1) * patches(tile.y0, tile.y1)).sum();
    let fly_bytes = population.flies.len() as u64 * BYTES_PER_FLY;
    let alpha_bytes = if population.background == Backdrop::Transparent { BYTES_PER_ALPHA } else { 0 };
    entries * BYTES_PER_ENTRY + fly_bytes + pixel_count.saturating_mul(BYTES_PER_OUTPUT_PIXEL + alpha_bytes)
}

/// About how many bytes an evolution needs.
pub(crate) fn estimate_bytes(pixel_count: u64, fly_count: usize, output_pixel_count: u64) -> u64 {
    pixel_count * BYTES_PER_PIXEL
        + fly_count as u64 * BYTES_PER_FLY
        + output_pixel_count.saturating_mul(BYTES_PER_OUTPUT_PIXEL)
}

/// About how many bytes a search in cells keeps of so many pixels, besides what an evolution does.
pub(crate) fn search_bytes(pixel_count: u64, blend: Blend) -> u64 {
    pixel_count.saturating_mul(match blend {
        Blend::Opaque => BYTES_PER_SEARCHED_PIXEL,
        Blend::Translucent => BYTES_PER_GLAZED_PIXEL,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::fly::Genes;
    use crate::model::{Fly, MaskSet};

    #[test]
    fn flies_as_large_as_the_picture_are_counted_in_every_block() {
        let genes =
            Genes { x: 1024.0, y: 1024.0, z: 0.0, r: 0.0, g: 0.0, b: 0.0, w: 4096.0, h: 4096.0, angle_deg: 0.0 };
        let flies = vec![Fly::from_genes(&genes, 0); 3000];
        let population = Population {
            width_px: 2048,
            height_px: 2048,
            background: [0; 3].into(),
            grout: None,
            masks: MaskSet::default(),
            flies,
        };
        assert_eq!(list_bytes(&population), 3000 * 256 * 256 * 16);
    }

    #[test]
    fn a_transparent_picture_takes_six_bytes_a_pixel_more() {
        let population = |background| {
            let (masks, flies) = (MaskSet::default(), vec![Fly::ABSENT; 2]);
            Population { width_px: 9, height_px: 9, background, grout: None, masks, flies }
        };
        let bytes = |background| drawing_bytes(&population(background), &Canvas::evaluation(9, 9), 81);
        assert_eq!(bytes(Backdrop::Transparent) - bytes(Backdrop::Color([0; 3])), 6 * 81);
    }

    #[test]
    fn absurd_sizes_do_not_overflow_the_estimate() {
        assert!(estimate_bytes(1 << 28, 1_000_000, 65_535 * 65_535) > 40 << 30);
    }
}
