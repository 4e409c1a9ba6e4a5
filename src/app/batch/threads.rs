//! Who does what: devices, pictures in flight, and threads.

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::BatchArgs;
use super::pipeline::{InFlight, Worker};
use crate::app::computing::Computing;
use crate::app::device::Selected;
use crate::app::options::in_range;
use crate::error::{Error, Result};
use crate::vk::DeviceKind;

/// Most threads that read, or save.
const IO_THREADS_MAX: usize = 64;
/// Most of those unless somebody asks for more.
const IO_THREADS_USUAL: usize = 8;
/// Most pictures that evolve at the same time on a device.
const IN_FLIGHT_MAX: u64 = 4_096;
/// Most lanes of a GPU unless somebody asks for more; its memory may hold fewer.
const LANES_USUAL: usize = 256;
/// The same of software Vulkan, where more lanes only crowd the caches (`cargo bench --bench paper_lanes`).
const LANES_USUAL_IN_SOFTWARE: usize = 16;

/// Threads that read, and threads that save.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::app) struct IoThreads {
    load: usize,
    save: usize,
}

/// `LOAD:SAVE`, or one number for both.
pub(in crate::app) fn parse(text: &str) -> Result<IoThreads, String> {
    let (load, save) = text.split_once(':').unwrap_or((text, text));
    let count = |text: &str| text.parse().ok().filter(|count| (1..=IO_THREADS_MAX).contains(count));
    match (count(load), count(save)) {
        (Some(load), Some(save)) => Ok(IoThreads { load, save }),
        _ => Err(format!("expected LOAD:SAVE, two numbers from 1 to {IO_THREADS_MAX}, such as 2:1")),
    }
}

/// Threads that read and that save; no more than there are pictures.
pub(super) fn io_threads(asked_for: Option<IoThreads>, threads: usize, item_count: usize) -> (usize, usize) {
    let usual = threads.div_ceil(2).min(IO_THREADS_USUAL);
    let IoThreads { load, save } = asked_for.unwrap_or(IoThreads { load: usual, save: usual });
    (load.min(item_count).max(1), save.min(item_count).max(1))
}

/// The devices, each with as many pictures in flight as do it good.
///
/// # Errors
/// If a device cannot be opened, or a number is out of range.
pub(super) fn workers(args: &BatchArgs, computing: &Computing, item_count: usize) -> Result<Vec<Worker>> {
    let in_flight = args.in_flight.map(|count| in_range("--in-flight", count, (1, IN_FLIGHT_MAX))).transpose()?;
    let devices = args.devices.select(computing)?;
    let share = item_count.div_ceil(devices.len()).max(1);
    let threads = (computing.thread_count() / devices.len()).max(1);
    let most = |usual: usize| in_flight.map_or(usual, |count| count as usize).min(share);
    let worker = |selected: Selected| {
        let in_flight = match selected {
            Selected::Vulkan { ref device, .. } => InFlight::Lanes(most(match device.info().kind {
                DeviceKind::Cpu => LANES_USUAL_IN_SOFTWARE,
                _ => LANES_USUAL,
            })),
            Selected::Cpu { .. } => {
                let count = most(threads);
                InFlight::Pools((0..count).map(|_| pool((threads / count).max(1))).collect::<Result<_>>()?)
            }
        };
        Ok(Worker { selected, in_flight })
    };
    devices.into_iter().map(worker).collect()
}

fn pool(threads: usize) -> Result<ThreadPool> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|error| Error::Internal(format!("threads cannot be started ({error})")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn io_threads_are_two_numbers_or_one_for_both() {
        assert_eq!(parse("2:1"), Ok(IoThreads { load: 2, save: 1 }));
        assert_eq!(parse("3"), Ok(IoThreads { load: 3, save: 3 }));
        for text in ["", "0:1", "1:", "1:65", "a:b", "-1:1"] {
            assert!(parse(text).is_err(), "{text}");
        }
        assert_eq!(io_threads(None, 2, 1_000), (1, 1));
        assert_eq!(io_threads(None, 64, 3), (3, 3));
        assert_eq!(io_threads(parse("9:4").ok(), 2, 1_000), (9, 4));
    }
}
