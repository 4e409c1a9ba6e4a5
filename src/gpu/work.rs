//! What the device is to look at: blocks that wait, and work items for one submission.

use super::layout::WorkItem;

/// Work for the device, in buffers that are used again.
#[derive(Debug, Default)]
pub(super) struct Work {
    /// Blocks whose lists are still to be looked at from some entry on.
    pub pending: Vec<Pending>,
    pub items: Vec<WorkItem>,
    pub entries: Vec<u32>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Pending {
    pub lane: usize,
    pub block: u32,
    pub from: usize,
}
