//! The Vulkan evaluator: the host bakes tiles and keeps the block lists, the device does every pixel.

use std::sync::Arc;

use super::compose_pass::ComposePass;
use super::evaluate_pass::{EvaluatePass, KernelShape, LIST_PIECE, LaneSpan};
use super::layout::{FLAG_CONTINUED, FLAG_FRESH, FLAG_UNFINISHED, Tile, WorkItem};
use super::mosaic_pass::MosaicPass;
use super::translucent_pass::TranslucentPass;
use crate::error::Result;
use crate::model::blocks::index_of;
use crate::model::{Blend, Canvas, Change, Evaluation, Evaluator, Fly, Lane, Layers, Mosaic, Population, Scene};
use crate::vk::{Buffer, Device, PassTime, Recorder, Timing};

/// The evaluator of a Vulkan device.
pub struct GpuEvaluator {
    pub(super) device: Arc<Device>,
    pub(super) recorder: Recorder,
    pub(super) pass: EvaluatePass,
    /// Only if any lane is translucent.
    translucent: Option<TranslucentPass>,
    pub(super) lanes: Vec<Lane>,
    fitness: Vec<Fitness>,
    work: Work,
}

/// What the device last reported of an opaque lane.
#[derive(Clone, Debug)]
struct Fitness {
    sae: u64,
    marginal: Vec<i64>,
}

/// Work for the device, in buffers that are used again.
#[derive(Debug, Default)]
struct Work {
    /// Blocks whose lists are still to be looked at from some entry on.
    pending: Vec<Pending>,
    items: Vec<WorkItem>,
    entries: Vec<u32>,
}

#[derive(Clone, Copy, Debug)]
struct Pending {
    lane: usize,
    block: u32,
    from: usize,
}

impl GpuEvaluator {
    /// An evaluator with one lane per scene, each empty until it is loaded.
    ///
    /// # Errors
    /// If the device has no room for the scenes.
    pub fn create(device: &Arc<Device>, scenes: Vec<Scene>) -> Result<Self> {
        Self::create_with_shape(device, scenes, KernelShape::for_device(device.info().kind))
    }

    /// As [`GpuEvaluator::create`], with the kernel cut otherwise than is best for the device.
    ///
    /// # Errors
    /// If the device has no room for the scenes.
    pub fn create_with_shape(device: &Arc<Device>, scenes: Vec<Scene>, shape: KernelShape) -> Result<Self> {
        let lanes: Vec<Lane> = scenes.into_iter().map(|scene| Lane::new(scene, shape.block_side_px)).collect();
        let mut recorder = Recorder::create(device, "evaluator", Timing::Off)?;
        let pass = EvaluatePass::create(device, &mut recorder, &lanes, shape)?;
        let translucent =
            if lanes.iter().any(is_translucent) { Some(TranslucentPass::create(device, &pass, &lanes)?) } else { None };
        recorder.submit_and_wait()?;
        let fitness = lanes.iter().map(|lane| Fitness { sae: 0, marginal: vec![0; lane.tiles().len()] }).collect();
        let work = Work::default();
        Ok(Self { device: Arc::clone(device), recorder, pass, translucent, lanes, fitness, work })
    }

    /// As [`GpuEvaluator::create`], with timestamps around each pass where the device has them.
    ///
    /// # Errors
    /// If the device has no room for the scenes.
    pub fn create_timed(device: &Arc<Device>, scenes: Vec<Scene>) -> Result<Self> {
        let mut evaluator = Self::create(device, scenes)?;
        evaluator.recorder = Recorder::create(device, "evaluator", Timing::On)?;
        Ok(evaluator)
    }

    /// Times of the passes of the last submission; empty unless created with timestamps.
    #[must_use]
    pub fn pass_times(&self) -> &[PassTime] {
        self.recorder.pass_times()
    }

    /// The fly that shows at each pixel as the graphics pass draws it, or [`crate::model::NO_FLY`].
    ///
    /// # Errors
    /// If the device fails.
    pub fn draw_fly_layer(&mut self, population: &Population) -> Result<Vec<u32>> {
        let canvas = Canvas::evaluation(population.width_px, population.height_px);
        MosaicPass::create(&self.device, &mut self.recorder, population, &canvas)?.draw_fly_layer(&mut self.recorder)
    }

    /// Evaluates every lane once more from what is loaded: the device's part of [`Evaluator::load`], without binning.
    ///
    /// # Errors
    /// If the device fails.
    pub fn evaluate_again(&mut self) -> Result<()> {
        self.evaluate_all(&(0..self.lanes.len()).collect::<Vec<_>>())
    }

    /// Evaluates all blocks of `lanes` afresh.
    fn evaluate_all(&mut self, lanes: &[usize]) -> Result<()> {
        let mut zeroes = self.recorder.transfer_pass("zero sums")?;
        for &lane in lanes {
            let (offset, bytes) = marginal_range(&self.pass.spans[lane]);
            zeroes.fill(&self.pass.marginal, offset, bytes, 0);
            zeroes.fill(&self.pass.sums, lane as u64 * 8, 8, 0);
            let blocks = 0..self.lanes[lane].lists().block_count() as u32;
            self.work.pending.extend(blocks.map(|block| Pending { lane, block, from: 0 }));
        }
        drop(zeroes);
        self.run(lanes, FLAG_FRESH)
    }

    /// Evaluates all pending blocks and reads the fitness of `lanes` back.
    fn run(&mut self, lanes: &[usize], first_flags: u32) -> Result<()> {
        let mut pending = std::mem::take(&mut self.work.pending);
        // Each round looks at one piece of every list, so that a piece always finds what the one before it left.
        while !pending.is_empty() {
            let mut rest = Vec::new();
            for block in &pending {
                if is_translucent(&self.lanes[block.lane]) {
                    self.push_stack(*block)?;
                } else {
                    self.push_piece(*block, first_flags, &mut rest)?;
                }
            }
            if rest.is_empty() {
                break;
            }
            self.submit(&[])?;
            pending = rest;
        }
        self.submit(lanes)?;
        pending.clear();
        self.work.pending = pending;
        Ok(())
    }

    /// Adds a block of a translucent lane to the work.
    fn push_stack(&mut self, Pending { lane, block, .. }: Pending) -> Result<()> {
        let length = self.lanes[lane].lists().list(block as usize).len();
        if self.translucent.as_ref().is_some_and(|pass| !pass.has_room(length)) {
            self.submit(&[])?;
        }
        let first_pixel = self.first_pixel(lane, block);
        if let Some(pass) = &mut self.translucent {
            pass.add(lane, &self.lanes[lane], block, first_pixel);
        }
        Ok(())
    }

    /// Adds the next piece of a block's list to the work; what is left goes to `rest`.
    fn push_piece(&mut self, pending: Pending, first_flags: u32, rest: &mut Vec<Pending>) -> Result<()> {
        let list_length = self.lanes[pending.lane].lists().list(pending.block as usize).len();
        let piece = pending.from..list_length.min(pending.from + LIST_PIECE);
        let is_full = self.work.items.len() == self.pass.item_capacity()
            || self.work.entries.len() + piece.len() > self.pass.entry_capacity();
        if is_full {
            self.submit(&[])?;
        }
        let lists = self.lanes[pending.lane].lists();
        let list = lists.list(pending.block as usize);
        let mut flags = if pending.from == 0 { first_flags } else { FLAG_CONTINUED };
        if piece.end < list_length {
            flags |= FLAG_UNFINISHED;
            rest.push(Pending { from: piece.end, ..pending });
        }
        let (x, y) = lists.origin(pending.block as usize);
        let first_pixel = self.first_pixel(pending.lane, pending.block);
        self.work.items.push(WorkItem {
            lane: pending.lane as u32,
            first_pixel: first_pixel as u32,
            x: x as i32,
            y: y as i32,
            first_entry: self.work.entries.len() as u32,
            entry_count: piece.len() as u32,
            flags,
            padding: 0,
        });
        self.work.entries.extend(list[piece].iter().map(|&key| index_of(key)));
        Ok(())
    }

    /// Runs the collected work items, if any, and reads the fitness of `lanes` back.
    fn submit(&mut self, lanes: &[usize]) -> Result<()> {
        let (pass, recorder, work) = (&self.pass, &mut self.recorder, &mut self.work);
        let parts = self.translucent.as_ref().map_or(Ok(None), |pass| pass.record(recorder))?;
        if !work.items.is_empty() {
            pass.write_work(recorder, &work.items, &work.entries)?;
            pass.record(recorder, work.items.len())?;
        }
        let mut tickets = Vec::with_capacity(lanes.len());
        for &lane in lanes.iter().filter(|&&lane| !is_translucent(&self.lanes[lane])) {
            let span = &pass.spans[lane];
            let (offset, bytes) = marginal_range(span);
            let marginal = recorder.read_buffer(&pass.marginal, offset, bytes)?;
            tickets.push((lane, marginal, recorder.read_buffer(&pass.sums, lane as u64 * 8, 8)?));
        }
        recorder.submit_and_wait()?;
        if let (Some(pass), Some(parts)) = (&mut self.translucent, parts) {
            pass.absorb(recorder, &parts)?;
        }
        for (lane, marginal, sum) in tickets {
            let fitness = &mut self.fitness[lane];
            recorder.read_into(&marginal, bytemuck::cast_slice_mut(&mut fitness.marginal))?;
            recorder.read_into(&sum, bytemuck::bytes_of_mut(&mut fitness.sae))?;
            if !pass.variant.wide_sums {
                // Only the low words count.
                fitness.marginal.iter_mut().for_each(|marginal| *marginal = i64::from(*marginal as i32));
                fitness.sae &= u64::from(u32::MAX);
            }
        }
        work.items.clear();
        work.entries.clear();
        Ok(())
    }

    /// Number of a block's first pixel in the layers.
    fn first_pixel(&self, lane: usize, block: u32) -> usize {
        self.pass.spans[lane].first_pixel + block as usize * self.pass.variant.shape.block_pixels()
    }

    /// One layer of a lane, read back and put in rows.
    fn read_back_layer(&mut self, lane: usize, layer: &Arc<Buffer>) -> Result<Vec<u32>> {
        let span = &self.pass.spans[lane];
        let ticket = self.recorder.read_buffer(layer, span.first_pixel as u64 * 4, span.pixel_count as u64 * 4)?;
        self.recorder.submit_and_wait()?;
        let mut blocked = vec![0_u32; span.pixel_count];
        self.recorder.read_into(&ticket, bytemuck::cast_slice_mut(&mut blocked))?;
        let (target, lists) = (&self.lanes[lane].scene().target, self.lanes[lane].lists());
        let (side, columns) = (self.pass.variant.shape.block_side_px, lists.columns());
        let place = |i: u32, j: u32| {
            let block = (j / side * columns + i / side) as usize;
            block * (side * side) as usize + (j % side * side + i % side) as usize
        };
        let pixels = (0..target.height_px()).flat_map(|j| (0..target.width_px()).map(move |i| (i, j)));
        Ok(pixels.map(|(i, j)| blocked[place(i, j)]).collect())
    }
}

/// Whether the lane's fitness is the work of [`TranslucentPass`].
fn is_translucent(lane: &Lane) -> bool {
    lane.scene().masks.blend() == Blend::Translucent
}

/// Offset and size in bytes of a lane's marginal fitness.
fn marginal_range(span: &LaneSpan) -> (u64, u64) {
    (span.first_fly as u64 * 8, span.fly_count as u64 * 8)
}

impl Evaluator for GpuEvaluator {
    fn lane(&self, lane: usize) -> &Lane {
        &self.lanes[lane]
    }

    fn lane_count(&self) -> usize {
        self.lanes.len()
    }

    fn load(&mut self, populations: &[(usize, &[Fly])]) -> Result<()> {
        for &(number, flies) in populations {
            let (lane, span) = (&mut self.lanes[number], &self.pass.spans[number]);
            lane.load(flies);
            let tile_bytes = size_of::<Tile>() as u64;
            let first_byte = span.first_fly as u64 * tile_bytes;
            self.recorder.write_buffer(&self.pass.tiles, first_byte, bytemuck::cast_slice(lane.tiles()))?;
        }
        self.evaluate_all(&populations.iter().map(|&(lane, _)| lane).collect::<Vec<_>>())
    }

    fn replace(&mut self, changes: &[Change]) -> Result<()> {
        for change in changes {
            let (lane, span) = (&mut self.lanes[change.lane], &self.pass.spans[change.lane]);
            lane.replace(change.index, &change.fly);
            let tile = &lane.tiles()[change.index as usize];
            let offset = (span.first_fly + change.index as usize) * size_of::<Tile>();
            self.recorder.write_buffer(&self.pass.tiles, offset as u64, bytemuck::bytes_of(tile))?;
        }
        let mut stale = Vec::new();
        for (number, lane) in self.lanes.iter_mut().enumerate().filter(|(_, lane)| !lane.touched().is_empty()) {
            let blocks = lane.touched().iter();
            self.work.pending.extend(blocks.map(|&block| Pending { lane: number, block, from: 0 }));
            lane.clear_touched();
            stale.push(number);
        }
        self.run(&stale, 0)
    }

    fn evaluation(&self, lane: usize) -> Evaluation<'_> {
        match &self.translucent {
            Some(pass) if is_translucent(&self.lanes[lane]) => pass.evaluation(lane),
            _ => {
                let Fitness { sae, marginal } = &self.fitness[lane];
                Evaluation { sae: *sae, marginal }
            }
        }
    }

    fn read_back_layers(&mut self, lane: usize) -> Result<Layers> {
        let (top, under) = (Arc::clone(&self.pass.top), Arc::clone(&self.pass.under));
        Ok(Layers { top: self.read_back_layer(lane, &top)?, under: self.read_back_layer(lane, &under)? })
    }

    fn draw(&mut self, population: &Population, canvas: &Canvas, supersampling: u32) -> Result<Mosaic> {
        if population.masks.blend() == Blend::Translucent {
            let pass = ComposePass::create(&self.device, &mut self.recorder, population, canvas, supersampling)?;
            return pass.draw(&mut self.recorder, canvas, supersampling);
        }
        let samples = canvas.supersampled(supersampling);
        let pass = MosaicPass::create(&self.device, &mut self.recorder, population, &samples)?;
        pass.draw(&mut self.recorder, canvas, supersampling)
    }
}
