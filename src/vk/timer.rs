//! GPU time of each pass, from a pair of timestamps around it.

use std::sync::Arc;

use ash::vk;

use super::handle::Owned;
use super::{Device, call_failed};
use crate::error::Result;

/// Passes of one submission that are timed; later ones are not, so that the pool never has to grow while it is in use.
const MAX_PASSES: u32 = 256;

/// Whether a recorder measures its passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Timing {
    /// No timestamps.
    #[default]
    Off,
    /// The first 256 passes of every submission, where the device has timestamps.
    On,
}

/// The time that the device spent in a pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassTime {
    /// Label of the pass.
    pub name: &'static str,
    /// Milliseconds on the device.
    pub ms: f64,
}

/// The timestamps of one submission.
pub(super) struct Timer {
    pool: Owned<vk::QueryPool>,
    names: Vec<&'static str>,
    ticks: Vec<u64>,
    times: Vec<PassTime>,
}

impl Timer {
    /// A timer, unless timing is off or the device has no timestamps.
    pub(super) fn create(device: &Arc<Device>, timing: Timing) -> Result<Option<Self>> {
        if timing == Timing::Off || device.info().limits.timestamp_bits == 0 {
            return Ok(None);
        }
        let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(2 * MAX_PASSES);
        // SAFETY: V1.
        let pool = unsafe { device.raw().create_query_pool(&info, None) }
            .map_err(|result| call_failed("creation of the timestamps", result))?;
        let pool = Owned::new(device, pool, "pass timestamps");
        Ok(Some(Self { pool, names: Vec::new(), ticks: Vec::new(), times: Vec::new() }))
    }

    /// Forgets the last submission.
    pub(super) fn record_reset(&mut self, commands: vk::CommandBuffer) {
        self.names.clear();
        self.times.clear();
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

    /// Stops the clock of a pass.
    pub(super) fn record_stamp(&self, commands: vk::CommandBuffer, query: u32) {
        let stage = vk::PipelineStageFlags2::ALL_COMMANDS;
        // SAFETY: V1, V3; the query is in the pool and was reset in this submission.
        unsafe { self.pool.device().raw().cmd_write_timestamp2(commands, stage, self.pool.get(), query) };
    }

    /// Fetches the times of a submission that is over.
    pub(super) fn collect(&mut self) -> Result<()> {
        if self.names.is_empty() {
            return Ok(());
        }
        let device = self.pool.device();
        self.ticks.clear();
        self.ticks.resize(2 * self.names.len(), 0);
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: V1, V2; every query asked for was written.
        unsafe { device.raw().get_query_pool_results(self.pool.get(), 0, &mut self.ticks, flags) }
            .map_err(|result| call_failed("vkGetQueryPoolResults", result))?;
        let limits = &device.info().limits;
        let times = self.names.iter().zip(self.ticks.chunks_exact(2));
        self.times.extend(times.map(|(&name, pair)| PassTime {
            name,
            ms: elapsed_ms(pair[0], pair[1], limits.timestamp_bits, limits.timestamp_period_ns),
        }));
        Ok(())
    }

    /// The times of the last submission, in the order of its passes.
    pub(super) fn times(&self) -> &[PassTime] {
        &self.times
    }
}

/// Milliseconds between two timestamps of which only the low `bits` count.
fn elapsed_ms(start: u64, end: u64, bits: u32, period_ns: f32) -> f64 {
    let mask = u64::MAX >> (64 - bits.clamp(1, 64));
    (end.wrapping_sub(start) & mask) as f64 * f64::from(period_ns) * 1e-6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_counter_that_wraps_between_two_timestamps_still_gives_their_distance() {
        assert_eq!(elapsed_ms(1_000, 3_000, 64, 1.0), 0.002);
        assert_eq!(elapsed_ms((1 << 36) - 1_000, 1_000, 36, 1.0), 0.002);
        assert_eq!(elapsed_ms(u64::MAX, 1_999_999, 64, 0.5), 1.0);
    }
}
