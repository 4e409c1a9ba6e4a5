//! The tiles of a population on a canvas, kept from one drawing to the next: a fly is baked again only if it changed.

use std::sync::Arc;

use rayon::prelude::*;

use super::News;
use super::mirror::Mirror;
use crate::error::Result;
use crate::model::{Canvas, Fly, Patch, Population, Tile};
use crate::vk::{Buffer, Device, Recorder};

/// Flies from which on it is worth to bake them on all threads.
const FLIES_FOR_THREADS: usize = 1 << 12;

/// Flies with their tiles.
pub(super) struct BakedTiles {
    flies: Vec<Fly>,
    /// What the tiles were baked for, with the width of the ring of grout.
    baked_for: Option<(Canvas, u32)>,
    tiles: Mirror<Tile>,
}

impl BakedTiles {
    pub fn create(device: &Arc<Device>) -> Result<Self> {
        Ok(Self { flies: Vec::new(), baked_for: None, tiles: Mirror::create(device, "live tiles")? })
    }

    /// Brings the tiles up to date, records their upload, and notes both.
    pub fn update(
        &mut self,
        recorder: &mut Recorder,
        population: &Population,
        canvas: &Canvas,
        news: &mut News,
    ) -> Result<()> {
        let ring_width = population.grout.map_or(0, |grout| grout.width);
        let bake = |fly: &Fly| Tile::bake_with_ring(fly, canvas, ring_width);
        let device = Arc::clone(recorder.device());
        news.is_moved = self.tiles.reserve(&device, population.flies.len())?;
        if news.is_moved || self.baked_for != Some((*canvas, ring_width)) {
            self.forget();
        }
        let kept = self.flies.len().min(population.flies.len());
        news.has_other_tiles |= kept < self.flies.len();
        self.flies.truncate(kept);
        self.tiles.truncate(kept);
        for (place, (old, new)) in self.flies.iter_mut().zip(&population.flies).enumerate() {
            if old != new {
                *old = *new;
                self.tiles.put(place, bake(new));
                news.upload.tiles += 1;
            }
        }
        let added = &population.flies[kept..];
        let baked: Vec<Tile> = if added.len() < FLIES_FOR_THREADS {
            added.iter().map(bake).collect()
        } else {
            added.par_iter().map(bake).collect()
        };
        (kept..).zip(baked).for_each(|(place, tile)| self.tiles.put(place, tile));
        self.flies.extend_from_slice(added);
        news.upload.tiles += added.len();
        news.has_other_tiles |= news.upload.tiles > 0;
        self.baked_for = Some((*canvas, ring_width));
        news.upload.bytes += self.tiles.upload(recorder)?;
        Ok(())
    }

    /// Takes it that nothing was ever baked.
    pub fn forget(&mut self) {
        self.flies.clear();
        self.tiles.forget();
        self.baked_for = None;
    }

    pub fn flies(&self) -> &[Fly] {
        &self.flies
    }

    pub fn tiles(&self) -> &[Tile] {
        self.tiles.entries()
    }

    pub fn buffer(&self) -> &Arc<Buffer> {
        self.tiles.buffer()
    }

    /// The flies whose tiles' boxes meet a patch, in their order.
    pub fn on(&self, patch: &Patch) -> impl Iterator<Item = u32> + '_ {
        let meets = meets(*patch);
        (0..).zip(self.tiles()).filter(move |(_, tile)| meets(tile)).map(|(fly, _)| fly)
    }
}

/// Whether a tile's box meets a patch.
pub(super) fn meets(patch: Patch) -> impl Fn(&Tile) -> bool {
    let (left, top) = (patch.x as i32, patch.y as i32);
    let (right, bottom) = (left + patch.width_px as i32, top + patch.height_px as i32);
    move |tile| !tile.is_empty() && tile.x0 < right && tile.x1 >= left && tile.y0 < bottom && tile.y1 >= top
}
