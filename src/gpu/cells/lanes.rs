//! The cells searches of a Vulkan device. A submission makes many rounds of all lanes, which the host does not see one
//! by one. Twin: `cpu/cells/`.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::buffers::{self, LaneSlices, POOLS, Part, Pool, SearchBuffers};
use super::lane::Lane;
use super::layout::{FlyRecord, SearchHeader};
use super::pass::{CellsPart, CellsPass, LaneSize, Placed, Team, Variant};
use super::plan::{PIXEL_WORDS, Plan};
use super::shape::CellShape;
use super::state;
use crate::error::{Error, Result};
use crate::gpu::pace::Pace;
use crate::gpu::pools::{BufferRange, Growth, Needs};
use crate::model::Fly;
use crate::model::cells::{Course, Search, SearchLanes, SearchState, Stacks, Standing};
use crate::vk::{Device, DeviceKind, PassTime, ReadTicket, Recorder, Timing};

/// Most iterations of a submission to software Vulkan, which runs the lanes of a dispatch one after the other: all
/// lanes share this number.
const ITERATIONS_MAX: u32 = 16;
/// Most iterations of a submission to hardware. More would not make it busier.
const ITERATIONS_MAX_WIDE: u32 = 128;
/// Most cells that a submission to software Vulkan takes as far as their budget allows: tenths of a second of work.
/// An iteration of more of them takes several submissions.
const CELLS_MAX: u32 = 64;
/// The cells of the first submission to hardware of unknown speed.
const CELLS_FIRST: u64 = 256;
/// Evals that software Vulkan may lose when it is cut short: a tenth of a second of work.
const EVALS_BETWEEN_MARKS: u64 = 20_000;

/// Searches on a Vulkan device that share its dispatches. Their sizes, numbers of flies and rules may differ.
///
/// Memory bounds the number of lanes: several of them together may take half of the device's memory. No buffer may be
/// larger than shaders can see, so many lanes share several sets of buffers.
pub struct VulkanLanes {
    pub(super) device: Arc<Device>,
    pub(super) recorder: Recorder,
    pub(super) pass: CellsPass,
    kins: Vec<Kin>,
    /// Kins so far, those that are gone included.
    kin_count: u64,
    /// By number, without those that are free.
    pub(super) lanes: Vec<Option<Lane>>,
    /// Whether the rules on the device and the stages of the pass are those of the lanes.
    pub(super) is_arranged: bool,
    /// Of an iteration that takes several submissions, where the next one begins: cell and lane; zeros between
    /// iterations.
    next: (u32, u32),
    /// In cells that are taken as far as their budget allows.
    pace: Pace,
    /// Cells of the submission at hand.
    recorded: u64,
    /// Whether passes are recorded that work on lanes where they lie now, by the rules that are on the device. What is
    /// written to a lane or to the rules would reach the device before them.
    pub(super) is_spreading: bool,
}

/// Lanes of one variant, all or as many as buffers can hold. They share buffers that no other lanes use, so that
/// dispatches of different kins need no barrier between them.
struct Kin {
    variant: Variant,
    /// No other kin has had it.
    number: u64,
    buffers: SearchBuffers,
    /// The lanes in the order of their rules on the device.
    order: Vec<usize>,
}

impl VulkanLanes {
    /// Creates the searches of a device, none yet. With [`Timing::On`] each stage of a submission is timed, if the
    /// device has timestamps.
    ///
    /// # Errors
    /// If the device fails.
    pub fn create(device: &Arc<Device>, timing: Timing) -> Result<Self> {
        Ok(Self {
            device: Arc::clone(device),
            recorder: Recorder::create(device, "cells search", timing)?,
            pass: CellsPass::create(device)?,
            kins: Vec::new(),
            kin_count: 0,
            lanes: Vec::new(),
            is_arranged: false,
            next: (0, 0),
            pace: Pace::new(device.info().kind, CELLS_FIRST),
            recorded: 0,
            is_spreading: false,
        })
    }

    /// As [`SearchLanes::admit`], with the work of a cell cut otherwise than is best for the device.
    ///
    /// # Errors
    /// As of [`SearchLanes::admit`].
    pub fn admit_with_shape(
        &mut self,
        course: Course,
        first: Option<&[Fly]>,
        shape: CellShape,
    ) -> Result<Option<usize>> {
        state::check(&course)?;
        shape.check(self.device.info())?;
        let plan = Plan::new(&course);
        let variant = Variant::new(&course, shape);
        let needs = buffers::needs(&course, &plan, shape);
        let Some((kin, slices)) = self.take_slices(variant, &needs)? else { return Ok(None) };
        let number = self.lanes.iter().position(Option::is_none).unwrap_or(self.lanes.len());
        if number == self.lanes.len() {
            self.lanes.push(None);
        }
        self.lanes[number] = Some(Lane::new(course, plan, shape, (kin, slices)));
        if let Err(error) = self.begin(number, first) {
            self.dismiss(number);
            return Err(error);
        }
        Ok(Some(number))
    }

    /// Finds room for a lane among those of its variant, or in buffers of its own. Returns the number of its kin, too.
    fn take_slices(&mut self, variant: Variant, needs: &Needs<'_, POOLS>) -> Result<Option<(u64, LaneSlices)>> {
        self.flush()?;
        self.pass.disband();
        self.is_arranged = false;
        for place in 0..self.kins.len() {
            if self.kins[place].variant == variant
                && let Some(slices) = self.admit_to(place, needs)?
            {
                return Ok(Some((self.kins[place].number, slices)));
            }
        }
        let buffers = SearchBuffers::create(&self.device, &mut self.recorder)?;
        let number = self.kin_count;
        self.kin_count += 1;
        self.kins.push(Kin { variant, number, buffers, order: Vec::new() });
        let taken = self.admit_to(self.kins.len() - 1, needs);
        self.kins.retain(|kin| !kin.buffers.is_empty());
        Ok(taken?.map(|slices| (number, slices)))
    }

    /// Finds room for a lane in the buffers of a kin.
    fn admit_to(&mut self, place: usize, needs: &Needs<'_, POOLS>) -> Result<Option<LaneSlices>> {
        let others = self.kins.iter().enumerate().filter(|(other, _)| *other != place);
        // A lane alone may take what the device has; more of them share half of it.
        let bytes: u64 = others.map(|(_, kin)| kin.buffers.bytes()).sum();
        let bytes_max = (self.device.info().memory_bytes / 2).saturating_sub(bytes);
        let is_alone = self.lanes.iter().all(Option::is_none);
        let growth = if is_alone { Growth::Alone } else { Growth::Shared { bytes_max } };
        self.kins[place].buffers.admit(&mut self.recorder, needs, growth)
    }

    fn kin(&self, number: u64) -> &Kin {
        let kin = self.kins.iter().find(|kin| kin.number == number);
        kin.unwrap_or_else(|| panic!("kin {number} has no buffers"))
    }

    /// Where a lane's slice lies in the buffer of a part.
    pub(super) fn range(&self, number: usize, part: Part) -> BufferRange {
        let lane = self.lane(number);
        self.kin(lane.kin).buffers.range(part, &lane.slices)
    }

    /// Times of the stages of the last submission, by the stems of their shaders; empty unless created with timestamps.
    #[must_use]
    pub fn pass_times(&self) -> &[PassTime] {
        self.recorder.pass_times()
    }

    pub(super) fn lane(&self, lane: usize) -> &Lane {
        self.lanes[lane].as_ref().unwrap_or_else(|| no_lane(lane))
    }

    pub(super) fn lane_mut(&mut self, lane: usize) -> &mut Lane {
        self.lanes[lane].as_mut().unwrap_or_else(|| no_lane(lane))
    }

    /// Writes the beginning of a lane's slice.
    pub(super) fn write(&mut self, number: usize, part: Part, bytes: &[u8]) -> Result<()> {
        let BufferRange { buffer, offset, size_bytes } = self.range(number, part);
        if bytes.len() as u64 > size_bytes {
            return Err(Error::Internal(format!("{} bytes for the {size_bytes} of {part:?} of a lane", bytes.len())));
        }
        self.recorder.write_buffer(&buffer, offset, bytes)
    }

    /// Asks for the bytes of a lane's slice.
    fn ask_for(&mut self, number: usize, part: Part) -> Result<ReadTicket> {
        let BufferRange { buffer, offset, size_bytes } = self.range(number, part);
        self.recorder.read_buffer(&buffer, offset, size_bytes)
    }

    fn take<T: Pod + Zeroable>(&self, ticket: &ReadTicket) -> Result<Vec<T>> {
        let mut values = vec![T::zeroed(); ticket.size_bytes() as usize / size_of::<T>()];
        self.recorder.read_into(ticket, bytemuck::cast_slice_mut(&mut values))?;
        Ok(values)
    }

    /// The numbers of the lanes there are.
    fn numbers(&self) -> Vec<usize> {
        (0..self.lanes.len()).filter(|&number| self.lanes[number].is_some()).collect()
    }

    /// Puts the rules of all lanes on the device.
    pub(super) fn arrange(&mut self) -> Result<()> {
        self.flush()?;
        let numbers = self.numbers();
        let mut teams = Vec::new();
        for place in 0..self.kins.len() {
            let Kin { variant, number: kin, .. } = self.kins[place];
            let order: Vec<usize> = numbers.iter().copied().filter(|&number| self.lane(number).kin == kin).collect();
            let lanes = || order.iter().map(|&number| self.lane(number));
            let team = lanes().map(|lane| LaneSize::new(&lane.plan, lane.course.fly_count)).collect();
            let rules: Vec<_> =
                lanes().map(|lane| state::rules_record(&lane.course, &lane.plan, &lane.slices)).collect();
            let kin = &mut self.kins[place];
            self.recorder.write_buffer(kin.buffers.part(Part::Rules), 0, bytemuck::cast_slice(rules.as_flattened()))?;
            kin.order = order;
            teams.push(Team { variant, group: kin.buffers.bind(self.pass.any_pipeline())?, lanes: team });
        }
        self.pass.arrange(&teams)?;
        (self.is_arranged, self.next) = (true, (0, 0));
        Ok(())
    }

    /// Iterations after which about one of the busy lanes is done.
    fn iterations(&self, busy: &[usize]) -> u32 {
        let needed = |lane: &Lane| {
            let left = lane.wanted - lane.standing.rounds;
            // As many as rounds took so far, on average.
            lane.iterations.div_ceil(lane.standing.rounds.max(1)).max(1).saturating_mul(left)
        };
        let most = match self.device.info().kind {
            DeviceKind::Cpu => {
                let cells: u32 = busy.iter().map(|&number| self.lane(number).plan.cell_count).sum();
                (ITERATIONS_MAX / busy.len().max(1) as u32).min(CELLS_MAX / cells.max(1)).max(1)
            }
            _ => ITERATIONS_MAX_WIDE,
        };
        busy.iter().map(|&number| needed(self.lane(number))).min().unwrap_or(1).clamp(1, most)
    }

    /// Records what the lanes do in a submission.
    fn record(&mut self, busy: &[usize]) -> Result<()> {
        if !self.is_arranged {
            self.arrange()?;
        }
        let with_old_depths = self.placed(|_, lane| lane.has_old_depths.then_some(lane.plan.block_count() as u32))?;
        self.pass.record_depths(&mut self.recorder, &with_old_depths)?;
        self.keep_marks(busy)?;
        let (cells, lanes) = self.pass.cells();
        let all = u64::from(cells) * u64::from(lanes);
        let most = match self.device.info().kind {
            DeviceKind::Cpu => u64::from(CELLS_MAX.max(lanes)),
            _ => self.pace.units(),
        };
        if all > most || self.next != (0, 0) {
            let part = self.next_part((cells, lanes), most);
            self.recorded = part.cells.len() as u64 * part.lanes.len() as u64;
            return self.pass.record_part(&mut self.recorder, &part);
        }
        let iterations = self.iterations(busy).min((most / all.max(1)).min(u64::from(u32::MAX)) as u32).max(1);
        self.recorded = all * u64::from(iterations);
        self.pass.record(&mut self.recorder, iterations)
    }

    /// The next part of an iteration of so many cells and lanes: some cells of all lanes, or one cell of some.
    fn next_part(&mut self, (cells, lanes): (u32, u32), most: u64) -> CellsPart {
        let (cell, lane) = self.next;
        let most = most.min(u64::from(u32::MAX)) as u32;
        if lane == 0 && most >= lanes {
            let end = cell.saturating_add(most / lanes.max(1)).min(cells);
            self.next = if end == cells { (0, 0) } else { (end, 0) };
            return CellsPart { cells: cell..end, lanes: 0..lanes };
        }
        let end = lane.saturating_add(most).min(lanes);
        self.next = match (cell + 1 == cells, end == lanes) {
            (true, true) => (0, 0),
            (false, true) => (cell + 1, 0),
            (_, false) => (cell, end),
        };
        CellsPart { cells: cell..cell + 1, lanes: lane..end }
    }

    /// The lanes that need workgroups, with how many, by number and lane.
    pub(super) fn placed(&mut self, workgroups: impl Fn(usize, &Lane) -> Option<u32>) -> Result<Vec<Placed>> {
        let mut placed = Vec::new();
        for place in 0..self.kins.len() {
            let group = self.kins[place].buffers.bind(self.pass.any_pipeline())?;
            for (first_lane, &number) in (0..).zip(&self.kins[place].order) {
                if let Some(workgroups) = workgroups(number, self.lane(number)) {
                    placed.push(Placed { group: Arc::clone(&group), first_lane, workgroups });
                }
            }
        }
        Ok(placed)
    }

    pub(super) fn read_fly_records(&mut self, lanes: &[usize]) -> Result<Vec<Vec<FlyRecord>>> {
        let tickets = lanes.iter().map(|&lane| self.ask_for(lane, Part::Flies)).collect::<Result<Vec<_>>>()?;
        self.recorder.submit_and_wait()?;
        tickets.iter().map(|ticket| self.take(ticket)).collect()
    }
}

pub(super) fn no_lane(lane: usize) -> ! {
    panic!("lane {lane} was never admitted, or was dismissed")
}

impl SearchLanes for VulkanLanes {
    fn admit(&mut self, course: Course, first: Option<&[Fly]>) -> Result<Option<usize>> {
        state::check(&course)?;
        let shape = CellShape::for_device(self.device.info(), &course)?;
        self.admit_with_shape(course, first, shape)
    }

    fn dismiss(&mut self, lane: usize) {
        if let Some(Lane { slices, course, kin, .. }) = self.lanes[lane].take() {
            if let Some(kin) = self.kins.iter_mut().find(|other| other.number == kin) {
                kin.buffers.dismiss(&slices, &course.masks);
            }
            self.kins.retain(|kin| !kin.buffers.is_empty());
            self.pass.disband();
            self.is_arranged = false;
        }
    }

    fn course(&self, lane: usize) -> &Course {
        &self.lane(lane).course
    }

    fn standing(&self, lane: usize) -> Standing {
        self.lane(lane).standing
    }

    fn load(&mut self, lane: usize, flies: &[Fly]) -> Result<()> {
        self.begin(lane, Some(flies))
    }

    fn mark(&mut self, lane: usize) -> Result<()> {
        self.mark_lane(lane)
    }

    fn cut(&mut self, lane: usize) -> Result<()> {
        self.take_back(lane)
    }

    fn rounds_between_marks(&self, lane: usize) -> u32 {
        match self.device.info().kind {
            DeviceKind::Cpu => (EVALS_BETWEEN_MARKS / self.course(lane).evals_per_round().max(1)).max(1) as u32,
            _ => u32::MAX,
        }
    }

    fn ask(&mut self, lane: usize, rounds: u32) -> Result<()> {
        if self.lane(lane).has_old_pixels {
            self.lay_again(lane)?;
        }
        let Lane { wanted, has_failed, .. } = self.lane_mut(lane);
        if *has_failed {
            return Err(Error::Internal(format!("lane {lane} failed before and is asked for more")));
        }
        *wanted += rounds;
        let wanted = *wanted;
        let header = self.range(lane, Part::Header);
        let field = std::mem::offset_of!(SearchHeader, wanted) as u64;
        self.recorder.write_buffer(&header.buffer, header.offset + field, bytemuck::bytes_of(&wanted))
    }

    fn is_busy(&self, lane: usize) -> bool {
        self.lane(lane).is_busy()
    }

    fn work(&mut self) -> Result<()> {
        let busy: Vec<usize> = self.numbers().into_iter().filter(|&number| self.is_busy(number)).collect();
        if busy.is_empty() {
            return Ok(());
        }
        self.record(&busy)?;
        // The headers of a kin lie side by side, so one copy brings them all.
        let mut tickets = Vec::with_capacity(self.kins.len());
        for Kin { number, buffers, .. } in &self.kins {
            let headers = buffers.part(Part::Header);
            tickets.push((*number, self.recorder.read_buffer(headers, 0, headers.size_bytes())?));
        }
        self.recorder.submit_and_wait()?;
        self.is_spreading = false;
        self.pace.note(self.recorded, self.recorder.took());
        for (kin, ticket) in tickets {
            let headers = self.take::<SearchHeader>(&ticket)?;
            for lane in self.lanes.iter_mut().flatten().filter(|lane| lane.kin == kin) {
                lane.has_old_depths = false;
                if lane.is_busy() {
                    lane.absorb(&headers[lane.slices.first(Pool::Lanes) as usize]);
                }
            }
        }
        if !self.lanes.iter().flatten().any(Lane::is_busy) {
            self.next = (0, 0);
        }
        Ok(())
    }

    fn failure(&mut self, lane: usize) -> Option<Error> {
        self.lane_mut(lane).failure.take()
    }

    fn renormalise(&mut self, lanes: &[usize]) -> Result<()> {
        self.spread_depths(lanes)
    }

    fn read_back(&mut self, lane: usize) -> Result<SearchState> {
        let [flies, steps, fitness] = [Part::Flies, Part::Steps, Part::Fitness].map(|part| self.ask_for(lane, part));
        let (flies, steps, fitness) = (flies?, steps?, fitness?);
        self.recorder.submit_and_wait()?;
        let flies: Vec<FlyRecord> = self.take(&flies)?;
        let fitness: Vec<i32> = self.take(&fitness)?;
        Ok(SearchState {
            flies: flies.iter().map(FlyRecord::fly).collect(),
            steps: self.take(&steps)?,
            fitness: fitness.into_iter().map(i64::from).collect(),
        })
    }

    fn read_back_stacks(&mut self, lane: usize) -> Result<Stacks> {
        if self.lane(lane).has_old_pixels {
            return self.twin(lane)?.0.read_back_stacks();
        }
        let (pixels, stacks) = (self.ask_for(lane, Part::Pixels)?, self.ask_for(lane, Part::Stacks)?);
        self.recorder.submit_and_wait()?;
        let (pixels, words): (Vec<u32>, Vec<u32>) = (self.take(&pixels)?, self.take(&stacks)?);
        let plan = &self.lane(lane).plan;
        debug_assert_eq!(pixels.len(), plan.pixel_count() * PIXEL_WORDS);
        Ok(state::stacks(plan, &pixels, &words))
    }
}
