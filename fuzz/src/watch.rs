//! A thread that ends the program where an input takes too long, and a hook that sees every panic.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// On a busy machine an input may wait long for a processor. So one hangs if it has worked for as long as is allowed, or
/// has waited for so many times as long.
const PATIENCE: u32 = 20;

/// The input at work.
#[derive(Default)]
struct Now {
    since: Option<Instant>,
    /// What the process had worked before.
    worked: Duration,
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
                let Some(took) = now.since.map(|since| since.elapsed()) else { continue };
                let has_worked = worked().is_none_or(|worked| worked.saturating_sub(now.worked) > longest);
                if took > longest && (has_worked || took > longest * PATIENCE) {
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
        *self.now() = Now { since: Some(Instant::now()), worked: worked().unwrap_or_default(), path, panic: None };
    }

    /// It is done: how long it has worked, and the panic of any thread, though somebody may have caught it. Where the
    /// system does not tell what was work, waiting for a processor counts, too.
    pub fn stop(&self) -> (Duration, Option<String>) {
        let mut now = self.now();
        let took = now.since.take().map_or(Duration::ZERO, |since| since.elapsed());
        let has_worked = worked().map_or(took, |worked| worked.saturating_sub(now.worked));
        (has_worked, now.panic.take())
    }
}

/// How long all threads of this process together have worked, where the system tells it.
fn worked() -> Option<Duration> {
    // Fields 14 and 15, in hundredths of a second (proc_pid_stat(5)); the second field ends with the last bracket.
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    let (_, fields) = stat.rsplit_once(')')?;
    let ticks = fields.split_whitespace().skip(11).take(2).map(|field| field.parse::<u64>().ok());
    Some(Duration::from_millis(10 * ticks.sum::<Option<u64>>()?))
}
