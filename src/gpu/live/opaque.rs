//! Opaque tiles by the graphics pass `mosaic`, right into the image that is shown.

use std::sync::Arc;

use super::baked::BakedTiles;
use super::mirror::Mirror;
use super::{News, mask_bytes};
use crate::error::Result;
use crate::gpu::layout::Instance;
use crate::gpu::mosaic::{Brush, bind, clear_color, create_masks, create_pipeline, instance};
use crate::model::{Patch, Population};
use crate::vk::{ColorTarget, Device, GraphicsPipeline, Image, ImageFormat, Recorder};

/// What opaque tiles are drawn with.
pub(super) struct OpaqueTiles {
    instances: Mirror<Instance>,
    masks: Arc<Image>,
    depth: Arc<Image>,
    /// Without grout and with it.
    pipelines: [Option<Arc<GraphicsPipeline>>; 2],
    brush: Brush,
}

impl OpaqueTiles {
    /// Gets ready to draw a population whose tiles are in `baked`, into images of the shape of `image`.
    pub fn create(
        recorder: &mut Recorder,
        population: &Population,
        baked: &BakedTiles,
        image: &Image,
        news: &mut News,
    ) -> Result<Self> {
        let device = Arc::clone(recorder.device());
        let instances = Mirror::create(&device, "live instances")?;
        let masks = create_masks(&device, recorder, &population.masks)?;
        news.upload.bytes += mask_bytes(&population.masks);
        let pipeline = create_pipeline(&device, population.grout, &[ImageFormat::Rgba8Unorm])?;
        let mut pipelines = [None, None];
        pipelines[usize::from(population.grout.is_some())] = Some(Arc::clone(&pipeline));
        Ok(Self {
            depth: create_depth(&device, image)?,
            pipelines,
            brush: Brush {
                group: bind(&pipeline, baked.buffer(), instances.buffer(), &masks)?,
                pipeline,
                background: population.background,
                grout: population.grout,
            },
            instances,
            masks,
        })
    }

    /// Draws what of the tiles lies on a patch into the upper left corner of the image. The news are those since the
    /// last time.
    pub fn draw(
        &mut self,
        recorder: &mut Recorder,
        population: &Population,
        baked: &BakedTiles,
        (patch, image): (&Patch, &Arc<Image>),
        news: &mut News,
    ) -> Result<()> {
        let device = Arc::clone(recorder.device());
        if news.has_other_masks {
            self.masks = create_masks(&device, recorder, &population.masks)?;
            news.upload.bytes += mask_bytes(&population.masks);
        }
        if self.depth.shape() != image.shape() {
            self.depth = create_depth(&device, image)?;
        }
        self.choose_pipeline(&device, population)?;
        let count = baked.on(patch).count();
        let has_moved = self.instances.reserve(&device, count)?;
        for (place, fly) in baked.on(patch).enumerate() {
            let (genes, tile) = (&baked.flies()[fly as usize], &baked.tiles()[fly as usize]);
            self.instances.put(place, instance(fly, genes, tile));
        }
        self.instances.truncate(count);
        news.upload.bytes += self.instances.upload(recorder)?;
        if has_moved || news.is_moved || news.has_other_masks {
            self.brush.group = bind(&self.brush.pipeline, baked.buffer(), self.instances.buffer(), &self.masks)?;
        }
        let colors = [ColorTarget { image, clear: clear_color(self.brush.background) }];
        self.brush.record(recorder, &colors, &self.depth, patch, count)?;
        recorder.submit_and_wait()
    }

    fn choose_pipeline(&mut self, device: &Arc<Device>, population: &Population) -> Result<()> {
        let pipeline = &mut self.pipelines[usize::from(population.grout.is_some())];
        self.brush.pipeline = match pipeline {
            Some(pipeline) => Arc::clone(pipeline),
            None => {
                let created = create_pipeline(device, population.grout, &[ImageFormat::Rgba8Unorm])?;
                Arc::clone(pipeline.insert(created))
            }
        };
        self.brush.background = population.background;
        self.brush.grout = population.grout;
        Ok(())
    }
}

fn create_depth(device: &Arc<Device>, image: &Image) -> Result<Arc<Image>> {
    Image::create(device, "live depth", ImageFormat::D32Float, image.shape())
}
