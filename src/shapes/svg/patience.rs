//! A drawing on a thread of its own, which is given up if it takes too long.
//!
//! What a drawing may come to is counted beforehand, so this is for what the counts do not see. The clock decides only
//! whether there is a mask, never which.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Duration;

use crate::shapes::ink::Ink;
use crate::threads;

/// Longest time that a drawing may take. Those that people draw take a few milliseconds.
const DRAWING_TIME_MAX: Duration = Duration::from_millis(2_500);
/// Stack of the thread: drawing is recursive, and main threads have 8 MiB.
const STACK_BYTES: usize = 1 << 24;
/// Most drawings that may still be running though nobody waits for them.
const GIVEN_UP_MAX: usize = 4;

/// Drawings that nobody waits for, and that have not ended: a thread cannot be stopped from outside.
static GIVEN_UP: AtomicUsize = AtomicUsize::new(0);

const RUNNING: u8 = 0;
const ABANDONED: u8 = 1;
const ENDED: u8 = 2;

/// What `draw` draws, unless it takes too long.
///
/// # Errors
/// What `draw` returns, or a sentence for the user.
pub(super) fn drawn_in_time(
    draw: impl FnOnce() -> Result<Vec<Ink>, String> + Send + 'static,
) -> Result<Vec<Ink>, String> {
    let too_slow = || "the SVG takes too long to draw; simplify it, or export it as PNG".to_owned();
    if GIVEN_UP.load(Ordering::Relaxed) >= GIVEN_UP_MAX {
        return Err(too_slow());
    }
    let state = Arc::new(AtomicU8::new(RUNNING));
    let (sender, receiver) = sync_channel(1);
    let of_thread = Arc::clone(&state);
    let started = threads::spawn_with_stack("svg", STACK_BYTES, move || {
        // Nobody may be there to take it.
        let _ = sender.send(draw());
        if of_thread.swap(ENDED, Ordering::AcqRel) == ABANDONED {
            GIVEN_UP.fetch_sub(1, Ordering::Relaxed);
        }
    });
    started.map_err(|error| format!("the SVG cannot be drawn: {error}"))?;
    receiver.recv_timeout(DRAWING_TIME_MAX).unwrap_or_else(|error| {
        if error == RecvTimeoutError::Timeout {
            GIVEN_UP.fetch_add(1, Ordering::Relaxed);
            if state.swap(ABANDONED, Ordering::AcqRel) == ENDED {
                GIVEN_UP.fetch_sub(1, Ordering::Relaxed);
            }
        }
        Err(too_slow())
    })
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;

    #[test]
    fn a_drawing_that_does_not_end_is_given_up_and_a_few_of_them_leave_no_more_to_be_begun() {
        let drawn = || drawn_in_time(|| Ok(vec![Ink { alpha: 1, intensity: 2 }]));
        assert_eq!(drawn(), Ok(vec![Ink { alpha: 1, intensity: 2 }]));
        let (go_on, wait) = sync_channel::<()>(0);
        let wait = Arc::new(std::sync::Mutex::new(wait));
        let refusals: Vec<_> = thread::scope(|scope| {
            let draw = || {
                let wait = Arc::clone(&wait);
                drawn_in_time(move || Err(format!("{:?}", wait.lock().map(|wait| wait.recv().is_err()).is_ok())))
            };
            let waiting: Vec<_> =
                (0..GIVEN_UP_MAX).map(|_| threads::spawn_in(scope, draw).expect("it starts")).collect();
            waiting.into_iter().map(|waiting| waiting.join().expect("it does not panic")).collect()
        });
        let is_too_slow = |refusal: &Result<Vec<Ink>, String>| {
            refusal.as_ref().is_err_and(|reason| reason.starts_with("the SVG takes too long to draw"))
        };
        assert!(refusals.iter().all(is_too_slow) && is_too_slow(&drawn()), "{refusals:?}");
        drop(go_on);
        while GIVEN_UP.load(Ordering::Relaxed) > 0 {
            thread::yield_now();
        }
        assert!(drawn().is_ok());
    }
}
