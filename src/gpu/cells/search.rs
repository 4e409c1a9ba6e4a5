//! One search on a Vulkan device: lanes of which there is one.

use std::sync::Arc;

use super::lanes::VulkanLanes;
use super::shape::CellShape;
use super::state;
use crate::error::{Error, Result};
use crate::model::cells::{Course, Only};
use crate::vk::{Device, Timing};

/// A search on a Vulkan device.
pub type VulkanSearch = Only<VulkanLanes>;

impl Only<VulkanLanes> {
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
        Ok(Self::of(lanes, lane))
    }
}
