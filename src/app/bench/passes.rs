//! The time that each pass of a search takes on a device.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use super::measure::{Lap, repeat};
use crate::app::device::Selected;
use crate::error::Result;
use crate::model::Fly;
use crate::model::cells::{Course, Search};
use crate::vk::{Device, PassTime, Submission, SubmissionObserver, Timing};

/// Adds up the times of passes by name.
#[derive(Debug, Default)]
struct PassClock {
    seconds: Mutex<Vec<(&'static str, f64)>>,
}

impl SubmissionObserver for PassClock {
    fn timing(&self) -> Timing {
        Timing::On
    }

    fn before(&self, _device: &Arc<Device>, _submission: &Submission<'_>) {}

    fn after(&self, _device: &Arc<Device>, _submission: &Submission<'_>, passes: &[PassTime]) {
        let mut seconds = self.seconds.lock().unwrap_or_else(PoisonError::into_inner);
        for PassTime { name, ms, .. } in passes {
            match seconds.iter_mut().find(|(known, _)| known == name) {
                Some((_, sum)) => *sum += ms / 1e3,
                None => seconds.push((name, ms / 1e3)),
            }
        }
    }
}

/// What the passes of so many rounds took, again and again from the same population; nothing on the CPU. The search is one of
/// its own, since timestamps take time, too.
///
/// # Errors
/// If the device fails.
pub(super) fn of_rounds(
    selected: &Selected,
    course: Course,
    (flies, rounds): (&[Fly], u32),
    budget: Duration,
) -> Result<Vec<(&'static str, Vec<Lap>)>> {
    let Selected::Vulkan { device, .. } = selected else { return Ok(Vec::new()) };
    let clock = Arc::new(PassClock::default());
    let observer: Arc<dyn SubmissionObserver> = Arc::<PassClock>::clone(&clock);
    device.observe(Arc::clone(&observer));
    let opened = selected.open_search(course);
    device.stop_observing(&observer);
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
        let lap = (seconds, u64::from(rounds));
        match passes.iter_mut().find(|(known, _)| *known == name) {
            Some((_, laps)) => laps.push(lap),
            None => passes.push((name, vec![lap])),
        }
    }
    Ok(passes)
}
