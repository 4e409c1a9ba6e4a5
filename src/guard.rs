//! The one place where the bytes of foreign files are decoded. Decoders are other people's code, and now and then some
//! bytes make one panic. Here that ends as a sentence about the file, and nothing is printed.
//!
//! The message of a panic is printed by a hook of the whole process. So the first guard puts a hook in front of it,
//! which stays silent about threads that are under guard, and leaves all others to the hook that was there.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::panic::{self, AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::sync::Once;

/// Longest message of a decoder that is repeated, in characters.
const MESSAGE_CHARS_MAX: usize = 120;

thread_local! {
    /// How many guards this thread is under.
    static DEPTH: Cell<u32> = const { Cell::new(0) };
    /// Where in the sources the last panic under guard was.
    static PLACE: RefCell<String> = const { RefCell::new(String::new()) };
}

/// A panic that was caught.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub(crate) struct Panicked {
    /// What the code said as it gave up, on one line.
    pub message: String,
    /// The line of the sources where it gave up.
    #[cfg_attr(not(feature = "cli"), allow(dead_code, reason = "the command line tells it"))]
    pub place: String,
}

/// Decodes foreign bytes. A panic becomes a sentence for the user without the file's name, as other failures are.
///
/// # Errors
/// What `decode` returns, or that the file is broken.
pub(crate) fn decoded<T>(decode: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    caught(decode).unwrap_or_else(|panicked| {
        Err(format!("the file is broken: its decoder gave up ({panicked}); get the file or save it again"))
    })
}

/// Does some work that may panic, without a line on stderr if it does.
///
/// # Errors
/// The panic.
pub(crate) fn caught<T>(work: impl FnOnce() -> T) -> Result<T, Panicked> {
    install_hook();
    DEPTH.set(DEPTH.get() + 1);
    let done = catch_unwind(AssertUnwindSafe(work));
    DEPTH.set(DEPTH.get() - 1);
    done.map_err(|panic| Panicked { message: message(panic.as_ref()), place: PLACE.take() })
}

fn install_hook() {
    static INSTALLED: Once = Once::new();
    INSTALLED.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !note(info) {
                before(info);
            }
        }));
    });
}

/// Notes where a thread under guard panics; false if the thread is under none.
fn note(info: &PanicHookInfo<'_>) -> bool {
    // A thread that ends may have lost its variables already.
    let is_guarded = DEPTH.try_with(|depth| depth.get() > 0).unwrap_or(false);
    if is_guarded {
        let place = info.location().map(ToString::to_string).unwrap_or_default();
        let _ = PLACE.try_with(|noted| noted.replace(place));
    }
    is_guarded
}

fn message(panic: &(dyn Any + Send)) -> String {
    let told = panic.downcast_ref::<&str>().copied().or(panic.downcast_ref::<String>().map(String::as_str));
    let words: Vec<&str> = told.unwrap_or("no reason is given").split_whitespace().collect();
    words.join(" ").chars().take(MESSAGE_CHARS_MAX).collect()
}

#[cfg(test)]
mod tests {
    use rayon::prelude::*;

    use super::*;

    #[test]
    fn a_panic_of_a_decoder_becomes_a_sentence_in_every_thread() {
        let decode = |bytes: &[u8]| decoded(|| if bytes[2] == 7 { Ok(7) } else { Err("not seven".to_owned()) });
        let refusal = "the file is broken: its decoder gave up (index out of bounds: the len is 2 but the index is 2); \
                       get the file or save it again";
        (0..100).into_par_iter().for_each(|_| {
            assert_eq!(decode(&[1, 2]), Err(refusal.to_owned()));
            assert_eq!(decode(&[1, 2, 7]), Ok(7));
            assert_eq!(decode(&[1, 2, 3]), Err("not seven".to_owned()));
        });
    }

    #[test]
    fn a_panic_is_told_on_one_short_line_with_its_place() {
        let panicked = caught(|| panic!("left\n  right {}", "x".repeat(900))).expect_err("it panics");
        assert!(panicked.message.starts_with("left right xxx") && panicked.message.len() == 120, "{panicked}");
        assert!(panicked.place.starts_with("src/guard.rs:"), "{}", panicked.place);
        assert_eq!(DEPTH.get(), 0);
    }

    #[test]
    fn guards_inside_guards_are_told_apart() {
        let outer = decoded(|| {
            let inner: Result<(), String> = decoded(|| panic!("inside"));
            assert!(inner.expect_err("it panics").contains("(inside)"));
            Ok(DEPTH.get())
        });
        assert_eq!(outer, Ok(1));
    }
}
