//! Lanes whose round is cut short: they are taken back to where it began.

use std::sync::Arc;

use super::buffers::Part;
use super::lane::Lane;
use super::lanes::{VulkanLanes, no_lane};
use super::layout::FlyRecord;
use super::mark::{Mark, PARTS};
use super::state;
use crate::cpu::cells::CpuSearch;
use crate::error::{Error, Result};
use crate::gpu::pools::BufferRange;
use crate::model::Fly;
use crate::model::cells::Search;

impl VulkanLanes {
    /// The ranges of what marks copy.
    fn marked_ranges(&self, number: usize) -> [BufferRange; PARTS.len()] {
        PARTS.map(|part| self.range(number, part))
    }

    /// Marks where a lane is. The copy is made by the next submission that lets it go on.
    pub(super) fn mark_lane(&mut self, number: usize) -> Result<()> {
        let ranges = self.marked_ranges(number);
        let device = Arc::clone(&self.device);
        let Lane { mark, standing, iterations, .. } = self.lane_mut(number);
        let mark = match mark {
            Some(mark) => mark,
            None => mark.insert(Mark::create(&device, &ranges)?),
        };
        (mark.standing, mark.iterations, mark.is_due) = (*standing, *iterations, true);
        Ok(())
    }

    /// Records the copies that are due before these lanes go on.
    pub(super) fn keep_marks(&mut self, busy: &[usize]) -> Result<()> {
        for &number in busy {
            let ranges = self.marked_ranges(number);
            let mark = self.lanes[number].as_mut().and_then(|lane| lane.mark.as_mut());
            if let Some(mark) = mark.filter(|mark| mark.is_due) {
                mark.record_keep(&mut self.recorder, &ranges)?;
            }
        }
        Ok(())
    }

    /// Takes a lane back to its mark.
    pub(super) fn take_back(&mut self, number: usize) -> Result<()> {
        let ranges = self.marked_ranges(number);
        let lane = self.lane_mut(number);
        let Some(mark) = lane.mark.as_ref() else {
            return Err(Error::Internal(format!("lane {number} is cut short and was never marked")));
        };
        (lane.standing, lane.iterations, lane.wanted) = (mark.standing, mark.iterations, mark.standing.rounds);
        let header = lane.header();
        self.write(number, Part::Header, bytemuck::bytes_of(&header))?;
        self.end_cells(number)?;
        let Lane { mark, has_old_pixels, .. } = self.lanes[number].as_mut().unwrap_or_else(|| no_lane(number));
        if let Some(mark) = mark.as_ref().filter(|mark| !mark.is_due) {
            *has_old_pixels = true;
            mark.record_restore(&mut self.recorder, &ranges)?;
        }
        self.recorder.submit_and_wait()
    }

    /// The search of a lane on the CPU, and its flies, which alone decide what is on the pixels.
    pub(super) fn twin(&mut self, number: usize) -> Result<(CpuSearch, Vec<Fly>)> {
        let records = self.read_fly_records(&[number])?;
        let flies: Vec<Fly> = records.iter().flatten().map(FlyRecord::fly).collect();
        let mut twin = CpuSearch::new(self.lane(number).course.clone());
        twin.load(&flies)?;
        if twin.read_back()?.flies != flies {
            return Err(Error::Internal(format!("the flies of lane {number} cannot be laid again")));
        }
        Ok((twin, flies))
    }

    /// Lays the pixels of a lane that was taken back.
    pub(super) fn lay_again(&mut self, number: usize) -> Result<()> {
        let (mut twin, flies) = self.twin(number)?;
        let Lane { course, plan, .. } = self.lane(number);
        let (pixels, stacks) = state::state_words(course, plan, &flies, &twin.read_back_stacks()?);
        self.write(number, Part::Pixels, bytemuck::cast_slice(&pixels))?;
        self.write(number, Part::Stacks, bytemuck::cast_slice(&stacks))?;
        let lane = self.lane_mut(number);
        (lane.has_old_pixels, lane.has_old_depths) = (false, false);
        Ok(())
    }
}
