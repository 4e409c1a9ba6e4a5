//! Ctrl-C and similar signals: the first one asks for an orderly end, a second Ctrl-C ends the process at once. As long
//! as a command has nothing to save and nothing to clear away, the first one ends it at once.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use signal_hook::consts::SIGINT;
use signal_hook::low_level::unregister;
use signal_hook::{SigId, flag};

use crate::error::{Error, Result, in_words};
use crate::evolve::{Brake, StopReason};

/// Exit code after an orderly end before the work was done. The same command may be run again.
pub(crate) const EXIT_INTERRUPTED: u8 = 75;
/// Exit code of the second Ctrl-C.
const EXIT_AT_ONCE: i32 = 130;

#[cfg(unix)]
const SIGNALS: [i32; 4] =
    [SIGINT, signal_hook::consts::SIGTERM, signal_hook::consts::SIGUSR1, signal_hook::consts::SIGHUP];
#[cfg(not(unix))]
const SIGNALS: [i32; 2] = [SIGINT, signal_hook::consts::SIGTERM];

/// Whether the first signal ends the process at once.
static AT_ONCE: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Prepares the process for signals: until a command listens, the first one ends it at once.
///
/// # Errors
/// [`Error::Internal`] if no handler can be installed.
pub(crate) fn prepare() -> Result<()> {
    let at_once = Arc::new(AtomicBool::new(true));
    let prepare = || -> std::io::Result<()> {
        for signal in signals() {
            flag::register_conditional_shutdown(signal, EXIT_INTERRUPTED.into(), Arc::clone(&at_once))?;
        }
        // Without a handler, a file that exceeds `ulimit -f` would kill the process. With one, the write fails instead.
        #[cfg(unix)]
        flag::register(signal_hook::consts::SIGXFSZ, Arc::default())?;
        Ok(())
    };
    prepare().map_err(|error| not_installed(&error))?;
    // A second call fails, and there is none.
    let _ = AT_ONCE.set(at_once);
    Ok(())
}

/// The signals that ask for an end.
fn signals() -> impl Iterator<Item = i32> {
    SIGNALS.into_iter().filter(|&signal| !is_to_be_ignored(signal))
}

/// Whether the process was started to outlive its terminal, as by `nohup`.
#[cfg(unix)]
fn is_to_be_ignored(signal: i32) -> bool {
    static HANGUP_IS_IGNORED: OnceLock<bool> = OnceLock::new();
    signal == signal_hook::consts::SIGHUP
        && *HANGUP_IS_IGNORED.get_or_init(|| {
            let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
            let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
            let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
            ignored.is_some_and(|mask| mask & (1 << (signal - 1)) != 0)
        })
}

#[cfg(not(unix))]
fn is_to_be_ignored(_signal: i32) -> bool {
    false
}

fn not_installed(error: &std::io::Error) -> Error {
    Error::Internal(format!("the handlers of signals cannot be installed, since {}", in_words(error)))
}

/// Whether a signal asked for the work to end. All threads share it.
#[derive(Debug, Default)]
pub(crate) struct Interrupt {
    requested: Arc<AtomicBool>,
    /// Whether the next Ctrl-C ends the process.
    armed: Arc<AtomicBool>,
    arming: Mutex<Arming>,
}

/// Decides when [`Interrupt::armed`] may be set.
#[derive(Debug, Default)]
struct Arming {
    /// The actions of the signals.
    actions: Vec<SigId>,
    /// Threads that are writing.
    writers: usize,
}

impl Interrupt {
    /// Listens to the signals from now on: none ends the process at once any more.
    pub(crate) fn listen() -> Result<Self> {
        let interrupt = Self::default();
        interrupt.register().map_err(|error| not_installed(&error))?;
        // Only now, so that no signal is missed.
        if let Some(at_once) = AT_ONCE.get() {
            at_once.store(false, Ordering::Relaxed);
        }
        Ok(interrupt)
    }

    fn register(&self) -> std::io::Result<()> {
        // Registered before the flags: actions run in the order of registration, and the first Ctrl-C must find `armed`
        // still false.
        flag::register_conditional_shutdown(SIGINT, EXIT_AT_ONCE, Arc::clone(&self.armed))?;
        for signal in signals() {
            flag::register(signal, Arc::clone(&self.requested))?;
        }
        self.register_arming(&mut self.arming())
    }

    fn register_arming(&self, arming: &mut Arming) -> std::io::Result<()> {
        for signal in signals() {
            arming.actions.push(flag::register(signal, Arc::clone(&self.armed))?);
        }
        Ok(())
    }

    fn arming(&self) -> MutexGuard<'_, Arming> {
        self.arming.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends the work as a signal would.
    pub(crate) fn request(&self) {
        self.requested.store(true, Ordering::Relaxed);
    }

    /// Whether a signal came. Does not wait for writers.
    pub(crate) fn is_requested(&self) -> bool {
        self.requested.load(Ordering::Relaxed)
    }

    /// Ends the work in the middle of a round if a signal comes.
    pub(crate) fn brake(&self) -> Brake {
        let requested = Arc::clone(&self.requested);
        Brake::new(move || requested.load(Ordering::Relaxed).then_some(StopReason::Interrupted))
    }

    /// # Errors
    /// [`Error::Interrupted`] if a signal came.
    pub(crate) fn check(&self) -> Result<()> {
        if self.is_requested() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// Runs `write` so that no Ctrl-C can cut it short, which would leave a temporary file behind.
    ///
    /// Only for writes that end by themselves: one that waits for a reader could not be interrupted.
    pub(crate) fn while_writing<T>(&self, write: impl FnOnce() -> T) -> T {
        self.begin_writing();
        let written = write();
        self.end_writing();
        written
    }

    fn begin_writing(&self) {
        let mut arming = self.arming();
        // This comes first, so that no signal can arm it again.
        arming.actions.drain(..).for_each(|action| {
            unregister(action);
        });
        self.armed.store(false, Ordering::Relaxed);
        arming.writers += 1;
    }

    fn end_writing(&self) {
        let mut arming = self.arming();
        arming.writers -= 1;
        if arming.writers > 0 {
            return;
        }
        // If that fails, there is nothing left to protect, since the process is about to end.
        let _ = self.register_arming(&mut arming);
        if self.is_requested() {
            self.armed.store(true, Ordering::Relaxed);
        }
    }
}

/// Nothing is left to be saved, so the next signal ends the process at once, as in the beginning.
impl Drop for Interrupt {
    fn drop(&mut self) {
        self.begin_writing();
        if let Some(at_once) = AT_ONCE.get() {
            at_once.store(true, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use signal_hook::low_level::raise;

    use super::*;

    #[test]
    fn no_ctrl_c_ends_the_process_while_it_writes_and_the_next_one_after_it_would() {
        let interrupt = Interrupt::listen().expect("signals can be handled");
        interrupt.while_writing(|| {
            interrupt.while_writing(|| raise(SIGINT).expect("the signal is sent"));
            for _ in 0..3 {
                raise(SIGINT).expect("the signal is sent");
            }
        });
        assert!(interrupt.is_requested());
        assert!(interrupt.armed.load(Ordering::Relaxed), "but none may come: it would end this test");
    }
}
