//! GPU time of each pass, from a pair of timestamps around it.

use std::sync::Arc;

use ash::vk;

use super::commands::submission_failed;
use super::handle::Owned;
use super::{Device, call_failed};
use crate::error::Result;

/// Number of passes of one submission that are timed. Later passes are not, so the pool never has to grow while it is
/// in use.
const MAX_PASSES: u32 = 256;
/// Queries of a pool.
const QUERIES: u32 = 2 * MAX_PASSES + 2;
/// Label of the copies from the staging buffer before the first pass.
pub(super) const UPLOADS: &str = "uploads";
/// Label of the copies to the staging buffer after the last pass.
pub(super) const READ_BACKS: &str = "read-backs";

/// Whether a recorder measures its passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Timing {
    /// No timestamps.
    #[default]
    Off,
    /// It measures the first 256 passes of every submission, if the device has timestamps.
    On,
}

/// The time that the device spent in a pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassTime {
    /// Label of the pass.
    pub name: &'static str,
    /// Milliseconds on the device.
    pub ms: f64,
    /// When it began, by the device's clock; [`super::DeviceLimits::ns_between`] converts ticks.
    pub start_ticks: u64,
}

/// The timestamps of one submission.
pub(super) struct Timer {
    /// Two queries for each pass, and two for the uploads, whose command buffer runs before that of the passes.
    pool: Owned<vk::QueryPool>,
    has_uploads: bool,
    names: Vec<&'static str>,
    ticks: Vec<u64>,
    times: Vec<PassTime>,
}

impl Timer {
    /// A timer, unless timing is off or the device has no timestamps.
    pub(super) fn create(device: &Arc<Device>, name: &str, timing: Timing) -> Result<Option<Self>> {
        if timing == Timing::Off || device.info().limits.timestamp_bits == 0 {
            return Ok(None);
        }
        let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(QUERIES);
        // SAFETY: V1.
        let pool = unsafe { device.raw().create_query_pool(&info, None) }
            .map_err(|result| call_failed("creation of the timestamps", result))?;
        let pool = Owned::new(device, pool, &format!("{name} timestamps"));
        Ok(Some(Self { pool, has_uploads: false, names: Vec::new(), ticks: Vec::new(), times: Vec::new() }))
    }

    /// Forgets the last submission.
    pub(super) fn record_reset(&mut self, commands: vk::CommandBuffer) {
        self.names.clear();
        self.times.clear();
        self.has_uploads = false;
        // SAFETY: V1, V2, V3.
        unsafe { self.pool.device().raw().cmd_reset_query_pool(commands, self.pool.get(), 0, 2 * MAX_PASSES) };
    }

    /// Starts the clock of a pass; returns the query that stops it.
    pub(super) fn record_start(&mut self, commands: vk::CommandBuffer, name: &'static str) -> Option<u32> {
        let query = 2 * u32::try_from(self.names.len()).ok()?;
        if query >= 2 * MAX_PASSES {
            return None;
        }
        self.names.push(name);
        self.record_stamp(commands, query);
        Some(query + 1)
    }

    /// Starts the clock of the uploads, in their own command buffer; returns the query that stops it.
    pub(super) fn record_start_of_uploads(&mut self, commands: vk::CommandBuffer) -> u32 {
        self.has_uploads = true;
        // SAFETY: V1, V2, V3; what is reset here is not in the range that `record_reset` resets.
        unsafe { self.pool.device().raw().cmd_reset_query_pool(commands, self.pool.get(), 2 * MAX_PASSES, 2) };
        self.record_stamp(commands, 2 * MAX_PASSES);
        2 * MAX_PASSES + 1
    }

    /// Stops the clock of a pass.
    pub(super) fn record_stamp(&self, commands: vk::CommandBuffer, query: u32) {
        let stage = vk::PipelineStageFlags2::ALL_COMMANDS;
        // SAFETY: V1, V3; the query is in the pool and was reset in this submission.
        unsafe { self.pool.device().raw().cmd_write_timestamp2(commands, stage, self.pool.get(), query) };
    }

    /// Fetches the times of a submission that is over.
    pub(super) fn collect(&mut self) -> Result<()> {
        if self.has_uploads {
            self.fetch(2 * MAX_PASSES, &[UPLOADS])?;
        }
        let names = std::mem::take(&mut self.names);
        let fetched = self.fetch(0, &names);
        self.names = names;
        fetched
    }

    /// Fetches the times of passes whose queries begin at `first`.
    fn fetch(&mut self, first: u32, names: &[&'static str]) -> Result<()> {
        if names.is_empty() {
            return Ok(());
        }
        let device = self.pool.device();
        self.ticks.clear();
        self.ticks.resize(2 * names.len(), 0);
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: V1, V2; every query asked for was written.
        unsafe { device.raw().get_query_pool_results(self.pool.get(), first, &mut self.ticks, flags) }
            .map_err(|result| submission_failed("vkGetQueryPoolResults", result, names[names.len() - 1]))?;
        let limits = &device.info().limits;
        let times = names.iter().zip(self.ticks.chunks_exact(2));
        self.times.extend(times.map(|(&name, pair)| PassTime {
            name,
            ms: limits.ns_between(pair[0], pair[1]).max(0.0) * 1e-6,
            start_ticks: pair[0],
        }));
        Ok(())
    }

    /// The times of the last submission, in the order of its passes.
    pub(super) fn times(&self) -> &[PassTime] {
        &self.times
    }
}
