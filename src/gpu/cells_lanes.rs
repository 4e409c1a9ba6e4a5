//! The cells searches of a Vulkan device: whole rounds stay on the device, many in a submission, of all lanes. Twin: `cpu/cells/`.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use super::cells_layout::{CellRecord, FlyRecord, SearchHeader};
use super::cells_pass::{CellsPass, Team, Variant};
use super::cells_pools::{LaneSlices, Part, Pools};
use super::cells_shape::CellShape;
use super::cells_state::{self, PIXEL_WORDS, Plan};
use crate::cpu::cells::CpuSearch;
use crate::error::{Error, Result};
use crate::model::Fly;
use crate::model::cells::rules::STEP_FIRST;
use crate::model::cells::{Course, Search, SearchLanes, SearchState, Stacks, Standing, depths};
use crate::vk::{Buffer, Device, DeviceKind, PassTime, ReadTicket, Recorder, Timing};

/// Most iterations of a submission: with the budget of a dispatch well below a watchdog's second. Software Vulkan has no watchdog, but
/// does the lanes of a dispatch one after the other; there all lanes share them.
const ITERATIONS_MAX: u32 = 16;

/// A search among those of the device.
struct Lane {
    course: Course,
    plan: Plan,
    variant: Variant,
    slices: LaneSlices,
    budget: u32,
    standing: Standing,
    /// The objective of the population that was loaded.
    objective: i64,
    /// Rounds that it was asked for, with those that it made.
    wanted: u32,
    /// Iterations that had something to do so far.
    iterations: u32,
    has_failed: bool,
    failure: Option<Error>,
    /// Whether the pixels still hold depths from before the last spreading.
    has_old_depths: bool,
}

/// Searches on a Vulkan device, whose dispatches serve all of them. Pictures of other sizes, numbers of flies and rules share the device.
///
/// Memory bounds the number of lanes: no pool of theirs may be larger than a storage buffer of the device, nor all together, where there
/// are several lanes, than half of its memory.
pub struct VulkanLanes {
    device: Arc<Device>,
    recorder: Recorder,
    pass: CellsPass,
    kins: Vec<Kin>,
    /// By number; lanes that are free are none.
    lanes: Vec<Option<Lane>>,
    /// Whether the device knows who is there.
    is_arranged: bool,
}

/// Lanes that are compiled alike for. They share buffers, of which no other lane has a part: dispatches for different buffers need no
/// barrier between them.
struct Kin {
    variant: Variant,
    pools: Pools,
    /// The lanes in the order of their rules on the device.
    order: Vec<usize>,
}

impl VulkanLanes {
    /// Lanes on a device, none yet. With [`Timing::On`] each stage of a submission is timed, where the device has timestamps.
    ///
    /// # Errors
    /// If the device fails.
    pub fn create(device: &Arc<Device>, timing: Timing) -> Result<Self> {
        Ok(Self {
            device: Arc::clone(device),
            recorder: Recorder::create(device, "cells search", timing)?,
            pass: CellsPass::create(device)?,
            kins: Vec::new(),
            lanes: Vec::new(),
            is_arranged: false,
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
        cells_state::check(&course)?;
        shape.check(self.device.info())?;
        let plan = Plan::new(&course);
        let variant = Variant::new(&course, shape);
        let Some(slices) = self.take_slices(&course, variant, (&plan, shape))? else { return Ok(None) };
        let number = self.lanes.iter().position(Option::is_none).unwrap_or(self.lanes.len());
        if number == self.lanes.len() {
            self.lanes.push(None);
        }
        self.lanes[number] = Some(Lane {
            variant,
            course,
            plan,
            slices,
            budget: shape.budget,
            standing: Standing::default(),
            objective: 0,
            wanted: 0,
            iterations: 0,
            has_failed: false,
            failure: None,
            has_old_depths: false,
        });
        self.begin(number, first)?;
        Ok(Some(number))
    }

    /// Finds room for a lane among those of its variant.
    fn take_slices(
        &mut self,
        course: &Course,
        variant: Variant,
        cut: (&Plan, CellShape),
    ) -> Result<Option<LaneSlices>> {
        self.pass.disband();
        self.is_arranged = false;
        let place = match self.kins.iter().position(|kin| kin.variant == variant) {
            Some(place) => place,
            None => {
                let pools = Pools::create(&self.device, &mut self.recorder)?;
                self.kins.push(Kin { variant, pools, order: Vec::new() });
                self.kins.len() - 1
            }
        };
        let others = self.kins.iter().filter(|kin| kin.variant != variant).map(|kin| kin.pools.bytes());
        // A lane alone may take what the device has; more of them share half of it.
        let share = (self.device.info().memory_bytes / 2).saturating_sub(others.sum());
        let share = self.lanes.iter().any(Option::is_some).then_some(share);
        let taken = self.kins[place].pools.admit(&mut self.recorder, course, cut, share);
        if self.kins[place].pools.is_empty() {
            self.kins.remove(place);
        }
        taken
    }

    fn kin(&self, variant: Variant) -> &Kin {
        let kin = self.kins.iter().find(|kin| kin.variant == variant);
        kin.unwrap_or_else(|| panic!("lanes of {variant:?} have no buffers"))
    }

    /// The buffer of a part, and where a lane's slice begins in it and how long it is, in bytes.
    fn range(&self, number: usize, part: Part) -> (Arc<Buffer>, u64, u64) {
        let lane = self.lane(number);
        self.kin(lane.variant).pools.range(part, &lane.slices)
    }

    /// Times of the stages of the last submission, by the stems of their shaders; empty unless created with timestamps.
    #[must_use]
    pub fn pass_times(&self) -> &[PassTime] {
        self.recorder.pass_times()
    }

    fn lane(&self, lane: usize) -> &Lane {
        self.lanes[lane].as_ref().unwrap_or_else(|| no_lane(lane))
    }

    fn lane_mut(&mut self, lane: usize) -> &mut Lane {
        self.lanes[lane].as_mut().unwrap_or_else(|| no_lane(lane))
    }

    /// Writes the state that a lane begins with.
    fn begin(&mut self, number: usize, first: Option<&[Fly]>) -> Result<()> {
        let lane = self.lane(number);
        let (course, plan) = (lane.course.clone(), lane.plan);
        self.write(number, Part::Guide, bytemuck::cast_slice(&course.guide.samples))?;
        self.write(number, Part::Header, bytemuck::bytes_of(&SearchHeader::default()))?;
        self.write(number, Part::Cells, bytemuck::cast_slice(&vec![CellRecord::default(); plan.cell_count as usize]))?;
        let standing = match first {
            Some(flies) => self.write_flies(number, flies)?,
            None => self.write_bare(number)?,
        };
        if let Some(flies) = first.filter(|_| course.rules.leash > 0) {
            let origins: Vec<FlyRecord> = flies.iter().map(FlyRecord::new).collect();
            self.write(number, Part::Origins, bytemuck::cast_slice(&origins))?;
        }
        let lane = self.lane_mut(number);
        (lane.standing, lane.objective) = (standing, standing.objective);
        (lane.wanted, lane.iterations, lane.has_old_depths) = (0, 0, false);
        (lane.has_failed, lane.failure) = (false, None);
        Ok(())
    }

    /// Without flies the state is known. Stacks that are empty may hold anything.
    fn write_bare(&mut self, number: usize) -> Result<Standing> {
        let Lane { course, plan, .. } = self.lane(number);
        let fly_count = course.fly_count;
        let (pixels, objective) = cells_state::bare_words(course, plan);
        self.write(number, Part::Flies, bytemuck::cast_slice(&vec![FlyRecord::new(&Fly::ABSENT); fly_count]))?;
        self.write(number, Part::Pixels, bytemuck::cast_slice(&pixels))?;
        self.write(number, Part::Steps, bytemuck::cast_slice(&vec![STEP_FIRST; fly_count]))?;
        self.write(number, Part::Fitness, bytemuck::cast_slice(&vec![0_i32; fly_count]))?;
        Ok(Standing { objective, ..Standing::default() })
    }

    fn write_flies(&mut self, number: usize, flies: &[Fly]) -> Result<Standing> {
        // It happens once, so the twin's answer is good enough, and exact.
        let Lane { course, plan, .. } = self.lane(number);
        let mut twin = CpuSearch::new(course.clone());
        twin.load(flies)?;
        let SearchState { flies, steps, fitness } = twin.read_back()?;
        let (pixels, stacks) = cells_state::state_words(course, plan, &flies, &twin.read_back_stacks()?);
        let records: Vec<FlyRecord> = flies.iter().map(FlyRecord::new).collect();
        let fitness: Vec<i32> = fitness.into_iter().map(|fitness| fitness as i32).collect();
        self.write(number, Part::Flies, bytemuck::cast_slice(&records))?;
        self.write(number, Part::Pixels, bytemuck::cast_slice(&pixels))?;
        self.write(number, Part::Steps, bytemuck::cast_slice(&steps))?;
        self.write(number, Part::Fitness, bytemuck::cast_slice(&fitness))?;
        self.write(number, Part::Stacks, bytemuck::cast_slice(&stacks))?;
        Ok(twin.standing())
    }

    /// Writes the beginning of a lane's slice.
    fn write(&mut self, number: usize, part: Part, bytes: &[u8]) -> Result<()> {
        let (buffer, offset, size) = self.range(number, part);
        if bytes.len() as u64 > size {
            return Err(Error::Internal(format!("{} bytes for the {size} of {part:?} of a lane", bytes.len())));
        }
        self.recorder.write_buffer(&buffer, offset, bytes)
    }

    /// Asks for a lane's slice.
    fn ask_for(&mut self, number: usize, part: Part) -> Result<ReadTicket> {
        let (buffer, offset, size) = self.range(number, part);
        self.recorder.read_buffer(&buffer, offset, size)
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
    fn arrange(&mut self) -> Result<()> {
        let numbers = self.numbers();
        let mut teams = Vec::new();
        for place in 0..self.kins.len() {
            let variant = self.kins[place].variant;
            let order: Vec<usize> =
                numbers.iter().copied().filter(|&number| self.lane(number).variant == variant).collect();
            let lanes = || order.iter().map(|&number| self.lane(number));
            let team: Vec<(Plan, usize)> = lanes().map(|lane| (lane.plan, lane.course.fly_count)).collect();
            let rules: Vec<_> =
                lanes().map(|lane| cells_state::rules_record(&lane.course, &lane.plan, &lane.slices)).collect();
            let Kin { pools, order: told, .. } = &mut self.kins[place];
            self.recorder.write_buffer(pools.part(Part::Rules), 0, bytemuck::cast_slice(&rules))?;
            *told = order;
            teams.push(Team { variant, group: pools.bind(self.pass.any_pipeline())?, lanes: team });
        }
        self.pass.arrange(&teams)?;
        self.is_arranged = true;
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
            DeviceKind::Cpu => (ITERATIONS_MAX / busy.len().max(1) as u32).max(1),
            _ => ITERATIONS_MAX,
        };
        busy.iter().map(|&number| needed(self.lane(number))).min().unwrap_or(1).clamp(1, most)
    }

    /// Records what the lanes do in a submission.
    fn record(&mut self, busy: &[usize]) -> Result<()> {
        if !self.is_arranged {
            self.arrange()?;
        }
        let mut with_old_depths = Vec::new();
        for place in 0..self.kins.len() {
            let group = self.kins[place].pools.bind(self.pass.any_pipeline())?;
            for (first_lane, &number) in (0..).zip(&self.kins[place].order) {
                let lane = self.lane(number);
                if lane.has_old_depths {
                    with_old_depths.push((Arc::clone(&group), first_lane, lane.plan));
                }
            }
        }
        self.pass.record_depths(&mut self.recorder, &with_old_depths)?;
        let iterations = self.iterations(busy);
        self.pass.record(&mut self.recorder, iterations)
    }

    fn read_fly_records(&mut self, lanes: &[usize]) -> Result<Vec<Vec<FlyRecord>>> {
        let tickets = lanes.iter().map(|&lane| self.ask_for(lane, Part::Flies)).collect::<Result<Vec<_>>>()?;
        self.recorder.submit_and_wait()?;
        tickets.iter().map(|ticket| self.take(ticket)).collect()
    }
}

fn no_lane(lane: usize) -> ! {
    panic!("lane {lane} was never admitted, or was dismissed")
}

impl Lane {
    fn is_busy(&self) -> bool {
        self.standing.rounds < self.wanted && !self.has_failed
    }

    /// Takes what the header says after a submission.
    fn absorb(&mut self, header: &SearchHeader) {
        if header.overrun != 0 {
            self.has_failed = true;
            self.failure = Some(Error::Internal(format!(
                "a step of cell {} needs more than the {} turns of loops that a dispatch of the cells pass may take",
                header.overrun - 1,
                self.budget
            )));
            return;
        }
        let wide = |low: u32, high: u32| u64::from(low) | u64::from(high) << 32;
        self.standing = Standing {
            rounds: header.round,
            evals: wide(header.evals_low, header.evals_high),
            births: wide(header.births_low, header.births_high),
            accepted: wide(header.accepted_low, header.accepted_high),
            objective: self.objective + wide(header.change_low, header.change_high) as i64,
        };
        self.iterations = header.iterations;
    }
}

impl SearchLanes for VulkanLanes {
    fn admit(&mut self, course: Course, first: Option<&[Fly]>) -> Result<Option<usize>> {
        cells_state::check(&course)?;
        let shape = CellShape::for_device(self.device.info(), &course)?;
        self.admit_with_shape(course, first, shape)
    }

    fn dismiss(&mut self, lane: usize) {
        if let Some(Lane { slices, course, variant, .. }) = self.lanes[lane].take() {
            if let Some(kin) = self.kins.iter_mut().find(|kin| kin.variant == variant) {
                kin.pools.dismiss(&slices, &course.masks);
            }
            self.kins.retain(|kin| !kin.pools.is_empty());
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

    fn ask(&mut self, lane: usize, rounds: u32) -> Result<()> {
        let Lane { wanted, has_failed, .. } = self.lane_mut(lane);
        if *has_failed {
            return Err(Error::Internal(format!("lane {lane} failed before and is asked for more")));
        }
        *wanted += rounds;
        let wanted = *wanted;
        let (buffer, offset, _) = self.range(lane, Part::Header);
        let field = std::mem::offset_of!(SearchHeader, wanted) as u64;
        self.recorder.write_buffer(&buffer, offset + field, bytemuck::bytes_of(&wanted))
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
        let tickets = busy.iter().map(|&number| self.ask_for(number, Part::Header)).collect::<Result<Vec<_>>>()?;
        self.recorder.submit_and_wait()?;
        for lane in self.lanes.iter_mut().flatten() {
            lane.has_old_depths = false;
        }
        for (number, ticket) in busy.into_iter().zip(tickets) {
            let header = self.take::<SearchHeader>(&ticket)?[0];
            self.lane_mut(number).absorb(&header);
        }
        Ok(())
    }

    fn failure(&mut self, lane: usize) -> Option<Error> {
        self.lane_mut(lane).failure.take()
    }

    fn renormalise(&mut self, lanes: &[usize]) -> Result<()> {
        let mut records = self.read_fly_records(lanes)?;
        records.par_iter_mut().for_each(|records| {
            let mut flies: Vec<Fly> = records.iter().map(FlyRecord::fly).collect();
            depths::spread(&mut flies);
            records.iter_mut().zip(&flies).for_each(|(record, fly)| record.z = fly.z);
        });
        for (&lane, records) in lanes.iter().zip(&records) {
            self.write(lane, Part::Flies, bytemuck::cast_slice(records))?;
            self.lane_mut(lane).has_old_depths = true;
        }
        Ok(())
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
        let (pixels, stacks) = (self.ask_for(lane, Part::Pixels)?, self.ask_for(lane, Part::Stacks)?);
        self.recorder.submit_and_wait()?;
        let (pixels, words): (Vec<u32>, Vec<u32>) = (self.take(&pixels)?, self.take(&stacks)?);
        let plan = &self.lane(lane).plan;
        debug_assert_eq!(pixels.len(), plan.pixel_count() * PIXEL_WORDS);
        Ok(cells_state::stacks(plan, &pixels, &words))
    }
}
