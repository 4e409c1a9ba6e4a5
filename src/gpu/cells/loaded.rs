//! Lanes that begin: the state that is written for them.

use super::buffers::Part;
use super::lane::Lane;
use super::lanes::VulkanLanes;
use super::layout::{CellRecord, FlyRecord, SearchHeader};
use super::state;
use crate::cpu::cells::CpuSearch;
use crate::error::Result;
use crate::model::Fly;
use crate::model::cells::rules::STEP_FIRST;
use crate::model::cells::{Search, SearchState, Standing};

impl VulkanLanes {
    /// Writes the state that a lane begins with.
    pub(super) fn begin(&mut self, number: usize, first: Option<&[Fly]>) -> Result<()> {
        self.flush()?;
        let lane = self.lane(number);
        let course = lane.course.clone();
        self.write(number, Part::Guide, bytemuck::cast_slice(&course.guide.samples))?;
        self.write(number, Part::Header, bytemuck::bytes_of(&SearchHeader::default()))?;
        self.end_cells(number)?;
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
        lane.has_old_pixels = false;
        Ok(())
    }

    /// Takes all work from the cells of a lane.
    pub(super) fn end_cells(&mut self, number: usize) -> Result<()> {
        let records = vec![CellRecord::DONE; self.lane(number).plan.cell_count as usize];
        self.write(number, Part::Cells, bytemuck::cast_slice(&records))
    }

    /// Without flies the state is known. Stacks that are empty may hold anything.
    fn write_bare(&mut self, number: usize) -> Result<Standing> {
        let Lane { course, plan, .. } = self.lane(number);
        let fly_count = course.fly_count;
        let (pixels, objective) = state::bare_words(course, plan);
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
        let (pixels, stacks) = state::state_words(course, plan, &flies, &twin.read_back_stacks()?);
        let records: Vec<FlyRecord> = flies.iter().map(FlyRecord::new).collect();
        let fitness: Vec<i32> = fitness.into_iter().map(|fitness| fitness as i32).collect();
        self.write(number, Part::Flies, bytemuck::cast_slice(&records))?;
        self.write(number, Part::Pixels, bytemuck::cast_slice(&pixels))?;
        self.write(number, Part::Steps, bytemuck::cast_slice(&steps))?;
        self.write(number, Part::Fitness, bytemuck::cast_slice(&fitness))?;
        self.write(number, Part::Stacks, bytemuck::cast_slice(&stacks))?;
        Ok(twin.standing())
    }
}
