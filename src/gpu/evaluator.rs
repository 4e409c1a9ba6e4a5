//! The Vulkan evaluator: the host bakes tiles and keeps the block lists, the device does every pixel.

use std::sync::Arc;

use super::evaluate::{EvaluatePass, KernelShape};
use super::lane::{GpuLane, Unread, is_translucent};
use super::lane_buffers::{Part, Room};
use super::layout::Tile;
use super::pace::Pace;
use super::translucent::{Extent, TranslucentPass};
use super::work::Work;
use crate::error::{Error, Remedy, Result};
use crate::model::{Blend, Change, Evaluation, Evaluator, Fly, Lane, Layers, Scene};
use crate::vk::{Device, PassTime, Recorder, Timing};

/// Work items of the first submission to hardware of unknown speed: the blocks of a picture of 512 px, and more.
const ITEMS_FIRST: u64 = 4_096;

/// The evaluator of a Vulkan device.
pub struct GpuEvaluator {
    pub(super) device: Arc<Device>,
    pub(super) recorder: Recorder,
    pub(super) pass: EvaluatePass,
    /// Made for the first translucent lane.
    pub(super) translucent: Option<TranslucentPass>,
    /// By number, without those that were released.
    pub(super) lanes: Vec<Option<GpuLane>>,
    pub(super) work: Work,
    /// In work items.
    pub(super) pace: Pace,
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
        let room = Room::of(scenes.iter(), shape.block_side_px);
        let mut evaluator = Self {
            device: Arc::clone(device),
            recorder: Recorder::create(device, "evaluator", Timing::Off)?,
            pass: EvaluatePass::create(device, room, shape)?,
            translucent: None,
            lanes: Vec::with_capacity(scenes.len()),
            work: Work::default(),
            pace: Pace::new(device.info().kind, ITEMS_FIRST),
        };
        evaluator.make_room_for_translucent(&scenes.iter().collect::<Vec<_>>())?;
        for scene in scenes {
            evaluator.make_lane(scene)?.ok_or_else(|| {
                let what = "these pictures are too much for one Vulkan device at once".to_owned();
                Error::TooLarge { what, remedies: &[Remedy::FewerPictures] }
            })?;
        }
        evaluator.recorder.submit_and_wait()?;
        Ok(evaluator)
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

    /// Evaluates every lane once more from what is loaded: the device's part of [`Evaluator::load`], without binning.
    ///
    /// # Errors
    /// If the device fails.
    pub fn evaluate_again(&mut self) -> Result<()> {
        let lanes: Vec<usize> = (0..self.lanes.len()).filter(|&lane| self.lanes[lane].is_some()).collect();
        self.evaluate_all(&lanes)
    }

    pub(super) fn known(&self, lane: usize) -> &GpuLane {
        self.lanes[lane].as_ref().expect("the lane was released")
    }

    fn scenes(&self) -> impl Iterator<Item = &Scene> {
        self.lanes.iter().flatten().map(|lane| lane.lane.scene())
    }

    /// Makes a lane, if there is room for it.
    fn make_lane(&mut self, scene: Scene) -> Result<Option<usize>> {
        let side_px = self.pass.variant.shape.block_side_px;
        if !self.pass.buffers.make_room(&mut self.recorder, &scene, side_px)? {
            return Ok(None);
        }
        let scenes: Vec<&Scene> = self.lanes.iter().flatten().map(|lane| lane.lane.scene()).chain([&scene]).collect();
        self.pass.make_room_for_work(Room::of(scenes.iter().copied(), side_px))?;
        self.pass.choose_variant(scenes.into_iter());
        self.make_room_for_translucent(&[&scene])?;
        let lane = Lane::new(scene, side_px);
        let span = self.pass.buffers.place(&mut self.recorder, &lane)?;
        if let Some(pass) = self.translucent.as_mut().filter(|_| is_translucent(&lane)) {
            pass.admit(span.number, &lane);
        }
        if self.lanes.len() <= span.number {
            self.lanes.resize_with(span.number + 1, || None);
        }
        let marginal = vec![0; span.fly_count];
        self.lanes[span.number] = Some(GpuLane { lane, span, sae: 0, marginal, unread: Unread::All });
        Ok(Some(span.number))
    }

    /// Makes room for the work of those of `more` that are translucent, beside the lanes that are there.
    fn make_room_for_translucent(&mut self, more: &[&Scene]) -> Result<()> {
        let is_translucent = |scene: &&Scene| scene.masks.blend() == Blend::Translucent;
        if !more.iter().any(is_translucent) {
            return Ok(());
        }
        let shape = self.pass.variant.shape;
        let all = self.scenes().chain(more.iter().copied());
        let translucent: Vec<&Scene> = all.filter(is_translucent).collect();
        let extent = Extent {
            block_count: Room::of(translucent.iter().copied(), shape.block_side_px).pixels / shape.block_pixels(),
            fly_count: translucent.iter().map(|scene| scene.fly_count).max().unwrap_or(0),
        };
        match &mut self.translucent {
            Some(pass) => pass.make_room(&self.device, extent),
            None => {
                self.translucent = Some(TranslucentPass::create(&self.device, shape, extent)?);
                Ok(())
            }
        }
    }

    /// One layer of a lane, read back and put in rows.
    fn read_back_layer(&mut self, lane: usize, layer: Part) -> Result<Vec<u32>> {
        let span = self.known(lane).span;
        let range = self.pass.buffers.range(layer, &span);
        let ticket = self.recorder.read_buffer(&range.buffer, range.offset, range.size_bytes)?;
        self.recorder.submit_and_wait()?;
        let mut blocked = vec![0_u32; span.pixel_count];
        self.recorder.read_into(&ticket, bytemuck::cast_slice_mut(&mut blocked))?;
        let lane = &self.known(lane).lane;
        let (target, lists) = (&lane.scene().target, lane.lists());
        let (side, columns) = (self.pass.variant.shape.block_side_px, lists.columns());
        let place = |i: u32, j: u32| {
            let block = (j / side * columns + i / side) as usize;
            block * (side * side) as usize + (j % side * side + i % side) as usize
        };
        let pixels = (0..target.height_px()).flat_map(|j| (0..target.width_px()).map(move |i| (i, j)));
        Ok(pixels.map(|(i, j)| blocked[place(i, j)]).collect())
    }
}

impl Evaluator for GpuEvaluator {
    fn lane(&self, lane: usize) -> &Lane {
        &self.known(lane).lane
    }

    fn lane_count(&self) -> usize {
        self.lanes.iter().flatten().count()
    }

    fn admit(&mut self, scene: Scene) -> Result<Option<usize>> {
        let is_alone = self.lane_count() == 0;
        match self.make_lane(scene) {
            Err(Error::OutOfDeviceMemory { .. }) if !is_alone => Ok(None),
            made => made,
        }
    }

    fn release(&mut self, lane: usize) {
        let Some(GpuLane { span, lane: released, .. }) = self.lanes[lane].take() else { return };
        self.pass.buffers.release(&span, &released.scene().masks);
        if let Some(pass) = &mut self.translucent {
            pass.release(lane);
        }
        let scenes = self.lanes.iter().flatten().map(|lane| lane.lane.scene());
        self.pass.choose_variant(scenes);
    }

    fn load(&mut self, populations: &[(usize, &[Fly])]) -> Result<()> {
        for &(number, flies) in populations {
            let GpuLane { lane, span, .. } = self.lanes[number].as_mut().expect("the lane was released");
            lane.load(flies);
            let tiles = self.pass.buffers.range(Part::Tiles, span);
            self.recorder.write_buffer(&tiles.buffer, tiles.offset, bytemuck::cast_slice(lane.tiles()))?;
        }
        self.evaluate_all(&populations.iter().map(|&(lane, _)| lane).collect::<Vec<_>>())
    }

    fn replace(&mut self, changes: &[Change]) -> Result<()> {
        for change in changes {
            let GpuLane { lane, span, unread, .. } = self.lanes[change.lane].as_mut().expect("the lane was released");
            lane.replace(change.index, &change.fly);
            unread.add(std::iter::once(change.index));
            let tile = &lane.tiles()[change.index as usize];
            let tiles = self.pass.buffers.range(Part::Tiles, span);
            let offset = tiles.offset + u64::from(change.index) * size_of::<Tile>() as u64;
            self.recorder.write_buffer(&tiles.buffer, offset, bytemuck::bytes_of(tile))?;
        }
        self.evaluate_touched()
    }

    fn evaluation(&self, lane: usize) -> Evaluation<'_> {
        let known = self.known(lane);
        match &self.translucent {
            Some(pass) if is_translucent(&known.lane) => pass.evaluation(lane),
            _ => Evaluation { sae: known.sae, marginal: &known.marginal },
        }
    }

    fn read_back_layers(&mut self, lane: usize) -> Result<Layers> {
        let top = self.read_back_layer(lane, Part::TopLayer)?;
        Ok(Layers { top, under: self.read_back_layer(lane, Part::UnderLayer)? })
    }
}
