//! The loss of a display. Xlib ends the process from inside whichever of its calls notices, so that no call returns an
//! error; but before that it asks a handler. Wayland, Windows and macOS return errors.

/// Calls `act` when the X server of this process is gone, on the thread that noticed. The process ends when it returns.
/// The first `act` counts. Where there is no Xlib, nothing happens.
pub fn when_display_is_gone(act: impl Fn() + Send + Sync + 'static) {
    #[cfg(all(unix, not(target_os = "macos")))]
    x::call_when_gone(Box::new(act));
    #[cfg(not(all(unix, not(target_os = "macos"))))]
    drop(act);
}

#[cfg(all(unix, not(target_os = "macos")))]
mod x {
    use std::ffi::c_int;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::sync::OnceLock;

    use x11_dl::xlib::{Display, Xlib};

    type Act = Box<dyn Fn() + Send + Sync>;

    /// What the handler does.
    static ACT: OnceLock<Act> = OnceLock::new();

    pub(super) fn call_when_gone(act: Act) {
        // `x11-dl` never unloads it.
        let Ok(xlib) = Xlib::open() else { return };
        ACT.get_or_init(|| act);
        // SAFETY: the handler has the type that Xlib asks for and lives for ever; Xlib keeps only its address.
        unsafe { (xlib.XSetIOErrorHandler)(Some(handler)) };
    }

    /// What Xlib calls. It reads nothing of the display, and no panic leaves it.
    extern "C" fn handler(_: *mut Display) -> c_int {
        if let Some(act) = ACT.get() {
            // Xlib ends the process in any case.
            let _ = catch_unwind(AssertUnwindSafe(act));
        }
        0
    }
}
