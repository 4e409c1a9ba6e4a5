//! Threads. The system may refuse to start one (`ulimit -u`, or the limit of a container). Then there are fewer, or an
//! error that says so; no result depends on their number.
//!
//! No other module starts a thread.

use std::io;
use std::sync::OnceLock;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::{Builder, JoinHandle, Scope, ScopedJoinHandle};
use std::time::Duration;

use rayon::{ThreadBuilder, ThreadPool, ThreadPoolBuilder};

use crate::error::{Error, Result, in_words};

/// How often it is tried to start a thread, and the time between two tries. A thread that has just ended still counts
/// for a moment.
const TRIES: usize = 5;
const BETWEEN_TRIES: Duration = Duration::from_millis(10);

/// Starts the threads that all parallel work shares: `count` of them, or as many as the machine has processors. Later
/// calls change nothing.
///
/// Where the system starts fewer, they are fewer. Where it starts none, this thread does all the work. Without this
/// call the first parallel work would panic then.
///
/// # Errors
/// [`Error::Threads`] if a `count` was asked for and cannot be had.
pub fn start(count: Option<usize>) -> Result<()> {
    static STARTED: OnceLock<Result<()>> = OnceLock::new();
    STARTED.get_or_init(|| start_first(count)).clone()
}

fn start_first(count: Option<usize>) -> Result<()> {
    let wanted = count.unwrap_or_else(usual_count);
    // The shared pool can be built only once, so its threads are started before it.
    let mut hands: Vec<SyncSender<ThreadBuilder>> = Vec::new();
    for _ in 0..wanted {
        let (order, orders) = sync_channel::<ThreadBuilder>(1);
        let hand = Builder::new().spawn(move || {
            if let Ok(work) = orders.recv() {
                work.run();
            }
        });
        match hand {
            Ok(_) => hands.push(order),
            Err(error) if count.is_some() => return Err(refused(&error)),
            Err(_) => break,
        }
    }
    let pool = match hands.len() {
        0 => ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global(),
        started => ThreadPoolBuilder::new()
            .num_threads(started)
            .spawn_handler(|work| {
                let hand = hands.pop().ok_or(io::ErrorKind::Other)?;
                hand.send(work).map_err(|_| io::ErrorKind::Other.into())
            })
            .build_global(),
    };
    // It fails only where the program that embeds this has built it already.
    drop(pool);
    Ok(())
}

/// As many threads as parallel work has where nobody says a number.
fn usual_count() -> usize {
    // A pool whose threads never come: it only tells how many it would have.
    let pool = ThreadPoolBuilder::new().spawn_handler(|_| Ok(())).build();
    pool.map_or(1, |pool| pool.current_num_threads())
}

/// `count` pools of `threads` threads each; fewer pools, or none, where the system does not start them.
#[must_use]
pub fn pools(count: usize, threads: usize) -> Vec<ThreadPool> {
    let pool = |_| ThreadPoolBuilder::new().num_threads(threads).build().ok();
    (0..count).map_while(pool).collect()
}

/// Starts a thread.
///
/// # Errors
/// [`Error::Threads`].
pub fn spawn<T: Send + 'static>(name: &str, work: impl FnOnce() -> T + Send + 'static) -> Result<JoinHandle<T>> {
    spawn_as(Builder::new().name(name.to_owned()), work)
}

/// As [`spawn`], for recursive work: the thread has a stack of `stack_bytes`.
///
/// # Errors
/// [`Error::Threads`].
pub fn spawn_with_stack<T: Send + 'static>(
    name: &str,
    stack_bytes: usize,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>> {
    spawn_as(Builder::new().name(name.to_owned()).stack_size(stack_bytes), work)
}

fn spawn_as<T: Send + 'static>(thread: Builder, work: impl FnOnce() -> T + Send + 'static) -> Result<JoinHandle<T>> {
    // A builder takes the work with it even if it fails, so a thread is tried before.
    try_one()?;
    thread.spawn(work).map_err(|error| refused(&error))
}

/// Starts a thread in a scope.
///
/// # Errors
/// [`Error::Threads`].
pub fn spawn_in<'scope, T: Send + 'scope>(
    scope: &'scope Scope<'scope, '_>,
    work: impl FnOnce() -> T + Send + 'scope,
) -> Result<ScopedJoinHandle<'scope, T>> {
    try_one()?;
    Builder::new().spawn_scoped(scope, work).map_err(|error| refused(&error))
}

/// Waits a moment for the system to have room for another thread.
fn try_one() -> Result<()> {
    let mut outcome = Ok(());
    for _ in 0..TRIES {
        match Builder::new().spawn(|| ()) {
            Ok(tried) => {
                // It does nothing that could fail.
                let _ = tried.join();
                return Ok(());
            }
            Err(error) => outcome = Err(refused(&error)),
        }
        std::thread::sleep(BETWEEN_TRIES);
    }
    outcome
}

fn refused(error: &io::Error) -> Error {
    // What the system says then: "Resource temporarily unavailable".
    let at_limit = error.kind() == io::ErrorKind::WouldBlock;
    Error::Threads { reason: if at_limit { "their limit is reached".to_owned() } else { in_words(error) } }
}

/// The error where not one thread of several could be started.
#[must_use]
pub fn none() -> Error {
    refused(&io::ErrorKind::WouldBlock.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pools_have_the_threads_that_were_asked_for() {
        let pools = pools(2, 3);
        assert_eq!(pools.iter().map(ThreadPool::current_num_threads).collect::<Vec<_>>(), [3, 3]);
        assert!(usual_count() > 0);
    }

    #[test]
    fn the_shared_threads_are_started_once_and_a_second_call_is_no_failure() {
        for _ in 0..2 {
            start(None).expect("a test may start threads");
        }
        assert_eq!(rayon::join(|| 1, || 2), (1, 2));
    }

    #[test]
    fn a_thread_does_its_work_in_a_scope_and_by_itself() {
        let told = spawn("teller", || std::thread::current().name().map(str::to_owned)).expect("it starts").join();
        assert_eq!(told.expect("it does not panic").as_deref(), Some("teller"));
        let number = 7;
        let double = std::thread::scope(|scope| spawn_in(scope, || 2 * number).map(ScopedJoinHandle::join));
        assert_eq!(double.expect("it starts").expect("it does not panic"), 14);
    }
}
