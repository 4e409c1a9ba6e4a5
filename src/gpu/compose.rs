//! The compute pass `compose`: draws translucent tiles patch by patch, by the rule of the fitness; the blending of a
//! graphics pass rounds as the device likes. Twin: `cpu/mosaic.rs`.

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
const PATCH_SIDE: u32 = 1024;
/// List entries of one submission: well below a watchdog's second.
const ENTRIES_PER_SUBMISSION: usize = 1 << 18;

/// Pipeline, tiles and buffers of one population on one canvas of samples.
pub(super) struct ComposePass {
    samples: Canvas,
    shape: KernelShape,
    background: Backdrop,
    tiles: Vec<Tile>,
    lists: BlockLists,
    items: Vec<ComposeItem>,
    entries: Vec<u32>,
    item_buffer: Arc<Buffer>,
    entry_buffer: Arc<Buffer>,
    colors: Arc<Buffer>,
    pipeline: Arc<ComputePipeline>,
    group: Arc<BindingGroup>,
    workgroups_per_row: usize,
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
        let shape = KernelShape::for_device(device.info().kind);
        let tiles: Vec<Tile> = population.flies.iter().map(|fly| Tile::bake(fly, &samples)).collect();
        let side = PATCH_SIDE / supersampling * supersampling;
        let mut lists = BlockLists::new(&samples, side);
        lists.fill(&population.flies, &tiles);
        let block_count = (side.div_ceil(shape.block_side_px) as usize).pow(2);
        let storage = |name: &str, bytes: usize| {
            Buffer::create(device, name, bytes as u64, BufferUse::Storage, Residence::Device)
        };
        let item_buffer = storage("compose work", block_count * size_of::<ComposeItem>())?;
        let entry_buffer = storage("compose entries", ENTRIES_PER_SUBMISSION * 4)?;
        let tile_buffer = storage("compose tiles", tiles.len() * size_of::<Tile>())?;
        let states = storage("compose states", shape.block_pixels() * 16)?;
        let colors = storage("compose colours", block_count * shape.block_pixels() * 4)?;
        recorder.write_buffer(&tile_buffer, 0, bytemuck::cast_slice(&tiles))?;
        let masks = create_mask_buffer(device, recorder, std::iter::once(&population.masks))?;
        let pipeline = create_pipeline(device, shape, population.background)?;
        let bindings = [&item_buffer, &entry_buffer, &tile_buffer, &states, &colors, &masks].map(Binding::Buffer);
        let group = BindingGroup::create("compose", pipeline.layout(), &bindings)?;
        Ok(Self {
            samples,
            shape,
            background: population.background,
            tiles,
            lists,
            items: Vec::new(),
            entries: Vec::new(),
            item_buffer,
            entry_buffer,
            colors,
            pipeline,
            group,
            workgroups_per_row: device.info().limits.workgroups[0] as usize,
        })
    }

    /// Draws on the canvas, each pixel the mean of `supersampling`² samples.
    pub fn draw(
        mut self,
        recorder: &mut Recorder,
        canvas: &Canvas,
        supersampling: u32,
        watch: &mut dyn FnMut(f64),
    ) -> Result<Mosaic> {
        let mut mosaic = Mosaic::new(canvas, self.background);
        for number in 0..self.lists.block_count() {
            let patch = self.lists.patch(number, &self.samples);
            let colors = self.draw_patch(recorder, number, &patch)?;
            mosaic.absorb(&patch, &colors, supersampling);
            watch((number + 1) as f64 / self.lists.block_count() as f64);
        }
        Ok(mosaic)
    }

    /// Packed colours of a patch, row by row, with their opacity in the highest byte if the backdrop is transparent.
    fn draw_patch(&mut self, recorder: &mut Recorder, number: usize, patch: &Patch) -> Result<Vec<u32>> {
        let side = self.shape.block_side_px;
        let columns = patch.width_px.div_ceil(side);
        let rows = patch.height_px.div_ceil(side);
        for row in 0..rows {
            for (column, list) in (0..).zip(self.lists_of_row(number, patch, row)) {
                let place = (patch.x + column * side, patch.y + row * side);
                self.add_block(recorder, row * columns + column, place, &list)?;
            }
        }
        let bytes = columns as usize * rows as usize * self.shape.block_pixels() * 4;
        self.record(recorder)?;
        let ticket = recorder.read_buffer(&self.colors, 0, bytes as u64)?;
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
    fn lists_of_row(&self, number: usize, patch: &Patch, row: u32) -> Vec<Vec<u32>> {
        let side = self.shape.block_side_px as i32;
        let (left, top) = (patch.x as i32, (patch.y + row * self.shape.block_side_px) as i32);
        let mut lists = vec![Vec::new(); patch.width_px.div_ceil(side as u32) as usize];
        for &key in self.lists.list(number) {
            let tile = &self.tiles[index_of(key) as usize];
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
        recorder.write_buffer(&self.item_buffer, 0, bytemuck::cast_slice(&self.items))?;
        recorder.write_buffer(&self.entry_buffer, 0, bytemuck::cast_slice(&self.entries))?;
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
