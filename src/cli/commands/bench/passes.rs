//! The time that each pass of a search takes on a device.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use super::measure::{Lap, repeat};
use crate::error::Result;
use crate::model::Fly;
use crate::model::cells::{Course, Search};
use crate::studio::Device;
use crate::vk::{self, PassTime, Submission, SubmissionObserver, Timing};

/// Sums the times of passes by name.
#[derive(Debug, Default)]
struct PassClock {
    seconds: Mutex<Vec<(&'static str, f64)>>,
}

impl SubmissionObserver for PassClock {
    fn timing(&self) -> Timing {
        Timing::On
    }

    fn before(&self, _device: &Arc<vk::Device>, _submission: &Submission<'_>) {}

    fn after(&self, _device: &Arc<vk::Device>, _submission: &Submission<'_>, passes: &[PassTime]) {
        let mut seconds = self.seconds.lock().unwrap_or_else(PoisonError::into_inner);
        for PassTime { name, ms, .. } in passes {
            match seconds.iter_mut().find(|(known, _)| known == name) {
                Some((_, sum)) => *sum += ms / 1e3,
                None => seconds.push((name, ms / 1e3)),
            }
        }
    }
}

/// The times of the passes of `rounds` rounds, repeated from the same population. Empty on the CPU. It makes a search
/// of its own, since the timestamps would slow down the others.
///
/// # Errors
/// If the device fails.
pub(super) fn of_rounds(
    device: &Device,
    course: Course,
    flies: &[Fly],
    rounds: u32,
    budget: Duration,
) -> Result<Vec<(&'static str, Vec<Lap>)>> {
    let Some(vulkan) = device.vulkan() else { return Ok(Vec::new()) };
    let clock = Arc::new(PassClock::default());
    let observer: Arc<dyn SubmissionObserver> = Arc::<PassClock>::clone(&clock);
    vulkan.observe(Arc::clone(&observer));
    let opened = device.open_search(course);
    vulkan.stop_observing(&observer);
    let mut search: Box<dyn Search> = opened?.search;
    let take = || std::mem::take(&mut *clock.seconds.lock().unwrap_or_else(PoisonError::into_inner));
    let laps = repeat(budget, || {
        search.load(flies)?;
        take();
        search.advance(rounds)?;
        Ok(take())
    })?;
    let mut passes: Vec<(&'static str, Vec<Lap>)> = Vec::new();
    for (name, seconds) in laps.into_iter().flatten() {
        let lap = Lap { seconds, amount: u64::from(rounds) };
        match passes.iter_mut().find(|(known, _)| *known == name) {
            Some((_, laps)) => laps.push(lap),
            None => passes.push((name, vec![lap])),
        }
    }
    Ok(passes)
}
