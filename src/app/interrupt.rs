//! Ctrl-C and its relatives: the first asks for an orderly end, a second Ctrl-C ends the process at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::SIGINT;
use signal_hook::flag;

use crate::error::{Error, Result};

/// Exit code after an orderly end before the work was done: the same command may be run again.
pub(super) const EXIT_INTERRUPTED: u8 = 75;
/// Exit code of the second Ctrl-C.
const EXIT_AT_ONCE: i32 = 130;

#[cfg(unix)]
const SIGNALS: [i32; 3] = [SIGINT, signal_hook::consts::SIGTERM, signal_hook::consts::SIGUSR1];
#[cfg(not(unix))]
const SIGNALS: [i32; 2] = [SIGINT, signal_hook::consts::SIGTERM];

/// Whether somebody asked for the work to end.
#[derive(Clone, Debug, Default)]
pub(super) struct Interrupt {
    requested: Arc<AtomicBool>,
    /// Whether the next Ctrl-C ends the process.
    armed: Arc<AtomicBool>,
}

impl Interrupt {
    /// Listens to the signals from now on.
    pub(super) fn listen() -> Result<Self> {
        let interrupt = Self::default();
        interrupt
            .register()
            .map_err(|error| Error::Internal(format!("the handlers of signals cannot be installed ({error})")))?;
        Ok(interrupt)
    }

    fn register(&self) -> std::io::Result<()> {
        // Before the flags: actions run in this order, and the first Ctrl-C must find `armed` still false.
        flag::register_conditional_shutdown(SIGINT, EXIT_AT_ONCE, Arc::clone(&self.armed))?;
        for signal in SIGNALS {
            flag::register(signal, Arc::clone(&self.requested))?;
            flag::register(signal, Arc::clone(&self.armed))?;
        }
        Ok(())
    }

    /// Whether a signal came.
    pub(super) fn is_requested(&self) -> bool {
        self.requested.load(Ordering::Relaxed)
    }

    /// Runs `write`, which must not be cut short by a second Ctrl-C: it would leave a temporary file behind.
    pub(super) fn while_writing<T>(&self, write: impl FnOnce() -> T) -> T {
        self.armed.store(false, Ordering::Relaxed);
        let written = write();
        self.armed.store(self.is_requested(), Ordering::Relaxed);
        written
    }
}
