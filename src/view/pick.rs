//! The tile under the pointer: the same integer test as in every picture, at the scale of the screen.

use egui::{Pos2, pos2};

use crate::model::fly::UNITS_PER_PX;
use crate::model::mask::{COVERAGE_THRESHOLD, MASK_SIDE};
use crate::model::tile::Tile;
use crate::model::{Blend, Canvas, Fly, Mask, Population};
use crate::vector::outline;

/// The number of the nearest fly that covers pixel `(i, j)` of a canvas; of translucent ones, the nearest with any
/// opacity there.
pub(super) fn fly_at(tiles: &Population, canvas: &Canvas, (i, j): (i32, i32)) -> Option<usize> {
    let covered_from = covered_from(tiles);
    let near = tiles.flies.iter().enumerate().filter(|(_, fly)| may_cover(fly, canvas, (i, j)));
    let covers = |fly: &Fly| {
        let tile = Tile::bake(fly, canvas);
        let is_in_box = !tile.is_empty() && (tile.x0..=tile.x1).contains(&i) && (tile.y0..=tile.y1).contains(&j);
        is_in_box && {
            let (u, v) = tile.coordinates(i, j);
            let is_inside = u < tile.u_end() && v < tile.v_end();
            is_inside && is_there(&tile, tiles.masks.layers().get(usize::from(fly.mask)), (u, v), covered_from)
        }
    };
    let covering = near.filter(|(_, fly)| covers(fly));
    covering.min_by_key(|(number, fly)| fly.depth_key(*number as u32)).map(|(number, _)| number)
}

fn is_there(tile: &Tile, mask: Option<&Mask>, (u, v): (u32, u32), covered_from: u8) -> bool {
    let Some(mask) = mask.filter(|_| tile.mask != 0) else { return true };
    let (column, row) = tile.texel(u, v);
    mask.texel(column, row).coverage >= covered_from
}

/// Whether a fly is near enough to cover a pixel: a quick test that leaves few to be baked.
fn may_cover(fly: &Fly, canvas: &Canvas, (i, j): (i32, i32)) -> bool {
    if !fly.alive {
        return false;
    }
    let scale = f64::from(canvas.scale.0) / f64::from(canvas.scale.1);
    let px = f64::from(UNITS_PER_PX);
    let at = |gene: i32| (f64::from(gene) / px + 0.5) * scale - 0.5;
    let (dx, dy) = (at(fly.x) - f64::from(i), at(fly.y) - f64::from(j));
    let (w, h) = (f64::from(fly.w) / px * scale, f64::from(fly.h) / px * scale);
    dx * dx + dy * dy <= (w * w + h * h) / 4.0 + (w + h) * 2.0 + 9.0
}

/// The outlines of a tile's mask as places of the picture, where the centre of pixel (0, 0) lies at (0.5, 0.5).
pub(super) fn footprint(tiles: &Population, fly: &Fly) -> Vec<Vec<Pos2>> {
    let genes = fly.genes();
    let (sin, cos) = genes.angle_deg.to_radians().sin_cos();
    let texels = MASK_SIDE as f32;
    let place = |(u, v): (i32, i32)| {
        let (u, v) = (u as f32 / texels * genes.w, v as f32 / texels * genes.h);
        pos2(genes.x + 0.5 + u * cos - v * sin, genes.y + 0.5 + u * sin + v * cos)
    };
    let mask = tiles.masks.layers().get(usize::from(fly.mask)).filter(|_| fly.mask != 0);
    let half = MASK_SIDE as i32 / 2;
    let square = || vec![vec![(-half, -half), (half, -half), (half, half), (-half, half)]];
    let polygons = mask.map_or_else(square, |mask| outline(mask, covered_from(tiles)));
    polygons.into_iter().map(|polygon| polygon.into_iter().map(place).collect()).collect()
}

/// Least coverage of what belongs to a tile.
fn covered_from(tiles: &Population) -> u8 {
    match tiles.masks.blend() {
        Blend::Opaque => COVERAGE_THRESHOLD,
        Blend::Translucent => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::CpuPainter;
    use crate::model::mask::Texel;
    use crate::model::{MaskSet, Painter};

    #[test]
    fn the_fly_that_is_found_is_the_one_that_shows() {
        let fly = |number: u32| Fly {
            x: (number as i32 * 977) % 3_000,
            y: (number as i32 * 2_311) % 2_500,
            z: number * 7_919 % 9_973,
            angle: (number * 5_077) as u16,
            w: 200 + number * 97 % 900,
            h: 150 + number * 61 % 700,
            r: (number * 1_031) as u16,
            g: (number * 40_503) as u16,
            b: (number * 257) as u16,
            alive: !number.is_multiple_of(9),
            ..Fly::ABSENT
        };
        let (background, masks) = ([1, 2, 3].into(), MaskSet::default());
        let flies: Vec<Fly> = (0..60).map(fly).collect();
        let tiles = Population { width_px: 48, height_px: 40, background, grout: None, masks, flies };
        let canvas = Canvas::scaled(48, 40, 120);
        let mosaic = CpuPainter.draw(&tiles, &canvas, 1).expect("it draws");
        for j in 0..canvas.height_px {
            for i in 0..canvas.width_px {
                let shown = mosaic.pixels[(j * canvas.width_px + i) as usize];
                let found = fly_at(&tiles, &canvas, (i as i32, j as i32));
                assert_eq!(found.map_or([1, 2, 3], |number| tiles.flies[number].color()), shown, "{i} {j}");
            }
        }
    }

    #[test]
    fn a_footprint_turns_from_x_towards_y_and_is_that_of_the_mask() {
        let fly = Fly { x: 640, y: 640, w: 256, h: 128, angle: 16_384, alive: true, ..Fly::ABSENT };
        let with = |masks| Population {
            width_px: 20,
            height_px: 20,
            background: [0; 3].into(),
            grout: None,
            masks,
            flies: vec![fly],
        };
        // A quarter turn: the width of 4 px lies along y, the height of 2 px along x.
        let square = footprint(&with(MaskSet::default()), &fly);
        assert_eq!(square.iter().map(Vec::len).collect::<Vec<_>>(), [4]);
        assert!((square[0][0] - pos2(11.5, 8.5)).length() < 1e-3, "{square:?}");

        let right_half =
            |index: usize| Texel { coverage: if index % MASK_SIDE < MASK_SIDE / 2 { 0 } else { 255 }, shade: 255 };
        let mask = Mask::new((0..MASK_SIDE * MASK_SIDE).map(right_half).collect()).expect("whole");
        let masks = MaskSet::with_layers(vec![mask]).expect("a set");
        let half = footprint(&with(masks), &Fly { mask: 1, ..fly });
        // The right half of the tile is the lower one after the turn.
        assert!((half[0][0] - pos2(11.5, 10.5)).length() < 1e-3, "{half:?}");
        assert!(half.iter().flatten().all(|place| (10.5..=12.5).contains(&place.y)), "{half:?}");
    }
}
