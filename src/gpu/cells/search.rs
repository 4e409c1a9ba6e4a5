//! One search on a Vulkan device: lanes of which there is one.

use std::sync::Arc;

use super::lanes::VulkanLanes;
use super::shape::CellShape;
use super::state;
use crate::error::{Error, Result};
use crate::model::Fly;
use crate::model::cells::{Ask, Course, OneLane, Search, SearchLanes, SearchState, Stacks, Standing};
use crate::vk::{Device, Timing};

/// A search on a Vulkan device.
pub struct VulkanSearch {
    lanes: VulkanLanes,
    lane: usize,
}

impl VulkanSearch {
    /// A search that begins with absent flies.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if its numbers do not fit the device; or if the device fails.
    pub fn new(device: &Arc<Device>, course: Course) -> Result<Self> {
        state::check(&course)?;
        let shape = CellShape::for_device(device.info(), &course)?;
        Self::with_shape(device, course, shape)
    }

    /// As [`VulkanSearch::new`], with the work of a cell cut otherwise than is best for the device.
    ///
    /// # Errors
    /// As of [`VulkanSearch::new`].
    pub fn with_shape(device: &Arc<Device>, course: Course, shape: CellShape) -> Result<Self> {
        let mut lanes = VulkanLanes::create(device, Timing::Off)?;
        let lane = lanes.admit_with_shape(course, None, shape)?;
        let lane = lane.ok_or_else(|| Error::Internal("a device without lanes has no room for one".to_owned()))?;
        Ok(Self { lanes, lane })
    }

    fn only(&mut self) -> OneLane<'_> {
        OneLane { lanes: &mut self.lanes, lane: self.lane }
    }
}

impl Search for VulkanSearch {
    fn course(&self) -> &Course {
        self.lanes.course(self.lane)
    }

    fn load(&mut self, flies: &[Fly]) -> Result<()> {
        self.only().load(flies)
    }

    fn advance(&mut self, rounds: u32) -> Result<()> {
        self.only().advance(rounds)
    }

    fn advance_until(&mut self, rounds: u32, is_over: Ask<'_>) -> Result<bool> {
        self.only().advance_until(rounds, is_over)
    }

    fn renormalise(&mut self) -> Result<()> {
        self.only().renormalise()
    }

    fn standing(&self) -> Standing {
        self.lanes.standing(self.lane)
    }

    fn read_back(&mut self) -> Result<SearchState> {
        self.only().read_back()
    }

    fn read_back_stacks(&mut self) -> Result<Stacks> {
        self.only().read_back_stacks()
    }
}
