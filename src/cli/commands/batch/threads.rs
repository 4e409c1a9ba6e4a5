//! Decides how many pictures evolve on which device, and how many threads read and save.

use rayon::ThreadPool;

use super::stages::{InFlight, Worker};
use crate::cli::args::computing::Computing;
use crate::cli::list::{BatchArgs, IoThreads};
use crate::cli::values::in_range;
use crate::error::Result;
use crate::studio::Device;
use crate::vk::DeviceKind;

/// Most of these threads, unless more are asked for.
const IO_THREADS_USUAL: usize = 8;
/// Threads that a batch needs at least besides those that evolve.
const OTHER_THREADS: usize = 3;
/// Most pictures that evolve at the same time on a device.
const IN_FLIGHT_MAX: u64 = 4_096;
/// Most lanes of a GPU, unless more are asked for. Its memory may hold fewer.
const LANES_USUAL: usize = 256;
/// The same for software Vulkan, where more lanes only crowd the caches (`cargo bench --bench paper_lanes`).
const LANES_USUAL_IN_SOFTWARE: usize = 16;

/// How many threads read, and how many save; no more than there are pictures.
pub(super) fn io_threads(asked_for: Option<IoThreads>, threads: usize, item_count: usize) -> IoThreads {
    let usual = threads.div_ceil(2).min(IO_THREADS_USUAL);
    let IoThreads { load, save } = asked_for.unwrap_or(IoThreads { load: usual, save: usual });
    IoThreads { load: load.min(item_count).max(1), save: save.min(item_count).max(1) }
}

/// The devices, each with the number of pictures that it evolves at the same time.
///
/// # Errors
/// If a device cannot be opened, or a number is out of range.
pub(super) fn workers(args: &BatchArgs, computing: &Computing, item_count: usize) -> Result<Vec<Worker>> {
    let in_flight = args.in_flight.map(|count| in_range("--in-flight", count, 1..=IN_FLIGHT_MAX)).transpose()?;
    let devices = args.devices.select(computing)?;
    let share = item_count.div_ceil(devices.len()).max(1);
    let threads = (computing.thread_count() / devices.len()).max(1);
    let most = |usual: usize| in_flight.map_or(usual, |count| count as usize).min(share);
    let worker = |device: Device| {
        let in_flight = match device.vulkan() {
            Some(vulkan) => InFlight::Lanes(most(match vulkan.info().kind {
                DeviceKind::Cpu => LANES_USUAL_IN_SOFTWARE,
                _ => LANES_USUAL,
            })),
            None => {
                let count = most(threads);
                InFlight::Pools(pools(count, (threads / count).max(1))?)
            }
        };
        Ok(Worker { device, in_flight })
    };
    devices.into_iter().map(worker).collect()
}

/// A pool for each picture in flight. Where the system starts fewer threads, there are fewer pictures in flight.
fn pools(count: usize, threads: usize) -> Result<Vec<ThreadPool>> {
    let mut pools = crate::threads::pools(count, threads);
    if pools.len() < count {
        // Each pool needs a thread that hands it pictures, and others must read and save.
        pools.truncate((pools.len().saturating_sub(OTHER_THREADS) / 2).max(1));
    }
    if pools.is_empty() { Err(crate::threads::none()) } else { Ok(pools) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unless_said_half_of_the_threads_read_and_half_save_and_no_more_than_there_are_pictures() {
        assert_eq!(io_threads(None, 2, 1_000), IoThreads { load: 1, save: 1 });
        assert_eq!(io_threads(None, 64, 3), IoThreads { load: 3, save: 3 });
        assert_eq!(io_threads(Some(IoThreads { load: 9, save: 4 }), 2, 1_000), IoThreads { load: 9, save: 4 });
    }
}
