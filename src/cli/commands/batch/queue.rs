//! Queues from one stage to the threads of the next.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError};
use std::sync::{Mutex, PoisonError, TryLockError};
use std::time::Duration;

/// Time between two looks at what else there is to do.
const LOOK_INTERVAL: Duration = Duration::from_millis(50);

/// The receiving end of a channel, shared by several threads.
pub(super) struct Queue<T> {
    receiver: Mutex<Receiver<T>>,
    is_ended: AtomicBool,
}

impl<T> Queue<T> {
    pub(super) fn new(receiver: Receiver<T>) -> Self {
        Self { receiver: Mutex::new(receiver), is_ended: AtomicBool::new(false) }
    }

    /// The next item, as soon as there is one; none if there will be no more.
    pub(super) fn take(&self) -> Option<T> {
        let next = self.receiver.lock().unwrap_or_else(PoisonError::into_inner).recv().ok();
        if next.is_none() {
            self.is_ended.store(true, Ordering::Relaxed);
        }
        next
    }

    /// As [`Queue::take`], or what `other` gives, whichever comes first.
    pub(super) fn take_or(&self, other: impl Fn() -> Option<T>) -> Option<T> {
        loop {
            if let Some(other) = other() {
                return Some(other);
            }
            let next = self.receiver.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK_INTERVAL);
            match next {
                Ok(next) => return Some(next),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    self.is_ended.store(true, Ordering::Relaxed);
                    return None;
                }
            }
        }
    }

    /// The next item, if there is one now. Also none while another thread waits, since that one will get it.
    pub(super) fn take_if_ready(&self) -> Option<T> {
        let receiver = match self.receiver.try_lock() {
            Ok(receiver) => receiver,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return None,
        };
        match receiver.try_recv() {
            Ok(next) => Some(next),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                self.is_ended.store(true, Ordering::Relaxed);
                None
            }
        }
    }

    /// Whether a receiver has already found that there will be no more.
    pub(super) fn is_ended(&self) -> bool {
        self.is_ended.load(Ordering::Relaxed)
    }
}
