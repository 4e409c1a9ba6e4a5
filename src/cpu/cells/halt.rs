//! How the threads that make a round learn that it is to be cut short.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::model::cells::Ask;

/// Asks whether a round is to be cut short, and remembers the answer.
pub struct Halt<'a> {
    ask: Ask<'a>,
    is_called: AtomicBool,
}

/// What nobody ever calls.
pub static NEVER: Halt<'static> = Halt { ask: &|| false, is_called: AtomicBool::new(false) };

impl<'a> Halt<'a> {
    /// Nobody has called it yet.
    pub fn new(ask: Ask<'a>) -> Self {
        Self { ask, is_called: AtomicBool::new(false) }
    }

    /// Asks, unless the answer is known to be yes. The answer may cost a look at a clock.
    pub fn is_called(&self) -> bool {
        if self.was_called() {
            return true;
        }
        let is_called = (self.ask)();
        if is_called {
            self.is_called.store(true, Ordering::Relaxed);
        }
        is_called
    }

    /// Whether the answer was yes before.
    pub fn was_called(&self) -> bool {
        self.is_called.load(Ordering::Relaxed)
    }
}
