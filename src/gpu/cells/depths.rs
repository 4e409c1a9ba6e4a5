//! Depths of lanes are spread evenly: on the device, which need not wait for the host then, or by the host.

use rayon::prelude::*;

use super::buffers::Part;
use super::lane::Lane;
use super::lanes::VulkanLanes;
use super::layout::FlyRecord;
use super::pass::FLIES_PER_SPREAD;
use crate::error::Result;
use crate::model::Fly;
use crate::model::cells::depths;
use crate::vk::DeviceKind;

/// Most flies whose depths hardware spreads: each is compared with all others.
const SPREAD_MAX: usize = 1 << 15;

impl VulkanLanes {
    /// Runs what is recorded and must not wait.
    pub(super) fn flush(&mut self) -> Result<()> {
        if std::mem::take(&mut self.is_spreading) { self.recorder.submit_and_wait() } else { Ok(()) }
    }

    /// Spreads the depths of lanes that are not busy.
    pub(super) fn spread_depths(&mut self, lanes: &[usize]) -> Result<()> {
        // Software would compare flies on the cores that sort them faster.
        let is_software = self.device.info().kind == DeviceKind::Cpu;
        let (here, there): (Vec<usize>, Vec<usize>) =
            lanes.iter().partition(|&&lane| is_software || self.lane(lane).course.fly_count > SPREAD_MAX);
        self.spread_there(&there)?;
        if here.is_empty() {
            return Ok(());
        }
        let mut records = self.read_fly_records(&here)?;
        records.par_iter_mut().for_each(|records| {
            let mut flies: Vec<Fly> = records.iter().map(FlyRecord::fly).collect();
            depths::spread(&mut flies);
            records.iter_mut().zip(&flies).for_each(|(record, fly)| record.z = fly.z);
        });
        for (&lane, records) in here.iter().zip(&records) {
            self.write(lane, Part::Flies, bytemuck::cast_slice(records))?;
            self.lane_mut(lane).has_old_depths = true;
        }
        Ok(())
    }

    /// Spreads depths on the device, before its next work.
    fn spread_there(&mut self, lanes: &[usize]) -> Result<()> {
        if lanes.is_empty() {
            return Ok(());
        }
        if !self.is_arranged {
            self.arrange()?;
        }
        let is_meant = |number: usize, lane: &Lane| {
            lanes.contains(&number).then(|| (lane.course.fly_count as u32).div_ceil(FLIES_PER_SPREAD))
        };
        let placed = self.placed(is_meant)?;
        self.pass.record_spread(&mut self.recorder, &placed)?;
        self.is_spreading = true;
        for &lane in lanes {
            self.lane_mut(lane).has_old_depths = true;
        }
        Ok(())
    }
}
