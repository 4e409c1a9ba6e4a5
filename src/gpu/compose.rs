//! The compute pass `compose`: draws translucent tiles patch by patch, by the rule of the fitness; the blending of a
//! graphics pass rounds as the device likes. What it draws with serves a whole mosaic, and the picture of a mosaic at
//! work (`live`). Twin: `cpu/mosaic.rs`.

use std::sync::Arc;

use super::evaluate::{KernelShape, LIST_PIECE, create_mask_buffer};
use super::layout::{ComposeItem, ComposePush, FLAG_CONTINUED, FLAG_UNFINISHED, Tile};
use super::shaders;
use crate::error::Result;
use crate::model::blocks::{BlockLists, index_of};
use crate::model::tile::pack;
use crate::model::{Backdrop, Canvas, Mosaic, Patch, Population};
use crate::vk::{
    Binding, BindingGroup, BindingKind, Buffer, BufferUse, ComputePipeline, ComputeShader, Device, Recorder, Residence,
};

/// Samples along each side of a patch.
pub(super) const PATCH_SIDE: u32 = 1024;
/// List entries of one submission: well below a watchdog's second.
const ENTRIES_PER_SUBMISSION: usize = 1 << 18;

/// Tiles of one population on one canvas of samples, and what draws them.
pub(super) struct ComposePass {
    samples: Canvas,
    tiles: Vec<Tile>,
    lists: BlockLists,
    glazer: Glazer,
}

impl ComposePass {
    /// Bakes and uploads `population` for `canvas` with `supersampling`² samples per pixel.
    pub fn create(
        device: &Arc<Device>,
        recorder: &mut Recorder,
        population: &Population,
        canvas: &Canvas,
        supersampling: u32,
    ) -> Result<Self> {
        let samples = canvas.supersampled(supersampling);
        let tiles: Vec<Tile> = population.flies.iter().map(|fly| Tile::bake(fly, &samples)).collect();
        let side = PATCH_SIDE / supersampling * supersampling;
        let mut lists = BlockLists::new(&samples, side);
        lists.fill(&population.flies, &tiles);
        let tile_bytes = (tiles.len() * size_of::<Tile>()) as u64;
        let tile_buffer = Buffer::create(device, "compose tiles", tile_bytes, BufferUse::Storage, Residence::Device)?;
        recorder.write_buffer(&tile_buffer, 0, bytemuck::cast_slice(&tiles))?;
        let masks = create_mask_buffer(device, recorder, std::iter::once(&population.masks))?;
        let glazer = Glazer::create(device, side, population.background, &tile_buffer, &masks)?;
        Ok(Self { samples, tiles, lists, glazer })
    }

    /// Draws on the canvas, each pixel the mean of `supersampling`² samples.
    pub fn draw(
        mut self,
        recorder: &mut Recorder,
        canvas: &Canvas,
        supersampling: u32,
        watch: &mut dyn FnMut(f64),
    ) -> Result<Mosaic> {
        let mut mosaic = Mosaic::new(canvas, self.glazer.background);
        for number in 0..self.lists.block_count() {
            let patch = self.lists.patch(number, &self.samples);
            let colors = self.glazer.draw(recorder, &self.tiles, self.lists.list(number), &patch)?;
            mosaic.absorb(&patch, &colors, supersampling);
            watch((number + 1) as f64 / self.lists.block_count() as f64);
        }
        Ok(mosaic)
    }
}

/// Pipeline and buffers for one patch after the other. The tiles and masks are the caller's.
pub(super) struct Glazer {
    shape: KernelShape,
    background: Backdrop,
    items: Vec<ComposeItem>,
    entries: Vec<u32>,
    buffers: PatchBuffers,
    pipeline: Arc<ComputePipeline>,
    group: Arc<BindingGroup>,
    workgroups_per_row: usize,
}

/// What the work on a patch needs.
struct PatchBuffers {
    items: Arc<Buffer>,
    entries: Arc<Buffer>,
    states: Arc<Buffer>,
    colors: Arc<Buffer>,
}

impl PatchBuffers {
    fn create(device: &Arc<Device>, shape: KernelShape, side_px: u32) -> Result<Self> {
        let block_count = (side_px.div_ceil(shape.block_side_px) as usize).pow(2);
        let storage = |name: &str, bytes: usize| {
            Buffer::create(device, name, bytes as u64, BufferUse::Storage, Residence::Device)
        };
        Ok(Self {
            items: storage("compose work", block_count * size_of::<ComposeItem>())?,
            entries: storage("compose entries", ENTRIES_PER_SUBMISSION * 4)?,
            states: storage("compose states", shape.block_pixels() * 16)?,
            colors: storage("compose colours", block_count * shape.block_pixels() * 4)?,
        })
    }

    fn bind(&self, pipeline: &ComputePipeline, tiles: &Arc<Buffer>, masks: &Arc<Buffer>) -> Result<Arc<BindingGroup>> {
        let Self { items, entries, states, colors } = self;
        let bindings = [items, entries, tiles, states, colors, masks].map(Binding::Buffer);
        BindingGroup::create("compose", pipeline.layout(), &bindings)
    }
}

impl Glazer {
    /// Makes room for patches of up to `side_px` samples along each side.
    pub fn create(
        device: &Arc<Device>,
        side_px: u32,
        background: Backdrop,
        tiles: &Arc<Buffer>,
        masks: &Arc<Buffer>,
    ) -> Result<Self> {
        let shape = KernelShape::for_device(device.info().kind);
        let buffers = PatchBuffers::create(device, shape, side_px)?;
        let pipeline = create_pipeline(device, shape, background)?;
        Ok(Self {
            shape,
            background,
            items: Vec::new(),
            entries: Vec::new(),
            group: buffers.bind(&pipeline, tiles, masks)?,
            buffers,
            pipeline,
            workgroups_per_row: device.info().limits.workgroups[0] as usize,
        })
    }

    /// Takes other tiles and masks.
    pub fn bind(&mut self, tiles: &Arc<Buffer>, masks: &Arc<Buffer>) -> Result<()> {
        self.group = self.buffers.bind(&self.pipeline, tiles, masks)?;
        Ok(())
    }

    /// Takes another background. The shader is compiled again only if one of the two is transparent.
    pub fn put_on(&mut self, device: &Arc<Device>, background: Backdrop) -> Result<()> {
        let is_transparent = |backdrop| backdrop == Backdrop::Transparent;
        if is_transparent(background) != is_transparent(self.background) {
            self.pipeline = create_pipeline(device, self.shape, background)?;
        }
        self.background = background;
        Ok(())
    }

    /// Draws a patch and runs that: its packed colours, row by row, with their opacity in the highest byte if the
    /// backdrop is transparent. `list` are the depth keys of the tiles that touch the patch, nearest first.
    pub fn draw(&mut self, recorder: &mut Recorder, tiles: &[Tile], list: &[u64], patch: &Patch) -> Result<Vec<u32>> {
        let side = self.shape.block_side_px;
        let columns = patch.width_px.div_ceil(side);
        let rows = patch.height_px.div_ceil(side);
        for row in 0..rows {
            for (column, list) in (0..).zip(self.lists_of_row(tiles, list, patch, row)) {
                let place = (patch.x + column * side, patch.y + row * side);
                self.add_block(recorder, row * columns + column, place, &list)?;
            }
        }
        let bytes = columns as usize * rows as usize * self.shape.block_pixels() * 4;
        self.record(recorder)?;
        let ticket = recorder.read_buffer(&self.buffers.colors, 0, bytes as u64)?;
        recorder.submit_and_wait()?;
        let mut blocked = vec![0_u32; bytes / 4];
        recorder.read_into(&ticket, bytemuck::cast_slice_mut(&mut blocked))?;
        let place = |i: u32, j: u32| {
            let block = (j / side * columns + i / side) as usize;
            block * self.shape.block_pixels() + (j % side * side + i % side) as usize
        };
        let samples = (0..patch.height_px).flat_map(|j| (0..patch.width_px).map(move |i| (i, j)));
        Ok(samples.map(|(i, j)| blocked[place(i, j)]).collect())
    }

    /// The flies that touch each block in a row of blocks of a patch, nearest first. It is done row by row to save
    /// memory: a tile as large as the patch is in the lists of all of its blocks.
    fn lists_of_row(&self, tiles: &[Tile], list: &[u64], patch: &Patch, row: u32) -> Vec<Vec<u32>> {
        let side = self.shape.block_side_px as i32;
        let (left, top) = (patch.x as i32, (patch.y + row * self.shape.block_side_px) as i32);
        let mut lists = vec![Vec::new(); patch.width_px.div_ceil(side as u32) as usize];
        for &key in list {
            let tile = &tiles[index_of(key) as usize];
            if tile.y0 < top + side && tile.y1 >= top {
                let first = (tile.x0 - left).max(0) / side;
                let last = ((tile.x1 - left) / side).min(lists.len() as i32 - 1);
                lists[first as usize..=last as usize].iter_mut().for_each(|list| list.push(index_of(key)));
            }
        }
        lists
    }

    /// Adds a block to the work, and runs what there is when there is enough.
    fn add_block(&mut self, recorder: &mut Recorder, block: u32, (x, y): (u32, u32), list: &[u32]) -> Result<()> {
        let has_room = self.entries.len() + list.len() <= ENTRIES_PER_SUBMISSION;
        // The pieces of a long list follow each other in dispatches of their own.
        let is_long = list.len() > LIST_PIECE;
        if is_long || !has_room {
            self.run(recorder)?;
        }
        let mut from = 0;
        loop {
            let end = list.len().min(from + LIST_PIECE);
            let continued = if from > 0 { FLAG_CONTINUED } else { 0 };
            let unfinished = if end < list.len() { FLAG_UNFINISHED } else { 0 };
            self.items.push(ComposeItem {
                x: x as i32,
                y: y as i32,
                first_entry: self.entries.len() as u32,
                entry_count: (end - from) as u32,
                first_sample: block * self.shape.block_pixels() as u32,
                flags: continued | unfinished,
            });
            self.entries.extend_from_slice(&list[from..end]);
            if is_long {
                self.run(recorder)?;
            }
            if end == list.len() {
                return Ok(());
            }
            from = end;
        }
    }

    /// Runs the collected work.
    fn run(&mut self, recorder: &mut Recorder) -> Result<()> {
        self.record(recorder)?;
        recorder.submit_and_wait()
    }

    /// Records the collected work, if any.
    fn record(&mut self, recorder: &mut Recorder) -> Result<()> {
        if self.items.is_empty() {
            return Ok(());
        }
        recorder.write_buffer(&self.buffers.items, 0, bytemuck::cast_slice(&self.items))?;
        recorder.write_buffer(&self.buffers.entries, 0, bytemuck::cast_slice(&self.entries))?;
        let mut pass = recorder.compute_pass("compose")?;
        pass.bind(&self.pipeline, &self.group);
        let push = ComposePush { item_count: self.items.len() as u32, background: pack(self.background.color()) };
        pass.push_constants(bytemuck::bytes_of(&push));
        let columns = self.items.len().min(self.workgroups_per_row);
        pass.dispatch(columns as u32, self.items.len().div_ceil(columns) as u32, 1);
        self.items.clear();
        self.entries.clear();
        Ok(())
    }
}

fn create_pipeline(device: &Arc<Device>, shape: KernelShape, background: Backdrop) -> Result<Arc<ComputePipeline>> {
    let [threads, side, samples] = shape.specialization();
    let transparent = (3, u32::from(background == Backdrop::Transparent));
    ComputePipeline::create(
        device,
        &ComputeShader {
            name: "compose",
            spirv: &shaders::words(shaders::COMPOSE),
            specialization: &[threads, side, samples, transparent],
            bindings: &[BindingKind::StorageBuffer; 6],
            push_constant_bytes: size_of::<ComposePush>() as u32,
        },
    )
}
