//! Work that may take for ever, such as to decode what a stranger made, on a thread of its own. Whoever waits for it
//! still hears a signal. The work itself is then left alone: it ends with the process.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use super::interrupt::Interrupt;
use crate::error::{Error, Result};
use crate::{guard, threads};

/// Time between two looks at whether a signal came.
const LOOK_EVERY: Duration = Duration::from_millis(20);

type Work<T> = Box<dyn FnOnce() -> Result<T> + Send>;

/// A thread that does one piece of work after the other.
pub(crate) struct Aside<T> {
    orders: Sender<Work<T>>,
    done: Receiver<Result<T>>,
}

impl<T: Send + 'static> Aside<T> {
    /// Starts the thread.
    ///
    /// # Errors
    /// [`Error::Threads`].
    pub(crate) fn start(name: &str) -> Result<Self> {
        let (orders, ordered) = channel::<Work<T>>();
        let (finished, done) = channel();
        // The thread ends when this is dropped, or with the process.
        drop(threads::spawn(name, move || {
            ordered.into_iter().try_for_each(|work| finished.send(unless_it_panics(work)))
        })?);
        Ok(Self { orders, done })
    }

    /// Does the work, unless a signal comes before it is done. Nothing may be lost if it is never done.
    ///
    /// # Errors
    /// Those of `work`, and [`Error::Interrupted`]. After that, no more work can be done.
    pub(crate) fn unless_interrupted(
        &self,
        interrupt: &Interrupt,
        work: impl FnOnce() -> Result<T> + Send + 'static,
    ) -> Result<T> {
        let ended = || Error::Internal("a thread that reads ended".to_owned());
        self.orders.send(Box::new(work)).map_err(|_| ended())?;
        loop {
            interrupt.check()?;
            match self.done.recv_timeout(LOOK_EVERY) {
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(ended()),
                Ok(outcome) => return outcome,
            }
        }
    }
}

/// Does a piece of work aside. Where the system starts no thread, it is done here, and no signal is heard.
///
/// # Errors
/// As [`Aside::unless_interrupted`].
pub(crate) fn unless_interrupted<T: Send + 'static>(
    interrupt: &Interrupt,
    work: impl FnOnce() -> Result<T> + Send + 'static,
) -> Result<T> {
    match Aside::start("reading") {
        Ok(aside) => aside.unless_interrupted(interrupt, work),
        Err(_) => work(),
    }
}

/// Does some work on a picture. A panic becomes an error, since one picture must not end the work on others. What a
/// decoder makes of a broken file was caught before (`guard.rs`), so this one is a bug.
pub(crate) fn unless_it_panics<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    guard::caught(work).unwrap_or_else(|panicked| {
        let place = &panicked.place;
        Err(Error::Internal(format!("a picture made the program panic at {place}: {panicked}")))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_ends_the_wait_for_work_that_never_ends() {
        let (interrupt, aside) = (Interrupt::default(), Aside::start("reading").expect("it starts"));
        assert_eq!(aside.unless_interrupted(&interrupt, || Ok(3)).expect("it is done"), 3);
        let failed = aside.unless_interrupted(&interrupt, || Err(Error::Usage("no".to_owned())));
        assert_eq!(failed.expect_err("it fails").to_string(), "no");
        interrupt.request();
        let endless = || {
            loop {
                std::thread::park();
            }
        };
        assert!(matches!(aside.unless_interrupted(&interrupt, endless), Err(Error::Interrupted)));
    }
}
