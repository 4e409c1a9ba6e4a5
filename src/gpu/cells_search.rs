//! The cells search of a Vulkan device: whole rounds stay on the device, many in a submission. Twin: `cpu/cells/`.

use std::sync::Arc;

use super::cells_layout::{CellRecord, FlyRecord, SearchHeader};
use super::cells_pass::{CellShape, CellsPass};
use super::cells_state::{self, PIXEL_WORDS, Plan};
use crate::cpu::cells::CpuSearch;
use crate::error::{Error, Result};
use crate::model::Fly;
use crate::model::cells::{Course, Search, SearchState, Stacks, Standing, depths};
use crate::vk::{Buffer, Device, Recorder, Timing};

/// Most iterations of a submission: with the budget of a dispatch well below a watchdog's second.
const ITERATIONS_MAX: u32 = 16;

/// A search on a Vulkan device.
pub struct VulkanSearch {
    course: Course,
    plan: Plan,
    recorder: Recorder,
    pass: CellsPass,
    standing: Standing,
    /// The objective of the population that was loaded.
    objective: i64,
}

impl VulkanSearch {
    /// A search that begins with absent flies.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if its numbers do not fit the device; or if the device fails.
    pub fn new(device: &Arc<Device>, course: Course) -> Result<Self> {
        cells_state::check(&course)?;
        let shape = CellShape::for_device(device.info(), &course)?;
        Self::with_shape(device, course, shape)
    }

    /// As [`VulkanSearch::new`], with the work of a cell cut otherwise than is best for the device.
    ///
    /// # Errors
    /// As of [`VulkanSearch::new`].
    pub fn with_shape(device: &Arc<Device>, course: Course, shape: CellShape) -> Result<Self> {
        cells_state::check(&course)?;
        let mut recorder = Recorder::create(device, "cells search", Timing::Off)?;
        let pass = CellsPass::create(device, &mut recorder, &course, shape)?;
        let plan = Plan::new(&course);
        let mut search = Self { course, plan, recorder, pass, standing: Standing::default(), objective: 0 };
        search.load(&vec![Fly::ABSENT; search.course.fly_count])?;
        Ok(search)
    }

    /// The whole of a buffer, read after what was recorded.
    fn read<T: bytemuck::Pod>(&mut self, buffer: &Arc<Buffer>, count: usize) -> Result<Vec<T>> {
        let ticket = self.recorder.read_buffer(buffer, 0, (count * size_of::<T>()) as u64)?;
        self.recorder.submit_and_wait()?;
        let mut values = vec![T::zeroed(); count];
        self.recorder.read_into(&ticket, bytemuck::cast_slice_mut(&mut values))?;
        Ok(values)
    }

    fn read_flies(&mut self) -> Result<Vec<FlyRecord>> {
        let buffer = Arc::clone(&self.pass.buffers.flies);
        self.read(&buffer, self.course.fly_count)
    }

    fn read_pixels(&mut self) -> Result<Vec<u32>> {
        let buffer = Arc::clone(&self.pass.buffers.pixels);
        self.read(&buffer, self.plan.pixel_count() * PIXEL_WORDS)
    }

    /// Runs so many iterations, and takes what the header then says. Returns the iterations that had something to do so far.
    fn iterate(&mut self, iterations: u32) -> Result<u32> {
        self.pass.record(&mut self.recorder, iterations)?;
        let buffer = Arc::clone(&self.pass.buffers.header);
        let header = self.read::<SearchHeader>(&buffer, 1)?[0];
        if header.overrun != 0 {
            return Err(Error::Internal(format!(
                "a step of cell {} needs more than the {} turns of loops that a dispatch of the cells pass may take",
                header.overrun - 1,
                self.pass.budget()
            )));
        }
        let wide = |low: u32, high: u32| u64::from(low) | u64::from(high) << 32;
        self.standing = Standing {
            rounds: header.round,
            evals: wide(header.evals_low, header.evals_high),
            births: wide(header.births_low, header.births_high),
            accepted: wide(header.accepted_low, header.accepted_high),
            objective: self.objective + wide(header.change_low, header.change_high) as i64,
        };
        Ok(header.iterations)
    }
}

impl Search for VulkanSearch {
    fn course(&self) -> &Course {
        &self.course
    }

    fn load(&mut self, flies: &[Fly]) -> Result<()> {
        // It happens once, so the twin's answer is good enough, and exact.
        let mut twin = CpuSearch::new(self.course.clone());
        twin.load(flies)?;
        let SearchState { flies, steps, fitness } = twin.read_back()?;
        let (pixels, stacks) = cells_state::pixel_words(&self.course, &self.plan, &flies, &twin.read_back_stacks()?);
        let records: Vec<FlyRecord> = flies.iter().map(FlyRecord::new).collect();
        let fitness: Vec<i32> = fitness.into_iter().map(|fitness| fitness as i32).collect();
        let cells = vec![CellRecord::default(); self.plan.cell_count as usize];
        let (recorder, buffers) = (&mut self.recorder, &self.pass.buffers);
        for (buffer, bytes) in [
            (&buffers.header, bytemuck::bytes_of(&SearchHeader::default())),
            (&buffers.flies, bytemuck::cast_slice(&records)),
            (&buffers.cells, bytemuck::cast_slice(&cells)),
            (&buffers.pixels, bytemuck::cast_slice(&pixels)),
            (&buffers.steps, bytemuck::cast_slice(&steps)),
            (&buffers.fitness, bytemuck::cast_slice(&fitness)),
            (&buffers.stacks, bytemuck::cast_slice(&stacks)),
        ] {
            recorder.write_buffer(buffer, 0, bytes)?;
        }
        recorder.submit_and_wait()?;
        self.standing = twin.standing();
        self.objective = self.standing.objective;
        Ok(())
    }

    fn advance(&mut self, rounds: u32) -> Result<()> {
        let wanted = self.standing.rounds + rounds;
        let offset = std::mem::offset_of!(SearchHeader, wanted) as u64;
        self.recorder.write_buffer(&self.pass.buffers.header, offset, bytemuck::bytes_of(&wanted))?;
        let mut iterations = rounds;
        while self.standing.rounds < wanted {
            let made = self.iterate(iterations.clamp(1, ITERATIONS_MAX))?;
            // As many as rounds took so far, on average.
            let per_round = made.div_ceil(self.standing.rounds.max(1));
            iterations = per_round.saturating_mul(wanted - self.standing.rounds);
        }
        Ok(())
    }

    fn renormalise(&mut self) -> Result<()> {
        let mut flies: Vec<Fly> = self.read_flies()?.iter().map(FlyRecord::fly).collect();
        depths::spread(&mut flies);
        let flies: Vec<FlyRecord> = flies.iter().map(FlyRecord::new).collect();
        let mut pixels = self.read_pixels()?;
        cells_state::set_depths(&mut pixels, &flies);
        self.recorder.write_buffer(&self.pass.buffers.flies, 0, bytemuck::cast_slice(&flies))?;
        self.recorder.write_buffer(&self.pass.buffers.pixels, 0, bytemuck::cast_slice(&pixels))?;
        self.recorder.submit_and_wait()
    }

    fn standing(&self) -> Standing {
        self.standing
    }

    fn read_back(&mut self) -> Result<SearchState> {
        let flies = self.read_flies()?.iter().map(FlyRecord::fly).collect();
        let (steps, fitness) = (Arc::clone(&self.pass.buffers.steps), Arc::clone(&self.pass.buffers.fitness));
        let fly_count = self.course.fly_count;
        let steps = self.read(&steps, fly_count)?;
        let fitness = self.read::<i32>(&fitness, fly_count)?.into_iter().map(i64::from).collect();
        Ok(SearchState { flies, steps, fitness })
    }

    fn read_back_stacks(&mut self) -> Result<Stacks> {
        let pixels = self.read_pixels()?;
        let buffer = Arc::clone(&self.pass.buffers.stacks);
        let words: Vec<u32> = self.read(&buffer, self.plan.stack_words())?;
        Ok(cells_state::stacks(&self.plan, &pixels, &words))
    }
}
