//! Limits how many pictures are in memory at the same time, by the bytes that they need.

use std::sync::{Condvar, Mutex, PoisonError};

/// Admits pictures as long as their bytes stay within the limit. A single picture may exceed it.
pub(super) struct Gate {
    limit_bytes: u64,
    used_bytes: Mutex<u64>,
    changed: Condvar,
}

/// The bytes that a picture may use until this is dropped.
pub(super) struct Permit<'a> {
    gate: &'a Gate,
    bytes: u64,
}

impl Gate {
    pub(super) fn new(limit_bytes: u64) -> Self {
        Self { limit_bytes, used_bytes: Mutex::new(0), changed: Condvar::new() }
    }

    /// Waits until there is room for this many bytes.
    pub(super) fn enter(&self, bytes: u64) -> Permit<'_> {
        let mut used = self.used_bytes.lock().unwrap_or_else(PoisonError::into_inner);
        while *used > 0 && used.saturating_add(bytes) > self.limit_bytes {
            used = self.changed.wait(used).unwrap_or_else(PoisonError::into_inner);
        }
        *used = used.saturating_add(bytes);
        Permit { gate: self, bytes }
    }
}

impl Permit<'_> {
    /// Whether the picture exceeds the limit, and was admitted only because it is alone.
    pub(super) fn is_beyond_limit(&self) -> bool {
        self.bytes > self.gate.limit_bytes
    }
}

impl Drop for Permit<'_> {
    fn drop(&mut self) {
        let mut used = self.gate.used_bytes.lock().unwrap_or_else(PoisonError::into_inner);
        *used = used.saturating_sub(self.bytes);
        self.gate.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};

    use super::*;

    #[test]
    fn no_more_is_let_in_than_there_is_room_for_but_always_one() {
        let gate = Gate::new(100);
        let (inside, most) = (AtomicU64::new(0), AtomicU64::new(0));
        std::thread::scope(|scope| {
            for number in 0..24_u64 {
                let bytes = if number == 7 { 1_000 } else { 30 };
                let (gate, inside, most) = (&gate, &inside, &most);
                let visit = move || {
                    let permit = gate.enter(bytes);
                    let now = inside.fetch_add(bytes, Ordering::SeqCst) + bytes;
                    most.fetch_max(if bytes == 30 { now } else { bytes - now }, Ordering::SeqCst);
                    std::thread::yield_now();
                    inside.fetch_sub(bytes, Ordering::SeqCst);
                    drop(permit);
                };
                crate::threads::spawn_in(scope, visit).expect("a test may start threads");
            }
        });
        // Three pictures of 30 bytes fit, and the one of 1,000 was alone.
        assert!(most.into_inner() <= 90);
    }
}
