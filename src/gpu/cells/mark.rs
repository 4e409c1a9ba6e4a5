//! Where a lane was when its rounds began: a copy on the device of its flies and of what goes with them, to take it
//! back there. Of its pixels there is no copy, since they have most of the bytes: they follow from the flies.

use std::sync::Arc;

use super::buffers::Part;
use crate::error::Result;
use crate::gpu::pools::BufferRange;
use crate::model::cells::Standing;
use crate::vk::{Buffer, BufferUse, Device, Recorder, Residence};

/// What is copied.
pub(super) const PARTS: [Part; 4] = [Part::Flies, Part::Steps, Part::Fitness, Part::Origins];

/// A copy of a lane's slices of [`PARTS`], one after the other.
pub(super) struct Mark {
    buffer: Arc<Buffer>,
    /// How far the lane had come.
    pub standing: Standing,
    /// Iterations that had something to do until then.
    pub iterations: u32,
    /// Whether the copy is still to be made. As long as it is, the lane is where it was.
    pub is_due: bool,
}

impl Mark {
    /// A mark for slices of these ranges, which holds nothing yet.
    pub fn create(device: &Arc<Device>, slices: &[BufferRange]) -> Result<Self> {
        let bytes = slices.iter().map(|slice| slice.size_bytes).sum();
        let buffer = Buffer::create(device, "mark of a search", bytes, BufferUse::Transfer, Residence::Device)?;
        Ok(Self { buffer, standing: Standing::default(), iterations: 0, is_due: false })
    }

    /// Records the copy.
    pub fn record_keep(&mut self, recorder: &mut Recorder, slices: &[BufferRange]) -> Result<()> {
        let mut pass = recorder.transfer_pass("mark")?;
        let mut offset = 0;
        for slice in slices {
            pass.copy((&slice.buffer, slice.offset), (&self.buffer, offset), slice.size_bytes);
            offset += slice.size_bytes;
        }
        self.is_due = false;
        Ok(())
    }

    /// Records the way back.
    pub fn record_restore(&self, recorder: &mut Recorder, slices: &[BufferRange]) -> Result<()> {
        let mut pass = recorder.transfer_pass("take back")?;
        let mut offset = 0;
        for slice in slices {
            pass.copy((&self.buffer, offset), (&slice.buffer, slice.offset), slice.size_bytes);
            offset += slice.size_bytes;
        }
        Ok(())
    }
}
