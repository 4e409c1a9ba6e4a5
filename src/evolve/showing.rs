//! What a tile would show: the target's colours at the pixels where it would be in front of all others.
//!
//! This is read from the lists and tiles that the host keeps for every evaluator. So the size of the blocks does not
//! matter, and all evaluators give the same colours.

use crate::model::blocks::index_of;
use crate::model::mask::COVERAGE_THRESHOLD;
use crate::model::{Lane, MaskSet, Rgb, Tile};

/// For each channel, how many pixels want each value of the tile's colour.
#[derive(Clone, Debug)]
pub(super) struct Wanted {
    counts: [[u32; 256]; 3],
    pixel_count: u32,
}

/// The fly that is placed: its index, which is also the index of the fly that it replaces, and its depth key.
type Placed = (u32, u64);

impl Wanted {
    /// The colours that `tile` should have where it would show if it took the place of fly `index` with depth `key`. If
    /// it shows nowhere, those at all pixels that it covers; `None` if it covers none.
    pub(super) fn by(lane: &Lane, index: u32, key: u64, tile: &Tile) -> Option<Self> {
        let showing = Self::over(lane, tile, Some((index, key)));
        let wanted = if showing.pixel_count > 0 { showing } else { Self::over(lane, tile, None) };
        (wanted.pixel_count > 0).then_some(wanted)
    }

    /// The colours at the pixels that `tile` covers. If it is `placed` among others, only those where it shows.
    fn over(lane: &Lane, tile: &Tile, placed: Option<Placed>) -> Self {
        let (target, masks) = (&lane.scene().target, &lane.scene().masks);
        let mut wanted = Self { counts: [[0; 256]; 3], pixel_count: 0 };
        let mut hidden = Vec::new();
        for block in lane.lists().blocks_of(tile) {
            let area = Area::of(lane, block, tile);
            hidden.clear();
            hidden.resize(area.pixel_count(), false);
            if let Some(placed) = placed {
                hide(lane, lane.lists().list(block), placed, &area, &mut hidden);
            }
            for (&is_hidden, (i, j)) in hidden.iter().zip(area.pixels()) {
                if !is_hidden && let Some(shade) = shade_at(tile, masks, i, j) {
                    let pixel = j as usize * target.width_px() as usize + i as usize;
                    wanted.add(target.pixels()[pixel], shade);
                }
            }
        }
        wanted
    }

    /// Adds a pixel of the target under a texel of this shade. The pixel is divided by the shade, since the shaded
    /// colour should fit. A texel without any light fits every colour equally well.
    fn add(&mut self, color: Rgb, shade: u8) {
        let shade = u32::from(shade);
        if shade == 0 {
            return;
        }
        for (counts, channel) in self.counts.iter_mut().zip(color) {
            let unshaded = (u32::from(channel) * 255 + shade / 2) / shade;
            counts[unshaded.min(255) as usize] += 1;
        }
        self.pixel_count += 1;
    }

    /// The mean of each channel, rounded.
    pub(super) fn mean(&self) -> Rgb {
        let pixel_count = u64::from(self.pixel_count);
        self.counts.map(|counts| {
            let sum: u64 = (0..).zip(counts).map(|(value, count): (u64, u32)| value * u64::from(count)).sum();
            ((sum + pixel_count / 2) / pixel_count) as u8
        })
    }

    /// The median of each channel; for an even number of values, the lower one.
    pub(super) fn median(&self) -> Rgb {
        let rank = (self.pixel_count - 1) / 2;
        self.counts.map(|counts| {
            let mut below = 0;
            let at_rank = counts.iter().position(|count| {
                below += count;
                below > rank
            });
            at_rank.unwrap_or_default() as u8
        })
    }
}

/// The pixels that a block and a tile's box have in common, in picture coordinates, ends included.
struct Area {
    x0: i32,
    y0: i32,
    x1: i32,
    y1: i32,
}

impl Area {
    fn of(lane: &Lane, block: usize, tile: &Tile) -> Self {
        let side = lane.lists().side_px() as i32;
        let (x, y) = lane.lists().origin(block);
        let (x, y) = (x as i32, y as i32);
        Self { x0: tile.x0.max(x), y0: tile.y0.max(y), x1: tile.x1.min(x + side - 1), y1: tile.y1.min(y + side - 1) }
    }

    fn pixel_count(&self) -> usize {
        ((self.x1 - self.x0 + 1).max(0) * (self.y1 - self.y0 + 1).max(0)) as usize
    }

    fn pixels(&self) -> impl Iterator<Item = (i32, i32)> + use<> {
        let columns = self.x0..=self.x1;
        (self.y0..=self.y1).flat_map(move |j| columns.clone().map(move |i| (i, j)))
    }
}

/// Marks the pixels of `area` that a tile of `list` in front of the placed one covers, except for the one it replaces.
fn hide(lane: &Lane, list: &[u64], (index, key): Placed, area: &Area, hidden: &mut [bool]) {
    let columns = area.x1 - area.x0 + 1;
    let in_front = list.iter().map(|&other| (other, index_of(other))).take_while(|&(other, _)| other < key);
    for (_, other) in in_front.filter(|&(_, other)| other != index) {
        let tile = &lane.tiles()[other as usize];
        for j in area.y0.max(tile.y0)..=area.y1.min(tile.y1) {
            for i in area.x0.max(tile.x0)..=area.x1.min(tile.x1) {
                let pixel = ((j - area.y0) * columns + i - area.x0) as usize;
                hidden[pixel] = hidden[pixel] || shade_at(tile, &lane.scene().masks, i, j).is_some();
            }
        }
    }
}

/// The shade of `tile` at pixel `(i, j)` of its box; `None` where it has a hole or does not reach. A translucent texel
/// counts from the same coverage as an opaque one.
fn shade_at(tile: &Tile, masks: &MaskSet, i: i32, j: i32) -> Option<u8> {
    let (u, v) = tile.coordinates(i, j);
    if u >= tile.u_end() || v >= tile.v_end() {
        return None;
    }
    if tile.mask == 0 {
        return Some(255);
    }
    let (column, row) = tile.texel(u, v);
    let texel = masks.layers()[tile.mask as usize].texel(column, row);
    (texel.coverage >= COVERAGE_THRESHOLD).then_some(texel.shade)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::model::mask::{MASK_SIDE, Mask, Texel};
    use crate::model::{Canvas, Fly, Scene, Target};

    /// Columns 0 to 7 hold the values 0, 10, .. 70 in red, half of that in green, and 200 in blue.
    fn target() -> Target {
        let pixels = (0..64).map(|pixel| [pixel % 8 * 10, pixel % 8 * 5, 200]).collect();
        Target::new(8, 8, pixels).expect("8x8 pixels")
    }

    /// Left half: a hole. Right half: half of the light.
    fn half_mask() -> MaskSet {
        let texel = |index: usize| Texel { coverage: if index % MASK_SIDE < 128 { 0 } else { 255 }, shade: 128 };
        let texels = (0..MASK_SIDE * MASK_SIDE).map(texel).collect();
        MaskSet::with_layers(vec![Mask::new(texels).expect("a full layer")]).expect("one layer")
    }

    /// A tile over the columns `from..to` and all rows.
    fn columns(from: i32, to: i32, z: u32) -> Fly {
        let (x, w) = ((from + to) * 32 - 32, (to - from) as u32 * 64);
        Fly { x, y: 4 * 64 - 32, z, w, h: 512, alive: true, ..Fly::ABSENT }
    }

    fn lane(flies: &[Fly], block_side_px: u32) -> Lane {
        let (target, masks) = (Arc::new(target()), Arc::new(half_mask()));
        let mut lane = Lane::new(Scene { target, masks, background: [0; 3], fly_count: flies.len() }, block_side_px);
        lane.load(flies);
        lane
    }

    fn wanted(flies: &[Fly], index: u32, child: &Fly) -> Option<(Rgb, Rgb)> {
        let told = [8, 16, 2].map(|block_side_px| {
            let tile = Tile::bake(child, &Canvas::evaluation(8, 8));
            let wanted = Wanted::by(&lane(flies, block_side_px), index, child.depth_key(index), &tile);
            wanted.map(|wanted| (wanted.mean(), wanted.median()))
        });
        assert!(told.iter().all(|other| *other == told[0]), "the blocks' size matters: {told:?}");
        told[0]
    }

    #[test]
    fn only_pixels_that_no_nearer_tile_hides_count() {
        let flies = [columns(0, 3, 10), columns(6, 8, 30), columns(0, 8, 5)];
        // In place of the last fly, columns 3 to 7 show, since those of the second lie behind.
        let child = columns(0, 8, 20);
        assert_eq!(wanted(&flies, 2, &child), Some(([50, 25, 200], [50, 25, 200])));
        // In place of the first fly, nothing shows, so all covered pixels count. The median is the lower one.
        assert_eq!(wanted(&flies, 0, &child), Some(([35, 18, 200], [30, 15, 200])));
    }

    #[test]
    fn at_equal_depth_the_lower_index_is_in_front() {
        let flies = [columns(0, 4, 7), columns(0, 0, 0), columns(0, 6, 7)];
        assert_eq!(wanted(&flies, 1, &columns(0, 8, 7)), Some(([55, 28, 200], [50, 25, 200])));
    }

    #[test]
    fn a_tile_outside_the_picture_or_between_pixels_wants_nothing() {
        let sliver = Fly { x: 32, w: 20, ..columns(0, 1, 0) };
        assert_eq!(wanted(&[columns(0, 8, 5)], 0, &sliver), None);
    }

    #[test]
    fn masked_texels_are_divided_by_their_shade_and_holes_do_not_count() {
        let flies = [columns(0, 0, 0), columns(0, 5, 1)];
        // Columns 4 to 7 are solid, and the second tile, in front, hides the fourth: twice 50, 60 and 70.
        let child = Fly { mask: 1, ..columns(0, 8, 9) };
        let (mean, median) = wanted(&flies, 0, &child).expect("three columns show");
        assert_eq!((mean, median), ([120, 60, 255], [120, 60, 255]), "blue cannot be brighter than 255");
        // As a mask the second tile hides nothing with its hole: columns 0 to 1, and solid 2 to 4 do not show.
        let masked = [columns(0, 0, 0), Fly { mask: 1, ..columns(0, 4, 1) }];
        assert_eq!(wanted(&masked, 0, &columns(0, 4, 9)), Some(([5, 3, 200], [0, 0, 200])));
    }

    #[test]
    fn texels_without_light_do_not_count() {
        let mut wanted = Wanted { counts: [[0; 256]; 3], pixel_count: 0 };
        wanted.add([9, 9, 9], 0);
        assert_eq!(wanted.pixel_count, 0);
        wanted.add([100, 200, 0], 200);
        assert_eq!(wanted.mean(), [128, 255, 0]);
    }
}
