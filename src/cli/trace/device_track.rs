//! The track of a device: each submission, on the thread that waits for it, and each of its passes, on the device. Both
//! are on the clock of the trace.
//!
//! To compare the clocks, the device's clock is read between two looks at ours. This is done several times, and the
//! closest pair of looks counts. It is repeated later, since clocks drift apart.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use serde_json::{Map, Value, json};

use super::tracer::{Times, Tracer, Track, Weight};
use crate::vk::{ClockMethod, Device, PassTime, Submission, SubmissionObserver, Timing};

/// How many readings are made. The closest one counts.
const READINGS: usize = 5;

/// Draws the submissions of one device into a trace.
#[derive(Debug)]
pub(crate) struct DeviceTrack {
    tracer: Tracer,
    track: Track,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    /// When the submissions under way began.
    begun: HashMap<u64, Duration>,
    clock: Option<Clock>,
    readings: u64,
    /// The largest error of a reading: half the distance between the looks around it.
    deviation: Duration,
}

/// A moment on both clocks.
#[derive(Clone, Copy, Debug)]
struct Clock {
    at: Duration,
    ticks: u64,
    deviation: Duration,
}

impl DeviceTrack {
    /// A track for the device; `None` if there is no trace.
    pub(crate) fn new(tracer: &Tracer, device: &Device) -> Option<Self> {
        let track = tracer.device_track(&device.info().name)?;
        Some(Self { tracer: tracer.clone(), track, state: Mutex::default() })
    }

    /// Compares the clocks, unless that was done a short time ago.
    fn keep_time(&self, device: &Arc<Device>, state: &mut State) {
        let Some(method) = device.clock_method() else { return };
        let every = match method {
            ClockMethod::Calibrated => Duration::from_millis(100),
            // A comparison costs a submission.
            ClockMethod::Submission => Duration::from_secs(1),
        };
        if state.clock.is_some_and(|clock| self.tracer.now() < clock.at + every) {
            return;
        }
        let read = || {
            let before = self.tracer.now();
            let ticks = device.read_clock(method).ok()?;
            let deviation = (self.tracer.now() - before) / 2;
            Some(Clock { at: before + deviation, ticks, deviation })
        };
        // A failure is ignored here: the next submission fails, too, and reports it.
        let closest = (0..READINGS).filter_map(|_| read()).min_by_key(|clock| clock.deviation);
        state.clock = closest.or(state.clock);
        state.readings += 1;
        state.deviation = state.deviation.max(closest.map_or(Duration::ZERO, |clock| clock.deviation));
        let told = json!({
            "device": device.info().name,
            "method": match method {
                ClockMethod::Calibrated => "calibrated timestamps",
                ClockMethod::Submission => "timestamps of submissions",
            },
            "readings": state.readings,
            "largest_deviation_us": state.deviation.as_nanos() as f64 / 1e3,
        });
        self.tracer.tell_clock(self.track, told);
    }

    fn note_passes(&self, device: &Device, clock: Clock, passes: &[PassTime], told: &Map<String, Value>) {
        for PassTime { name, ms, start_ticks } in passes {
            let since = device.info().limits.ns_between(clock.ticks, *start_ticks).round() as i64;
            let times = Times { start_ns: clock.at.as_nanos() as i64 + since, ns: (ms * 1e6).round() as u64 };
            self.tracer.note_pass(self.track, name, times, told.clone());
        }
    }
}

impl SubmissionObserver for DeviceTrack {
    fn timing(&self) -> Timing {
        Timing::On
    }

    fn before(&self, device: &Arc<Device>, submission: &Submission<'_>) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        self.keep_time(device, &mut state);
        state.begun.insert(submission.number, self.tracer.now());
    }

    fn after(&self, device: &Arc<Device>, submission: &Submission<'_>, passes: &[PassTime]) {
        let ended = self.tracer.now();
        let (began, clock) = {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            (state.begun.remove(&submission.number), state.clock)
        };
        let number = ("submission".to_owned(), submission.number.into());
        if let Some(clock) = clock {
            self.note_passes(device, clock, passes, &Map::from_iter([number.clone()]));
        }
        let told = Map::from_iter([number, ("recorder".to_owned(), submission.recorder.into())]);
        self.tracer.note("submit and wait", Weight::Frequent, began.unwrap_or(ended)..ended, told);
    }
}
