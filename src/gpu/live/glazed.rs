//! Translucent tiles by the compute pass `compose`, and from there into the image that is shown.

use std::sync::Arc;

use super::baked::{BakedTiles, meets};
use super::{News, mask_bytes};
use crate::error::Result;
use crate::gpu::compose::{Glazer, PATCH_SIDE};
use crate::gpu::evaluate::create_mask_buffer;
use crate::model::blocks::index_of;
use crate::model::tile::{pack, unpack};
use crate::model::{Backdrop, Patch, Population};
use crate::vk::{Buffer, Image, Recorder};

/// What translucent tiles are drawn with.
pub(super) struct GlazedTiles {
    masks: Arc<Buffer>,
    glazer: Glazer,
    pixels: Vec<u32>,
}

impl GlazedTiles {
    /// Gets ready to draw a population whose tiles are in `baked`.
    pub fn create(
        recorder: &mut Recorder,
        population: &Population,
        baked: &BakedTiles,
        news: &mut News,
    ) -> Result<Self> {
        let device = Arc::clone(recorder.device());
        let masks = create_mask_buffer(&device, recorder, std::iter::once(&population.masks))?;
        news.upload.bytes += mask_bytes(&population.masks);
        let glazer = Glazer::create(&device, PATCH_SIDE, population.background, baked.buffer(), &masks)?;
        Ok(Self { masks, glazer, pixels: Vec::new() })
    }

    /// Draws what of the tiles lies on an area into the upper left corner of the image. The news are those since the
    /// last time.
    pub fn draw(
        &mut self,
        recorder: &mut Recorder,
        population: &Population,
        baked: &BakedTiles,
        (area, image): (&Patch, &Arc<Image>),
        news: &mut News,
    ) -> Result<()> {
        let device = Arc::clone(recorder.device());
        self.glazer.put_on(&device, population.background)?;
        if news.has_other_masks {
            self.masks = create_mask_buffer(&device, recorder, std::iter::once(&population.masks))?;
            news.upload.bytes += mask_bytes(&population.masks);
        }
        if news.is_moved || news.has_other_masks {
            self.glazer.bind(baked.buffer(), &self.masks)?;
        }
        let mut keys: Vec<u64> = baked.on(area).map(|fly| baked.flies()[fly as usize].depth_key(fly)).collect();
        keys.sort_unstable();
        let width = area.width_px as usize;
        self.pixels.resize(width * area.height_px as usize, 0);
        for patch in patches(area) {
            let is_on = meets(patch);
            let list: Vec<u64> =
                keys.iter().copied().filter(|&key| is_on(&baked.tiles()[index_of(key) as usize])).collect();
            let colors = self.glazer.draw(recorder, baked.tiles(), &list, &patch)?;
            let first = (patch.y - area.y) as usize * width + (patch.x - area.x) as usize;
            for (row, colors) in colors.chunks_exact(patch.width_px as usize).enumerate() {
                let pixels = &mut self.pixels[first + row * width..][..colors.len()];
                pixels.iter_mut().zip(colors).for_each(|(pixel, &color)| *pixel = shown(color, population.background));
            }
        }
        recorder.write_image_corner(image, [area.width_px, area.height_px], bytemuck::cast_slice(&self.pixels))?;
        recorder.submit_and_wait()
    }
}

/// The patches that an area is drawn in.
fn patches(area: &Patch) -> impl Iterator<Item = Patch> + use<> {
    let Patch { x, y, width_px, height_px } = *area;
    let pieces = |from: u32, size: u32| {
        (0..size).step_by(PATCH_SIDE as usize).map(move |at| (from + at, PATCH_SIDE.min(size - at)))
    };
    pieces(y, height_px).flat_map(move |(y, height_px)| {
        pieces(x, width_px).map(move |(x, width_px)| Patch { x, y, width_px, height_px })
    })
}

/// A packed colour as a pixel of the image: its opacity in the highest byte, and the channels multiplied by it.
fn shown(color: u32, background: Backdrop) -> u32 {
    const SOLID: u32 = 255 << 24;
    match (background, color >> 24) {
        (Backdrop::Color(_), _) => color | SOLID,
        (Backdrop::Transparent, 255) => color,
        (Backdrop::Transparent, alpha) => {
            let darkened = unpack(color).map(|channel| ((u32::from(channel) * alpha + 127) / 255) as u8);
            pack(darkened) | alpha << 24
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_patches_of_an_area_cover_each_pixel_of_it_once() {
        let area = Patch { x: 60_000, y: 7, width_px: 2 * PATCH_SIDE + 1, height_px: PATCH_SIDE };
        let found: Vec<Patch> = patches(&area).collect();
        assert_eq!(found.len(), 3);
        assert_eq!(found[2], Patch { x: 60_000 + 2 * PATCH_SIDE, y: 7, width_px: 1, height_px: PATCH_SIDE });
        let pixels: u32 = found.iter().map(|patch| patch.width_px * patch.height_px).sum();
        assert_eq!(pixels, area.width_px * area.height_px);
    }

    #[test]
    fn what_lies_over_nothing_is_multiplied_by_its_opacity() {
        assert_eq!(shown(0x0012_3456, Backdrop::Color([1, 2, 3])), 0xFF12_3456);
        assert_eq!(shown(0xFF12_3456, Backdrop::Transparent), 0xFF12_3456);
        assert_eq!(shown(0x80FF_0003, Backdrop::Transparent), 0x8080_0002);
        assert_eq!(shown(0x00FF_FFFF, Backdrop::Transparent), 0);
    }
}
