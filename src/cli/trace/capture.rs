//! A RenderDoc capture of chosen submissions, without a window.
//!
//! RenderDoc must have been loaded with the program, so that it saw the instance and the device being created. Nothing
//! here loads it.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::in_application::InApplication;
use crate::error::{Error, Result};
use crate::vk::{Device, PassTime, Submission, SubmissionObserver};

/// The submissions of a device to capture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CaptureRange {
    /// Number of the first submission, at least 1.
    first: u64,
    /// Number of the last submission.
    last: u64,
}

/// Reads `FIRST` or `FIRST+COUNT`.
pub(crate) fn range(text: &str) -> Result<CaptureRange, String> {
    let whole = |digits: &str| digits.bytes().all(|byte| byte.is_ascii_digit()).then(|| digits.parse::<u64>().ok());
    let (first, count) = text.split_once('+').unwrap_or((text, "1"));
    let (first, count) = (whole(first).flatten(), whole(count).flatten());
    match (first, count) {
        (Some(first @ 1..), Some(count @ 1..)) => {
            let last = first.checked_add(count - 1).ok_or("no device makes that many submissions")?;
            Ok(CaptureRange { first, last })
        }
        _ => {
            Err("expected the number of a submission, at least 1, and perhaps how many, such as 12 or 12+3".to_owned())
        }
    }
}

/// Captures a range of the submissions of a device.
#[derive(Debug)]
pub(crate) struct Capture {
    range: CaptureRange,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    renderdoc: InApplication,
    /// How many captures there were before ours.
    earlier: u32,
    /// Submissions made so far.
    submissions: u64,
}

impl Capture {
    /// Prepares a capture on `device`.
    ///
    /// # Errors
    /// [`Error::Usage`] if RenderDoc does not watch the device.
    pub(crate) fn new(range: CaptureRange, device: &Device) -> Result<Self> {
        let is_watched = device.tools().iter().any(|tool| tool == "RenderDoc");
        let unwatched = "--capture: RenderDoc was not loaded with the program; run the same command under `renderdoccmd \
                         capture --wait-for-exit --working-dir . smalti ..`, from Debian's package renderdoc or \
                         renderdoc.org";
        let renderdoc = is_watched.then(InApplication::find).flatten();
        let renderdoc = renderdoc.ok_or_else(|| Error::Usage(unwatched.to_owned()))?;
        let earlier = renderdoc.count();
        Ok(Self { range, state: Mutex::new(State { renderdoc, earlier, submissions: 0 }) })
    }

    /// The file that RenderDoc wrote, and what is in it, in words. Call it after the last submission.
    ///
    /// # Errors
    /// [`Error::Usage`] if there were too few submissions; [`Error::Internal`] if RenderDoc wrote nothing.
    pub(crate) fn outcome(&self) -> Result<(PathBuf, String)> {
        let mut state = self.state();
        let CaptureRange { first, last } = self.range;
        if state.submissions < first {
            return Err(Error::Usage(format!(
                "--capture: only {} submissions were made, so none was captured; name a lower number than {first}",
                state.submissions
            )));
        }
        if state.submissions < last {
            state.renderdoc.end();
        }
        let path = state.renderdoc.file(state.earlier).ok_or_else(|| Error::Output {
            path: "--capture".into(),
            reason: "RenderDoc wrote no capture; see its log".to_owned(),
        })?;
        Ok((path, format!("submissions {first} to {} of the device", last.min(state.submissions))))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl SubmissionObserver for Capture {
    fn before(&self, _device: &Arc<Device>, submission: &Submission<'_>) {
        let mut state = self.state();
        state.submissions = state.submissions.max(submission.number);
        if submission.number == self.range.first {
            state.renderdoc.start();
        }
    }

    fn after(&self, _device: &Arc<Device>, submission: &Submission<'_>, _passes: &[PassTime]) {
        if submission.number == self.range.last {
            self.state().renderdoc.end();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_is_a_first_submission_and_how_many() {
        assert_eq!(range("12"), Ok(CaptureRange { first: 12, last: 12 }));
        assert_eq!(range("12+3"), Ok(CaptureRange { first: 12, last: 14 }));
        for text in ["", "0", "+3", "3+", "3+0", "-1", "3 + 1", "3+1+1", "a", "18446744073709551615+2"] {
            assert!(range(text).is_err(), "{text:?}");
        }
    }
}
