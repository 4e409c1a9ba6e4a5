//! Handing recorded commands to the queue and waiting for them.

use std::sync::Arc;

use ash::vk;

use super::Submission;
use super::commands::submission_failed;
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
        let fence = [self.fence()];
        let (uploads, passes) = self.command_buffers();
        let infos = [uploads, passes].map(|commands| vk::CommandBufferSubmitInfo::default().command_buffer(commands));
        let infos = if self.has_uploads() { &infos[..] } else { &infos[1..] };
        let submits = [vk::SubmitInfo2::default().command_buffer_infos(infos)];
        let failed = |call: &str, result| submission_failed(call, result, self.last_pass());
        {
            let queue = device.queue();
            // SAFETY: V1, V2, V3: the fence is not in use, since every submission is waited for.
            unsafe {
                device.raw().reset_fences(&fence).map_err(|result| failed("vkResetFences", result))?;
                device
                    .raw()
                    .queue_submit2(*queue, &submits, fence[0])
                    .map_err(|result| failed("vkQueueSubmit2", result))?;
            }
        }
        // SAFETY: V1.
        unsafe { device.raw().wait_for_fences(&fence, true, u64::MAX) }.map_err(|result| {
            // V2: the objects that the commands use are dropped next.
            device.wait_idle();
            failed("vkWaitForFences", result)
        })
    }
}
