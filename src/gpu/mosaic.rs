//! The graphics pass `mosaic`: instanced quads with a transform and a mask each, drawn into colour, fly and depth. What
//! it draws with serves a whole mosaic, patch by patch, and the picture of a mosaic at work (`live`). Twin:
//! `cpu/mosaic.rs`.

use std::sync::Arc;

use glam::{DAffine2, DMat2, DVec2};

use super::layout::{Instance, MosaicPush, Tile};
use super::shaders;
use crate::error::Result;
use crate::model::blocks::{BlockLists, index_of};
use crate::model::mask::MASK_SIDE;
use crate::model::tile::pack;
use crate::model::{Backdrop, Canvas, Fly, Grout, MaskSet, Mosaic, NO_FLY, Patch, Population};
use crate::vk::{
    Binding, BindingGroup, BindingKind, Buffer, BufferUse, ClearColor, ColorTarget, DepthTest, Device,
    GraphicsPipeline, GraphicsShaders, Image, ImageFormat, ImageShape, Recorder, RenderTargets, Residence,
};

/// Samples along each side of a patch: three attachments of 16 MiB, whatever the size of the canvas.
const PATCH_SIDE: u32 = 2048;

/// Pipeline, attachments and tiles of one population on one canvas of samples.
pub(super) struct MosaicPass {
    samples: Canvas,
    tiles: Vec<Tile>,
    flies: Vec<Fly>,
    instances: Arc<Buffer>,
    brush: Brush,
    color: Arc<Image>,
    fly: Arc<Image>,
    depth: Arc<Image>,
}

impl MosaicPass {
    /// Bakes and uploads `population` for a canvas of samples.
    pub fn create(
        device: &Arc<Device>,
        recorder: &mut Recorder,
        population: &Population,
        samples: &Canvas,
    ) -> Result<Self> {
        let ring_width = population.grout.map_or(0, |grout| grout.width);
        let bake = |fly| Tile::bake_with_ring(fly, samples, ring_width);
        let tiles: Vec<Tile> = population.flies.iter().map(bake).collect();
        let storage = |name: &str, bytes: usize| {
            Buffer::create(device, name, bytes as u64, BufferUse::Storage, Residence::Device)
        };
        let tile_buffer = storage("mosaic tiles", tiles.len() * size_of::<Tile>())?;
        recorder.write_buffer(&tile_buffer, 0, bytemuck::cast_slice(&tiles))?;
        let instances = storage("mosaic instances", tiles.len() * size_of::<Instance>())?;
        let masks = create_masks(device, recorder, &population.masks)?;
        let pipeline = create_pipeline(device, population.grout, &[ImageFormat::Rgba8Unorm, ImageFormat::R32Uint])?;
        let side = PATCH_SIDE.min(device.info().limits.image_side_px);
        let shape =
            ImageShape { width_px: side.min(samples.width_px), height_px: side.min(samples.height_px), layers: 1 };
        let group = bind(&pipeline, &tile_buffer, &instances, &masks)?;
        Ok(Self {
            samples: *samples,
            flies: population.flies.clone(),
            tiles,
            instances,
            brush: Brush { pipeline, group, background: population.background, grout: population.grout },
            color: Image::create(device, "mosaic colour", ImageFormat::Rgba8Unorm, shape)?,
            fly: Image::create(device, "mosaic fly", ImageFormat::R32Uint, shape)?,
            depth: Image::create(device, "mosaic depth", ImageFormat::D32Float, shape)?,
        })
    }

    /// Draws on `canvas`, each pixel the mean of `supersampling`² samples; tells `watch` the share that is done.
    pub fn draw(
        &self,
        recorder: &mut Recorder,
        canvas: &Canvas,
        supersampling: u32,
        watch: &mut dyn FnMut(f64),
    ) -> Result<Mosaic> {
        let mut mosaic = Mosaic::new(canvas, self.brush.background);
        let color = Arc::clone(&self.color);
        self.draw_patches(recorder, supersampling, &color, |patch, samples, share| {
            mosaic.absorb(patch, samples, supersampling);
            watch(share);
        })?;
        Ok(mosaic)
    }

    /// The fly that shows at each sample, row by row.
    pub fn draw_fly_layer(&self, recorder: &mut Recorder) -> Result<Vec<u32>> {
        let width = self.samples.width_px as usize;
        let mut layer = vec![NO_FLY; width * self.samples.height_px as usize];
        let fly = Arc::clone(&self.fly);
        self.draw_patches(recorder, 1, &fly, |patch, flies, _| {
            for (row, flies) in flies.chunks_exact(patch.width_px as usize).enumerate() {
                let first = (patch.y as usize + row) * width + patch.x as usize;
                layer[first..first + flies.len()].copy_from_slice(flies);
            }
        })?;
        Ok(layer)
    }

    /// Draws every patch and hands the rows of `attachment` to `take`, with the share of all patches that are drawn.
    /// Patches start at multiples of `grain`.
    fn draw_patches(
        &self,
        recorder: &mut Recorder,
        grain: u32,
        attachment: &Arc<Image>,
        mut take: impl FnMut(&Patch, &[u32], f64),
    ) -> Result<()> {
        let shape = self.color.shape();
        let side = shape.width_px.max(shape.height_px) / grain * grain;
        let mut lists = BlockLists::new(&self.samples, side);
        lists.fill(&self.flies, &self.tiles);
        let mut pixels = vec![0_u32; shape.width_px as usize * shape.height_px as usize];
        for number in 0..lists.block_count() {
            let patch = lists.patch(number, &self.samples);
            self.record(recorder, &patch, lists.list(number))?;
            let ticket = recorder.read_image(attachment)?;
            recorder.submit_and_wait()?;
            recorder.read_into(&ticket, bytemuck::cast_slice_mut(&mut pixels))?;
            let rows = pixels.chunks_exact(shape.width_px as usize).take(patch.height_px as usize);
            let packed: Vec<u32> = rows.flat_map(|row| &row[..patch.width_px as usize]).copied().collect();
            take(&patch, &packed, (number + 1) as f64 / lists.block_count() as f64);
        }
        Ok(())
    }

    /// Records the drawing of one patch, nearest tiles first.
    fn record(&self, recorder: &mut Recorder, patch: &Patch, list: &[u64]) -> Result<()> {
        let instances: Vec<Instance> = list
            .iter()
            .map(|&key| index_of(key))
            .map(|fly| instance(fly, &self.flies[fly as usize], &self.tiles[fly as usize]))
            .collect();
        recorder.write_buffer(&self.instances, 0, bytemuck::cast_slice(&instances))?;
        let colors = [
            ColorTarget { image: &self.color, clear: clear_color(self.brush.background) },
            ColorTarget { image: &self.fly, clear: ClearColor::Uint([NO_FLY; 4]) },
        ];
        self.brush.record(recorder, &colors, &self.depth, patch, instances.len())
    }
}

/// What tiles are drawn with, wherever they are drawn.
pub(super) struct Brush {
    pub pipeline: Arc<GraphicsPipeline>,
    pub group: Arc<BindingGroup>,
    pub background: Backdrop,
    pub grout: Option<Grout>,
}

impl Brush {
    /// Records the drawing of the first instances into the upper left corner of the targets: what of them lies on a
    /// patch. Of two at the same depth, the first is nearer.
    pub fn record(
        &self,
        recorder: &mut Recorder,
        colors: &[ColorTarget<'_>],
        depth: &Arc<Image>,
        patch: &Patch,
        instance_count: usize,
    ) -> Result<()> {
        let &Patch { x, y, width_px, height_px } = patch;
        let targets = RenderTargets { colors, depth: Some(depth), width_px, height_px };
        let mut pass = recorder.render_pass("mosaic", &targets)?;
        pass.bind(&self.pipeline, &self.group);
        pass.push_constants(bytemuck::bytes_of(&MosaicPush {
            origin: [x as i32, y as i32],
            pixel_size: [2.0 / width_px as f32, 2.0 / height_px as f32],
            first_mask: 0,
            grout: self.grout.map_or(0, |grout| pack(grout.color)),
        }));
        pass.draw(4, instance_count as u32);
        Ok(())
    }
}

/// What a picture holds where no tile is.
pub(super) fn clear_color(background: Backdrop) -> ClearColor {
    let [r, g, b] = background.color().map(|channel| f32::from(channel) / 255.0);
    ClearColor::Float([r, g, b, if background == Backdrop::Transparent { 0.0 } else { 1.0 }])
}

/// The quad of a fly's tile, which is not empty. Its depth has 24 bits, as many as a rank.
pub(super) fn instance(fly: u32, genes: &Fly, tile: &Tile) -> Instance {
    let quad = quad_transform(tile);
    Instance {
        axis_u: quad.matrix2.x_axis.as_vec2().to_array(),
        axis_v: quad.matrix2.y_axis.as_vec2().to_array(),
        centre: quad.translation.as_vec2().to_array(),
        fly,
        rank: genes.z,
    }
}

/// All layers of a mask set as a texture array.
pub(super) fn create_masks(device: &Arc<Device>, recorder: &mut Recorder, set: &MaskSet) -> Result<Arc<Image>> {
    let side = MASK_SIDE as u32;
    let shape = ImageShape { width_px: side, height_px: side, layers: set.layers().len() as u32 };
    let image = Image::create(device, "masks", ImageFormat::Rg8Uint, shape)?;
    for (layer, mask) in (0..).zip(set.layers()) {
        recorder.write_image_layer(&image, layer, bytemuck::cast_slice(mask.texels()))?;
    }
    Ok(image)
}

/// The transform from the square [-1, 1]² to a quad, in px of the canvas, that holds the tile and a pixel around it.
///
/// It inverts the tile's integer map, so its error is that of f64, far below the extra pixel.
fn quad_transform(tile: &Tile) -> DAffine2 {
    let (cos, sin) = (f64::from(tile.cos), f64::from(tile.sin));
    // (u, v) = scale * rotation^-1 * (i, j); the inverse has the axes (cos, sin) and (-sin, cos) over scale².
    let rotation = DMat2::from_cols(DVec2::new(cos, sin), DVec2::new(-sin, cos));
    let to_px = rotation * rotation.determinant().recip();
    let scale = rotation.determinant().sqrt();
    let half = DVec2::new(f64::from(tile.u_end()), f64::from(tile.v_end())) / 2.0;
    let corner = DVec2::new(f64::from(tile.x0), f64::from(tile.y0));
    let centre = corner + to_px * (half - DVec2::new(f64::from(tile.u0), f64::from(tile.v0)));
    DAffine2::from_mat2_translation(to_px * DMat2::from_diagonal(half + DVec2::splat(scale)), centre)
}

/// Binds what the shaders read.
pub(super) fn bind(
    pipeline: &GraphicsPipeline,
    tiles: &Arc<Buffer>,
    instances: &Arc<Buffer>,
    masks: &Arc<Image>,
) -> Result<Arc<BindingGroup>> {
    let bindings = [Binding::Buffer(tiles), Binding::Buffer(instances), Binding::SampledImage(masks)];
    BindingGroup::create("mosaic", pipeline.layout(), &bindings)
}

/// Compiles the shaders for colours, and flies if that is attached, too.
pub(super) fn create_pipeline(
    device: &Arc<Device>,
    grout: Option<Grout>,
    colors: &[ImageFormat],
) -> Result<Arc<GraphicsPipeline>> {
    GraphicsPipeline::create(
        device,
        &GraphicsShaders {
            name: "mosaic",
            vertex: &shaders::words(shaders::MOSAIC_VERTEX),
            fragment: &shaders::words(shaders::MOSAIC_FRAGMENT),
            // Whether there is grout: without it the test of the ring is not even there.
            specialization: &[(0, u32::from(grout.is_some()))],
            bindings: &[BindingKind::StorageBuffer, BindingKind::StorageBuffer, BindingKind::SampledImage],
            push_constant_bytes: size_of::<MosaicPush>() as u32,
            colors,
            depth: DepthTest::Less,
        },
    )
}
