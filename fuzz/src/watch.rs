//! A thread that ends the program where an input takes too long, and a hook that sees every panic.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The input at work.
#[derive(Default)]
struct Now {
    since: Option<Instant>,
    /// Where its bytes lie.
    path: PathBuf,
    /// Where in the sources the last panic was, and what it said.
    panic: Option<String>,
}

/// Watches one input at a time.
#[derive(Clone, Default)]
pub struct Watch(Arc<Mutex<Now>>);

impl Watch {
    /// Begins to watch. `hung` gets the path of an input that takes longer than `longest`, and must not return.
    pub fn begin(longest: Duration, hung: fn(&std::path::Path) -> !) -> Self {
        let watch = Self::default();
        let of_thread = watch.clone();
        std::thread::spawn(move || {
            loop {
                std::thread::sleep(Duration::from_millis(100));
                let now = of_thread.now();
                if now.since.is_some_and(|since| since.elapsed() > longest) {
                    hung(&now.path);
                }
            }
        });
        let of_hook = watch.clone();
        // smalti puts its own hook before this one, and keeps to itself what its decoders say under guard.
        std::panic::set_hook(Box::new(move |info| {
            let place = info.location().map(ToString::to_string).unwrap_or_default();
            let payload = info.payload();
            let told = payload.downcast_ref::<&str>().copied();
            let told = told.or(payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no reason is given");
            of_hook.now().panic = Some(format!("{place}: {told}"));
        }));
        watch
    }

    fn now(&self) -> MutexGuard<'_, Now> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// An input is at work now.
    pub fn start(&self, path: PathBuf) {
        *self.now() = Now { since: Some(Instant::now()), path, panic: None };
    }

    /// It is done: how long it took, and the panic of any thread, though somebody may have caught it.
    pub fn stop(&self) -> (Duration, Option<String>) {
        let mut now = self.now();
        (now.since.take().map_or(Duration::ZERO, |since| since.elapsed()), now.panic.take())
    }
}
