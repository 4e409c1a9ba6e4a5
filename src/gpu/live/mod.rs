//! The picture of a mosaic at work: any rectangle of it at any size, drawn again and again while flies change. Its
//! bytes are those of [`super::GpuPainter`] without supersampling. It stays on the device, in an image to be shown.

mod baked;
mod glazed;
mod mirror;
mod opaque;

use std::sync::Arc;

use self::baked::BakedTiles;
use self::glazed::GlazedTiles;
use self::opaque::OpaqueTiles;
use crate::error::{Error, Result};
use crate::model::{Backdrop, Blend, Canvas, Grout, MaskSet, Patch, Population};
use crate::vk::{Device, Image, ImageFormat, ImageShape, Recorder, Timing};

/// Sides of the image are multiples of this, so that a window that is pulled larger does not ask for one in each frame.
const SIDE_STEP_PX: u32 = 256;

/// What of a mosaic is drawn: a rectangle of a canvas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LiveView {
    /// The canvas that the whole mosaic fills.
    pub canvas: Canvas,
    /// Left column of the rectangle on the canvas.
    pub x: u32,
    /// Top row.
    pub y: u32,
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
}

impl LiveView {
    /// The rectangle, which must hold a pixel and lie on the canvas.
    fn patch(&self) -> Result<Patch> {
        let &Self { canvas, x, y, width_px, height_px } = self;
        let lies_on = |from: u32, size: u32, whole: u32| size > 0 && from <= whole && size <= whole - from;
        if lies_on(x, width_px, canvas.width_px) && lies_on(y, height_px, canvas.height_px) {
            return Ok(Patch { x, y, width_px, height_px });
        }
        let value = format!("{width_px}x{height_px} px at {x}, {y}");
        let reason = format!("it must lie on the canvas of {}x{} px", canvas.width_px, canvas.height_px);
        Err(Error::value("view", value, reason))
    }
}

/// What a drawing uploaded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Upload {
    /// Tiles that were baked.
    pub tiles: usize,
    /// Bytes of tiles, of their quads and of masks. The pixels of translucent tiles are not counted.
    pub bytes: u64,
}

/// What changed since the last drawing.
#[derive(Clone, Copy, Default)]
struct News {
    /// Some fly changed, came or went.
    has_other_tiles: bool,
    /// The tiles are in another buffer.
    is_moved: bool,
    /// The masks are others.
    has_other_masks: bool,
    upload: Upload,
}

/// What besides flies and view decides a drawing.
struct Look {
    background: Backdrop,
    grout: Option<Grout>,
    masks: MaskSet,
}

/// What the tiles are drawn with.
enum Drawer {
    Opaque(OpaqueTiles),
    Glazed(GlazedTiles),
}

/// Draws one mosaic at work.
pub struct LiveMosaic {
    recorder: Recorder,
    baked: BakedTiles,
    drawer: Option<Drawer>,
    image: Option<Arc<Image>>,
    /// What the image holds; nothing after a failure.
    drawn: Option<(LiveView, Look)>,
    upload: Upload,
}

impl LiveMosaic {
    /// Makes room for a few tiles.
    ///
    /// # Errors
    /// If the device fails.
    pub fn create(device: &Arc<Device>) -> Result<Self> {
        Ok(Self {
            recorder: Recorder::create(device, "live", Timing::Off)?,
            baked: BakedTiles::create(device)?,
            drawer: None,
            image: None,
            drawn: None,
            upload: Upload::default(),
        })
    }

    /// Draws a rectangle of the population into the upper left corner of an image, and returns that image: the same one
    /// as the last time, unless it was too small. Where the backdrop is transparent, the image has alpha, and its
    /// colours are multiplied by it.
    ///
    /// Only the tiles of flies that changed since the last call are baked and uploaded, unless the canvas, the masks or
    /// the width of the grout changed.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the rectangle does not lie on the canvas, [`Error::TooLarge`] if it is larger than an
    /// image of the device; else if the device fails or cannot draw.
    pub fn draw(&mut self, population: &Population, view: &LiveView) -> Result<Arc<Image>> {
        let patch = view.patch()?;
        self.upload = Upload::default();
        let last = self.drawn.take();
        if last.is_none() {
            // What an earlier drawing uploaded may have been lost when it failed.
            self.baked.forget();
            self.drawer = None;
        }
        let mut news = News::default();
        self.baked.update(&mut self.recorder, population, &view.canvas, &mut news)?;
        let image = self.image_for(&patch)?;
        let (has_same_view, look) = match last {
            Some((view_then, look)) if look.is_of(population) => (view_then == *view, look),
            last => {
                news.has_other_masks = last.is_some_and(|(_, look)| look.masks != population.masks);
                (false, Look::of(population))
            }
        };
        if !has_same_view || news.has_other_tiles {
            self.draw_anew(population, (&patch, &image), &mut news)?;
        }
        self.drawn = Some((*view, look));
        self.upload = news.upload;
        Ok(image)
    }

    fn draw_anew(&mut self, population: &Population, target: (&Patch, &Arc<Image>), news: &mut News) -> Result<()> {
        let (recorder, baked) = (&mut self.recorder, &self.baked);
        match (population.masks.blend(), &mut self.drawer) {
            (Blend::Opaque, Some(Drawer::Opaque(tiles))) => tiles.draw(recorder, population, baked, target, news),
            (Blend::Translucent, Some(Drawer::Glazed(tiles))) => tiles.draw(recorder, population, baked, target, news),
            (Blend::Opaque, drawer) => {
                let mut tiles = OpaqueTiles::create(recorder, population, baked, target.1, news)?;
                news.has_other_masks = false;
                tiles.draw(recorder, population, baked, target, news)?;
                *drawer = Some(Drawer::Opaque(tiles));
                Ok(())
            }
            (Blend::Translucent, drawer) => {
                let mut tiles = GlazedTiles::create(recorder, population, baked, news)?;
                news.has_other_masks = false;
                tiles.draw(recorder, population, baked, target, news)?;
                *drawer = Some(Drawer::Glazed(tiles));
                Ok(())
            }
        }
    }

    /// The image, made anew if it is too small.
    fn image_for(&mut self, patch: &Patch) -> Result<Arc<Image>> {
        let needed = [patch.width_px, patch.height_px];
        let now = self.image.as_ref().map_or([0; 2], |image| [image.shape().width_px, image.shape().height_px]);
        if let Some(image) = &self.image
            && (0..2).all(|axis| needed[axis] <= now[axis])
        {
            return Ok(Arc::clone(image));
        }
        let device = self.recorder.device();
        let most = device.info().limits.image_side_px;
        let side = |axis: usize| {
            let rounded = needed[axis].next_multiple_of(SIDE_STEP_PX).min(most);
            rounded.max(needed[axis]).max(now[axis])
        };
        let shape = ImageShape { width_px: side(0), height_px: side(1), layers: 1 };
        Ok(Arc::clone(self.image.insert(Image::create(device, "live mosaic", ImageFormat::Rgba8Unorm, shape)?)))
    }

    /// What the last drawing uploaded.
    #[must_use]
    pub fn last_upload(&self) -> Upload {
        self.upload
    }
}

impl Look {
    fn of(population: &Population) -> Self {
        let &Population { background, grout, ref masks, .. } = population;
        Self { background, grout, masks: masks.clone() }
    }

    fn is_of(&self, population: &Population) -> bool {
        let Population { background, grout, masks, .. } = population;
        (&self.background, &self.grout, &self.masks) == (background, grout, masks)
    }
}

/// Bytes of all layers of a mask set.
fn mask_bytes(masks: &MaskSet) -> u64 {
    masks.layers().iter().map(|mask| size_of_val(mask.texels()) as u64).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_lies_on_its_canvas() {
        let canvas = Canvas::evaluation(40, 30);
        let view = |x, y, width_px, height_px| LiveView { canvas, x, y, width_px, height_px }.patch().is_ok();
        assert!(view(0, 0, 40, 30) && view(39, 29, 1, 1));
        assert!(!view(0, 0, 41, 30) && !view(1, 0, 40, 30) && !view(0, 30, 1, 1));
        assert!(!view(0, 0, 0, 1) && !view(u32::MAX, 0, 2, 1));
    }
}
