//! Handing recorded commands to the queue and waiting for them.

use std::sync::Arc;
use std::time::Instant;

use super::Submission;
use super::commands::run_and_wait;
use super::recorder::Recorder;
use crate::error::Result;

impl Recorder {
    /// Runs the recording in one submission and waits until it is over: first all writes, then the passes in order,
    /// then all reads. If nothing was recorded, it does nothing. Afterwards the recorder is empty again, even after a
    /// failure.
    ///
    /// # Errors
    /// The first error of the recording, if there was one, in which case nothing runs; [`crate::Error::DeviceLost`] if
    /// the device stopped working; [`crate::Error::OutOfDeviceMemory`] if a staging buffer had to grow and could not.
    pub fn submit_and_wait(&mut self) -> Result<()> {
        if !self.is_recording() {
            return Ok(());
        }
        let outcome = self.finish_recording().and_then(|()| self.run_observed());
        self.clear();
        outcome
    }

    /// Runs the command buffers and notifies the observers.
    fn run_observed(&mut self) -> Result<()> {
        let device = Arc::clone(self.device());
        let number = device.next_submission();
        let submission = Submission { number, recorder: self.name() };
        self.observers().iter().for_each(|observer| observer.before(&device, &submission));
        let outcome = self.run().and_then(|()| self.collect_times());
        let submission = Submission { number, recorder: self.name() };
        let passes = if outcome.is_ok() { self.pass_times() } else { &[] };
        // In reverse order, so that the spans of observers nest.
        self.observers().iter().rev().for_each(|observer| observer.after(&device, &submission, passes));
        outcome
    }

    fn run(&mut self) -> Result<()> {
        let device = Arc::clone(self.device());
        let (uploads, passes) = self.command_buffers();
        let commands = [uploads, passes];
        let commands = if self.has_uploads() { &commands[..] } else { &commands[1..] };
        let began = Instant::now();
        let outcome = run_and_wait(&device, commands, self.fence(), self.last_pass());
        self.note_time(began.elapsed());
        outcome
    }
}
